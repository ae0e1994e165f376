"""What labs do to recordings without knowing: each takes a log and returns it spoilt, with the truth left behind."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from catenary.plant import MotionLog
from catenary.units import DISPLAY


class Spoiling(NamedTuple):
    """A way to spoil recordings, and the words of which one in what a command says names the doubt."""

    name: str
    spoil: Callable[[MotionLog], MotionLog]
    named_by: tuple[str, ...] = ()


def late(log: MotionLog, seconds: float, joints: slice = slice(None)) -> MotionLog:
    """Return a log whose measurement (of these joints) is of so many seconds ago, or ahead: in fractions of a row."""
    assert log.q_encoder is not None
    assert log.time is not None
    good = np.flatnonzero(log.ok)
    at = log.time - seconds
    measured = np.column_stack([np.interp(at, log.time[good], column) for column in log.q_encoder[good].T])
    k = np.clip(np.searchsorted(log.time, at), 1, len(log) - 1)
    ok = log.ok[k] & log.ok[k - 1] & (at >= log.time[0]) & (at <= log.time[-1])
    spoilt = log.q_encoder.copy()
    spoilt[ok, joints] = measured[ok, joints]
    return replace(log, q_encoder=spoilt, ok=ok)


def _shown(log: MotionLog, deg_or_mm: float) -> np.ndarray:
    """Return a size in the joints' own units, (n,)."""
    return np.array([deg_or_mm / DISPLAY[unit][1] for unit in log.joint_units])


def wild(log: MotionLog, share: float) -> MotionLog:
    """Return a log in which a share of single measurements is wild by 20 deg or mm."""
    assert log.q_encoder is not None
    rng, measured = np.random.default_rng(7), log.q_encoder.copy()
    rows = rng.choice(len(log), round(share * len(log)), replace=False)
    measured[rows] += rng.normal(size=(len(rows), measured.shape[1])) * _shown(log, 20.0)
    return replace(log, q_encoder=measured)


def dropped(log: MotionLog, share: float) -> MotionLog:
    """Return a log whose sensor lost a share of the rows, where joints moved fastest: a camera's blur."""
    speed = np.linalg.norm(np.gradient(log.q_nominal, axis=0) / np.ptp(log.q_nominal, axis=0).clip(1e-9), axis=1)
    return replace(log, ok=log.ok & (speed <= np.quantile(speed, 1.0 - share)))


def coarse(log: MotionLog, step: float) -> MotionLog:
    """Return a log measured in steps of so many deg or mm."""
    assert log.q_encoder is not None
    size = _shown(log, step)
    return replace(log, q_encoder=np.where(log.ok[:, None], np.round(log.q_encoder / size) * size, log.q_encoder))


def slack_cut(log: MotionLog, quantile: float) -> MotionLog:
    """Return a log in which rows of the largest errors, of hysteresis and slack, were called outliers and cut."""
    assert log.q_encoder is not None
    error = np.abs(log.q_encoder - log.q_nominal - np.median((log.q_encoder - log.q_nominal)[log.ok], axis=0))
    limit = np.quantile(error[log.ok], quantile, axis=0)
    return replace(log, ok=log.ok & (error <= limit).all(axis=1))


def withheld(log: MotionLog, share: float) -> MotionLog:
    """Return a log without single rows of the largest errors, of all joints together: its file has no trace of them.

    Of twice as many every second one: errors of neighbours are alike, and whole stretches would be gaps.
    """
    assert log.q_encoder is not None
    error = log.q_encoder - log.q_nominal - np.median((log.q_encoder - log.q_nominal)[log.ok], axis=0)
    size = np.linalg.norm(error / np.median(np.abs(error[log.ok]), axis=0).clip(1e-12), axis=1)
    worst = log.ok & (size > np.quantile(size[log.ok], 1.0 - 2.0 * share))
    kept = ~worst | (np.cumsum(worst) % 2 == 0)
    names = ("q_nominal", "q_encoder", "ok", "time", "qd", "tau")
    arrays = {name: values[kept] for name in names if (values := getattr(log, name)) is not None}
    return replace(log, signals={}, signal_units={}, sha256=None, **arrays)


def moved(log: MotionLog, along: Callable[[np.ndarray], np.ndarray]) -> MotionLog:
    """Return a log whose second joint's measurement moves by so many deg or mm along the recording, 0 to 1."""
    assert log.q_encoder is not None
    measured = log.q_encoder.copy()
    measured[:, 1 % measured.shape[1]] += (
        along(np.linspace(0.0, 1.0, len(log))) * _shown(log, 1.0)[1 % len(measured[0])]
    )
    return replace(log, q_encoder=measured)


def twice(log: MotionLog) -> MotionLog:
    """Return a log that begins again at its end, and then stops half-way."""
    rows = np.r_[np.arange(len(log)), np.arange(len(log) // 2)]
    names = ("q_nominal", "q_encoder", "ok", "qd", "tau")
    arrays = {name: values[rows] for name in names if (values := getattr(log, name)) is not None}
    step = 0.0 if log.time is None else float(np.median(np.diff(log.time)))
    time = None if log.time is None else np.r_[log.time, log.time[: len(log) // 2] - log.time[0] + log.time[-1] + step]
    return replace(log, time=time, signals={}, signal_units={}, sha256=None, **arrays)


def tiny(log: MotionLog) -> MotionLog:
    """Return a log in rad and m that somebody took for degrees and millimetres, and converted."""
    assert log.q_encoder is not None
    factors = 1.0 / np.array([DISPLAY[unit][1] for unit in log.joint_units])
    return replace(log, q_nominal=log.q_nominal * factors, q_encoder=log.q_encoder * factors)


def filled(log: MotionLog, share: float, by_commands: bool = False) -> MotionLog:
    """Return a log whose camera lost the arm for 3 s now and then, and somebody filled the gaps: nothing says so."""
    assert log.q_encoder is not None
    assert log.time is not None
    rng, long = np.random.default_rng(1), max(2, round(3.0 / float(np.median(np.diff(log.time)))))
    lost = np.zeros(len(log), dtype=bool)
    while lost.mean() < share:
        first = int(rng.integers(long, len(log) - 2 * long))
        lost[first : first + long] = True
    good, rows = np.flatnonzero(log.ok & ~lost), np.arange(len(log))
    lines = np.column_stack([np.interp(rows, good, column) for column in log.q_encoder[good].T])
    return replace(log, q_encoder=np.where(lost[:, None], log.q_nominal if by_commands else lines, log.q_encoder))


DELAYS = (-0.15, -0.1, -0.05, -0.02, 0.02, 0.05, 0.1, 0.15, 0.2, 0.5)
NOT_ALIKE = ("not like the others",)
NOTHING = Spoiling("untouched", lambda log: log, ("where joints meet", "which says little"))
SPOILINGS = (
    NOTHING,
    *(
        Spoiling(
            f"{abs(d):.2f} s {'late' if d > 0.0 else 'early'}",
            lambda log, d=d: late(log, d),
            ("would hide in hysteresis", "friction could look the same"),
        )  # type: ignore[misc]
        for d in DELAYS
    ),
    Spoiling(
        "second joint 0.3 s late",
        lambda log: late(log, 0.3, slice(1, 2)),
        ("those of all joints together", "would hide in hysteresis", "friction could look the same"),
    ),
    Spoiling("zero leaps by 3 deg or mm", lambda log: moved(log, lambda u: 3.0 * (u > 0.5)), ("the error leaps",)),
    Spoiling("zero drifts by 3 deg or mm", lambda log: moved(log, lambda u: 3.0 * u), ("the error drifts",)),
    Spoiling("half of the minutes twice", twice, ("in the data twice",)),
    Spoiling("one row in 100 wild", lambda log: wild(log, 0.01), ("robust", "--max-error")),
    Spoiling("fast rows lost", lambda log: dropped(log, 0.3), NOT_ALIKE),
    Spoiling("converted to rad and m twice", tiny, ("converted twice",)),
    Spoiling("gaps of 3 s filled by lines", lambda log: filled(log, 0.2), ("straight lines",)),
    Spoiling("gaps of 3 s filled with commands", lambda log: filled(log, 0.1, True), ("commands themselves",)),
    Spoiling("steps of 0.5 deg or mm", lambda log: coarse(log, 0.5), ("come in steps",)),
    Spoiling("slack cut out", lambda log: slack_cut(log, 0.85), NOT_ALIKE),
    *(Spoiling(f"{s:.0%} of rows withheld singly", lambda log, s=s: withheld(log, s), NOT_ALIKE) for s in (0.1, 0.3)),
)
