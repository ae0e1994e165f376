"""Fitted functions of features: a constant, a linear function, a polynomial of second order, a network; regression.

They are NumPy arrays with names, and the compiled steps that evaluate them; networks are trained in neural.py. Arrays
that do not fit together, or hold NaN or infinity, are refused when a predictor is made.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import ClassVar, Literal, Self, get_args

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.calibration import arithmetic
from catenary.calibration.arithmetic import Step
from catenary.calibration.valid_range import standardisation
from catenary.cards import StoredFloats
from catenary.errors import InputError

Activation = Literal["logistic", "tanh"]


class Predictor(ABC):
    """A fitted function of features (N, F) to (N, m)."""

    by_output: ClassVar[tuple[str, ...]] = ()  # arrays whose last axis is the outputs

    @property
    @abstractmethod
    def shape(self) -> tuple[int | None, int]:
        """Numbers of features F, None where any number will do, and of outputs m."""

    @property
    def width(self) -> int:
        """Columns of the widest array between features and outputs."""
        return max(self.shape[0] or 0, self.shape[1])

    @abstractmethod
    def steps(self, X: Floats, Y: Floats) -> list[Step]:
        """Return the compiled steps that write the outputs Y (N, m) for features X (N, F)."""

    def of(self, outputs: Sequence[int]) -> Self:
        """Return the function that gives only some of the outputs, each to the bit as before."""
        taken = list(outputs)
        parts = {name: getattr(self, name)[..., taken] for name in self.by_output}
        return replace(self, **parts)  # type: ignore[type-var]  # those below are dataclasses

    def predict(self, X: Floats) -> Floats:
        """Return outputs (N, m) for features (N, F)."""
        inputs, outputs = self.shape
        X = as_array("features", X, (None, inputs), finite=False)
        Y = np.empty((len(X), outputs))
        for rows in arithmetic.blocks(len(X), self.width):
            arithmetic.run(self.steps(X[rows], Y[rows]))
        return Y

    def _keep(self, shapes: Mapping[str, tuple[int | None, ...]]) -> None:
        for name, shape in shapes.items():
            object.__setattr__(self, name, as_array(name, getattr(self, name), shape))


@dataclass(frozen=True)
class Constant(Predictor):
    """y = value for any features."""

    value: StoredFloats  # (m,)
    kind: Literal["constant"] = "constant"
    by_output: ClassVar[tuple[str, ...]] = ("value",)

    def __post_init__(self) -> None:
        self._keep({"value": (None,)})

    @property
    def shape(self) -> tuple[int | None, int]:  # noqa: D102
        return None, len(self.value)

    def steps(self, X: Floats, Y: Floats) -> list[Step]:  # noqa: D102
        return [Step(arithmetic.repeat, (self.value,), (Y,))]


@dataclass(frozen=True)
class Linear(Predictor):
    """y = X @ weights + bias."""

    weights: StoredFloats  # (F, m) in units of y per unit of the feature
    bias: StoredFloats  # (m,)
    kind: Literal["linear"] = "linear"
    by_output: ClassVar[tuple[str, ...]] = ("weights", "bias")

    def __post_init__(self) -> None:
        self._keep({"weights": (None, None), "bias": (np.shape(self.weights)[-1],)})

    @property
    def shape(self) -> tuple[int | None, int]:  # noqa: D102
        return len(self.weights), len(self.bias)

    def steps(self, X: Floats, Y: Floats) -> list[Step]:  # noqa: D102
        return [Step(arithmetic.dense, (X, self.weights, self.bias), (Y,))]


@dataclass(frozen=True)
class Quadratic(Predictor):
    """y = bias + z @ linear + sum_ij z_i z_j quadratic_ij, z = (x - mean) / scale, i <= j row by row."""

    mean: StoredFloats  # (F,)
    scale: StoredFloats  # (F,)
    linear: StoredFloats  # (F, m)
    quadratic: StoredFloats  # (F (F + 1) / 2, m), pairs (0, 0), (0, 1), ..., (1, 1), ...
    bias: StoredFloats  # (m,)
    kind: Literal["quadratic"] = "quadratic"
    by_output: ClassVar[tuple[str, ...]] = ("linear", "quadratic", "bias")

    def __post_init__(self) -> None:
        inputs, m = len(self.mean), len(self.bias)
        pairs = inputs * (inputs + 1) // 2
        self._keep({"mean": (inputs,), "scale": (inputs,), "bias": (m,)})
        self._keep({"linear": (inputs, m), "quadratic": (pairs, m)})

    @property
    def shape(self) -> tuple[int | None, int]:  # noqa: D102
        return len(self.mean), len(self.bias)

    @property
    def width(self) -> int:  # noqa: D102
        return len(self.linear) + len(self.quadratic)

    def steps(self, X: Floats, Y: Floats) -> list[Step]:  # noqa: D102
        weights = np.vstack([self.linear, self.quadratic])
        Z, P = np.empty(X.shape), np.empty((len(X), len(weights)))
        return [
            Step(arithmetic.standardise, (X, self.mean, self.scale), (Z,)),
            Step(arithmetic.monomials, (Z,), (P,)),
            Step(arithmetic.dense, (P, weights, self.bias), (Y,)),
        ]


@dataclass(frozen=True)
class Network(Predictor):
    """y = out_mean + out_scale * layers(z) + skip(x), z = (x - mean) / scale; the last layer is linear."""

    mean: StoredFloats  # (F,)
    scale: StoredFloats  # (F,)
    weights: tuple[StoredFloats, ...]  # (F, h1), (h1, h2), ..., (h, m)
    biases: tuple[StoredFloats, ...]
    activation: Activation
    out_mean: StoredFloats  # (m,)
    out_scale: StoredFloats  # (m,)
    skip: Linear | None = None  # a linear model that the network corrects
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
        if self.skip is not None and self.skip.weights.shape != (widths[0], widths[-1]):
            raise InputError(
                f"skip: expected weights of shape {(widths[0], widths[-1])}, got {self.skip.weights.shape}"
            )

    @property
    def shape(self) -> tuple[int | None, int]:  # noqa: D102
        return len(self.mean), len(self.out_mean)

    @property
    def width(self) -> int:  # noqa: D102
        return max(len(self.mean), *map(len, self.biases))

    def steps(self, X: Floats, Y: Floats) -> list[Step]:  # noqa: D102
        activate = arithmetic.tanh if self.activation == "tanh" else arithmetic.logistic
        layer = np.empty(X.shape)
        steps = [Step(arithmetic.standardise, (X, self.mean, self.scale), (layer,))]
        for weights, bias in zip(self.weights, self.biases, strict=True):
            below, layer = layer, np.empty((len(X), len(bias)))
            steps += [Step(arithmetic.dense, (below, weights, bias), (layer,)), Step(activate, (), (layer,))]
        of_layers, of_skip = (Y, Y) if self.skip is None else (np.empty(Y.shape), np.empty(Y.shape))
        # the last layer is linear
        steps[-1:] = [Step(arithmetic.rescale, (layer, self.out_scale, self.out_mean), (of_layers,))]
        if self.skip is not None:
            steps += [*self.skip.steps(X, of_skip), Step(arithmetic.total, (of_layers, of_skip), (Y,))]
        return steps

    def of(self, outputs: Sequence[int]) -> "Network":  # noqa: D102
        taken = list(outputs)
        return replace(
            self,
            weights=(*self.weights[:-1], self.weights[-1][:, taken]),
            biases=(*self.biases[:-1], self.biases[-1][taken]),
            out_mean=self.out_mean[taken],
            out_scale=self.out_scale[taken],
            skip=None if self.skip is None else self.skip.of(outputs),
        )


def fit_offset(X: Floats, Y: Floats) -> Constant:
    """Fit the mean of Y (N, m): the paper's baseline, the average bias over the training data."""
    return Constant(Y.mean(axis=0))


def fit_linear(X: Floats, Y: Floats, *, ridge: float = 0.0) -> Linear:
    """Fit Y (N, m) as a linear function of the features X (N, F).

    Minimises ||Y - X W - b||^2 + ridge ||W||^2 on standardised X. Where the data do not determine W
    (a joint that never moved), the smallest W is taken; the valid range keeps it from being asked there.
    """
    mean, scale = standardisation(X)
    weights, bias = _least_squares((X - mean) / scale, Y, ridge)
    weights /= scale[:, None]
    return Linear(weights, bias - mean @ weights)


def fit_polynomial(X: Floats, Y: Floats, *, ridge: float = 0.0) -> Quadratic:
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
    n = X.shape[1]
    return Quadratic(mean, scale, weights[:n], weights[n:], bias - middle @ weights)


def _least_squares(Z: Floats, Y: Floats, ridge: float) -> tuple[Floats, Floats]:
    """Return weights (F, m) and bias (m,) of a regression on standardised features."""
    from sklearn.linear_model import LinearRegression, Ridge

    regression = Ridge(alpha=ridge) if ridge > 0.0 else LinearRegression()
    fitted = regression.fit(Z, Y)
    weights = np.asarray(fitted.coef_, dtype=float).reshape(Y.shape[1], -1).T
    return np.array(weights, order="C"), np.asarray(fitted.intercept_, dtype=float).reshape(-1)
