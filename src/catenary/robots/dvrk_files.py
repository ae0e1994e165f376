"""The dVRK's own files of an arm, in JSON: DH tables of its kinematics, and of its instrument's behind them.

[jhu-dvrk/sawIntuitiveResearchKit, share/kinematic and share/tool] A joint's `offset` adds to theta or D. Instruments
differ in their shafts, .4162 m of the classic ones (models 400...), .4670 m of S and Si (420...), for which a PSM_Si
stands 50.8 mm farther back than a PSM. Rows are in the joints that measured_js reports: `coupling`, from the motors to
them, is no part of it, and masses, which not all links have, are left out.
"""

from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import AliasChoices, Field

from catenary.bounded_parsers import MAX_JSON_BYTES, cut, json_table, read_bounded, without_comments
from catenary.config import Recorded, parse_settings
from catenary.errors import FileFormatError, UnsupportedModelError
from catenary.plant import nameless
from catenary.robots.assembly import file_source, naming_the_file
from catenary.robots.dh_table import RobotTable, robot_of_table
from catenary.robots.model import Massless, RobotModel

_SHORT = 1e-4  # by which numbers of four digits leave a matrix no rotation
_Convention = Literal["modified", "standard"] | None
_Matrix = tuple[tuple[float, float, float, float], ...]


class _DvrkJoint(Recorded):
    """A row of the table: lengths in m, angles in rad, strength in Nm or N."""

    name: str = ""
    type: Literal["revolute", "prismatic"]
    mode: str = "active"
    alpha: float
    a: float = Field(alias="A")
    theta: float = 0.0
    d: float = Field(0.0, alias="D")
    offset: float = 0.0
    convention: _Convention = None  # of older files, in each row
    qmin: float | None = None
    qmax: float | None = None
    ftmax: float | None = None


class _Table(Recorded):
    convention: _Convention = None
    joints: tuple[_DvrkJoint, ...] = Field(min_length=1, validation_alias=AliasChoices("joints", "links"))


class _Kinematics(Recorded):
    dh: _Table = Field(alias="DH")
    snake_like: bool = Field(False, alias="snake-like")
    base: _Matrix = Field((), validation_alias=AliasChoices("base-offset", "base_offset"))
    tooltip: _Matrix = Field((), validation_alias=AliasChoices("tooltip_offset", "tooltip-offset"))


def load_dvrk(path: Path, *, instrument: Path | None = None, massless: Massless = ()) -> RobotModel:
    """Load an arm of a da Vinci from the dVRK's kinematics of it, and of its instrument where it has one."""
    files = [path] if instrument is None else [path, instrument]
    parts, sources = [], []
    for file in files:
        data = read_bounded(file, MAX_JSON_BYTES)
        parts.append(_kinematics(file, json_table(without_comments(data), str(file))))
        sources.append(file_source(file, data))
    if parts[0].tooltip and len(parts[0].dh.joints) < 6:
        raise FileFormatError(
            f"{path}: is an instrument of the dVRK, whose arm it does not state; expected the arm's kinematics "
            f'(PSM.json), or a TOML with description = "PSM.json" and instrument = "{cut(path.name)}"'
        )
    where = ", ".join(map(str, files))
    conventions = {joint.convention or part.dh.convention for part in parts for joint in part.dh.joints}
    if len(conventions) != 1 or None in conventions:
        raise FileFormatError(f"{where}: convention: expected modified or standard, the same in all rows")
    joints = [joint for part in parts for joint in part.dh.joints]
    names = [joint.name or plain for joint, plain in zip(joints, nameless(len(joints)), strict=True)]
    table: dict[str, Any] = {
        "name": "_".join(file.stem for file in files),
        "convention": conventions.pop(),
        "sources": sources,
        "link": [_link(name, joint) for name, joint in zip(names, joints, strict=True)],
    }
    if parts[0].base:
        table["base_rotation"], table["base_position_m"] = _pose(f"{where}: base offset", parts[0].base)
    if parts[-1].tooltip:
        rotation, position = _pose(f"{where}: tooltip_offset", parts[-1].tooltip)
        table["tip"] = "tool"
        table["frame"] = [{"name": "tool", "link": names[-1], "position_m": position, "rotation": rotation}]
    with naming_the_file(where):
        return robot_of_table(where, parse_settings(table, RobotTable, where), massless)


def _kinematics(path: Path, content: dict[str, Any]) -> _Kinematics:
    if "DH" not in content:
        raise FileFormatError(
            f"{path}: is not a dVRK robot file: expected kinematics with DH (share/kinematic, share/tool), "
            f"got {', '.join(map(cut, list(content)[:8])) or 'nothing'}"
        )
    kinematics = parse_settings(content, _Kinematics, str(path))
    if kinematics.snake_like or any(joint.mode != "active" for joint in kinematics.dh.joints):
        raise UnsupportedModelError(
            f"{path}: is snake-like or has passive joints, whose rule is in the dVRK's code, not in the file; "
            "of an arm's two files use the one without _physical"
        )
    return kinematics


def _link(name: str, joint: _DvrkJoint) -> dict[str, Any]:
    turns = joint.type == "revolute"
    own: dict[str, Any] = {} if joint.ftmax is None else {"effort_nm" if turns else "effort_n": joint.ftmax}
    if joint.qmin is not None and joint.qmax is not None:
        limits = np.array([joint.qmin, joint.qmax])
        own |= {"limits_deg": np.rad2deg(limits).tolist()} if turns else {"limits_m": limits.tolist()}
    return {
        "name": name,
        "joint": joint.type,
        "alpha_deg": float(np.rad2deg(joint.alpha)),
        "a_m": joint.a,
        "theta_deg": float(np.rad2deg(joint.theta + (joint.offset if turns else 0.0))),
        "d_m": joint.d + (0.0 if turns else joint.offset),
        **own,
    }


def _pose(where: str, matrix: _Matrix) -> tuple[list[list[float]], list[float]]:
    """Return the rotation next to a matrix of four digits, and the position [m]."""
    rows = np.array(matrix)[:3]
    u, _, v = np.linalg.svd(rows[:, :3])
    if len(rows) < 3 or not np.abs(u @ v - rows[:, :3]).max() < _SHORT or np.linalg.det(u @ v) < 0.0:
        raise FileFormatError(f"{where}: expected a rotation and a position, got {rows.tolist()}")
    return (u @ v).tolist(), rows[:, 3].tolist()
