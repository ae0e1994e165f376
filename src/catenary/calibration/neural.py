"""The networks of a calibration model and their training: presets, back-propagation, Adam, in single precision.

Numbers are those of scikit-learn's MLPRegressor with the same seed, to the rounding of the activations; that has no
schedule of the learning rate for Adam.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from catenary.arrays import Floats
from catenary.calibration.predictors import Network
from catenary.calibration.valid_range import standardisation
from catenary.kernels.compiled import compiled, inlined
from catenary.parallel import Progress, silent

Singles = NDArray[np.float32]
# Adam's decay rates, and what it adds to a root [Kingma and Ba 2014]
_MOMENTUM_64, _SQUARES_64, _EPSILON_64 = 0.9, 0.999, 1e-8
_MOMENTUM, _SQUARES, _EPSILON = np.float32(_MOMENTUM_64), np.float32(_SQUARES_64), np.float32(_EPSILON_64)
_NEW_MOMENTUM, _NEW_SQUARE = np.float32(1.0 - _MOMENTUM_64), np.float32(1.0 - _SQUARES_64)
_ONE, _HALF = np.float32(1.0), np.float32(0.5)
# tanh(x) = x p(x^2) / q(x^2) to 3e-7, and +-1 beyond the bound [Eigen 3.3, MathFunctionsImpl.h]
_BOUND = np.float32(7.90531110763549805)
_P0, _P1, _P2, _P3, _P4, _P5, _P6 = map(np.float32, (
    4.89352455891786e-03, 6.37261928875436e-04, 1.48572235717979e-05, 5.12229709037114e-08,
    -8.60467152213735e-11, 2.00018790482477e-13, -2.76076847742355e-16,
))  # fmt: skip
_Q0, _Q1, _Q2, _Q3 = map(
    np.float32, (4.89352518554385e-03, 2.26843463243900e-03, 1.18534705686654e-04, 1.19825839466702e-06)
)


@inlined
def _tanh(x: np.float32) -> np.float32:
    x = min(max(x, -_BOUND), _BOUND)
    s = x * x
    p = _P0 + s * (_P1 + s * (_P2 + s * (_P3 + s * (_P4 + s * (_P5 + s * _P6)))))
    return x * p / (_Q0 + s * (_Q1 + s * (_Q2 + s * _Q3)))


@compiled
def logistic_units(layer: Singles, bias: Singles) -> None:
    """Write 1 / (1 + exp(-layer - bias)) into layer (N, units)."""
    for row in range(layer.shape[0]):
        for k in range(layer.shape[1]):
            layer[row, k] = _HALF + _HALF * _tanh(_HALF * (layer[row, k] + bias[k]))


@compiled
def logistic_slopes(delta: Singles, layer: Singles) -> None:
    """Multiply delta (N, units) by the slope of the logistic function where it gave `layer`."""
    for row in range(layer.shape[0]):
        for k in range(layer.shape[1]):
            delta[row, k] *= layer[row, k] * (_ONE - layer[row, k])


@compiled
def adam_step(values: Singles, slopes: Singles, means: Singles, squares: Singles, rate: np.float32) -> None:
    """Move values down their slopes [Kingma and Ba 2014, algorithm 1]; all four arrays are flat."""
    for i in range(len(values)):
        means[i] = _MOMENTUM * means[i] + _NEW_MOMENTUM * slopes[i]
        squares[i] = _SQUARES * squares[i] + _NEW_SQUARE * (slopes[i] * slopes[i])
        values[i] -= rate * means[i] / (np.sqrt(squares[i]) + _EPSILON)


@dataclass(frozen=True)
class Penalties:
    """Factors of what Keras adds to the mean squared error beside the squared weights."""

    l1: float = 0.0  # of the sum of the weights' magnitudes
    bias_l2: float = 0.0  # of the sum of squared biases
    activity_l2: float = 0.0  # of the sum of squared outputs of hidden units, mean over rows
    output: bool = True  # whether the output layer's weights and biases count, as the hidden ones' do


_NO_PENALTIES = Penalties()


class Adam:
    """Adaptive moments of every parameter's slope [Kingma and Ba 2014, algorithm 1]."""

    def __init__(self, parameters: Sequence[Singles]) -> None:
        self._means = [np.zeros(parameter.size, np.float32) for parameter in parameters]
        self._squares = [np.zeros(parameter.size, np.float32) for parameter in parameters]
        self._steps = 0

    def step(self, parameters: Sequence[Singles], gradient: Sequence[Singles], learning_rate: float) -> None:
        """Move parameters, contiguous arrays, down their gradient."""
        self._steps += 1
        rate = learning_rate * np.sqrt(1 - _SQUARES_64**self._steps) / (1 - _MOMENTUM_64**self._steps)
        moments = zip(parameters, gradient, self._means, self._squares, strict=True)
        for values, slopes, means, squares in moments:
            adam_step(values.reshape(-1), slopes.reshape(-1), means, squares, np.float32(rate))


class TrainedNetwork:
    """Layers of sigmoid units; the last one is linear."""

    def __init__(self, widths: Sequence[int], seed: int) -> None:
        """Draw weights and biases uniformly [Glorot and Bengio 2010]."""
        self.weights: list[Singles] = []
        self.biases: list[Singles] = []
        rng = np.random.RandomState(seed)
        for below, width in pairwise(widths):
            bound = np.sqrt(2.0 / (below + width))
            self.weights.append(rng.uniform(-bound, bound, (below, width)).astype(np.float32))
            self.biases.append(rng.uniform(-bound, bound, width).astype(np.float32))
        self._adam = Adam(self._parameters)
        self._rooms: dict[str, Singles] = {}

    @property
    def _parameters(self) -> list[Singles]:
        return [*self.weights, *self.biases]

    def _room(self, name: str, rows: int, weights: Singles, axis: int) -> Singles:
        """Return an array (rows, width) that every batch overwrites: new memory costs as long as the arithmetic."""
        room = self._rooms.get(name)
        if room is None or len(room) < rows:
            room = self._rooms[name] = np.empty((rows, weights.shape[axis]), weights.dtype)
        return room[:rows]

    def gradient(self, X: Singles, Y: Singles, l2: float, others: Penalties = _NO_PENALTIES) -> list[Singles]:
        """Return the gradient of the loss, times m / 2: first by the weights, then by the biases.

        The loss is Keras's for inputs X (N, F) and wanted outputs Y (N, m): mean over rows and outputs of the squared
        error, + l2 * sum of squared weights, + the other penalties. Adam's steps do not depend on the factor.
        """
        rows, layers = len(X), [X]
        for k, (weights, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            layer = np.matmul(layers[-1], weights, out=self._room(f"layer {k}", rows, weights, axis=1))
            if k + 1 < len(self.weights):
                logistic_units(layer, bias)
            else:
                layer += bias
            layers.append(layer)
        delta = layers.pop()
        delta -= Y
        by_weights: list[Singles] = []
        by_biases: list[Singles] = []
        for layer, weights in zip(reversed(layers), reversed(self.weights), strict=True):
            held_back = l2 if by_weights or others.output else 0.0
            by_weights.insert(0, (layer.T @ delta + held_back * rows * Y.shape[1] * weights) / rows)
            by_biases.insert(0, delta.sum(axis=0) / rows)
            if layer is not X:
                room = self._room(f"delta {len(by_weights)}", rows, weights, axis=0)
                delta = np.matmul(delta, weights.T, out=room)
                if others.activity_l2:
                    delta += others.activity_l2 * Y.shape[1] * layer
                logistic_slopes(delta, layer)
        last = len(self.weights) - (not others.output)
        if others.l1:
            for slope, weights in zip(by_weights[:last], self.weights[:last], strict=True):
                slope += 0.5 * others.l1 * Y.shape[1] * np.sign(weights)
        if others.bias_l2:
            for slope, bias in zip(by_biases[:last], self.biases[:last], strict=True):
                slope += others.bias_l2 * Y.shape[1] * bias
        return [*by_weights, *by_biases]

    def step(self, gradient: Sequence[Singles], learning_rate: float) -> None:
        """Take one step of Adam."""
        self._adam.step(self._parameters, gradient, learning_rate)


@dataclass(frozen=True)
class NetworkSettings:
    """Size of a network, and how it is trained."""

    hidden: tuple[int, ...]
    l2: float  # factor of the sum of squared weights beside the mean squared error
    learning_rate: float
    batch: int
    epochs: int
    penalties: Penalties = _NO_PENALTIES  # beside `l2`


# Peng et al., section IV-B: two hidden layers of 100 sigmoid units, mean squared error, L2 5e-4 on the kernels,
# Adam 1e-3 (0.9, 0.999), batch 1024, 200 epochs. Not stated, and as in the first author's public code of a companion
# study (RAVEN-2-Feature-Ablation): inputs and outputs are standardised, penalties are on hidden layers alone.
PAPER = NetworkSettings((100, 100), 5e-4, 1e-3, 1024, 200, penalties=Penalties(output=False))


def fit_neural(X: Floats, Y: Floats, settings: NetworkSettings, *, seed: int, progress: Progress = silent) -> Network:
    """Train a network to give Y (N, m) from features X (N, F), standardised, by Keras's loss as the paper's."""
    with threadpool_limits(limits=1):  # two BLAS threads on two busy cores are slower than one
        return _train(X, Y, settings, seed, progress)


def _train(X: Floats, Y: Floats, settings: NetworkSettings, seed: int, progress: Progress) -> Network:
    mean, scale = standardisation(X)
    out_mean, out_scale = standardisation(Y)
    target = (Y - out_mean) / out_scale
    # an output that a constant gives exactly gets no ripple from the network
    out_scale = np.where(np.ptp(target, axis=0) > 1e-9, out_scale, 0.0)
    # single precision trains twice as fast, as Keras does
    Z, targets = ((X - mean) / scale).astype(np.float32), target.astype(np.float32)
    rng = np.random.default_rng(seed)
    network = TrainedNetwork((Z.shape[1], *settings.hidden, targets.shape[1]), seed)
    for epoch in range(settings.epochs):
        order = rng.permutation(len(Z))
        for rows in np.array_split(order, range(settings.batch, len(Z), settings.batch)):
            network.step(
                network.gradient(Z[rows], targets[rows], settings.l2, settings.penalties), settings.learning_rate
            )
        progress((epoch + 1) / settings.epochs)
    weights, biases = (tuple(layer.astype(np.float64) for layer in some) for some in (network.weights, network.biases))
    return Network(mean, scale, weights, biases, "logistic", out_mean, out_scale)
