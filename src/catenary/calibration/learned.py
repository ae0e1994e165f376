"""The learner: ridge regression on terms of positions, loads and play states, with penalties by cross-validation.

Terms are in groups (`GROUPS`), such as those of the joint itself and those of other joints. Each joint has a penalty
per group, from almost none to one that drops the group: a constant or a linear function is a special case. Penalties
minimise the errors on blocks of time that are left out in turn; sums of products per block suffice to compute these.
The score is the mean of the log errors, so that no single block dominates. The search takes a larger penalty if the
score rises by less than its standard error over blocks, and a smaller one if it falls by more
[Breiman et al., Classification and Regression Trees, 1984, section 3.4.3].

Rows far from the fit, such as failed measurements, are down-weighted [Huber, Robust Estimation of a Location
Parameter, 1964].
"""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from threadpoolctl import threadpool_limits

from catenary.arrays import Floats, Integers
from catenary.calibration.extrapolation import TrainedRows, leverage
from catenary.calibration.feature_terms import DROPPED, Terms, term_owners
from catenary.calibration.features import FeatureSet
from catenary.calibration.predictors import Expansion
from catenary.calibration.spike_filter import ANY_SIZE
from catenary.calibration.valid_range import standardisation

GROUPS = (
    "signals", "own smooth", "own memory", "own ripple", "other smooth", "other memory", "other ripple", "products",
    "path memory",
)  # fmt: skip
# groups of a term of other joints, and of one of the joint itself
_OF_KIND = {"smooth": (4, 1), "memory": (5, 2), "ripple": (6, 3), "path": (5, 8)}
_LADDER = (0.1, 1.0, 10.0, 100.0, 1e3, 1e4, DROPPED)
_START = (1.0, 1.0, 10.0, 100.0, 100.0, 100.0, DROPPED, 100.0, 10.0)
# groups in the order in which penalties are tried, but for the waves of other joints, which only older files hold: on
# simulated RAVEN-IIs and drawn arms of even seeds they gained nothing and, along a zig-zag, took the place of memory
_WALK = (7, 5, 4, 2, 8, 3, 1, 0)
_SWEEPS = 2
_MIN_LOG_GAIN = 0.004  # change of the log mean square that a larger penalty may cost and a smaller one must gain
BLOCKS = 6
_FAR_DEVIATIONS = 8.0  # robust standard deviations of a joint's errors beyond which a row is down-weighted
_REWEIGHTINGS, _COLUMNS = 3, 64
_POSITION_LIMIT, _LOAD_LIMIT = 1.15, 4.0  # half ranges; standard deviations
_OFFSET_RATIO = 2.0  # times the fixed offset's error, beyond which a prediction is not trusted; set on even seeds
_RESOLUTION_SI = 1e-7  # [rad|m] errors below the resolution of any encoder
_ZERO_PENALTY, _MIN_ZEROED = 300.0, 3  # rows; recordings: with fewer, differences of their zeros may be chance
_EVERY = 3  # one play state in so many gets product terms


def terms_of(X: Floats, features: FeatureSet, columns: Integers) -> Terms:
    """Return the terms of a set's features `columns`, scaled by the ranges of their rows X (N, F)."""
    names = [features.names[c] for c in columns]
    units = [features.feature_units[c] for c in columns]
    is_state = features.bounded[columns]
    plays = features.play_columns
    widths = [plays[c][1] if c in plays else None for c in columns.tolist()]
    low, high, (_, sd) = X.min(axis=0), X.max(axis=0), standardisation(X)
    is_position = np.array([name.startswith("q:") for name in names])
    middle = np.where(is_position, 0.5 * (low + high), np.where(is_state, 0.0, np.median(X, axis=0)))
    half = np.where(high > low, 0.5 * (high - low), 1.0)
    scale = np.where(is_position, half, [d if w is None else w for w, d in zip(widths, sd, strict=True)])
    limit = np.where(is_position, _POSITION_LIMIT, np.where(is_state, ANY_SIZE, _LOAD_LIMIT))
    moves: list[int] = np.flatnonzero(high > low).tolist()
    positions = [k for k in moves if is_position[k]]
    loads = [k for k in moves if not is_position[k] and not is_state[k]]
    angles = [k for k in positions if units[k] == "rad"]
    pairs = [*combinations(positions, 2)]
    joints = [features.owners[c] for c in columns]
    for k in positions:
        own = [load for load in loads if joints[load] == joints[k]]
        ladder = [i for i, width in enumerate(widths) if width is not None and joints[i] == joints[k]]
        pairs += [(play, other) for play in ladder[2:-2:_EVERY] for other in (k, *own)]
        pairs += [(position, load) for position in positions for load in own]
    indices = (np.array(group, dtype=np.int64) for group in (positions, angles, loads, np.reshape(pairs, (-1, 2))))
    return Terms(middle, scale, limit, *indices)


def groups_of(terms: Terms, features: FeatureSet, columns: Integers, joint: str) -> Integers:
    """Return the group of each term (C,) in the model of a joint."""
    coupled = () if features.friction is None else [f"{lag}" for lag, _ in features.friction.columns]
    paths = {name for name, *_ in features.paths}
    along = {c for c, (name, _) in features.play_columns.items() if name in paths}
    names, is_state = [features.names[c] for c in columns], features.bounded[columns]
    kinds, owners = term_owners(terms, [features.owners[c] for c in columns])
    groups = []
    for k, (kind, owner) in enumerate(zip(kinds, owners, strict=True)):
        if kind == "feature":
            kind = ("path" if columns[k] in along else "memory") if is_state[k] else kind
            owner = joint if names[k] in coupled else owner
        groups.append(0 if kind == "feature" else 7 if kind == "product" else _OF_KIND[kind][owner == joint])
    return np.array(groups)


class _Sums(NamedTuple):
    """Sums of products of standardised terms, a constant and outputs over each block of time."""

    of_blocks: Floats  # (K, C + 1 + m, C + 1 + m)
    mean: Floats  # (C,) of the terms
    scale: Floats  # (C,)
    middle: Floats  # (m,) of the outputs
    spread: Floats  # (m,)
    weight: Floats  # (N,) of the rows


def fit_learned(
    X: Floats, Y: Floats, *, features: FeatureSet, columns: Integers, joints: Sequence[str], block: Integers,
    recording: Integers, penalties: Floats | None = None,
) -> Expansion:  # fmt: skip
    """Fit outputs Y (N, m) to the features X (N, F) of a set's `columns`.

    Args:
        joints: (m,) joint name of each output.
        block, recording: (N,) number of each row's block of time, and of its recording; each of several recordings has
            its own zero, which the model does not learn.
        penalties: (m, groups) those of a model of more rows; chosen if None.
    """
    terms = terms_of(X, features, columns)
    numbers = np.unique(recording)
    zeros = np.eye(len(numbers))[np.searchsorted(numbers, recording)][:, : len(numbers) * (len(numbers) >= _MIN_ZEROED)]
    of_zeros = np.full(zeros.shape[1], len(GROUPS))
    groups = np.array([np.append(groups_of(terms, features, columns, joint), of_zeros) for joint in joints])
    with threadpool_limits(limits=1):
        sums = _weighted_sums(terms.of(X), zeros, Y, block, groups)
        chosen = penalties is None
        if penalties is None:
            penalties = np.array([_chosen(sums.of_blocks, groups[k], k) for k in range(Y.shape[1])])
        total = sums.of_blocks.sum(axis=0)
        of_terms = np.array([_by_term(penalties[k], groups[k]) for k in range(Y.shape[1])])
        solved = np.array([_solved(total, of_terms[k], k) for k in range(Y.shape[1])]).T
        grown = None
        if chosen:
            targets = (Y - sums.middle) / sums.spread - zeros @ solved[len(terms) : -1]
            means = sums.mean, sums.scale
            rows = TrainedRows(X, [*columns.tolist()], features, joints)
            grown = leverage(rows, terms, means, targets, sums.weight, of_terms[:, : len(terms)], block, _OFFSET_RATIO)
    of_zeros = zeros.mean(axis=0) @ solved[len(terms) : -1]
    weights = solved[: len(terms)] * sums.spread / sums.scale[:, None]
    bias = (solved[-1] + of_zeros) * sums.spread + sums.middle - sums.mean @ weights
    return Expansion(terms, np.ascontiguousarray(weights), bias, penalties, grown)


def _by_term(penalties: Floats, group: Integers) -> Floats:
    """Return the penalty of each column from its group's; columns of recordings' zeros follow the terms."""
    return np.append(penalties, _ZERO_PENALTY)[group]


def _weighted_sums(Z: Floats, zeros: Floats, Y: Floats, block: Integers, groups: Integers) -> _Sums:
    """Return sums over blocks, with rows far from a first fit down-weighted; overwrites the terms Z (N, C)."""
    # some columns at a time, to save memory
    parts = [standardisation(Z[:, k : k + _COLUMNS]) for k in range(0, Z.shape[1], _COLUMNS)]
    mean, scale = np.concatenate(parts, axis=1)
    middle = np.median(Y, axis=0)
    spread = np.maximum(1.4826 * np.median(np.abs(Y - middle), axis=0), _RESOLUTION_SI)
    Z -= mean
    Z /= scale
    Z = np.hstack([Z, zeros, np.ones((len(Z), 1)), (Y - middle) / spread])
    m, names = Y.shape[1], np.unique(block)
    of_blocks = np.array([part.T @ part for part in (Z[block == k] for k in names)])
    weight = np.ones(len(Z))
    for _ in range(_REWEIGHTINGS):
        total = of_blocks.sum(axis=0)
        W = np.column_stack([_solved(total, _by_term(np.array(_START), groups[k]), k) for k in range(m)])
        left = Z[:, -m:] - Z[:, :-m] @ W
        left = np.abs(left - np.median(left, axis=0))
        deviation = np.maximum(1.4826 * np.median(left, axis=0), _RESOLUTION_SI / spread)
        new = np.minimum(1.0, _FAR_DEVIATIONS / np.maximum((left / deviation).max(axis=1), 1e-9)) ** 2
        changed = new != weight
        if not changed.any():
            break
        for k, name in enumerate(names):
            rows = changed & (block == name)
            of_blocks[k] += Z[rows].T @ (Z[rows] * (new - weight)[rows, None])
        weight = new
    return _Sums(of_blocks, mean, scale, middle, spread, weight)


def _solved(sums: Floats, penalty: Floats, output: int) -> Floats:
    """Return an output's weights (C + 1,): 0 for dropped terms, the constant last."""
    size = len(penalty)
    kept = np.append(np.flatnonzero(penalty < DROPPED), size)
    gram = sums[np.ix_(kept, kept)]
    gram[np.diag_indices(len(kept))] += np.append(penalty[kept[:-1]], 1e-9)
    weights = np.zeros(size + 1)
    weights[kept] = cho_solve(cho_factor(gram, overwrite_a=True, check_finite=False), sums[kept, size + 1 + output])
    return weights


def _log_squares(sums: Floats, penalty: Floats, output: int) -> Floats:
    """Return the log mean square of an output's errors on each block (K,), left out in turn."""
    size = len(penalty) + 1
    kept = np.append(np.flatnonzero(penalty < DROPPED), [size - 1, size + output])
    errors = squares_left_out(sums[:, kept[:, None], kept], penalty[kept[:-2]])
    return np.log(np.maximum(errors[:, 0], 1e-12))


def squares_left_out(sums: Floats, penalty: Floats) -> Floats:
    """Return the mean squares (K, m) of errors on blocks, each left out of a ridge regression in turn.

    Args:
        sums: (K, C + 1 + m, C + 1 + m) products of columns, a constant and outputs, summed over each block.
        penalty: (C,) of the columns.
    """
    size = len(penalty) + 1
    total, errors = sums.sum(axis=0), []
    total[np.diag_indices(size)] += np.append(penalty, 1e-9)
    for own in sums:
        left = total - own
        W = cho_solve(cho_factor(left[:size, :size], check_finite=False), left[:size, size:])
        gram, moment, square = own[:size, :size], own[:size, size:], np.diag(own)[size:]
        errors.append((square - 2.0 * np.sum(W * moment, axis=0) + np.sum(W * (gram @ W), axis=0)) / gram[-1, -1])
    return np.array(errors)


def _chosen(sums: Floats, group: Integers, output: int) -> Floats:
    """Return the penalties (groups,) of an output: a search along the ladder from the values of most joints."""
    taken = np.array(_START)
    if len(sums) < 2:
        return taken
    squares = _log_squares(sums, _by_term(taken, group), output)
    for _ in range(_SWEEPS):
        before = squares.mean()
        for g in _WALK:
            for step in (1, -1):
                while (group == g).any():
                    place = _LADDER.index(taken[g]) + step
                    if not 0 <= place < len(_LADDER):
                        break
                    trial = taken.copy()
                    trial[g] = _LADDER[place]
                    tried = _log_squares(sums, _by_term(trial, group), output)
                    change = tried - squares
                    chance = change.std(ddof=1) / np.sqrt(len(change))
                    if change.mean() > step * max(_MIN_LOG_GAIN, chance):
                        break
                    taken, squares = trial, tried
        if squares.mean() > before - 0.01:
            break
    return taken
