"""Recordings spoilt in the ways that labs spoil theirs, each with the names of findings that say so."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.plant import MotionLog


class Spoil(NamedTuple):
    """A way to spoil a recording."""

    kind: str  # unit, swap, sign, shift, stuck, scale, clock, outliers, mixed joints, ...
    says: str
    spoil: Callable[[MotionLog], MotionLog]
    named: tuple[str, ...]  # a finding of one of these names is right
    refused: bool = True


def _measured(log: MotionLog) -> Floats:
    assert log.q_encoder is not None
    return log.q_encoder.copy()


def scaled(log: MotionLog, what: str, joints: slice | list[int], factor: float | Floats) -> MotionLog:
    """Return a log with columns of an array times a factor."""
    values = getattr(log, what).copy()
    values[:, joints] *= factor
    return replace(log, **{what: values})


def in_deg_and_mm(log: MotionLog, *arrays: str) -> MotionLog:
    """Return a log with arrays in deg and mm, though it says rad and m."""
    factor = np.array([np.rad2deg(1.0) if unit == "rad" else 1e3 for unit in log.joint_units])
    return replace(log, **{what: getattr(log, what) * factor for what in arrays})


def in_counts(log: MotionLog, *arrays: str) -> MotionLog:
    """Return a log with arrays in encoder counts: 40,000 a turn, 2 micrometres each."""
    factor = np.array([40_000 / (2.0 * np.pi) if unit == "rad" else 5e5 for unit in log.joint_units])
    return replace(log, **{what: np.round(getattr(log, what) * factor) for what in arrays})


def exchanged(log: MotionLog, what: str, order: list[int]) -> MotionLog:
    """Return a log with the first columns of an array in another order."""
    values = getattr(log, what).copy()
    values[:, : len(order)] = values[:, order]
    return replace(log, **{what: values})


def shifted(log: MotionLog, rows: int) -> MotionLog:
    """Return a log whose measurement lies some rows late; those that come from its other end are not trusted."""
    ok = np.roll(log.ok, rows)
    ok[slice(0, rows) if rows > 0 else slice(rows, None)] = False
    return replace(log, q_encoder=np.roll(_measured(log), rows, axis=0), ok=ok)


def lost(log: MotionLog, rows: int) -> MotionLog:
    """Return a log whose measurement lost some rows in the middle."""
    middle = len(log) // 2
    measured, ok = _measured(log), log.ok.copy()
    measured[middle:-rows], ok[middle:-rows] = measured[middle + rows :], ok[middle + rows :]
    ok[-rows:] = False
    return replace(log, q_encoder=measured, ok=ok)


def stuck(log: MotionLog, joint: int, share: float, noise: float = 0.0) -> MotionLog:
    """Return a log whose encoder of one joint stands still over a share of the rows."""
    measured, first, rows = _measured(log), len(log) // 3, int(share * len(log))
    measured[first : first + rows, joint] = measured[first, joint]
    measured[first : first + rows, joint] += noise * np.random.default_rng(1).standard_normal(rows)
    return replace(log, q_encoder=measured)


def drifting(log: MotionLog, rate: float) -> MotionLog:
    """Return a log whose measurement was taken by a clock that runs faster or slower."""
    rows = np.arange(len(log))
    seen = np.minimum(rows * (1.0 + rate), len(log) - 1)
    measured = np.column_stack([np.interp(seen, rows, column) for column in _measured(log).T])
    return replace(log, q_encoder=measured, ok=log.ok & (seen < len(log) - 1))


def repeated_stamps(log: MotionLog) -> MotionLog:
    """Return a log in which every fiftieth stamp repeats the one before."""
    assert log.time is not None
    time = log.time.copy()
    time[50::50] = time[49:-1:50][: len(time[50::50])]
    return replace(log, time=time)


def shuffled(log: MotionLog) -> MotionLog:
    """Return a log whose measured rows were shuffled."""
    order = np.random.default_rng(2).permutation(len(log))
    return replace(log, q_encoder=_measured(log)[order], ok=log.ok[order])


def shuffled_stamps(log: MotionLog) -> MotionLog:
    """Return a log whose stamps were shuffled."""
    assert log.time is not None
    return replace(log, time=np.random.default_rng(3).permutation(log.time))


def with_outliers(log: MotionLog) -> MotionLog:
    """Return a log in which one measurement in 200 is wild."""
    rng, measured = np.random.default_rng(4), _measured(log)
    rows = rng.choice(len(log), len(log) // 200, replace=False)
    measured[rows] += rng.choice([-1.0, 1.0], (len(rows), measured.shape[1])) * 5.0
    return replace(log, q_encoder=measured)


def with_zeros(log: MotionLog) -> MotionLog:
    """Return a log in which one row in 50 was not measured, and says that it was."""
    measured, ok = _measured(log), log.ok.copy()
    measured[::50], ok[::50] = 0.0, True
    return replace(log, q_encoder=measured, ok=ok)


def constant(log: MotionLog, what: str, joint: int, value: float = 0.0) -> MotionLog:
    """Return a log with a column that never changes."""
    values = getattr(log, what).copy()
    values[:, joint] = value
    return replace(log, **{what: values})


def with_time(log: MotionLog, factor: float) -> MotionLog:
    """Return a log with stamps in another unit."""
    assert log.time is not None
    return replace(log, time=factor * log.time)


def copied(log: MotionLog, joints: slice | list[int]) -> MotionLog:
    """Return a log whose measurement of some joints is their command."""
    measured = _measured(log)
    measured[:, joints] = log.q_nominal[:, joints]
    return replace(log, q_encoder=measured)


def leapt(log: MotionLog, joint: int, by: float) -> MotionLog:
    """Return a log whose encoder of one joint was zeroed anew after two fifths of the rows."""
    measured = _measured(log)
    measured[2 * len(log) // 5 :, joint] += by
    return replace(log, q_encoder=measured)


def wrapped(log: MotionLog, joint: int, turn: float) -> MotionLog:
    """Return a log in which a joint's measurement is told within a turn about the middle of its range."""
    measured = _measured(log)
    zero = np.median(log.q_nominal[:, joint])
    measured[:, joint] = zero + np.mod(measured[:, joint] - zero, turn)
    return replace(log, q_encoder=measured)


def mixed(log: MotionLog, a: int, b: int) -> MotionLog:
    """Return a log with measurements of two joints in another frame, turned by 53 deg."""
    measured = _measured(log)
    measured[:, [a, b]] = measured[:, [a, b]] @ np.array([[0.6, 0.8], [-0.8, 0.6]])
    return replace(log, q_encoder=measured)


def held(log: MotionLog) -> MotionLog:
    """Return a log of a sensor at half the rate, whose last reading is written again."""
    measured = _measured(log)
    measured[1::2] = measured[: 2 * (len(measured) // 2) : 2]
    return replace(log, q_encoder=measured)


BOTH, COMMAND, MEASURED = ("q_nominal", "q_encoder"), "q_nominal", "q_encoder"
SPOILS = (
    Spoil("unit", "all numbers in deg and mm", lambda g: in_deg_and_mm(g, *BOTH), ("units",)),
    Spoil("unit", "measurements in deg and mm", lambda g: in_deg_and_mm(g, MEASURED), ("units",)),
    Spoil("unit", "commands in deg and mm", lambda g: in_deg_and_mm(g, COMMAND), ("units",)),
    Spoil("unit", "measured J2 in deg", lambda g: scaled(g, MEASURED, [1], np.rad2deg(1.0)), ("units",)),
    Spoil("unit", "all J3 in mm", lambda g: scaled(scaled(g, MEASURED, [2], 1e3), COMMAND, [2], 1e3), ("units",)),
    Spoil("unit", "measured J3 in mm", lambda g: scaled(g, MEASURED, [2], 1e3), ("units",)),
    Spoil("unit", "measured J3 times 180/pi", lambda g: scaled(g, MEASURED, [2], np.rad2deg(1.0)), ("units",)),
    Spoil("counts", "measurements in encoder counts", lambda g: in_counts(g, MEASURED), ("scale",)),
    Spoil("counts", "commands in encoder counts", lambda g: in_counts(g, COMMAND), ("scale", "range")),
    Spoil("counts", "all numbers in encoder counts", lambda g: in_counts(g, *BOTH), ("range",)),
    Spoil("swap", "measured J1 and J2", lambda g: exchanged(g, MEASURED, [1, 0]), ("swapped",)),
    Spoil("swap", "commanded J1 and J2", lambda g: exchanged(g, COMMAND, [1, 0]), ("swapped",)),
    Spoil("swap", "measured J2 and J3", lambda g: exchanged(g, MEASURED, [0, 2, 1]), ("swapped",)),
    Spoil("mixed joints", "J1, J2, J3 in turn", lambda g: exchanged(g, MEASURED, [1, 2, 0]), ("swapped",)),
    Spoil("mixed joints", "measured J2 is J1", lambda g: exchanged(g, MEASURED, [0, 0]), ("unrelated", "swapped")),
    Spoil("sign", "measured J1", lambda g: scaled(g, MEASURED, [0], -1.0), ("sign",)),
    Spoil("sign", "commanded J3", lambda g: scaled(g, COMMAND, [2], -1.0), ("sign",)),
    Spoil("sign", "every measurement", lambda g: scaled(g, MEASURED, slice(None), -1.0), ("sign",)),
    Spoil("shift", "measurement 20 rows late", lambda g: shifted(g, 20), ("delay",)),
    Spoil("shift", "measurement 8 rows early", lambda g: shifted(g, -8), ("delay",)),
    Spoil("shift", "12 rows lost half-way", lambda g: lost(g, 12), ("delay", "clock")),
    Spoil("stuck", "J1 on a tenth of the rows", lambda g: stuck(g, 0, 0.1), ("stuck",)),
    Spoil("stuck", "J3 on a fifth, with noise", lambda g: stuck(g, 2, 0.2, 1e-5), ("stuck",)),
    Spoil("stuck", "J2 on all", lambda g: constant(g, MEASURED, 1, 0.3), ("constant",)),
    Spoil("scale", "measured J1 times 1.3", lambda g: scaled(g, MEASURED, [0], 1.3), ("scale",)),
    Spoil("scale", "measured J3 times 0.75", lambda g: scaled(g, MEASURED, [2], 0.75), ("scale",)),
    Spoil("scale", "commanded J2 times 2", lambda g: scaled(g, COMMAND, [1], 2.0), ("scale",)),
    Spoil("clock", "measurement's clock 1 % fast", lambda g: drifting(g, 0.01), ("clock", "delay", "unrelated")),
    Spoil("clock", "stamps in ms", lambda g: with_time(g, 1e3), ("stamps",)),
    Spoil("clock", "stamps in ns", lambda g: with_time(g, 1e9), ("stamps",)),
    Spoil("clock", "stamps in thousands of s", lambda g: with_time(g, 1e-3), ("stamps", "short")),
    Spoil("clock", "repeated stamps", repeated_stamps, ("stamps",)),
    Spoil("clock", "shuffled stamps", shuffled_stamps, ("stamps",)),
    Spoil("outliers", "one row in 200 wild", with_outliers, ("outliers",), refused=False),
    Spoil("zeros", "one row in 50 zero", with_zeros, ("zeros",)),
    Spoil("mixed joints", "measured rows shuffled", shuffled, ("unrelated",)),
    Spoil("constant", "commanded J1 zero", lambda g: constant(g, COMMAND, 0), ("constant",)),
    Spoil("constant", "measured J3 zero", lambda g: constant(g, MEASURED, 2), ("constant",)),
    Spoil("copy", "measurements are commands", lambda g: copied(g, slice(None)), ("copied",)),
    Spoil("copy", "measured J1 is its command", lambda g: copied(g, [0]), ("copied",)),
    Spoil("zero", "J1 leaps by 0.3 rad", lambda g: leapt(g, 0, 0.3), ("jump",)),
    Spoil("zero", "J3 leaps by 20 mm", lambda g: leapt(g, 2, 0.02), ("jump",)),
    Spoil("zero", "J5 lost a turn", lambda g: leapt(g, 4, 2.0 * np.pi), ("turns",)),
    Spoil("zero", "J4 within half a turn", lambda g: wrapped(g, 3, np.pi), ("turns",)),
    Spoil("mixed joints", "J1 and J2 in another frame", lambda g: mixed(g, 0, 1), ("mixed", "swapped")),
    Spoil("stuck", "every second measurement repeated", held, ("stuck",), refused=False),
    Spoil("short", "20 rows", lambda g: g.part(0, 20), ("short",)),
)
