"""Finds which joints a cable's friction couples, and the springs and friction between them.

Six numbers describe two coupled joints: of the springs K, of which the first's stiffness is the unit, two, and a
threshold for an element along each joint. They are searched for (Nelder and Mead 1965) so that a ridge regression on
positions, play states and friction states predicts contiguous blocks of time that it was not fitted to; systems with
thresholds from a tenth to 2.5 times these stand beside each other, as play states of several widths do.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from scipy.optimize import minimize
from threadpoolctl import threadpool_limits

from catenary.arrays import Floats
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.friction_search import MIN_ROWS, SearchedRows, SumsBeside, is_gain, searched_rows
from catenary.calibration.friction_states import FoundFriction, FrictionStates
from catenary.calibration.recordings import Recordings
from catenary.errors import InputError
from catenary.transmission.cable_friction import CoupledFriction, coupled_friction

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


class _Errors:
    """Errors of joints with friction states, or with play states in their place."""

    def __init__(self, rows: SearchedRows, joints: Sequence[int]) -> None:
        self._rows, self._joints, Y = rows, list(joints), rows.error[:, list(joints)]
        self._beside = SumsBeside(rows.fixed[:, rows.columns(joints)], Y, rows.block)
        self.of_play = SumsBeside(rows.fixed, Y, rows.block).errors(rows.fixed[:, :0])  # (K, n)

    def __call__(self, friction: CoupledFriction) -> Floats:
        """Return RMSE of joints on each block by a ridge regression on the others, (K, n)."""

        def states(path: Floats) -> Floats:
            lag = friction.lag(path[:, self._joints])
            return lag.reshape(len(lag), lag.shape[1] * lag.shape[2])

        return self._beside.errors(self._rows.of_paths(states))


def find_friction(recordings: Recordings, options: FitOptions, *, held_out: float = 0.0) -> FoundFriction | None:
    """Return the friction of coupled joints, looking only at what comes before the held-out part; None without.

    Where `options.coupled` names no joints, the pair whose errors friction states explain best is taken, if these
    explain more than play states do, and than friction of each joint alone.
    """
    if options.coupled == ():
        return None
    with threadpool_limits(limits=1):
        rows = searched_rows(recordings, options, held_out)
        few = len(rows.fixed) < MIN_ROWS
        joints = _named_joints(rows, options.coupled) if options.coupled else () if few else _best_pair(rows)
        if not joints:
            return None
        errors_of = _Errors(rows, joints)
        least, alone = _searched(errors_of, len(joints))
        after = errors_of(least)
        before = min(errors_of.of_play, errors_of(alone), key=lambda errors: float(np.log(errors).mean()))
        if options.coupled is None and not is_gain(before, after, _MIN_COUPLING_LOG_GAIN):
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
        errors_of = _Errors(rows, joints)
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


def _searched(errors_of: _Errors, n: int) -> tuple[CoupledFriction, CoupledFriction]:
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
