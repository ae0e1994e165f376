"""The linear layer onto a predictor's outputs: what goes into it, and predictors with another one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.predictors import Constant, Linear, Network, Predictor, Quadratic


@dataclass(frozen=True)
class Adjustment:
    """A change of one output: y' = scale y + bias + X @ linear + L @ layer, L of `layer_inputs`."""

    scale: float
    bias: float
    linear: Floats  # (F,)
    layer: Floats  # (h,)


def layer_inputs(predictor: Predictor, X: Floats) -> Floats:
    """Return the inputs (N, h) of the linear layer onto a predictor's outputs, for features X (N, F).

    A linear model's are the features, a polynomial's its monomials, a network's the values of its last hidden units.
    A constant has none.
    """
    if isinstance(predictor, Linear):
        return X
    if isinstance(predictor, Quadratic):
        Z = (X - predictor.mean) / predictor.scale
        rows, columns = np.triu_indices(Z.shape[1])
        return np.hstack([Z, Z[:, rows] * Z[:, columns]])
    if isinstance(predictor, Network):
        from scipy.special import expit

        activate = np.tanh if predictor.activation == "tanh" else expit
        values = (X - predictor.mean) / predictor.scale
        for weights, bias in zip(predictor.weights[:-1], predictor.biases[:-1], strict=True):
            values = activate(values @ weights + bias)
        return values
    return np.zeros((len(X), 0))


def adjusted(predictor: Predictor, changes: Sequence[Adjustment]) -> Predictor:
    """Return a predictor with its m outputs changed, each by its own adjustment.

    The kind stays, but for two: a constant that gets a slope becomes linear, and a network a linear part beside it.
    """
    scale, bias = np.array([c.scale for c in changes]), np.array([c.bias for c in changes])
    linear, layer = (
        np.column_stack(each) for each in zip(*((c.linear, c.layer) for c in changes), strict=True)
    )
    if isinstance(predictor, Constant):
        value = scale * predictor.value + bias
        return Linear(linear, value) if linear.any() else Constant(value)
    if isinstance(predictor, Linear):
        return Linear(scale * predictor.weights + linear + layer, scale * predictor.bias + bias)
    if isinstance(predictor, Quadratic):
        F = len(predictor.mean)
        return replace(
            predictor,
            linear=scale * predictor.linear + predictor.scale[:, None] * linear + layer[:F],
            quadratic=scale * predictor.quadratic + layer[F:],
            bias=scale * predictor.bias + bias + predictor.mean @ linear,
        )
    if isinstance(predictor, Network):
        skip = predictor.skip
        if skip is not None:
            skip = Linear(scale * skip.weights + linear, scale * skip.bias)
        elif linear.any():
            skip = Linear(linear, np.zeros(len(changes)))
        return replace(
            predictor,
            weights=(*predictor.weights[:-1], scale * predictor.weights[-1] + layer / predictor.out_scale),
            biases=(*predictor.biases[:-1], scale * predictor.biases[-1]),
            out_mean=scale * predictor.out_mean + bias,
            skip=skip,
        )
    raise TypeError(f"no last layer of {type(predictor).__name__}")
