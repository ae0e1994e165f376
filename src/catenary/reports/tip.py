"""How far the tip is off, through the robot's kinematics, by reported and by corrected joints."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.arithmetic import blocks
from catenary.calibration.evaluate import Evaluation, rms
from catenary.calibration.model import CalibrationModel
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError
from catenary.reports.page import Block, Heading, Table, Text
from catenary.robots.catalog import load_robot, robot_names
from catenary.robots.model import RobotModel

STILL = 1e-9  # [m] that a tip moves by rounding


@dataclass(frozen=True)
class Distances:
    """Distances of a tip from where it is [m], over all rows."""

    rmse: float
    median: float
    largest: float


@dataclass(frozen=True)
class TipErrors:
    """Where the tip is by measured joints, and how far from there it is by the others."""

    robot: RobotModel
    q: Floats  # (N, n) of the robot by measured joints [rad|m]
    true: Floats  # (N, 3) by measured joints, in the base frame [m]
    reported: Floats  # (N, 3) by joints as reported
    corrected: Floats  # (N, 3) by corrected joints
    raw: Distances
    offset: Distances
    model: Distances
    moves: tuple[bool, ...]  # whether each joint of the model moves the tip


def kinematics_of(name: str | None, model: CalibrationModel) -> RobotModel | None:
    """Return the catalogue's robot of this name where its tip can be had from a model's joints, None otherwise."""
    if name is None or name not in robot_names():
        return None
    robot = load_robot(name)
    return robot if _places(robot, model.joint_names, model.joint_units) is not None else None


def tip_errors(robot: RobotModel, model: CalibrationModel, evaluation: Evaluation) -> TipErrors:
    """Compare where the tip is by measured, reported and corrected joints.

    Args:
        robot: Has the model's joints, by name or its first ones by units; others must not move the tip, and are zero.
        model: The model.
        evaluation: Its errors (N, n).
    """
    places = _places(robot, model.joint_names, model.joint_units)
    if places is None:
        raise InputError(
            f'robot "{robot.name}": joints {", ".join(robot.joint_names)}; its tip cannot be had from the model\'s '
            f"joints {', '.join(model.joint_names)}"
        )
    measured = evaluation.data.q_nominal + evaluation.raw

    def full(error: Floats) -> Floats:
        q = np.zeros((len(measured), robot.n))
        q[:, places] = measured - error
        return q

    q = full(np.zeros_like(measured))
    true = _tips(robot, q)
    reported, by_offset, corrected = (
        _tips(robot, full(error))
        for error in (evaluation.raw, evaluation.after_offset, evaluation.after_model)
    )
    return TipErrors(
        robot=robot,
        q=q,
        true=true,
        reported=reported,
        corrected=corrected,
        raw=_distances(true, reported),
        offset=_distances(true, by_offset),
        model=_distances(true, corrected),
        moves=tuple(_moves_tip(robot, [place]) for place in places),
    )


def tip_blocks(tip: TipErrors, name: str, joints: Sequence[str]) -> list[Block]:
    """Return what a page says of the tip of a model of these joints."""
    without = [joint for joint, moves in zip(joints, tip.moves, strict=True) if not moves]
    aside = (
        f" Joints that do not move this frame, and are not in its error: {', '.join(without)}."
        if without
        else ""
    )
    kinds = (("raw", tip.raw), ("fixed offset", tip.offset), (name, tip.model))
    rows = [[kind, *(f"{1e3 * v:.3f}" for v in (d.rmse, d.median, d.largest))] for kind, d in kinds]
    return [
        Heading("Error of the tip"),
        Table(["joints", "RMSE [mm]", "median [mm]", "largest [mm]"], rows),
        Text(
            f'Distance between frame "{tip.robot.tip}" of robot {tip.robot.name} by these joints and by the measured '
            "ones, through the robot's kinematics, over the same rows as above. What the kinematics themselves are off "
            f"by is not in it.{aside}"
        ),
    ]


def _tips(robot: RobotModel, q: Floats) -> Floats:
    return np.concatenate([forward_kinematics(robot, q[part])[1] for part in blocks(len(q))])


def _distances(true: Floats, tip: Floats) -> Distances:
    apart = np.linalg.norm(tip - true, axis=1)
    return Distances(rms(apart), float(np.median(apart)), float(apart.max()))


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
    return bool(np.linalg.norm(first - second) > STILL)
