"""Angles that were recorded within one turn, from -pi to pi or from 0 to 2 pi, made continuous again."""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from catenary.arrays import Floats
from catenary.recording.import_formats.columns import Place, Stream
from catenary.robots.model import RobotModel

TURN = 2.0 * np.pi
NEAR = 0.1  # of a turn by which a step from end to end differs from a whole turn at most
SMALL = 0.1  # of a turn: nearly all other steps are smaller, or poses are too far apart to tell how they were reached
ALIKE = 0.8  # mean resultant length of errors from which on measurement and command are of one angle
MOST = 2  # turns that are taken off: more are rather degrees
FAR = 1.0  # [rad] from the others of a measurement that is no matter of turns


def unwrap_columns(
    streams: Mapping[str, Stream], places: Sequence[Place], scale: Floats, units: Sequence[str], names: Sequence[str]
) -> tuple[dict[str, Stream], dict[str, int]]:
    """Make angles at `places` continuous, which `scale` (n,) makes rad; say how often each joint jumped by a turn."""
    changed, jumped = dict(streams), dict[str, int]()
    for place, factor, unit, name in zip(places, scale, units, names, strict=True):
        if unit != "rad":
            continue
        stream = changed[place.stream]
        values = np.asarray(stream.columns[place.column], dtype=np.float64)
        found, jumps = unwrapped(values, TURN / abs(float(factor)))
        if jumps:
            changed[place.stream] = stream.with_column(place.column, found)
            jumped[name] = jumps
    return changed, jumped


def unwrapped(values: Floats, turn: float) -> tuple[Floats, int]:
    """Return values (M,) without jumps from one end of a turn to the other, and how many there were."""
    found = values.copy()
    finite = np.isfinite(values)
    x = values[finite]
    if len(x) < 3 or np.ptp(x) > turn * (1.0 + 1e-3):
        return found, 0
    steps = np.diff(x)
    jumps = np.abs(np.abs(steps) - turn) < NEAR * turn
    if not jumps.any() or jumps.all() or np.quantile(np.abs(steps[~jumps]), 0.99) > SMALL * turn:
        return found, 0
    found[np.flatnonzero(finite)[1:]] -= turn * np.cumsum(np.where(jumps, np.sign(steps), 0.0))
    return found, int(jumps.sum())


def in_one_turn(
    q_nominal: Floats,
    q_encoder: Floats | None,
    units: Sequence[str],
    names: Sequence[str],
    model: RobotModel | None,
    jumped: Collection[str],
) -> tuple[Floats, Floats | None, list[str]]:
    """Bring measurements into the commands' turn, and what `jumped` into the robot's limits, by whole turns; say so."""
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
    if abs(mean) < ALIKE:
        return turns
    away = error[rows] - np.angle(mean)
    whole = np.round(away / TURN)
    if np.abs(whole).max() <= MOST:
        turns[rows] = np.where(np.abs(away - TURN * whole) < FAR, whole, 0.0)
    return turns


def _turns_outside(q: Floats, low: float, high: float) -> int:
    """Return the whole turns that bring a joint within its limits; 0 where it is there, or none do."""
    slack = 0.1 * (high - low)
    if not np.isfinite(slack) or (q.min() >= low - slack and q.max() <= high + slack):
        return 0
    turns = round((0.5 * (q.min() + q.max()) - 0.5 * (low + high)) / TURN)
    moved = q - TURN * turns
    return turns if moved.min() >= low - slack and moved.max() <= high + slack else 0
