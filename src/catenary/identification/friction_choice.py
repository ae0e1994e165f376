"""Which friction and rotors a recording shows: parts are added while held-out blocks are predicted better.

Candidates are the terms of `FRICTION_TERMS` that are not on every joint, on a grid of their speeds and distances. All
are linear in their parameters, so that of every block the products of all columns are all that is needed. The best
candidate is added, again and again, as long as it takes enough away from the residuals of blocks that were not fitted,
and more than that differs from block to block.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from catenary.arrays import Floats, spread
from catenary.config import IN_FILES
from catenary.identification.base_parameters import BaseParameters
from catenary.identification.parameters import recorded_load
from catenary.identification.samples import FOLDS, Samples, fold_of_rows
from catenary.robots.actuation import Actuation, ActuationTerm
from catenary.robots.friction_terms import FRICTION_TERMS

Extra = tuple[str, int]  # kind, and which friction
_MIN_LOG_GAIN = 0.02  # least that each part takes from the sum over axes of log residual: 2 % of one axis
_MAX_HARM = 0.05  # most by which any axis may be worse than with the friction that is given
_DISTINCT_SHARE = 0.05  # least part of a column that others do not give
_MAX_ROWS = 20_000  # that are looked at
# standard errors of a gain, by how blocks differ, which it exceeds; blocks differ by their motion too, not by chance
# alone
_SCATTER_ERRORS = 0.5
_MAD_DEVIATIONS = 1.4826  # standard deviations in a median absolute deviation


@dataclass(frozen=True)
class FrictionPart:
    """A part that was added to a friction, and what it took away."""

    __pydantic_config__ = IN_FILES

    friction: str
    kind: str
    scale: float | None  # of a term that has one [rad/s, m/s, or rad, m]
    gain: float  # by how much the residual on held-out blocks, as the mean over axes, became less


class _Candidate(NamedTuple):
    kind: str
    friction: int
    scale: float | None
    rung: int  # of the grid of scales
    column: int
    term: ActuationTerm


class _Products(NamedTuple):
    """What least squares needs of every fold: the products of all columns with each other."""

    each: Floats  # (folds, n, c, c) by axis
    train: Floats  # (folds, c, c) of all folds but one, weighted, over all axes


def choose_friction(
    base: BaseParameters, samples: Sequence[Samples], weights: Floats, actuation: Actuation, kinds: Sequence[str]
) -> tuple[Actuation, tuple[FrictionPart, ...]]:
    """Return the actuation with the parts of friction that held-out blocks show, and what each of them gained.

    Recordings to fit tell in `carried` what the links ask of the actuators.
    """
    candidates = _candidates(actuation, samples, kinds, base.count)
    if not candidates:
        return actuation, ()
    products = _products(base, samples, [each.term for each in candidates], weights, actuation.coulomb_velocity)
    fixed = list(range(base.count))
    moves = [*_together(candidates), *((candidate,) for candidate in candidates)]
    chosen: dict[Extra, _Candidate] = {}

    def with_parts(parts: Collection[_Candidate], added: int) -> Floats | None:
        return _held_out(products, [*fixed, *(c.column for c in parts)], added=added)

    first = before = with_parts((), 0)
    while first is not None and before is not None:
        best, best_squares, most = None, before, 0.0
        for move in moves:
            added = {(c.kind, c.friction): c for c in move if chosen.get((c.kind, c.friction)) != c}
            others = [c for key, c in chosen.items() if key not in added]
            after = with_parts([*others, *added.values()], len(added)) if added else None
            if after is None or (after.sum(axis=0) > (1.0 + _MAX_HARM) ** 2 * first.sum(axis=0)).any():
                continue
            gain = _gain(before, after, least=_MIN_LOG_GAIN * len(added))
            if gain > most:
                best, best_squares, most = added, after, gain
        if best is None:
            break
        chosen |= best
        before = best_squares
    # one that came with others, or before them, stays only where blocks are predicted worse without it
    parts = dict[Extra, FrictionPart]()
    for key, part in list(chosen.items()):
        without = with_parts([c for k, c in chosen.items() if k != key], 0)
        if without is None or before is None:
            continue
        if _gain(without, before, least=0.0) <= 0.0:
            before = without
            del chosen[key]
        else:
            gain = float(np.mean(1.0 - np.sqrt(before.sum(axis=0) / without.sum(axis=0))))
            parts[key] = FrictionPart(actuation.friction[part.friction].name, part.kind, part.scale, gain)
    friction = list(actuation.friction)
    for (kind, place), candidate in chosen.items():
        given: dict[str, Any] = {kind: True if candidate.scale is None else candidate.scale}
        friction[place] = replace(friction[place], **given)
    return replace(actuation, friction=tuple(friction)), tuple(parts.values())


def terms_show(
    base: BaseParameters,
    samples: Sequence[Samples],
    weights: Floats,
    terms: Sequence[ActuationTerm],
    coulomb_velocity: float,
) -> bool | None:
    """Return whether held-out blocks are predicted better with some terms, such as rotors, all together.

    Those that the base parameters give, as a rotor that moves like an upright first link, do not count; None where
    they give all.
    """
    products = _products(base, samples, terms, weights, coulomb_velocity)
    columns = list(range(base.count))
    before = _held_out(products, columns, added=0)
    for k in range(len(terms)):
        if _held_out(products, [*columns, base.count + k], added=1) is not None:
            columns.append(base.count + k)
    added = len(columns) - base.count
    after = _held_out(products, columns, added=added) if added else None
    return None if before is None or after is None else _gain(before, after, least=_MIN_LOG_GAIN * added) > 0.0


def _gain(before: Floats, after: Floats, *, least: float) -> float:
    """Return by how much the sum over axes of log residual, (folds, n) squares, fell beyond `least`; 0 if by chance.

    It may be where neither the gain of all blocks together exceeds its scatter (the jackknife: a block where a joint
    hardly moves counts as little there as in the sum), nor the usual block's gain that of blocks (by the median).
    """
    every, left = before.sum(axis=0), after.sum(axis=0)
    whole = float(np.log(every / left).sum())
    others = np.log((every - before) / (left - after)).sum(axis=1)
    scatter = float(np.sqrt((FOLDS - 1) ** 2 / FOLDS) * others.std(ddof=1))
    blocks = np.log(before / after).sum(axis=1)
    usual = float(np.median(blocks))
    of_blocks = _MAD_DEVIATIONS * float(np.median(np.abs(blocks - usual)))
    if whole <= _SCATTER_ERRORS * scatter and usual <= _SCATTER_ERRORS * of_blocks:
        return 0.0
    return 0.5 * whole - least


def _together(candidates: list[_Candidate]) -> list[tuple[_Candidate, ...]]:
    """Return moves that give all frictions a part at once: one alone may not show beside others that lack it."""
    groups: dict[tuple[str, int], dict[bytes, _Candidate]] = {}
    for candidate in candidates:
        group = groups.setdefault((candidate.kind, candidate.rung), {})
        along = np.ascontiguousarray(candidate.term.combination)
        group.setdefault(along.tobytes(), candidate)  # two links on a drive rub as one
    return [tuple(group.values()) for group in groups.values() if len(group) > 1]


def _candidates(actuation: Actuation, samples: Sequence[Samples], kinds: Sequence[str], first: int) -> list[_Candidate]:
    """Return the parts that frictions lack and could have, their columns behind the first ones."""
    found: list[_Candidate] = []
    tried = [term for term in FRICTION_TERMS.values() if term.kind in kinds and not term.usual]
    tried.sort(key=lambda term: term.scale is not None)  # what has no grid of scales first
    if samples[0].history is None:
        tried = [term for term in tried if term.memory is None]
    for place, friction in enumerate(actuation.friction):
        c = friction.combination
        s = np.concatenate([part.q @ c for part in samples])
        travel = float(np.subtract(*np.percentile(s, (95, 5))))
        speed = float(np.sqrt(np.mean(np.concatenate([part.qd @ c for part in samples]) ** 2)))
        if friction.recording or not (travel > 0.0 and speed > 0.0):
            continue
        sizes = {"speed": speed, "travel": travel}
        for term in tried:
            if getattr(friction, term.kind) or not getattr(friction, term.beside):
                continue
            scales: list[float | None] = [None]
            if term.scale is not None:
                scales = [share * sizes[term.scale.of] for share in term.scale.shares]
            for rung, scale in enumerate(scales):
                column = ActuationTerm(term.kind, friction.name, c, None, scale or 0.0)
                found.append(_Candidate(term.kind, place, scale, rung, first + len(found), column))
    return found


def _products(
    base: BaseParameters,
    samples: Sequence[Samples],
    terms: Sequence[ActuationTerm],
    weights: Floats,
    coulomb_velocity: float,
) -> _Products:
    """Return the products of all columns with each other, those of torque last."""
    n, count = samples[0].q.shape[1], base.count + len(terms) + 1
    along = np.array([term.combination for term in terms])
    products = np.zeros((FOLDS, n, count, count))
    every = max(1, sum(len(part) for part in samples) // _MAX_ROWS)
    for part in samples:
        fold = fold_of_rows(part)
        loads = np.column_stack([recorded_load(term, part, coulomb_velocity) for term in terms])
        for rows, Y in base.chunks(part):
            for f in range(FOLDS):
                here = np.flatnonzero(fold[rows] == f)
                here = here[spread(len(here), -(-len(here) // every))]
                for i in range(n):
                    tau = part.tau[rows][here, i, None]
                    A = np.concatenate([Y[here, i], loads[rows][here] * along[:, i], tau], axis=1)
                    products[f, i] += A.T @ A
    weighted = np.einsum("i,fijk->fjk", weights**2, products)
    return _Products(products, weighted.sum(axis=0) - weighted)


def _held_out(products: _Products, columns: list[int], *, added: int) -> Floats | None:
    """Return squares (folds, n) left on folds fitted to the others, or None where an added column is hardly its own."""
    target = products.train.shape[1] - 1
    train = products.train[np.ix_(range(FOLDS), [*columns, target], [*columns, target])]
    scale = np.sqrt(np.maximum(np.einsum("fjj->fj", train), 1e-300))
    correlation = train / scale[:, :, None] / scale[:, None, :]
    m = len(columns)
    try:
        lower = np.linalg.cholesky(correlation[:, :m, :m] + 1e-12 * np.eye(m))
    except np.linalg.LinAlgError:
        return None
    if (np.einsum("fjj->fj", lower)[:, m - added :] < _DISTINCT_SHARE).any():
        return None
    solution = np.linalg.solve(correlation[:, :m, :m] + 1e-12 * np.eye(m), correlation[:, :m, m, None])[:, :, 0]
    beta = solution * scale[:, m:] / scale[:, :m]
    vector = np.zeros((FOLDS, 1, target + 1, 1))
    vector[:, 0, columns, 0], vector[:, 0, target, 0] = -beta, 1.0
    return np.maximum((vector * (products.each @ vector)).sum(axis=(2, 3)), 1e-300)
