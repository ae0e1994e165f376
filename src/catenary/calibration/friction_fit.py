"""Finds which joints a cable's friction couples, the springs and friction between them, and the inputs they need.

Six numbers describe two coupled joints: of the springs K, of which the first's stiffness is the unit, two, and a
threshold for an element along each joint. They are searched for (Nelder and Mead 1965) so that a ridge regression on
positions, play states and friction states predicts contiguous blocks of time that it was not fitted to; systems with
thresholds from a tenth to 2.5 times these stand beside each other, as play states of several widths do. Long recordings
are searched by a sample of blocks, each with rows before it in which the states find their places.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize
from threadpoolctl import threadpool_limits

from catenary.arrays import Floats, Integers
from catenary.calibration.features import FeatureSet
from catenary.calibration.fit_options import MEMORY_RIDGE, FitOptions
from catenary.calibration.fit_rows import choose_inputs
from catenary.calibration.friction_level import best_level, levels_tried
from catenary.calibration.friction_states import FoundFriction, FrictionStates
from catenary.calibration.recordings import Recordings
from catenary.calibration.valid_range import standardisation
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.transmission.cable_friction import CoupledFriction, coupled_friction

_THRESHOLD_SCALES = np.array([0.1, 0.25, 0.5, 1.0, 1.6, 2.5])  # of the thresholds
_START_THRESHOLD = 0.035  # of each joint's range: where the search begins; 5 deg of a wrist
_START_COUPLING = 0.5  # of the springs, where the search begins
_MAX_STEP_SHARE = 0.015  # of each joint's range: a longer step is split; 2 deg of a wrist
_SIMPLEX_STEP = 0.35  # of the search, in logarithms and couplings
_MAX_SEARCH_STEPS = 80  # steps
_COUPLING_RIDGE = 1e-4  # weight on squared couplings
_BLOCKS = 5
_MIN_LOG_GAIN = 0.03  # in the logarithm of the error, from play states of each joint
# rows that are searched whole; else this many parts, and rows before each
_MAX_SEARCHED_ROWS, _WINDOWS, _WARMUP_SHARE = 12_000, 10, 0.2
_MIN_ROWS = 200  # rows


class _Rows(NamedTuple):
    """Rows that the search sees, and the paths that lead to them."""

    signals: FeatureSet  # of `fixed`
    fixed: Floats  # (N, F) positions and play states, and what else the model takes
    error: Floats  # (N, n)
    block: Integers  # (N,)
    recording: Integers  # (N,)
    # positions (L, n) of each motion as shares of ranges, which of its rows these are, and the number of its recording
    paths: list[tuple[Floats, Integers, int]]
    ranges: Floats  # (n,)
    joint_names: tuple[str, ...]

    def columns(self, joints: Sequence[int]) -> Integers:
        """Return the columns of `fixed` without play states of the given joints."""
        own = {f"q:{self.joint_names[j]}" for j in joints}
        names = self.signals.names
        return np.array([i for i, n in enumerate(names) if not (n.startswith("play(") and n[5:].split(",")[0] in own)])

    def lags(self, joints: Sequence[int], friction: CoupledFriction, only: int | None = None) -> Floats:
        """Return friction states of joints at the rows, (N, S n), of all recordings or of one."""
        parts = []
        for path, rows, number in self.paths:
            if only in (None, number):
                lag = friction.lag(path[:, list(joints)])
                parts.append(lag.reshape(len(lag), lag.shape[1] * lag.shape[2])[rows])  # of some there are no rows
        return np.concatenate(parts)


def find_friction(recordings: Recordings, options: FitOptions, *, held_out: float = 0.0) -> FoundFriction | None:
    """Return the friction of coupled joints, looking only at what comes before the held-out part; None without.

    Where `options.coupled` names no joints, the pair whose errors friction states explain best is taken, if these
    explain more than play states do.
    """
    if options.coupled == ():
        return None
    with threadpool_limits(limits=1):
        rows = _rows_of(recordings, options, held_out)
        if options.coupled is not None:
            joints = _told(rows, options.coupled)
        elif len(rows.fixed) < _MIN_ROWS:
            return None
        else:
            joints = _best_pair(rows)
        if not joints:
            return None
        found = _searched(rows, joints)
        before, after = (_errors(rows, joints, each) for each in (None, found))
        gain = np.log(before / after).mean(axis=1)  # of each block
        shown = gain.mean() > max(_MIN_LOG_GAIN, gain.std(ddof=1) / np.sqrt(len(gain)))
        if options.coupled is None and not shown:
            return None
        kept, also = _inputs_needed(rows, joints, found)
        levels = _levels(rows, joints, found) if len(recordings.logs) > 1 else np.zeros((1, len(found.directions)))
        found = found._replace(thresholds=found.thresholds * np.exp(levels.mean(axis=0)))
        levels -= levels.mean(axis=0)
    unit = rows.ranges[list(joints)]
    states = coupled_friction(
        unit[:, None] * found.lever * unit, found.directions / unit, found.thresholds, found.longest * unit
    )
    names = tuple(rows.joint_names[j] for j in joints)
    return FoundFriction(
        FrictionStates.of(tuple(f"q:{name}" for name in names), states),
        kept,
        tuple(name for j, name in enumerate(rows.joint_names) if j in joints or j in also),
        tuple(map(tuple, levels.tolist())),
        float(1.0 - np.exp(-gain.mean())),
    )


def _rows_of(recordings: Recordings, options: FitOptions, held_out: float) -> _Rows:
    logs = recordings.logs
    plain = replace(options, kind="hysteretic", preset=None, friction=None, coupled=())
    inputs = choose_inputs(recordings, plain, held_out=held_out)
    fixed, errors, blocks, recording, paths = [], [], [], [], []
    ranges = np.ptp(np.vstack([log.q_nominal[: _seen(log, held_out)] for log in logs]), axis=0)
    scale = np.where(ranges > 0.0, ranges, 1.0)
    for which, log in enumerate(logs):
        if log.q_encoder is None:
            raise InputError(f'recording "{log.name}": has no q_encoder; a calibration needs measured joint positions')
        for number, (start, first, last) in enumerate(_windows(_seen(log, held_out), len(logs))):
            part = log.part(start, last)
            X = inputs.features.matrix(part)
            error = log.q_encoder[start:last] - log.q_nominal[start:last]
            usable = part.ok & np.isfinite(X).all(axis=1)
            usable[: first - start] = False
            if recordings.max_error is not None:
                usable[usable] = (np.abs(error[usable]) <= recordings.max_error).all(axis=1)
            at = np.flatnonzero(usable)
            ends = [*part.starts[1:], len(part)]
            for begin, end in zip(part.starts, ends, strict=True):
                paths.append((part.q_nominal[begin:end] / scale, at[(at >= begin) & (at < end)] - begin, which))
            fixed.append(X[at])
            errors.append(error[at])
            recording.append(np.full(len(at), which))
            whole = first == 0 and last == _seen(log, held_out)
            blocks.append(
                np.arange(len(at)) * _BLOCKS // max(1, len(at)) if whole else np.full(len(at), number % _BLOCKS)
            )
    numbers = (np.concatenate(blocks), np.concatenate(recording))
    return _Rows(inputs.features, np.vstack(fixed), np.vstack(errors), *numbers, paths, scale, logs[0].joint_names)


def _seen(log: MotionLog, held_out: float) -> int:
    return max(1, round((1.0 - held_out) * len(log)))


def _windows(rows: int, recordings: int) -> list[tuple[int, int, int]]:
    """Return parts of a recording: where its path begins, and the rows of it that count."""
    most = _MAX_SEARCHED_ROWS // recordings
    if rows <= most:
        return [(0, 0, rows)]
    length, spacing = most // _WINDOWS, rows // _WINDOWS
    warming = int(_WARMUP_SHARE * length)
    starts = [k * spacing for k in range(_WINDOWS)]
    return [(start, start + warming, start + length) for start in starts]


def _told(rows: _Rows, names: Sequence[str]) -> tuple[int, ...]:
    for name in names:
        if name not in rows.joint_names:
            raise InputError(f'coupled joint "{name}": no such joint; joints: {", ".join(rows.joint_names)}')
        if f"q:{name}" not in rows.signals.signals:
            raise InputError(f'coupled joint "{name}": expected its position among the inputs')
    if len(set(names)) != len(names) or len(names) < 2:
        raise InputError(f"coupled joints: expected two or more different ones, got {', '.join(names)}")
    return tuple(rows.joint_names.index(name) for name in names)


def _friction(parameters: Floats, n: int) -> CoupledFriction:
    """Return friction in shares of the joints' ranges: of a triangular root of K, whose first is 1, and thresholds."""
    root = np.zeros((n, n))
    root[np.tril_indices(n)] = np.append(0.0, parameters[: n * (n + 1) // 2 - 1])
    root[np.diag_indices(n)] = np.exp(np.diag(root))
    thresholds = np.outer(_THRESHOLD_SCALES, np.exp(parameters[-n:]))
    K = root @ root.T
    compliance = np.linalg.inv(K)
    return coupled_friction(0.5 * (compliance + compliance.T), np.eye(n), thresholds, np.full(n, _MAX_STEP_SHARE))


def _start(n: int, coupling: float) -> Floats:
    """Return where the search begins: springs alike, each coupled to those before it."""
    root = np.linalg.cholesky(np.full((n, n), coupling) + (1.0 - coupling) * np.eye(n)) if coupling > 0 else np.eye(n)
    if coupling < 0:
        root[1, 0], root[1, 1] = coupling, np.sqrt(1.0 - coupling**2)
    root[np.diag_indices(n)] = np.log(np.diag(root))
    return np.append(root[np.tril_indices(n)][1:], np.full(n, np.log(_START_THRESHOLD)))


def _best_pair(rows: _Rows) -> tuple[int, ...]:
    """Return the two joints whose errors friction states explain most beyond play states; none where none do."""
    best, pair = 0.0, tuple[int, ...]()
    moving = [j for j, name in enumerate(rows.joint_names) if f"q:{name}" in {p for p, _ in rows.signals.play}]
    for joints in combinations(moving, 2):
        before = np.log(_errors(rows, joints, None)).mean()
        for coupling in (_START_COUPLING, -_START_COUPLING):
            gain = before - np.log(_errors(rows, joints, _friction(_start(2, coupling), 2))).mean()
            if gain > best:
                best, pair = gain, joints
    return pair


def _searched(rows: _Rows, joints: Sequence[int]) -> CoupledFriction:
    n = len(joints)
    springs = n * (n + 1) // 2 - 1

    def loss(parameters: Floats) -> float:
        errors = _errors(rows, joints, _friction(np.clip(parameters, -5.0, 5.0), n))
        return float(
            0.5 * np.log(np.square(errors).mean(axis=0)).mean()
            + _COUPLING_RIDGE * np.square(parameters[:springs]).sum()
        )

    start = min((_start(n, coupling) for coupling in (_START_COUPLING, 0.0, -_START_COUPLING)), key=loss)
    simplex = np.vstack([start, start + _SIMPLEX_STEP * np.eye(len(start))])
    options: Any = {"maxiter": _MAX_SEARCH_STEPS, "initial_simplex": simplex, "xatol": 1e-2, "fatol": 1e-5}
    found = minimize(loss, start, method="Nelder-Mead", options=options)
    return _friction(np.clip(found.x, -5.0, 5.0), n)


def _levels(rows: _Rows, joints: Sequence[int], friction: CoupledFriction) -> Floats:
    """Return the logarithm of each recording's friction, (R, m), with springs and a ridge regression shared by all.

    A model is fitted at their mean: at each recording's own level it predicted the fourth of a real wrist no better.
    """
    recordings, tried = int(rows.recording.max()) + 1, levels_tried(len(friction.directions))
    fixed, Y = rows.fixed[:, rows.columns(joints)], rows.error[:, list(joints)]
    X = np.hstack([fixed, rows.lags(joints, friction), np.eye(recordings)[rows.recording]])  # a zero of each
    mean, scale = standardisation(X)
    Z = (X - mean) / scale
    W = np.linalg.solve(Z.T @ Z + MEMORY_RIDGE * np.eye(Z.shape[1]), Z.T @ (Y - Y.mean(axis=0))) / scale[:, None]
    of_fixed, of_lags = W[: fixed.shape[1]], W[fixed.shape[1] : -recordings]
    levels = np.zeros((recordings, tried.shape[1]))
    for r in np.unique(rows.recording):
        here = rows.recording == r
        at_levels = (friction._replace(thresholds=friction.thresholds * factors) for factors in np.exp(tried))
        left = [Y[here] - fixed[here] @ of_fixed - rows.lags(joints, each, only=r) @ of_lags for each in at_levels]
        levels[r] = tried[best_level(np.array(left), tried)]
    return levels


def _errors(rows: _Rows, joints: Sequence[int], friction: CoupledFriction | None) -> Floats:
    """Return RMSE of joints on each block by a ridge regression on the others, (K, n); with friction or without."""
    X = rows.fixed
    if friction is not None:
        X = np.hstack([X[:, rows.columns(joints)], rows.lags(joints, friction)])
    return _ridge_errors(*_sums(X, rows.error[:, list(joints)], rows.block))


def _sums(X: Floats, Y: Floats, block: Integers) -> tuple[Floats, int]:
    """Return sums of products of standardised columns, a one and Y over each block, (K, F + 1 + m, ...), and m."""
    mean, scale = standardisation(X)
    all_columns = np.hstack([(X - mean) / scale, np.ones((len(X), 1)), Y])
    parts = [all_columns[block == k] for k in np.unique(block)]
    return np.array([each.T @ each for each in parts]), Y.shape[1]


def _ridge_errors(sums: Floats, m: int, columns: Integers | None = None) -> Floats:
    """Return RMSE on each block of a regression on all others, (K, m), from `_sums`; of some columns."""
    size = sums.shape[1] - m
    taken = np.arange(size) if columns is None else np.append(columns, size - 1)
    penalty = np.full(len(taken), MEMORY_RIDGE)
    penalty[-1] = 1e-9
    G, M = sums[:, taken[:, None], taken], sums[:, taken, size:]
    squares = np.array([np.diag(each[size:, size:]) for each in sums])
    errors = []
    for g, moment, square, rows in zip(G, M, squares, sums[:, size - 1, size - 1], strict=True):
        W = np.linalg.solve(G.sum(axis=0) - g + np.diag(penalty), M.sum(axis=0) - moment)
        left = square - 2.0 * np.einsum("fm,fm->m", W, moment) + np.einsum("fm,fg,gm->m", W, g, W)
        errors.append(np.sqrt(np.maximum(left, 1e-30) / rows))
    return np.array(errors)


def _inputs_needed(
    rows: _Rows, joints: Sequence[int], friction: CoupledFriction
) -> tuple[tuple[str, ...], frozenset[int]]:
    """Return the signals without which coupled joints are predicted worse, and the other joints that need no more."""
    columns, lags = rows.columns(joints), rows.lags(joints, friction)
    features = rows.signals
    X = np.hstack([rows.fixed[:, columns], lags])
    sums, m = _sums(X, rows.error, rows.block)

    def errors(kept: Sequence[str]) -> Floats:
        of_kept = np.flatnonzero(np.isin(columns, features.columns_of(kept)))
        taken = np.append(of_kept, np.arange(len(columns), X.shape[1]))
        return np.asarray(np.log(np.square(_ridge_errors(sums, m, taken)).mean(axis=0)))

    own = {f"q:{rows.joint_names[j]}" for j in joints}
    kept = features.signals
    everything = errors(kept)
    least = everything[list(joints)].mean()
    while True:
        fewer = [tuple(k for k in kept if k != left_out) for left_out in kept if left_out not in own]
        trials = [errors(each)[list(joints)].mean() for each in fewer]
        if not trials or min(trials) > least:
            break
        least, kept = min(trials), fewer[int(np.argmin(trials))]
    also = errors(kept) <= everything
    return kept, frozenset(np.flatnonzero(also).tolist())
