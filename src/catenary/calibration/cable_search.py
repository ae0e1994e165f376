"""Finds what an arm's cables do in recordings: friction that couples joints, drums of other joints, and slack.

All is searched for so that a ridge regression on play states and all else predicts contiguous blocks of time that it
was not fitted to. What is found is taken where it explains more than the joint's own position and a ladder of play
states do. Long recordings are searched by a sample of stretches, each with rows before it in which the states find
their places.

A joint's error may depend on play of its position and a factor times another's, where its cable runs over that joint's
drum. The factor is searched for, and then the half-width of its slack.

Six numbers describe two joints that a cable's friction couples: of the springs K, of which the first's stiffness is the
unit, two, and a threshold for an element along each joint (Nelder and Mead 1965); systems with thresholds from a tenth
to 2.5 times these stand beside each other, as play states of several widths do.
"""

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import minimize, minimize_scalar
from threadpoolctl import threadpool_limits

from catenary.arrays import Floats, Integers
from catenary.calibration.features import FeatureSet, FrictionStates
from catenary.calibration.fit_options import MEMORY_RIDGE, PLAY_SHARES, FitOptions, FoundCables, FoundFriction
from catenary.calibration.fit_rows import choose_inputs, joint_inputs
from catenary.calibration.learned import squares_left_out
from catenary.calibration.recordings import Recordings
from catenary.calibration.valid_range import standardisation
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.transmission.cable_friction import CoupledFriction, coupled_friction
from catenary.verdict.command_response import play

_BLOCKS = 5
# rows that are searched whole; else this many parts, and rows before each
_MAX_SEARCHED_ROWS, _WINDOWS, _WARMUP_SHARE = 8_000, 10, 0.2
_PERIOD_S = 0.04  # between rows that are searched
_FAR_DEVIATIONS = 8.0  # robust deviations
_MIN_ROWS = 200  # rows
_MIN_LOG_GAIN = 0.03  # in the logarithm of the error, that what is found must explain
_FACTORS = (-1.2, -0.8, -0.5, -0.25, -0.1, 0.1, 0.25, 0.5, 0.8, 1.2)  # of ranges, from which the search begins
_SLACKS = tuple(0.0004 * 1.25**k for k in range(22))  # of a path's range
_MIN_PATH_LOG_GAIN = 0.28  # in the logarithm of the error: zig-zags show up to 0.25 where there is no such path
_MAX_SLACKS = 2  # of a joint
_POWERS = (2, 3)
_THRESHOLD_SCALES = np.array([0.1, 0.25, 0.5, 1.0, 1.6, 2.5])  # of the thresholds
_START_THRESHOLD = 0.035  # of each joint's range: where the search begins; 5 deg of a wrist
_START_COUPLING = 0.5  # of the springs, where the search begins
_MAX_STEP_SHARE = 0.015  # of each joint's range: a longer step is split; 2 deg of a wrist
_SIMPLEX_STEP = 0.35  # of the search, in logarithms and couplings
_MAX_SEARCH_STEPS = 80  # steps
_MIN_COUPLING_LOG_GAIN = 0.08  # in the logarithm of the error: pairs of drawn arms without such friction stay below
# of joints that never move at once (a zig-zag), play states of two paths explain as much: steps count as of both where
# the smaller, of its range, is a fifth of the larger, and a tenth of all must (drawn arms and wrists: two thirds)
_TOGETHER_RATIO, _MIN_TOGETHER_SHARE = 0.2, 0.1
_MIN_START_LOG_GAIN = 0.02  # where the search begins: pairs that gain less are not searched
_COUPLING_RIDGE = 1e-4  # weight on squared couplings


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


class _Errors:
    """RMSE of joints on blocks of time, each left out of a regression on some columns X (N, F) and further states."""

    def __init__(self, rows: SearchedRows, X: Floats, joints: Sequence[int]) -> None:
        mean, scale = standardisation(X)
        columns = np.hstack([(X - mean) / scale, np.ones((len(X), 1)), rows.error[:, list(joints)]])
        self._paths, self._fixed = rows.paths, X.shape[1]
        self._rows = [np.flatnonzero(rows.block == k) for k in np.unique(rows.block)]
        self._parts = [columns[at] for at in self._rows]
        self._sums = [part.T @ part for part in self._parts]

    def __call__(self, states: Callable[[Floats], Floats]) -> Floats:
        """Return errors (K, m) with the states (L, S) of paths (L, n) at their rows."""
        P = np.concatenate([states(path)[at] for path, at in self._paths])
        mean, scale = standardisation(P)
        P, sums = (P - mean) / scale, []
        for at, part, own in zip(self._rows, self._parts, self._sums, strict=True):
            across = P[at].T @ part
            sums.append(np.block([[P[at].T @ P[at], across], [across.T, own]]))
        squares = squares_left_out(np.array(sums), np.full(P.shape[1] + self._fixed, MEMORY_RIDGE))
        return np.sqrt(np.maximum(squares, 1e-30))


def _is_gain(before: Floats, after: Floats, least: float = _MIN_LOG_GAIN) -> bool:
    """Return True if log errors on blocks (K, m) fell by `least`, and significantly."""
    gain = np.log(before / after).mean(axis=1)  # of each block
    return bool(gain.mean() > max(least, gain.std(ddof=1) / np.sqrt(len(gain))))


def find_cables(recordings: Recordings, options: FitOptions, *, held_out: float = 0.0) -> FoundCables:
    """Return the paths of cables and their slack, looking only at what comes before the held-out part."""
    with threadpool_limits(limits=1):
        rows = searched_rows(recordings, options, held_out)
        if len(rows.fixed) < _MIN_ROWS:
            return FoundCables()
        moving = {name for name, _ in rows.signals.play}
        joints = [j for j, name in enumerate(rows.joint_names) if f"q:{name}" in moving]
        per_joint = [_CableSearch(rows, j, joints).found() for j in joints]
    return FoundCables(
        sum((cables.paths for cables in per_joint), ()), sum((cables.slacks for cables in per_joint), ())
    )


class _CableSearch:
    def __init__(self, rows: SearchedRows, joint: int, joints: Sequence[int]) -> None:
        self._rows, self._joint = rows, joint
        self._others = [other for other in joints if other != joint]
        own = rows.fixed[:, rows.signals.names.index(f"q:{rows.joint_names[joint]}")]
        z = (own - own.mean()) / own.std()
        smooth = np.column_stack([rows.fixed[:, rows.columns([joint])], *(z**power for power in _POWERS)])
        self._errors_of = _Errors(rows, smooth, [joint])
        self._before = self._errors(0, 0.0, PLAY_SHARES)

    def found(self) -> FoundCables:
        name = self._rows.joint_names[self._joint]
        unit, position = self._rows.ranges[self._joint], f"q:{name}"
        other, factor = self._path()
        paths: tuple[tuple[str, str, str, float], ...] = ()
        if factor:
            ratio = float(f"{factor * unit / self._rows.ranges[other]:.6g}")
            drum = f"q:{self._rows.joint_names[other]}"
            paths = ((f"{position}{ratio:+.6g}*{drum}", position, drum, ratio),)
        where = paths[0][0] if paths else position
        slacks = self._slacks(other, factor)
        return FoundCables(paths, tuple((where, float(f"{slack * unit:.6g}")) for slack in slacks))

    def _path(self) -> tuple[int, float]:
        """Return another joint and its factor, of ranges; 0 where the joint's own position will do."""
        tried = [(self._score(other, f, PLAY_SHARES), other, f) for other in self._others for f in _FACTORS]
        if not tried:
            return 0, 0.0
        _, other, start = min(tried)
        factor = _least(lambda f: self._score(other, f, PLAY_SHARES), start, 0.3)
        errors = self._errors(other, factor, PLAY_SHARES)
        if not _is_gain(self._before, errors, _MIN_PATH_LOG_GAIN):
            return 0, 0.0
        self._before = errors
        return other, factor

    def _slacks(self, other: int, factor: float) -> list[float]:
        """Return half-widths, of the range, that explain more than a ladder of them."""
        half_widths: list[float] = []
        while len(half_widths) < _MAX_SLACKS:
            shares = (*PLAY_SHARES, *half_widths)
            start = min(_SLACKS, key=lambda share: self._score(other, factor, (*shares, share)))

            def score(log_share: float, shares: tuple[float, ...] = shares) -> float:
                return self._score(other, factor, (*shares, float(np.exp(log_share))))

            share = float(np.exp(_least(score, float(np.log(start)), 0.22)))
            errors = self._errors(other, factor, (*shares, share))
            if not _is_gain(self._before, errors):
                break
            half_widths.append(share)
            self._before = errors
        return half_widths

    def _score(self, other: int, factor: float, shares: Sequence[float]) -> float:
        return float(np.log(self._errors(other, factor, shares)).mean())

    def _errors(self, other: int, factor: float, shares: Sequence[float]) -> Floats:
        """Return the joint's RMSE on blocks (K, 1) with play states along a path."""
        widths = np.array(shares)
        return self._errors_of(lambda path: play_states(path[:, self._joint] + factor * path[:, other], widths))


def _least(score: Callable[[float], float], start: float, away: float) -> float:
    minimum = minimize_scalar(score, bounds=(start - away, start + away), method="bounded", options={"xatol": 1e-4})
    return float(minimum.x) if minimum.fun < score(start) else start


def play_states(path: Floats, widths: Floats) -> Floats:
    """Return play states of half-widths (K,) along a path (N,), each from the middle of its slack, less the path."""
    return np.column_stack([play(path, width) for width in widths]) - path[:, None]


class _PairErrors:
    """Errors of joints with friction states, or with play states in their place."""

    def __init__(self, rows: SearchedRows, joints: Sequence[int]) -> None:
        self._joints, self._errors_of = list(joints), _Errors(rows, rows.fixed[:, rows.columns(joints)], joints)
        self.of_play = _Errors(rows, rows.fixed, joints)(lambda path: path[:, :0])  # (K, n)

    def __call__(self, friction: CoupledFriction) -> Floats:
        """Return RMSE of joints on each block by a ridge regression on the others, (K, n)."""
        return self._errors_of(lambda path: friction.lag(path[:, self._joints]).reshape(len(path), -1))


def find_friction(recordings: Recordings, options: FitOptions, *, held_out: float = 0.0) -> FoundFriction | None:
    """Return the friction of coupled joints, looking only at what comes before the held-out part; None without.

    Where `options.coupled` names no joints, the pair whose errors friction states explain best is taken, if these
    explain more than play states do, and than friction of each joint alone.
    """
    if options.coupled == ():
        return None
    with threadpool_limits(limits=1):
        rows = searched_rows(recordings, options, held_out)
        few = len(rows.fixed) < _MIN_ROWS
        joints = _named_joints(rows, options.coupled) if options.coupled else () if few else _best_pair(rows)
        if not joints:
            return None
        errors_of = _PairErrors(rows, joints)
        least, alone = _searched(errors_of, len(joints))
        after = errors_of(least)
        before = min(errors_of.of_play, errors_of(alone), key=lambda errors: float(np.log(errors).mean()))
        if options.coupled is None and not _is_gain(before, after, _MIN_COUPLING_LOG_GAIN):
            return None
    unit = rows.ranges[list(joints)]
    states = coupled_friction(
        unit[:, None] * least.lever * unit, least.directions / unit, least.thresholds, least.longest * unit
    )
    names = tuple(rows.joint_names[j] for j in joints)
    return FoundFriction(
        FrictionStates.of(tuple(f"q:{name}" for name in names), states),
        float(1.0 - np.exp(np.log(after / before).mean())),
    )


def _named_joints(rows: SearchedRows, names: Sequence[str]) -> tuple[int, ...]:
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
    """Return the start of the search: equal springs, each joint coupled to those before it."""
    root = np.linalg.cholesky(np.full((n, n), coupling) + (1.0 - coupling) * np.eye(n)) if coupling > 0 else np.eye(n)
    if coupling < 0:
        root[1, 0], root[1, 1] = coupling, np.sqrt(1.0 - coupling**2)
    root[np.diag_indices(n)] = np.log(np.diag(root))
    return np.append(root[np.tril_indices(n)][1:], np.full(n, np.log(_START_THRESHOLD)))


def _best_pair(rows: SearchedRows) -> tuple[int, ...]:
    """Return the two joints whose errors friction states explain most beyond play states; none if none do."""
    best, pair = _MIN_START_LOG_GAIN, tuple[int, ...]()
    moving = [j for j, name in enumerate(rows.joint_names) if f"q:{name}" in {p for p, _ in rows.signals.play}]
    for joints in combinations(moving, 2):
        if not _move_together(rows, joints):
            continue
        errors_of = _PairErrors(rows, joints)
        before = min(np.log(errors).mean() for errors in (errors_of.of_play, errors_of(_friction(_start(2, 0.0), 2))))
        for coupling in (_START_COUPLING, -_START_COUPLING):
            gain = before - np.log(errors_of(_friction(_start(2, coupling), 2))).mean()
            if gain > best:
                best, pair = gain, joints
    return pair


def _move_together(rows: SearchedRows, joints: tuple[int, int]) -> bool:
    """Return True if both of two joints move in enough of the steps in which one does."""
    steps = np.concatenate([np.abs(np.diff(path[:, joints], axis=0)) for path, _ in rows.paths])
    larger = steps.max(axis=1)
    moved = larger > 0.0
    together = steps.min(axis=1)[moved] >= _TOGETHER_RATIO * larger[moved]
    return bool(together.any()) and float(together.mean()) >= _MIN_TOGETHER_SHARE


def _searched(errors_of: _PairErrors, n: int) -> tuple[CoupledFriction, CoupledFriction]:
    """Return the friction that predicts n joints best, and the same without what couples them."""
    springs = n * (n + 1) // 2 - 1

    def loss(parameters: Floats) -> float:
        errors = errors_of(_friction(np.clip(parameters, -5.0, 5.0), n))
        return float(
            0.5 * np.log(np.square(errors).mean(axis=0)).mean()
            + _COUPLING_RIDGE * np.square(parameters[:springs]).sum()
        )

    start = min((_start(n, coupling) for coupling in (_START_COUPLING, 0.0, -_START_COUPLING)), key=loss)
    simplex = np.vstack([start, start + _SIMPLEX_STEP * np.eye(len(start))])
    options: Any = {"maxiter": _MAX_SEARCH_STEPS, "initial_simplex": simplex, "xatol": 1e-2, "fatol": 1e-5}
    minimum = minimize(loss, start, method="Nelder-Mead", options=options)
    coupled = np.clip(minimum.x, -5.0, 5.0)
    first, second = np.tril_indices(n)
    alone = coupled.copy()
    alone[:springs][(first != second)[1:]] = 0.0
    return _friction(coupled, n), _friction(alone, n)
