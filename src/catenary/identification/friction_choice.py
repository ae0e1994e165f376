"""Which friction recordings show: parts are added, and taken away again, while held-out blocks are predicted better.

Candidates are the terms of `FRICTION_TERMS` that are not on every joint, on a grid of their speeds and distances, and
friction of each recording. All are linear in their parameters, so of every block the products of all columns are all
that is needed. What is compared is the log density of blocks by fits to the others, -1/2 N sum_i log(squares left of
axis i), N the rows that a filter leaves independent, less a price for each part [Stone, Cross-validatory choice and
assessment of statistical predictions, J. Royal Statistical Society B 36(2), 1974].
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from catenary.arrays import Floats, spread
from catenary.config import IN_FILES
from catenary.identification.base_parameters import OF_RECORDING, BaseParameters, recorded_load
from catenary.identification.samples import FOLDS, Samples, fold_of_rows
from catenary.robots.actuation import Actuation, ActuationTerm, Friction, actuation_terms
from catenary.robots.friction_terms import FRICTION_TERMS

_PART_PRICE = 3.0  # [nats] negative log prior odds of a column: one in twenty
_DISTINCT_SHARE = 0.05  # least part of a column that others do not give
_BASE_RIDGE, _RIDGE = 1e-12, 1e-6  # beside squares of columns that are one
_MAX_ROWS = 20_000  # that are looked at
_RECORDING = "recording"  # the kind of friction that each recording has by itself


@dataclass(frozen=True)
class FrictionPart:
    """A part that was added to a friction, and what it gained."""

    __pydantic_config__ = IN_FILES

    friction: str
    kind: str
    scale: float | None  # of a term that has one [rad/s, m/s, or rad, m]
    gain: float  # [nats] of log evidence


class _Candidate(NamedTuple):
    kind: str
    name: str  # of the friction that has it; of one kind and name there is one
    scale: float | None
    rung: int  # of the grid of scales
    terms: tuple[ActuationTerm, ...]
    added: tuple[Friction, ...] = ()  # in place of a part of a friction


def choose_friction(
    base: BaseParameters, samples: Sequence[Samples], weights: Floats, actuation: Actuation, kinds: Sequence[str]
) -> tuple[Actuation, tuple[FrictionPart, ...]]:
    """Return the actuation with the parts of friction that recordings show, and what each of them gained.

    Recordings to fit tell in `carried` what the links ask of the actuators.
    """
    candidates = _candidates(actuation, samples, kinds)
    if not candidates:
        return actuation, ()
    evidence = _Evidence(base, samples, candidates, weights, actuation.coulomb_velocity)
    chosen, best = dict[tuple[str, str], int](), evidence.log(())
    while True:
        tried = [chosen | added for added in _moves(candidates)]
        tried += [{key: k for key, k in chosen.items() if key != without} for without in chosen]
        logs = [evidence.log(parts.values()) for parts in tried]
        if max(logs) <= best:
            break
        chosen, best = tried[int(np.argmax(logs))], max(logs)
    friction, parts = list(actuation.friction), []
    for key, k in chosen.items():
        kind, name, scale, _, _, added = candidates[k]
        part: dict[str, Any] = {} if added else {kind: True if scale is None else scale}
        friction = [*(replace(own, **part) if own.name == name else own for own in friction), *added]
        gain = best - evidence.log([other for of, other in chosen.items() if of != key])
        parts += [] if added else [FrictionPart(name, kind, scale, gain)]
    return replace(actuation, friction=tuple(friction)), tuple(parts)


def _moves(candidates: Sequence[_Candidate]) -> list[dict[tuple[str, str], int]]:
    """Return the steps of the search: a part of one friction, or of all: one alone may not show without the others."""
    groups: dict[tuple[str, int], dict[bytes, int]] = {}
    for k, candidate in enumerate(candidates):
        along = np.ascontiguousarray(candidate.terms[0].combination)
        groups.setdefault((candidate.kind, candidate.rung), {}).setdefault(along.tobytes(), k)  # two on a drive: once
    moves = [(k,) for k in range(len(candidates))] + [tuple(group.values()) for group in groups.values()]
    return [{(candidates[k].kind, candidates[k].name): k for k in move} for move in moves]


def _candidates(actuation: Actuation, samples: Sequence[Samples], kinds: Sequence[str]) -> list[_Candidate]:
    candidates, own = list[_Candidate](), [friction for friction in actuation.friction if not friction.recording]
    tried = [term for term in FRICTION_TERMS.values() if term.kind in kinds and not term.usual]
    tried = [term for term in tried if term.memory is None or samples[0].history is not None]
    for friction in own:
        c = friction.combination
        s = np.concatenate([part.q @ c for part in samples])
        travel = float(np.subtract(*np.percentile(s, (95, 5))))
        speed = float(np.sqrt(np.mean(np.concatenate([part.qd @ c for part in samples]) ** 2)))
        for term in tried if min(travel, speed) > 0.0 else ():
            if not getattr(friction, term.kind) and getattr(friction, term.beside):
                size = {"speed": speed, "travel": travel}
                scales = [None] if term.scale is None else [share * size[term.scale.of] for share in term.scale.shares]
                for rung, scale in enumerate(scales):
                    column = ActuationTerm(term.kind, friction.name, c, None, scale or 0.0)
                    candidates.append(_Candidate(term.kind, friction.name, scale, rung, (column,)))
    names = [part.name for part in samples]
    if _RECORDING in kinds and len(set(names)) == len(names):
        for name in names[:-1]:
            of_it = [f.only(lambda t: t.usual, name=f"{f.name}{OF_RECORDING}{name}", recording=name) for f in own]
            terms = actuation_terms(Actuation(friction=tuple(of_it)))
            candidates.append(_Candidate(_RECORDING, name, None, 0, terms, tuple(of_it)))
    return candidates


class _Evidence:
    def __init__(
        self,
        base: BaseParameters,
        samples: Sequence[Samples],
        candidates: Sequence[_Candidate],
        weights: Floats,
        coulomb_velocity: float,
    ) -> None:
        """Take the products of all columns with each other, those of torque last, base parameters eliminated."""
        terms = [term for candidate in candidates for term in candidate.terms]
        ends = np.cumsum([0, *(len(candidate.terms) for candidate in candidates)])
        self._columns = [range(first, last) for first, last in pairwise(ends)]
        products = _products(base, samples, terms, len(weights), coulomb_velocity)
        whole = np.einsum("i,fijk->fjk", weights**2, products)
        train = whole.sum(axis=0) - whole
        self._sizes = np.sqrt(np.maximum(np.einsum("fjj->fj", train), 1e-300))
        train = train / self._sizes[:, None] / self._sizes[:, :, None]
        b, c = base.count, train.shape[1]
        onto = np.linalg.solve(train[:, :b, :b] + _BASE_RIDGE * np.eye(b), train[:, :b, b:])
        projection = np.concatenate([-onto, np.broadcast_to(np.eye(c - b), (FOLDS, c - b, c - b))], axis=1)
        self._train = projection.transpose(0, 2, 1) @ train @ projection
        projection = projection / self._sizes[:, :, None]
        self._products = projection.transpose(0, 2, 1)[:, None] @ products @ projection[:, None]
        self._rows = sum(part.independent * len(part) for part in samples)

    def log(self, chosen: Collection[int]) -> float:
        """Return the log evidence of some candidates; minus infinity where a column is hardly its own."""
        columns = [c for k in chosen for c in self._columns[k]]
        own = self._train[np.ix_(range(FOLDS), columns, columns)] + _RIDGE * np.eye(len(columns))
        solution = np.linalg.solve(own, self._train[:, columns, -1:])
        if (np.einsum("fjj->fj", np.linalg.cholesky(own)) < _DISTINCT_SHARE).any():
            return -np.inf
        vector = np.zeros((FOLDS, 1, self._train.shape[1], 1))
        vector[:, 0, columns], vector[:, 0, -1] = -solution, 1.0
        left = np.maximum((vector * (self._products @ vector)).sum(axis=(0, 2, 3)), 1e-300)
        return -0.5 * self._rows * float(np.log(left).sum()) - _PART_PRICE * len(columns)


def _products(
    base: BaseParameters, samples: Sequence[Samples], terms: Sequence[ActuationTerm], n: int, coulomb_velocity: float
) -> Floats:
    """Return the products (folds, n, c, c) of all columns with each other, those of torque last."""
    along, count = np.array([term.combination for term in terms]), base.count + len(terms) + 1
    every = max(1, sum(len(part) for part in samples) // _MAX_ROWS)
    products = np.zeros((FOLDS, n, count, count))
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
    return products
