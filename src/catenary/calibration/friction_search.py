"""Rows by which friction and cables are searched, and errors of ridge regressions on blocks of time left out.

Long recordings are searched by a sample of stretches, each with rows before it in which the states find their places.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats, Integers
from catenary.calibration.features import FeatureSet
from catenary.calibration.fit_options import MEMORY_RIDGE, PLAY_SHARES, FitOptions
from catenary.calibration.fit_rows import choose_inputs, joint_inputs
from catenary.calibration.learned import squares_left_out
from catenary.calibration.recordings import Recordings
from catenary.calibration.valid_range import standardisation
from catenary.errors import InputError
from catenary.plant import MotionLog

_BLOCKS = 5
# rows that are searched whole; else this many parts, and rows before each
_MAX_SEARCHED_ROWS, _WINDOWS, _WARMUP_SHARE = 8_000, 10, 0.2
_PERIOD_S = 0.04  # between rows that are searched
_FAR_DEVIATIONS = 8.0  # robust deviations
MIN_ROWS = 200  # rows
_MIN_LOG_GAIN = 0.03  # in the logarithm of the error, that what is found must explain


class SearchedRows(NamedTuple):
    """Rows that the search sees, and the paths that lead to them."""

    signals: FeatureSet  # of `fixed`
    fixed: Floats  # (N, F) positions and play states, and what else the model takes
    error: Floats  # (N, n)
    block: Integers  # (N,)
    # positions (L, n) of each motion as shares of ranges, and which of its rows these are
    paths: list[tuple[Floats, Integers]]
    ranges: Floats  # (n,)
    joint_names: tuple[str, ...]

    def columns(self, joints: Sequence[int]) -> Integers:
        """Return the columns of `fixed` without play states of the given joints."""
        own = {f"q:{self.joint_names[j]}" for j in joints}
        plays = [column for column, (along, _) in self.signals.play_columns.items() if along in own]
        return np.setdiff1d(np.arange(len(self.signals.names)), plays)

    def of_paths(self, state: Callable[[Floats], Floats]) -> Floats:
        """Return states (N, S) at the rows; `state` gives them for paths (L, n)."""
        return np.concatenate([state(path)[rows] for path, rows in self.paths])


def searched_rows(recordings: Recordings, options: FitOptions, held_out: float) -> SearchedRows:
    """Return the rows of recordings that come before their held-out part, or a sample of stretches."""
    logs = recordings.logs
    taken = joint_inputs(logs[0]) if options.inputs is None else options.inputs
    plain = FitOptions("linear", inputs=taken, play=PLAY_SHARES, cables=options.cables)
    inputs = choose_inputs(recordings, plain, held_out=held_out)
    fixed, errors, blocks, paths = [], [], [], []
    ranges = np.ptp(np.vstack([log.q_nominal[: _seen(log, held_out)] for log in logs]), axis=0)
    scale = np.where(ranges > 0.0, ranges, 1.0)
    for log in logs:
        if log.q_encoder is None:
            raise InputError(f'recording "{log.name}": has no q_encoder; a calibration needs measured joint positions')
        period = 0.0 if log.time is None else float(np.median(np.diff(log.time)))
        every = max(1, int(_PERIOD_S / period)) if period > 0.0 else 1  # play states hardly depend on the rate
        for number, (start, first, last) in enumerate(_windows(_seen(log, held_out), len(logs), every)):
            part = log.part(start, last)
            X = inputs.features.matrix(part)
            error = log.q_encoder[start:last] - log.q_nominal[start:last]
            usable = part.ok & np.isfinite(X).all(axis=1)
            usable[: first - start] = False
            if recordings.max_error is not None:
                usable[usable] = (np.abs(error[usable]) <= recordings.max_error).all(axis=1)
            sampled = np.zeros(len(part), dtype=bool)
            for begin, end in zip(part.starts, [*part.starts[1:], len(part)], strict=True):
                sampled[begin:end:every] = True
                at = np.flatnonzero(usable[begin:end:every])
                paths.append((part.q_nominal[begin:end:every] / scale, at))
            at = np.flatnonzero(usable & sampled)
            fixed.append(X[at])
            errors.append(error[at])
            whole = first == 0 and last == _seen(log, held_out)
            blocks.append(
                np.arange(len(at)) * _BLOCKS // max(1, len(at)) if whole else np.full(len(at), number % _BLOCKS)
            )
    X, error = np.vstack(fixed), np.vstack(errors)
    return SearchedRows(inputs.features, X, _held(X, error), np.concatenate(blocks), paths, scale, logs[0].joint_names)


def _held(X: Floats, error: Floats) -> Floats:
    """Return errors (N, n) of which failed measurements, far from a line, are drawn near to it."""
    mean, scale = standardisation(X)
    Z = np.column_stack([(X - mean) / scale, np.ones(len(X))])
    for _ in range(2):
        line = Z @ np.linalg.solve(Z.T @ Z + MEMORY_RIDGE * np.eye(Z.shape[1]), Z.T @ error)
        left = error - line
        limit = _FAR_DEVIATIONS * 1.4826 * np.median(np.abs(left), axis=0)
        error = line + np.clip(left, -limit, limit)
    return error


def _seen(log: MotionLog, held_out: float) -> int:
    return max(1, round((1.0 - held_out) * len(log)))


def _windows(rows: int, recordings: int, every: int) -> list[tuple[int, int, int]]:
    """Return parts of a recording: where its path begins, and the rows of it that count."""
    longest = every * (_MAX_SEARCHED_ROWS // recordings)
    if rows <= longest:
        return [(0, 0, rows)]
    length, spacing = longest // _WINDOWS, rows // _WINDOWS
    warming = int(_WARMUP_SHARE * length)
    starts = [k * spacing for k in range(_WINDOWS)]
    return [(start, start + warming, start + length) for start in starts]


class SumsBeside:
    """Sums of products over each block of some columns (N, F) and outputs (N, m), to which others are added."""

    def __init__(self, X: Floats, Y: Floats, block: Integers) -> None:
        mean, scale = standardisation(X)
        columns = np.hstack([(X - mean) / scale, np.ones((len(X), 1)), Y])
        self._rows = [np.flatnonzero(block == k) for k in np.unique(block)]
        self._parts = [columns[rows] for rows in self._rows]
        self._sums, self._own = [part.T @ part for part in self._parts], X.shape[1]

    def errors(self, P: Floats) -> Floats:
        """Return RMSE on each block (K, m) of a regression on all others, with columns P (N, C) added."""
        mean, scale = standardisation(P)
        P, sums = (P - mean) / scale, []
        for rows, part, own in zip(self._rows, self._parts, self._sums, strict=True):
            across = P[rows].T @ part
            sums.append(np.block([[P[rows].T @ P[rows], across], [across.T, own]]))
        squares = squares_left_out(np.array(sums), np.full(P.shape[1] + self._own, MEMORY_RIDGE))
        return np.sqrt(np.maximum(squares, 1e-30))


def is_gain(before: Floats, after: Floats, least: float = _MIN_LOG_GAIN) -> bool:
    """Return True if log errors on blocks (K, m) fell by `least`, and significantly."""
    gain = np.log(before / after).mean(axis=1)  # of each block
    return bool(gain.mean() > max(least, gain.std(ddof=1) / np.sqrt(len(gain))))
