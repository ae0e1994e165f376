"""Whole turns that recordings of angles jump by, or that measurements lie away from commands."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from catenary.arrays import Flags, Floats
from catenary.plant import MotionLog
from catenary.robots.model import RobotModel

TURN = 2.0 * np.pi
_NEAR_TURNS = 0.1  # of a turn by which a step from end to end differs from a whole turn at most
# of a turn: nearly all other steps are smaller, or poses are too far apart to tell how they were reached
_SMALL_TURNS = 0.1
_ALIKE_LENGTH = 0.8  # mean resultant length of errors from which measurement and command are of one angle
_MAX_TURNS = 2  # turns that are taken off: more are rather degrees
_FAR_RAD = 1.0  # [rad] from the others of a measurement that is no matter of turns


def from_median(error: Floats, rows: Flags | slice = slice(None)) -> Floats:
    """Return errors (N,) less the median of some: that of one row, as a mean of two may lie between whole turns."""
    return np.asarray(error - np.percentile(error[rows], 50.0, method="lower"))


def unwrapped(values: Floats, turn: float) -> tuple[Floats, int]:
    """Return values without jumps from one end of a turn to the other, and the number of jumps.

    Args:
        values, turn: (M,), of which NaN stays; length of a turn.
    """
    whole = values.copy()
    finite = np.isfinite(values)
    x = values[finite]
    if len(x) < 3 or np.ptp(x) > turn * (1.0 + 1e-3):
        return whole, 0
    steps = np.diff(x)
    jumps = np.abs(np.abs(steps) - turn) < _NEAR_TURNS * turn
    if not jumps.any() or jumps.all() or np.quantile(np.abs(steps[~jumps]), 0.99) > _SMALL_TURNS * turn:
        return whole, 0
    whole[np.flatnonzero(finite)[1:]] -= turn * np.cumsum(np.where(jumps, np.sign(steps), 0.0))
    return whole, int(jumps.sum())


def turned_back(log: MotionLog, model: RobotModel | None = None) -> MotionLog:
    """Return a log whose angles do not jump by a turn, within the robot's limits if it is known; its notes say so.

    Args:
        model: Robot, if known.
    """
    changed: dict[str, Floats] = {}
    jumped, notes = set(log.joint_names if model is not None else ()), list[str]()
    for key in ("q_nominal", "q_encoder", "q_reported"):
        recorded = getattr(log, key)
        if recorded is None:
            continue
        changed[key] = values = recorded.copy()
        for j in [j for j, unit in enumerate(log.joint_units) if unit == "rad"]:
            values[:, j], jumps = unwrapped(values[:, j], TURN)
            notes += [f"{key} of {log.joint_names[j]}: jumps by a turn {jumps} time(s); unwrapped"] * bool(jumps)
            jumped |= {log.joint_names[j]} if jumps else set()
    q, measured, note = in_one_turn(
        changed["q_nominal"], changed.get("q_encoder"), log.joint_units, log.joint_names, model, jumped
    )
    changed |= {"q_nominal": q} | ({} if measured is None else {"q_encoder": measured})
    made: dict[str, Any] = {**changed, "notes": (*log.notes, *notes, *note)}
    return replace(log, **made)


def in_one_turn(
    q_nominal: Floats,
    q_encoder: Floats | None,
    units: Sequence[str],
    names: Sequence[str],
    model: RobotModel | None,
    jumped: Collection[str],
) -> tuple[Floats, Floats | None, list[str]]:
    """Bring measurements to the commands' turn, jumping joints into limits, by whole turns; return them with notes.

    Args:
        q_nominal, q_encoder: Commands, and measurements if any, (N, n) [rad|m].
        units: "rad" or "m" of each joint.
    """
    q, measured = q_nominal.copy(), None if q_encoder is None else q_encoder.copy()
    notes = []
    for j in [j for j, unit in enumerate(units) if unit == "rad"]:
        if measured is not None:
            away = _turns_away(measured[:, j] - q[:, j])
            measured[:, j] -= TURN * away
            if away.any():
                notes.append(f"q_encoder of {names[j]}: {np.count_nonzero(away)} rows were a turn away")
        outside = 0
        if model is not None and names[j] in jumped and names[j] in model.joint_names:
            k = model.joint_names.index(names[j])
            outside = _turns_outside(q[:, j], float(model.lower[k]), float(model.upper[k]))
        if outside:
            q[:, j] -= TURN * outside
            if measured is not None:
                measured[:, j] -= TURN * outside
            notes.append(f"{names[j]}: brought within the robot's limits by {-outside:+d} turn(s)")
    return q, measured, notes


def _turns_away(error: Floats) -> Floats:
    """Return by how many turns each of N errors lies away from the others (N,); 0 where that is no matter of turns."""
    turns = np.zeros(len(error))
    rows = np.isfinite(error)
    mean = np.mean(np.exp(1j * error[rows])) if rows.any() else 0.0
    if abs(mean) < _ALIKE_LENGTH:
        return turns
    away = error[rows] - np.angle(mean)
    whole = np.round(away / TURN)
    if np.abs(whole).max() <= _MAX_TURNS:
        turns[rows] = np.where(np.abs(away - TURN * whole) < _FAR_RAD, whole, 0.0)
    return turns


def _turns_outside(q: Floats, low: float, high: float) -> int:
    """Return the whole turns that bring a joint within its limits; 0 where it is there, or none do."""
    slack = 0.1 * (high - low)
    if not np.isfinite(slack) or (q.min() >= low - slack and q.max() <= high + slack):
        return 0
    turns = round((0.5 * (q.min() + q.max()) - 0.5 * (low + high)) / TURN)
    moved = q - TURN * turns
    return turns if moved.min() >= low - slack and moved.max() <= high + slack else 0
