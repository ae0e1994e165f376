"""How far the tip is off by reported and by corrected joints: a table, and a picture of the arm with its tip's path."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.arithmetic import blocks
from catenary.calibration.evaluate import Evaluation, rms
from catenary.calibration.model import CalibrationModel
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError
from catenary.reports.joint_errors import MODEL, RAW, wrapped
from catenary.reports.page import Block, Column, Heading, Picture, Table, Text, picture
from catenary.reports.robot_plot import draw_links, equal_axes
from catenary.robots.catalog import load_robot, robot_names
from catenary.robots.model import RobotModel

STILL = 1e-9  # [m] that a tip moves by rounding
MEASURED = "#1c2430"
MOST_POINTS = 3_000  # of a path
STRETCH = 120  # rows of the path that are drawn close up
LEAST_ROWS = 6  # of them
FARTHEST = 12.0  # times the raw error: how far the tip goes in them


class TipErrors(NamedTuple):
    """Where the tip is by measured joints, and by the others; tips are (N, 3) in the base frame [m]."""

    robot: RobotModel
    q: Floats  # (N, n) of the robot by measured joints [rad|m]
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

    def full(error: Floats | float) -> Floats:
        q = np.zeros((len(measured), robot.n))
        q[:, places] = measured - error
        return q

    rows = [full(error) for error in (0.0, evaluation.raw, evaluation.after_offset, evaluation.after_model)]
    true, reported, offset, corrected = (
        np.concatenate([forward_kinematics(robot, q[part])[1] for part in blocks(len(q))]) for q in rows
    )
    moves = tuple(_moves_tip(robot, [place]) for place in places)
    return TipErrors(robot, rows[0], true, reported, offset, corrected, moves)


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
    return bool(np.linalg.norm(first - second) > STILL)


def arm_picture(tip: TipErrors, name: str, row_breaks: Floats) -> Picture:
    """Draw the arm with its tip's path, and a stretch close up; rows are missing before those of `row_breaks` (B,)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 5.0), layout="constrained")
    arm = figure.add_subplot(1, 2, 1, projection="3d")
    close = figure.add_subplot(1, 2, 2, projection="3d")
    kept = np.arange(0, len(tip.true), max(1, len(tip.true) // MOST_POINTS))
    path = 1e3 * np.insert(tip.true[kept], np.searchsorted(kept, row_breaks), np.nan, axis=0)
    arm.plot(*path.T, color=MEASURED, linewidth=0.5, alpha=0.6)
    middle = int(np.argmin(np.linalg.norm(tip.true - tip.true.mean(axis=0), axis=1)))
    points = draw_links(arm, tip.robot, tip.q[middle])
    equal_axes(arm, np.vstack([points, path[np.isfinite(path).all(axis=1)]]))
    arm.set_title("arm and path of its tip", fontsize=9)

    rows = _stretch(tip, row_breaks)
    drawn = ((tip.reported, RAW, "raw", "-"), (tip.corrected, MODEL, name, "-"), (tip.true, MEASURED, "measured", "--"))
    for points, color, label, style in drawn:
        close.plot(*1e3 * points[rows].T, color=color, linewidth=1.4, linestyle=style, label=wrapped(label))
    equal_axes(close, 1e3 * np.vstack([points[rows] for points, *_ in drawn]))
    close.set_title(f"close up: {rows.stop - rows.start} rows of the path", fontsize=9)
    figure.legend(*close.get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False, fontsize=9)
    caption = (
        f"Left: robot {tip.robot.name} in its base frame (square: base, dot: tip), and the path of its tip by measured "
        f"joints. Right: a stretch of the path, and where the tip is by raw joints and after {name}. RMSE of the tip: "
        f"{tip_rmse(tip)[0]:.3f} mm raw, {tip_rmse(tip)[1]:.3f} mm after {name}."
    )
    return picture(figure, caption, "The arm drawn in space with the path of its tip, and a part of the path close up.")


def _stretch(tip: TipErrors, row_breaks: Floats) -> slice:
    """Return rows without a gap, so short that the raw error can be seen beside the way that the tip goes."""
    starts = np.concatenate([[0], row_breaks, [len(tip.true)]]).astype(int)
    longest = int(np.argmax(np.minimum(np.diff(starts), STRETCH)))
    first, end = starts[longest], min(starts[longest] + STRETCH, starts[longest + 1])
    away = np.linalg.norm(tip.true[first:end] - tip.true[first], axis=1)
    far = np.flatnonzero(away > FARTHEST * rms(tip.distances(tip.reported)))
    least = min(first + LEAST_ROWS, end)
    return slice(int(first), int(max(least, first + far[0])) if len(far) else int(end))
