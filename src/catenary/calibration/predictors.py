"""Fitted functions of features: a constant, a linear function, a polynomial of second order, a network.

They are NumPy arrays with names, and the compiled steps that evaluate them; how they are fitted is in regression.py and
neural.py. Arrays that do not fit together, or hold NaN or infinity, are refused when a predictor is made.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import ClassVar, Literal, get_args

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.calibration import kernels
from catenary.calibration.kernels import Step
from catenary.errors import InputError

Activation = Literal["logistic", "tanh"]


class Predictor(ABC):
    """A fitted function of features (N, F) to (N, m)."""

    kind: ClassVar[str]

    @property
    @abstractmethod
    def shape(self) -> tuple[int | None, int]:
        """Numbers of features F, None where any number will do, and of outputs m."""

    @abstractmethod
    def steps(self, X: Floats, Y: Floats) -> list[Step]:
        """Return the compiled steps that write the outputs Y (N, m) for features X (N, F)."""

    @abstractmethod
    def of(self, outputs: Sequence[int]) -> "Predictor":
        """Return the function that gives only some of the outputs, each to the bit as before."""

    def predict(self, X: Floats) -> Floats:
        """Return outputs (N, m) for features (N, F).

        Raises:
            InputError: X has another shape.
        """
        inputs, outputs = self.shape
        X = as_array("features", X, (None, inputs), finite=False)
        Y = np.empty((len(X), outputs))
        for rows in kernels.blocks(len(X)):
            kernels.run(self.steps(X[rows], Y[rows]))
        return Y

    def _keep(self, shapes: Mapping[str, tuple[int | None, ...]]) -> None:
        for name, shape in shapes.items():
            object.__setattr__(self, name, as_array(name, getattr(self, name), shape))


@dataclass(frozen=True)
class Constant(Predictor):
    """y = value for any features."""

    kind: ClassVar[str] = "constant"
    value: Floats  # (m,)

    def __post_init__(self) -> None:
        self._keep({"value": (None,)})

    @property
    def shape(self) -> tuple[int | None, int]:  # noqa: D102
        return None, len(self.value)

    def steps(self, X: Floats, Y: Floats) -> list[Step]:  # noqa: D102
        return [Step(kernels.repeat, (self.value,), (Y,))]

    def of(self, outputs: Sequence[int]) -> "Constant":  # noqa: D102
        return Constant(self.value[list(outputs)])


@dataclass(frozen=True)
class Linear(Predictor):
    """y = X @ weights + bias."""

    kind: ClassVar[str] = "linear"
    weights: Floats  # (F, m) in units of y per unit of the feature
    bias: Floats  # (m,)

    def __post_init__(self) -> None:
        self._keep({"weights": (None, None), "bias": (np.shape(self.weights)[-1],)})

    @property
    def shape(self) -> tuple[int | None, int]:  # noqa: D102
        return len(self.weights), len(self.bias)

    def steps(self, X: Floats, Y: Floats) -> list[Step]:  # noqa: D102
        return [Step(kernels.dense, (X, self.weights, self.bias), (Y,))]

    def of(self, outputs: Sequence[int]) -> "Linear":  # noqa: D102
        return Linear(self.weights[:, list(outputs)], self.bias[list(outputs)])


@dataclass(frozen=True)
class Quadratic(Predictor):
    """y = bias + z @ linear + sum_ij z_i z_j quadratic_ij, z = (x - mean) / scale, i <= j row by row."""

    kind: ClassVar[str] = "quadratic"
    mean: Floats  # (F,)
    scale: Floats  # (F,)
    linear: Floats  # (F, m)
    quadratic: Floats  # (F (F + 1) / 2, m), pairs (0, 0), (0, 1), ..., (1, 1), ...
    bias: Floats  # (m,)

    def __post_init__(self) -> None:
        inputs, m = len(self.mean), len(self.bias)
        pairs = inputs * (inputs + 1) // 2
        self._keep({"mean": (inputs,), "scale": (inputs,), "bias": (m,)})
        self._keep({"linear": (inputs, m), "quadratic": (pairs, m)})

    @property
    def shape(self) -> tuple[int | None, int]:  # noqa: D102
        return len(self.mean), len(self.bias)

    def steps(self, X: Floats, Y: Floats) -> list[Step]:  # noqa: D102
        weights = np.vstack([self.linear, self.quadratic])
        Z, P = np.empty(X.shape), np.empty((len(X), len(weights)))
        return [
            Step(kernels.standardise, (X, self.mean, self.scale), (Z,)),
            Step(kernels.monomials, (Z,), (P,)),
            Step(kernels.dense, (P, weights, self.bias), (Y,)),
        ]

    def of(self, outputs: Sequence[int]) -> "Quadratic":  # noqa: D102
        taken = list(outputs)
        return replace(
            self, linear=self.linear[:, taken], quadratic=self.quadratic[:, taken], bias=self.bias[taken]
        )


@dataclass(frozen=True)
class Network(Predictor):
    """y = out_mean + out_scale * layers(z) + skip(x), z = (x - mean) / scale; the last layer is linear."""

    kind: ClassVar[str] = "network"
    mean: Floats  # (F,)
    scale: Floats  # (F,)
    weights: tuple[Floats, ...]  # (F, h1), (h1, h2), ..., (h, m)
    biases: tuple[Floats, ...]
    activation: Activation
    out_mean: Floats  # (m,)
    out_scale: Floats  # (m,)
    skip: Linear | None = None  # a linear model that the network corrects

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

    def steps(self, X: Floats, Y: Floats) -> list[Step]:  # noqa: D102
        activate = kernels.tanh if self.activation == "tanh" else kernels.logistic
        layer = np.empty(X.shape)
        steps = [Step(kernels.standardise, (X, self.mean, self.scale), (layer,))]
        for weights, bias in zip(self.weights, self.biases, strict=True):
            below, layer = layer, np.empty((len(X), len(bias)))
            steps += [Step(kernels.dense, (below, weights, bias), (layer,)), Step(activate, (), (layer,))]
        of_layers, of_skip = (Y, Y) if self.skip is None else (np.empty(Y.shape), np.empty(Y.shape))
        # the last layer is linear
        steps[-1:] = [Step(kernels.rescale, (layer, self.out_scale, self.out_mean), (of_layers,))]
        if self.skip is not None:
            steps += [*self.skip.steps(X, of_skip), Step(kernels.total, (of_layers, of_skip), (Y,))]
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
