"""How much more a ridge regression may be wrong where it was not trained: by leverage, and by what leaving out shows.

The variance of a prediction at terms z is in proportion to its leverage, z (Z'Z + penalties)^-1 z' [Bishop 2006,
section 3.3.2], by what the noise of a row is: but neighbouring rows err alike, and terms lack what moves a joint. So
the factor is measured: fifths of the joint's own range, regions of the joints' middles, and directions of motion are
left out in turn, as no block of time does, and the factor is that with which nine of ten errors lie within, the median
of the three. Another motion is farther away: the factor counts _BEYOND times; and rows in which a joint stands tell of
it what one of them does. The leverage that half of the rows have in blocks of time widens nothing. In a loop the
leverage is that of a sketch: a few random combinations of what is uncertain, in place of all.

Where a prediction is expected to err more than the fixed offset, as errors on blocks of time grow, it is not trusted.
Measured on pairs of recordings (days of a dVRK, tools, drawn arms of even seeds): error over the fixed offset's where
that rule trusts and where not, medians: 0.92 and 1.49, 0.78 and 1.30 of polynomials, 0.82 and 1.08 of linear models.
The learner holds what it extrapolates and may go farther: 0.20 and 1.12 on drawn arms trained in a part of their range.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular

from catenary.arrays import Floats, Integers, spread
from catenary.calibration.feature_terms import DROPPED, Terms
from catenary.calibration.features import FeatureSet
from catenary.calibration.predictors import Leverage
from catenary.calibration.valid_range import standardisation

_NORMAL_90 = 1.6449  # standard deviations about the mean that hold 90 % of a normal distribution
_SKETCHES = 32
_LARGEST_PENALTY = 1e4  # rows: of terms that one joint drops, in the leverage of all
_ROWS, _ASKED_EVERY = 6_000, 5  # rows that are left out, and one in so many that is asked
_LARGEST_SHARE, _MIN_LEFT_OUT = 0.6, 50  # of the rows, that a part may hold; rows
_MET_ROWS = 1000
_PIECES = 20  # of the rows, one after another in memory
_STANDING_SHARE, _LEAST_MOVING = 0.02, 0.05  # of the fastest steps; share of rows
_EPSILON, _LEAST_RIDGE = 1e-6, 1.0  # rows: a constant is hardly held
_OFFSET_RATIO = 1.3  # times the fixed offset's error, that a prediction may be expected to have; as below
_BEYOND, _LEAST, _MOST = 2.0, 8.0, 30.0  # of the factor; set on simulated RAVEN-IIs and drawn arms of even seeds


class TrainedRows(NamedTuple):
    """Rows of features that a regression is fitted to."""

    X: Floats  # (N, F)
    columns: Sequence[int]  # (F,) of a set of features
    features: FeatureSet
    joints: Sequence[str]  # (m,) of its outputs

    @property
    def owners(self) -> list[str]:
        """The joint of each column."""
        return [self.features.owners[c] for c in self.columns]

    def parts(self) -> Iterator[tuple[Integers, Sequence[int]]]:
        """Yield what to leave out in turn, (N,), and the outputs that it is for: regions, directions, own fifths."""
        owners, plays, everything = self.owners, self.features.play_columns, range(len(self.joints))
        place = {joint: k for k, joint in enumerate(owners) if self.features.names[self.columns[k]] == f"q:{joint}"}
        first = {plays[c][0]: k for k, c in reversed([*enumerate(self.columns)]) if c in plays}  # its narrowest
        narrowest = [k for name, k in first.items() if name in self.features.signals]
        if place:
            q = self.X[:, [*place.values()]]
            yield _signs(q - np.median(q, axis=0)), everything
        if narrowest:
            yield _signs(self.X[:, narrowest]), everything
        for k, joint in enumerate(self.joints):
            if joint in place:
                q = self.X[:, place[joint]]
                yield np.searchsorted(np.quantile(q, (0.2, 0.4, 0.6, 0.8)), q), [k]

    def moving(self, output: int) -> float:
        """Return in which share of rows an output's joint moves: where it stands, rows tell the same again."""
        names = [self.features.names[c] for c in self.columns]
        if (name := f"q:{self.joints[output]}") not in names:
            return 1.0
        steps = np.abs(np.diff(self.X[:, names.index(name)]))
        return max(float(np.mean(steps > _STANDING_SHARE * np.quantile(steps, 0.99))), _LEAST_MOVING)

    def met(self) -> Floats:
        """Return rows in which each joint's features are those of another row, (M, F)."""
        rng = np.random.default_rng(0)
        rows = {joint: rng.integers(len(self.X), size=_MET_ROWS) for joint in dict.fromkeys(self.owners)}
        return np.column_stack([column[rows[joint]] for column, joint in zip(self.X.T, self.owners, strict=True)])


def leverage(
    rows: TrainedRows,
    terms: Terms,
    means: tuple[Floats, Floats],  # (C,) mean and scale of the terms
    Y: Floats,  # (N, m) outputs
    weight: Floats,  # (N,) of the rows
    penalties: Floats,  # (m, C) of each output and term
    block: Integers,  # (N,) blocks of time
    offset_ratio: float = _OFFSET_RATIO,
) -> Leverage:
    """Return the leverage of a regression's rows and how much it widens each output's interval."""
    nothing = Leverage(np.zeros((len(terms), 0)), np.zeros(0), 0.0, np.zeros(len(penalties)), np.ones(len(penalties)))
    of_offset = np.quantile(np.abs(Y), 0.9, axis=0) / _NORMAL_90

    def standardised(X: Floats) -> Floats:
        return np.hstack([(terms.of(X) - means[0]) / means[1], np.ones((len(X), 1))])

    taken = spread(len(Y), min(_ROWS, len(Y)))
    fitted = _Regression(standardised(rows.X[taken]), Y[taken], weight[taken] * len(Y) / len(taken), penalties)
    time = fitted.errors_left_out(block[taken])
    if not time:
        return nothing
    scale = np.quantile(np.abs(np.vstack([errors for errors, _ in time])), 0.9, axis=0) / _NORMAL_90
    scale = np.maximum(scale, 1e-12)
    usual = float(np.median(np.concatenate([left_out for _, left_out in time])))
    parts = [(outputs, fitted.errors_left_out(label[taken])) for label, outputs in rows.parts()]
    factor = np.empty(len(penalties))
    for k in range(len(factor)):
        shown = [
            _factor(
                np.concatenate([errors[:, k] for errors, _ in left_out]) / scale[k],
                np.concatenate([more for _, more in left_out]) - usual,
            )
            for outputs, left_out in parts
            if k in outputs and left_out
        ]
        factor[k] = np.clip(_BEYOND * np.median(shown), _LEAST, _MOST) if shown else _LEAST
        factor[k] /= np.sqrt(rows.moving(k))
    sketch = fitted.sketch()
    fitted_to, met = (
        1.0 + factor**2 * np.maximum(np.square(standardised(X) @ sketch).sum(axis=1) - usual, 0.0).mean()
        for X in (rows.X[taken], rows.met())
    )
    of_terms = np.ascontiguousarray(sketch[:-1] / means[1][:, None])
    widening = np.maximum(np.sqrt(met / fitted_to), 1.0)
    trained = max(np.square(standardised(X) @ sketch).sum(axis=1).max() for X in np.array_split(rows.X, _PIECES))
    farthest = np.maximum(np.square(offset_ratio * of_offset / scale) - 1.0, 0.0) / factor**2
    farthest = np.maximum(farthest, (1.0 + _EPSILON) * trained - usual)
    return Leverage(of_terms, sketch[-1] - means[0] @ of_terms, usual, factor, widening, farthest)


def leverage_of(rows: TrainedRows, terms: Terms, Y: Floats, ridge: float, block: Integers) -> Leverage:
    """Return the leverage of a regression of outputs Y (N, m) whose rows weigh alike, as all its terms do."""
    Z, (middle, scale) = terms.of(rows.X), standardisation(Y)
    penalties = np.full((Y.shape[1], Z.shape[1]), max(ridge, _LEAST_RIDGE))
    return leverage(rows, terms, standardisation(Z), (Y - middle) / scale, np.ones(len(Y)), penalties, block)


class _Regression:
    """A ridge regression with parts of its rows left out in turn."""

    def __init__(self, Z: Floats, Y: Floats, weight: Floats, penalties: Floats) -> None:
        self._Z, self._Y, self._penalties = Z, Y, penalties
        self._weighted = Z * weight[:, None]
        self._gram, self._moments = self._weighted.T @ Z, self._weighted.T @ Y
        self._shared = np.exp(np.log(np.minimum(penalties, _LARGEST_PENALTY)).mean(axis=0))

    def sketch(self) -> Floats:
        """Return combinations of terms whose squares add up to their leverage, nearly, (C + 1, K)."""
        root = self._root(self._gram)
        draws = np.random.default_rng(0).normal(size=(len(root), _SKETCHES)) / np.sqrt(_SKETCHES)
        return np.asarray(solve_triangular(root.T, draws, lower=False, check_finite=False))

    def _root(self, gram: Floats) -> Floats:
        return np.asarray(cholesky(gram + np.diag(np.append(self._shared, _EPSILON)), lower=True, check_finite=False))

    def errors_left_out(self, label: Integers) -> list[tuple[Floats, Floats]]:
        """Return errors (R, m) and leverages (R,) of some rows of each part of labels (N,) that is left out."""
        parts = []
        for name in np.unique(label):
            part = np.flatnonzero(label == name)
            if not _MIN_LEFT_OUT <= len(part) <= _LARGEST_SHARE * len(label):
                continue
            gram = self._gram - self._weighted[part].T @ self._Z[part]
            moments = self._moments - self._weighted[part].T @ self._Y[part]
            tested = part[::_ASKED_EVERY]
            Z, errors = self._Z[tested], self._Y[tested].copy()
            of_rows = solve_triangular(self._root(gram), Z.T, lower=True, check_finite=False)
            for k, penalty in enumerate(self._penalties):
                kept = np.append(np.flatnonzero(penalty < DROPPED), len(penalty))
                own = gram[np.ix_(kept, kept)] + np.diag(np.append(penalty[kept[:-1]], _EPSILON))
                errors[:, k] -= Z[:, kept] @ cho_solve(cho_factor(own, check_finite=False), moments[kept, k])
            parts.append((errors, np.square(of_rows).sum(axis=0)))
        return parts


def _factor(errors: Floats, more: Floats) -> float:
    """Return the factor on roots of leverage with which normal intervals hold 90 % of errors, both (R,)."""
    needed = np.maximum(np.square(errors / _NORMAL_90) - 1.0, 0.0) / np.maximum(more, 1e-12)
    return float(np.sqrt(np.quantile(needed, 0.9)))


def _signs(X: Floats) -> Integers:
    return np.asarray((X > 0.0) @ (1 << np.arange(X.shape[1], dtype=np.int64)), dtype=np.int64)
