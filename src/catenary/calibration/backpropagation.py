"""A feed-forward network while it is trained: its gradient by back-propagation, and Adam's steps, in single precision.

Numbers are those of scikit-learn's MLPRegressor with the same seed: of tanh units to the bit, of logistic ones to the
rounding of the logistic function; that has no schedule of the learning rate for Adam.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from catenary.calibration.predictors import Activation

Singles = NDArray[np.float32]
# Adam's decay rates, and what it adds to a root [Kingma and Ba 2014]
MOMENTUM, SQUARES, EPSILON = 0.9, 0.999, 1e-8


@dataclass(frozen=True)
class Penalties:
    """Factors of what Keras adds to the mean squared error beside the squared weights."""

    l1: float = 0.0  # of the sum of the weights' magnitudes
    bias_l2: float = 0.0  # of the sum of squared biases
    activity_l2: float = 0.0  # of the sum of squared outputs of hidden units, mean over rows


NO_PENALTIES = Penalties()


def logistic(x: Singles) -> Singles:
    """Return 1 / (1 + exp(-x)), in the same array; three times as fast as SciPy's `expit` on single precision."""
    np.negative(x, out=x)
    with np.errstate(over="ignore"):  # exp(-x) beyond single precision: 0 is right
        np.exp(x, out=x)
    x += 1
    np.reciprocal(x, out=x)
    return x


class TrainedNetwork:
    """Layers of units; the last one is linear."""

    def __init__(self, widths: Sequence[int], activation: Activation, seed: int) -> None:
        """Draw weights and biases uniformly [Glorot and Bengio 2010].

        Args:
            widths: Numbers of inputs, of units of each hidden layer, and of outputs.
            activation: Of the hidden layers.
            seed: Of the draw.
        """
        self._logistic = activation == "logistic"
        self.weights: list[Singles] = []
        self.biases: list[Singles] = []
        rng = np.random.RandomState(seed)
        for below, width in pairwise(widths):
            bound = np.sqrt((2.0 if self._logistic else 6.0) / (below + width))
            self.weights.append(rng.uniform(-bound, bound, (below, width)).astype(np.float32))
            self.biases.append(rng.uniform(-bound, bound, width).astype(np.float32))
        self._means = [np.zeros_like(each) for each in self._parameters]
        self._squares = [np.zeros_like(each) for each in self._parameters]
        self._steps = 0

    @property
    def _parameters(self) -> list[Singles]:
        return [*self.weights, *self.biases]

    def gradient(self, X: Singles, Y: Singles, l2: float, others: Penalties = NO_PENALTIES) -> list[Singles]:
        """Return the gradient of the loss, times m / 2: first by the weights, then by the biases.

        The loss is Keras's: mean over rows and outputs of the squared error, + l2 * sum of squared weights, + the other
        penalties. Adam's steps do not depend on the factor.

        Args:
            X: (N, F) inputs.
            Y: (N, m) outputs that are wanted.
            l2: Weight on the squared weights.
            others: Weights on magnitudes of weights, on biases and on what hidden units give.
        """
        layers = [X]
        for weights, bias in zip(self.weights, self.biases, strict=True):
            layer = layers[-1] @ weights
            layer += bias
            if len(layers) < len(self.weights):
                layer = logistic(layer) if self._logistic else np.tanh(layer)
            layers.append(layer)
        rows, delta = len(X), layers.pop() - Y
        by_weights: list[Singles] = []
        by_biases: list[Singles] = []
        for layer, weights in zip(reversed(layers), reversed(self.weights), strict=True):
            by_weights.insert(0, (layer.T @ delta + l2 * rows * Y.shape[1] * weights) / rows)
            by_biases.insert(0, delta.sum(axis=0) / rows)
            if layer is not X:
                delta = delta @ weights.T
                if others.activity_l2:
                    delta += others.activity_l2 * Y.shape[1] * layer
                if self._logistic:
                    delta *= layer
                delta *= 1 - layer if self._logistic else 1 - layer**2
        if others.l1:
            for slope, weights in zip(by_weights, self.weights, strict=True):
                slope += 0.5 * others.l1 * Y.shape[1] * np.sign(weights)
        if others.bias_l2:
            for slope, bias in zip(by_biases, self.biases, strict=True):
                slope += others.bias_l2 * Y.shape[1] * bias
        return [*by_weights, *by_biases]

    def step(self, gradient: Sequence[Singles], learning_rate: float) -> None:
        """Take one step of Adam [Kingma and Ba 2014, algorithm 1]."""
        self._steps += 1
        rate = learning_rate * np.sqrt(1 - SQUARES**self._steps) / (1 - MOMENTUM**self._steps)
        parts = zip(self._parameters, gradient, self._means, self._squares, strict=True)
        for k, (values, slope, mean, square) in enumerate(parts):
            self._means[k] = MOMENTUM * mean + (1 - MOMENTUM) * slope
            self._squares[k] = SQUARES * square + (1 - SQUARES) * slope**2
            values += -rate * self._means[k] / (np.sqrt(self._squares[k]) + EPSILON)
