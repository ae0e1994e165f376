"""What every peer learns from and is asked about: rows of a recording in order; and the form of a fitted peer."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from catenary import MotionLog
from catenary.arrays import Floats
from catenary.calibration.features import choose_signals, signals_of

Places = NDArray[np.int64]


@dataclass(frozen=True)
class Rows:
    """N rows of a recording, those without a measurement included: they are commands all the same."""

    inputs: Floats  # (N, F) what a model of the joint errors takes
    velocity: Floats  # (N, n) of the reported positions [rad/s|m/s]; per row where there is no time
    error: Floats  # (N, n) q_encoder - q_nominal [rad|m]; whatever stands there on rows without a measurement
    known: NDArray[np.bool_]  # (N,) rows that have a measurement and may be learned from
    first: Places  # (N,) the row at which the motion of each row began


class Peer(Protocol):
    """A fitted model of joint errors."""

    def correction(self, rows: Rows, at: Places | None = None) -> Floats:
        """Return what to add to the reported positions [rad|m]: of every row (N, n), or of rows `at` (M,) only."""
        ...


def joined(parts: Sequence[Rows]) -> Rows:
    """Return the rows of recordings one after the other; no motion goes on from one to the next."""
    before = np.cumsum([0, *(len(part.inputs) for part in parts)])
    first = [part.first + count for part, count in zip(parts, before[:-1], strict=True)]
    columns = ("inputs", "velocity", "error", "known")
    return Rows(
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in columns},
        first=np.concatenate(first),
    )


def rows_of_log(log: MotionLog, words: tuple[str, ...], known: NDArray[np.bool_] | None = None) -> Rows:
    """Return a recording as rows, `known` (N,) those to learn from: all with a measurement when None."""
    if log.q_encoder is None:
        raise ValueError(f'recording "{log.name}" has no measured joint positions')
    signals = signals_of(log)
    inputs = np.column_stack([signals[name][0] for name in choose_signals(log, words)])
    count, first, velocity = len(log), np.zeros(len(log), dtype=np.int64), np.zeros_like(log.q_nominal)
    for start, end in zip(log.starts, [*log.starts[1:], count], strict=True):
        first[start:end] = start
        step = np.ones(end - start - 1) if log.time is None else np.diff(log.time[start:end])
        moved = np.diff(log.q_nominal[start:end], axis=0)
        velocity[start + 1 : end] = np.divide(moved, step[:, None], out=np.zeros_like(moved), where=step[:, None] > 0.0)
    error = np.where(log.ok[:, None], log.q_encoder - log.q_nominal, 0.0)
    return Rows(inputs, velocity, error, log.ok if known is None else known, first)
