"""The tool behind a wrist's force/torque sensor, and the sensor's biases, from a table of poses at rest."""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import as_array
from catenary.dynamics.kinematics import forward_kinematics
from catenary.recording.import_formats.table_files import read_rows
from catenary.robots.model import RobotModel
from catenary.sensing.wrist_tool import WristTool, fit_wrist_tool, wrist_tool_findings
from catenary.verdict.finding import judge

WRENCH = ("fx", "fy", "fz", "tx", "ty", "tz")  # [N], [Nm] in the sensor's axes


def wrist_tool_of_file(
    path: Path, model: RobotModel, frame: str | None, gravity: ArrayLike
) -> tuple[WristTool, list[str]]:
    """Fit mass, centre of mass and biases to a table with a row for each pose at rest: joints by name, and WRENCH.

    Returns what was found, and what is doubtful about it.
    The arm carries the sensor on a frame, its tip when None; gravity (3,) is in base axes [m/s2].
    """
    rows = read_rows(path, (*model.joint_names, *WRENCH))
    q, force, torque = np.split(rows, [model.n, model.n + 3], axis=1)
    rotation = forward_kinematics(model, q, frame).rotation
    tool = fit_wrist_tool(force, torque, as_array("gravity", gravity, (3,)) @ rotation)  # R_base_sensor^T g
    return tool, judge([(path.name, each) for each in wrist_tool_findings(tool, force, rotation, gravity)])
