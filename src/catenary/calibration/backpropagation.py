"""A feed-forward network while it is trained: its gradient by back-propagation, and Adam's steps, in single precision.

Numbers are those of scikit-learn's MLPRegressor with the same seed, to the rounding of the activations; that has no
schedule of the learning rate for Adam.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from catenary.calibration.predictors import Activation
from catenary.calibration.training_steps import (
    MOMENTUM,
    SQUARES,
    Singles,
    adam_step,
    logistic_slopes,
    logistic_units,
    tanh_slopes,
    tanh_units,
)


@dataclass(frozen=True)
class Penalties:
    """Factors of what Keras adds to the mean squared error beside the squared weights."""

    l1: float = 0.0  # of the sum of the weights' magnitudes
    bias_l2: float = 0.0  # of the sum of squared biases
    activity_l2: float = 0.0  # of the sum of squared outputs of hidden units, mean over rows


NO_PENALTIES = Penalties()


class Adam:
    """Adaptive moments of every parameter's slope [Kingma and Ba 2014, algorithm 1]."""

    def __init__(self, parameters: Sequence[Singles]) -> None:
        """Begin with moments of zero for parameters of these shapes."""
        self._means = [np.zeros(each.size, np.float32) for each in parameters]
        self._squares = [np.zeros(each.size, np.float32) for each in parameters]
        self._steps = 0

    def step(self, parameters: Sequence[Singles], gradient: Sequence[Singles], learning_rate: float) -> None:
        """Move parameters, contiguous arrays, down their gradient."""
        self._steps += 1
        rate = learning_rate * np.sqrt(1 - SQUARES**self._steps) / (1 - MOMENTUM**self._steps)
        moments = zip(parameters, gradient, self._means, self._squares, strict=True)
        for values, slopes, means, squares in moments:
            adam_step(values.reshape(-1), slopes.reshape(-1), means, squares, np.float32(rate))


class TrainedNetwork:
    """Layers of units; the last one is linear."""

    def __init__(self, widths: Sequence[int], activation: Activation, seed: int) -> None:
        """Draw weights and biases uniformly [Glorot and Bengio 2010].

        Args:
            widths: Numbers of inputs, of units of each hidden layer, and of outputs.
            activation: Of the hidden layers.
            seed: Of the draw.
        """
        self._activate, self._slopes = (
            (logistic_units, logistic_slopes) if activation == "logistic" else (tanh_units, tanh_slopes)
        )
        self.weights: list[Singles] = []
        self.biases: list[Singles] = []
        rng = np.random.RandomState(seed)
        for below, width in pairwise(widths):
            bound = np.sqrt((2.0 if activation == "logistic" else 6.0) / (below + width))
            self.weights.append(rng.uniform(-bound, bound, (below, width)).astype(np.float32))
            self.biases.append(rng.uniform(-bound, bound, width).astype(np.float32))
        self._adam = Adam(self._parameters)
        self._rooms: dict[str, Singles] = {}

    @property
    def _parameters(self) -> list[Singles]:
        return [*self.weights, *self.biases]

    def _room(self, name: str, rows: int, weights: Singles, axis: int) -> Singles:
        """Return an array (rows, width) that every batch writes anew: new memory costs as long as the arithmetic."""
        room = self._rooms.get(name)
        if room is None or len(room) < rows:
            room = self._rooms[name] = np.empty((rows, weights.shape[axis]), weights.dtype)
        return room[:rows]

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
        rows, layers = len(X), [X]
        for k, (weights, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            layer = np.matmul(layers[-1], weights, out=self._room(f"layer {k}", rows, weights, axis=1))
            if k + 1 < len(self.weights):
                self._activate(layer, bias)
            else:
                layer += bias
            layers.append(layer)
        delta = layers.pop()
        delta -= Y
        by_weights: list[Singles] = []
        by_biases: list[Singles] = []
        for layer, weights in zip(reversed(layers), reversed(self.weights), strict=True):
            by_weights.insert(0, (layer.T @ delta + l2 * rows * Y.shape[1] * weights) / rows)
            by_biases.insert(0, delta.sum(axis=0) / rows)
            if layer is not X:
                room = self._room(f"delta {len(by_weights)}", rows, weights, axis=0)
                delta = np.matmul(delta, weights.T, out=room)
                if others.activity_l2:
                    delta += others.activity_l2 * Y.shape[1] * layer
                self._slopes(delta, layer)
        if others.l1:
            for slope, weights in zip(by_weights, self.weights, strict=True):
                slope += 0.5 * others.l1 * Y.shape[1] * np.sign(weights)
        if others.bias_l2:
            for slope, bias in zip(by_biases, self.biases, strict=True):
                slope += others.bias_l2 * Y.shape[1] * bias
        return [*by_weights, *by_biases]

    def step(self, gradient: Sequence[Singles], learning_rate: float) -> None:
        """Take one step of Adam."""
        self._adam.step(self._parameters, gradient, learning_rate)
