"""Fitted functions of features: linear in terms of them, as a constant or polynomial, a network, or one's own.

They are NumPy arrays with names, and the compiled steps that evaluate them; networks are trained in neural.py, the
learner's terms are weighed in learned.py. Arrays that do not fit together, or hold NaN or infinity, are refused.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import Field

from catenary.arrays import Floats, as_array
from catenary.calibration.feature_terms import Terms
from catenary.calibration.valid_range import standardisation
from catenary.cards import Stored, StoredFloats
from catenary.errors import InputError
from catenary.kernels import row_functions as arithmetic
from catenary.kernels.bind import Step, blocks, run
from catenary.kernels.compiled import compiled

Activation = Literal["logistic", "tanh"]


@dataclass(frozen=True)
class Leverage:
    """How much less than of usual rows a regression knows of a row, and what that widens (extrapolation.py)."""

    sketch: StoredFloats  # (C, K) combinations of terms whose squares, with their constants, are the leverage of a row
    constants: StoredFloats  # (K,)
    usual: float  # leverage beyond which errors grow
    factor: StoredFloats  # (m,) by which they do
    widening: StoredFloats  # (m,) times as large as on blocks of training is an error where joints meet otherwise
    # (m,) leverage beyond usual from which the fixed offset is expected to err less; None of files before
    farthest: StoredFloats | None = None


class Predictor(ABC):
    """A fitted function of features (N, F) to (N, m)."""

    leverage: Leverage | None

    @property
    @abstractmethod
    def shape(self) -> tuple[int, int]:
        """Numbers of features F and of outputs m."""

    @abstractmethod
    def steps(self, X: Floats, Y: Floats, beyond: Floats | None = None) -> list[Step]:
        """Return the compiled steps from features X (N, F) to outputs Y (N, m), and leverage beyond usual (N, 1)."""

    def predict(self, X: Floats) -> Floats:
        """Return outputs (N, m) for features (N, F)."""
        inputs, outputs = self.shape
        X = as_array("features", X, (None, inputs), finite=False)
        Y = np.empty((len(X), outputs))
        for rows in blocks(len(X)):
            run(self.steps(X[rows], Y[rows]))
        return Y

    def _keep(self, shapes: Mapping[str, tuple[int | None, ...]]) -> None:
        for name, shape in shapes.items():
            object.__setattr__(self, name, as_array(name, getattr(self, name), shape))


@dataclass(frozen=True)
class Expansion(Predictor):
    """y = bias + terms(x) @ weights."""

    terms: Terms
    weights: StoredFloats  # (C, m)
    bias: StoredFloats  # (m,)
    penalties: StoredFloats | None = None  # (m, groups) that the weights were fitted with (learned.py)
    leverage: Leverage | None = None
    kind: Literal["expansion"] = "expansion"

    def __post_init__(self) -> None:
        self._keep({"bias": (None,), "weights": (len(self.terms), len(self.bias))})
        if self.leverage is not None:
            m, combinations = len(self.bias), len(self.leverage.constants)
            as_array("sketch", self.leverage.sketch, (len(self.terms), combinations))
            for name in ("factor", "widening"):
                as_array(name, getattr(self.leverage, name), (m,))

    @property
    def shape(self) -> tuple[int, int]:  # noqa: D102
        return len(self.terms.middle), len(self.bias)

    def steps(self, X: Floats, Y: Floats, beyond: Floats | None = None) -> list[Step]:  # noqa: D102
        Z = np.empty((len(X), len(self.terms)))
        steps = [self.terms.step(X, Z), Step(arithmetic.dense, (Z, self.weights, self.bias), (Y,))]
        if beyond is not None and self.leverage is not None:
            known, P = self.leverage, np.empty((len(X), len(self.leverage.constants)))
            steps.append(Step(arithmetic.dense, (Z, known.sketch, known.constants), (P,)))
            steps.append(Step(excess, (P, np.array([known.usual])), (beyond,)))
        return steps


@compiled
def excess(P: Floats, usual: Floats, beyond: Floats) -> None:
    """Write by how much the sum of squares of rows P (N, K) is beyond `usual` (1,), (N, 1); 0 where it is not."""
    for row in range(len(P)):
        total = -usual[0]
        for k in range(P.shape[1]):
            total += P[row, k] * P[row, k]
        beyond[row, 0] = total if total > 0.0 else 0.0


@dataclass(frozen=True)
class Network(Predictor):
    """y = out_mean + out_scale * layers(z), z = (x - mean) / scale; the last layer is linear."""

    mean: StoredFloats  # (F,)
    scale: StoredFloats  # (F,)
    weights: tuple[StoredFloats, ...]  # (F, h1), (h1, h2), ..., (h, m)
    biases: tuple[StoredFloats, ...]
    activation: Activation
    out_mean: StoredFloats  # (m,)
    out_scale: StoredFloats  # (m,)
    leverage: None = None
    kind: Literal["network"] = "network"

    def __post_init__(self) -> None:
        if self.activation not in get_args(Activation) or not self.weights:
            raise InputError(
                f"network: expected layers and an activation of {' or '.join(get_args(Activation))}, "
                f"got {len(self.weights)} layers, {self.activation!r}"
            )
        widths = (len(self.mean), *(len(bias) for bias in self.biases))
        inputs, outputs = widths[:1], widths[-1:]
        self._keep({"mean": inputs, "scale": inputs, "out_mean": outputs, "out_scale": outputs})
        layers = zip(self.weights, pairwise(widths), strict=True)
        weights = tuple(as_array(f"weights {k}", W, shape) for k, (W, shape) in enumerate(layers))
        biases = tuple(as_array(f"biases {k}", b, (None,)) for k, b in enumerate(self.biases))
        object.__setattr__(self, "weights", weights)
        object.__setattr__(self, "biases", biases)

    @property
    def shape(self) -> tuple[int, int]:  # noqa: D102
        return len(self.mean), len(self.out_mean)

    def steps(self, X: Floats, Y: Floats, beyond: Floats | None = None) -> list[Step]:  # noqa: D102
        activate = arithmetic.tanh if self.activation == "tanh" else arithmetic.logistic
        layer = np.empty(X.shape)
        steps = [Step(arithmetic.standardise, (X, self.mean, self.scale), (layer,))]
        for weights, bias in zip(self.weights, self.biases, strict=True):
            below, layer = layer, np.empty((len(X), len(bias)))
            steps += [Step(arithmetic.dense, (below, weights, bias), (layer,)), Step(activate, (), (layer,))]
        # the last layer is linear
        return [*steps[:-1], Step(arithmetic.rescale, (layer, self.out_scale, self.out_mean), (Y,))]


@dataclass(frozen=True)
class OwnFunction(Predictor):
    """y = out_mean + out_scale * f((x - mean) / scale), f an estimator's `predict` or a function (own_model.py)."""

    name: str  # "module:name" of the class or function
    mean: StoredFloats  # (F,)
    scale: StoredFloats  # (F,)
    out_mean: StoredFloats  # (m,)
    out_scale: StoredFloats  # (m,)
    fitted: tuple[Annotated[Any, Stored()], ...]  # one for all outputs or one for each; bytes as a file holds them
    leverage: None = None
    kind: Literal["own"] = "own"

    @property
    def shape(self) -> tuple[int, int]:  # noqa: D102
        return len(self.mean), len(self.out_mean)

    def steps(self, X: Floats, Y: Floats, beyond: Floats | None = None) -> list[Step]:  # noqa: D102
        if any(isinstance(part, np.ndarray) for part in self.fitted):
            module, _, name = self.name.partition(":")
            raise InputError(
                f"model of {self.name}: it runs only where its class is named: from {module} import {name}; "
                f"load_model(path, own={name}); commands that run it have --own {self.name}"
            )
        return [Step(self._write, (X,), (Y,), is_compiled=False)]

    def _write(self, X: Floats, Y: Floats) -> None:
        """Write outputs of rows, NaN if a feature is not finite, which few estimators take."""
        known = np.isfinite(X).all(axis=1)
        Y[:] = np.nan
        if not known.any():
            return
        Z = (X[known] - self.mean) / self.scale
        predictions = [np.asarray(getattr(part, "predict", part)(Z), dtype=float) for part in self.fitted]
        columns = [values.reshape(len(Z), -1) for values in predictions if values.shape[:1] == (len(Z),)]
        if sum(values.shape[1] for values in columns) != Y.shape[1]:
            shapes = ", ".join(str(values.shape) for values in predictions)
            raise InputError(f"model of {self.name}: expected {Y.shape[1]} outputs of {len(Z)} rows, got {shapes}")
        Y[known] = np.hstack(columns) * self.out_scale + self.out_mean


AnyPredictor = Annotated[Expansion | Network | OwnFunction, Field(discriminator="kind")]


def linear(weights: Floats, bias: Floats) -> Expansion:
    """Return y = X @ weights (F, m) + bias (m,)."""
    inputs = len(weights)
    return Expansion(Terms.plain(np.zeros(inputs), np.ones(inputs)), weights, bias)


def fit_offset(X: Floats, Y: Floats) -> Expansion:
    """Fit the mean of Y (N, m): the paper's baseline, the average bias over the training data."""
    return linear(np.zeros((X.shape[1], Y.shape[1])), Y.mean(axis=0))


def fit_linear(X: Floats, Y: Floats, *, ridge: float = 0.0) -> Expansion:
    """Fit Y (N, m) as a linear function of the features X (N, F).

    Minimises ||Y - X W - b||^2 + ridge ||W||^2 on standardised X. Where the data do not determine W
    (a joint that never moved), the smallest W is taken; the valid range keeps it from being asked there.
    """
    mean, scale = standardisation(X)
    weights, bias = _least_squares((X - mean) / scale, Y, ridge)
    weights /= scale[:, None]
    return linear(weights, bias - mean @ weights)


def fit_polynomial(X: Floats, Y: Floats, *, ridge: float = 0.0) -> Expansion:
    """Fit Y (N, m) as a second-order polynomial of the features X (N, F).

    Ordinary least squares as in the paper when `ridge` is 0; otherwise ridge regression on the standardised
    monomials, which features with memory need: 42 features have 945 monomials.
    """
    from sklearn.preprocessing import PolynomialFeatures

    mean, scale = standardisation(X)
    monomials = PolynomialFeatures(2, include_bias=False).fit_transform((X - mean) / scale)
    middle, spread = standardisation(monomials)
    weights, bias = _least_squares((monomials - middle) / spread, Y, ridge)
    weights /= spread[:, None]
    pairs = np.column_stack(np.triu_indices(X.shape[1]))
    return Expansion(Terms.plain(mean, scale, pairs), weights, bias - middle @ weights)


def _least_squares(Z: Floats, Y: Floats, ridge: float) -> tuple[Floats, Floats]:  # weights (F, m), bias (m,)
    from sklearn.linear_model import LinearRegression, Ridge

    regression = Ridge(alpha=ridge) if ridge > 0.0 else LinearRegression()
    fitted = regression.fit(Z, Y)
    weights = np.asarray(fitted.coef_, dtype=float).reshape(Y.shape[1], -1).T
    return np.array(weights, order="C"), np.asarray(fitted.intercept_, dtype=float).reshape(-1)
