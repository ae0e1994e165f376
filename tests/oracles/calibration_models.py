"""Random predictors, and what they must give, in plain NumPy."""

from itertools import pairwise

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.linear import Linear
from catenary.calibration.model import Predictor
from catenary.calibration.neural import Activation, Network
from catenary.calibration.offset import Constant
from catenary.calibration.polynomial import Quadratic

PREDICTORS = ("constant", "linear", "quadratic", "tanh", "logistic", "tanh, skip", "logistic, skip")


def random_predictor(name: str, inputs: int, outputs: int, rng: np.random.Generator) -> Predictor:
    """Draw a predictor of one of PREDICTORS."""
    n = rng.normal
    if name == "constant":
        return Constant(n(size=outputs))
    linear = Linear(n(size=(inputs, outputs)), n(size=outputs))
    if name == "linear":
        return linear
    mean, scale = n(size=inputs), np.exp(0.3 * n(size=inputs))
    if name == "quadratic":
        pairs = inputs * (inputs + 1) // 2
        return Quadratic(mean, scale, linear.weights, n(size=(pairs, outputs)), linear.bias)
    activation: Activation = "tanh" if name.startswith("tanh") else "logistic"
    hidden = tuple(int(width) for width in rng.integers(1, 20, size=rng.integers(0, 4)))
    return random_network((inputs, *hidden, outputs), activation, rng, linear if "skip" in name else None)


def random_network(
    widths: tuple[int, ...], activation: Activation, rng: np.random.Generator, skip: Linear | None = None
) -> Network:
    """Draw a network with layers of the given widths, the inputs' first."""
    n = rng.normal
    return Network(
        mean=n(size=widths[0]),
        scale=np.exp(0.3 * n(size=widths[0])),
        weights=tuple(n(size=(a, b)) / np.sqrt(a) for a, b in pairwise(widths)),
        biases=tuple(n(size=b) for b in widths[1:]),
        activation=activation,
        out_mean=n(size=widths[-1]),
        out_scale=np.exp(n(size=widths[-1])),
        skip=skip,
    )


def predicted(predictor: Predictor, X: Floats) -> Floats:
    """Give a predictor's outputs (N, m) by matrix products and the C library's functions."""
    if isinstance(predictor, Constant):
        return np.tile(predictor.value, (len(X), 1))
    if isinstance(predictor, Linear):
        return X @ predictor.weights + predictor.bias
    assert isinstance(predictor, Quadratic | Network)
    Z = (X - predictor.mean) / predictor.scale
    if isinstance(predictor, Quadratic):
        i, j = np.triu_indices(Z.shape[1])
        return Z @ predictor.linear + (Z[:, i] * Z[:, j]) @ predictor.quadratic + predictor.bias
    for W, b in zip(predictor.weights[:-1], predictor.biases[:-1], strict=True):
        Z = Z @ W + b
        Z = np.tanh(Z) if predictor.activation == "tanh" else 1.0 / (1.0 + np.exp(-Z))
    out = (Z @ predictor.weights[-1] + predictor.biases[-1]) * predictor.out_scale + predictor.out_mean
    return out if predictor.skip is None else out + predicted(predictor.skip, X)
