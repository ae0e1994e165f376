"""How far the tip is off by reported and by corrected joints."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.arithmetic import blocks
from catenary.calibration.evaluate import Evaluation, rms
from catenary.calibration.model import CalibrationModel
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError
from catenary.reports.page import Block, Column, Heading, Table, Text
from catenary.robots.catalog import load_robot, robot_names
from catenary.robots.model import RobotModel

_ROUNDING_M = 1e-9  # that a tip moves by rounding


class TipErrors(NamedTuple):
    """Where the tip is by measured joints, and by the others; tips are (N, 3) in the base frame [m]."""

    robot: RobotModel
    true: Floats  # by measured joints
    reported: Floats
    offset: Floats  # by reported joints after the fixed offset
    corrected: Floats
    moves: tuple[bool, ...]  # whether each joint of the model moves the tip

    def distances(self, tip: Floats) -> Floats:
        """Return the tip's distances (N,) from where it is [m]."""
        return np.linalg.norm(tip - self.true, axis=1)


def kinematics_of(name: str | None, model: CalibrationModel) -> RobotModel | None:
    """Return the catalogue's robot of this name where its tip can be had from a model's joints, None otherwise."""
    if name is None or name not in robot_names():
        return None
    robot = load_robot(name)
    return robot if _places(robot, model.joint_names, model.joint_units) is not None else None


def tip_errors(robot: RobotModel, model: CalibrationModel, evaluation: Evaluation) -> TipErrors:
    """Compare where the tip is by measured, reported and corrected joints; others must not move it, and are zero."""
    places = _places(robot, model.joint_names, model.joint_units)
    if places is None:
        raise InputError(
            f'robot "{robot.name}": joints {", ".join(robot.joint_names)}; its tip cannot be had from the model\'s '
            f"joints {', '.join(model.joint_names)}"
        )
    measured = evaluation.data.q_nominal + evaluation.raw

    def tip(error: Floats) -> Floats:
        q = np.zeros((len(measured), robot.n))
        q[:, places] = measured - error
        return np.concatenate([forward_kinematics(robot, q[part])[1] for part in blocks(len(q), 16 * q.shape[1])])

    none = np.zeros_like(evaluation.raw)
    true, reported, offset, corrected = map(
        tip, (none, evaluation.raw, evaluation.after_offset, evaluation.after_model)
    )
    moves = tuple(_moves_tip(robot, [place]) for place in places)
    return TipErrors(robot, true, reported, offset, corrected, moves)


def tip_blocks(tip: TipErrors, name: str, joints: Sequence[str]) -> list[Block]:
    """Return what a page says of the tip of a model of these joints."""
    without = [joint for joint, moves in zip(joints, tip.moves, strict=True) if not moves]
    aside = f" Joints that do not move this frame, and are not in its error: {', '.join(without)}." if without else ""
    rows = []
    for called, tips in (("raw", tip.reported), ("fixed offset", tip.offset), (name, tip.corrected)):
        off = tip.distances(tips)
        rows.append([called, 1e3 * rms(off), 1e3 * np.median(off), 1e3 * off.max()])
    columns: list[Column] = ["joints", ("RMSE [mm]", ":.3f"), ("median [mm]", ":.3f"), ("largest [mm]", ":.3f")]
    return [
        Heading("Error of the tip"),
        Table(columns, rows),
        Text(
            f'Distance between frame "{tip.robot.tip}" of robot {tip.robot.name} by these joints and by the measured '
            "ones, through the robot's kinematics, over the same rows as above. What the kinematics themselves are off "
            f"by is not in it.{aside}"
        ),
    ]


def tip_rmse(tip: TipErrors) -> tuple[float, float]:
    """Return the RMS distance by reported and by corrected joints [mm]."""
    return 1e3 * rms(tip.distances(tip.reported)), 1e3 * rms(tip.distances(tip.corrected))


def _places(robot: RobotModel, names: Sequence[str], units: Sequence[str]) -> list[int] | None:
    """Return which of the robot's coordinates a model's joints are; None if others move its tip too."""
    n = len(names)
    if set(names) <= set(robot.joint_names):
        places = [robot.joint_names.index(name) for name in names]
        if [robot.joint_units[place] for place in places] != list(units):
            return None
    elif tuple(robot.joint_units[:n]) == tuple(units):
        places = list(range(n))
    else:
        return None
    others = [place for place in range(robot.n) if place not in places]
    return None if _moves_tip(robot, others) else places


def _moves_tip(robot: RobotModel, places: Sequence[int]) -> bool:
    """Return whether some of the robot's coordinates move its tip."""
    q = np.full((2, robot.n), 0.1)
    q[1, list(places)] = 0.0
    first, second = forward_kinematics(robot, q)[1]
    return bool(np.linalg.norm(first - second) > _ROUNDING_M)
