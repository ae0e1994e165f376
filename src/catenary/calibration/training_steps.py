"""What training does to every number of a layer: bias and activation, the activation's slope, Adam's step.

Each is one pass over arrays in single precision, compiled: with NumPy's passes, training takes up to twice as long.
"""

import numpy as np
from numpy.typing import NDArray

from catenary.kernels.compiled import compiled, inlined

Singles = NDArray[np.float32]
# Adam's decay rates, and what it adds to a root [Kingma and Ba 2014]
MOMENTUM, SQUARES, EPSILON = 0.9, 0.999, 1e-8
_MOMENTUM, _SQUARES, _EPSILON = np.float32(MOMENTUM), np.float32(SQUARES), np.float32(EPSILON)
_NEW_MOMENTUM, _NEW_SQUARE = np.float32(1.0 - MOMENTUM), np.float32(1.0 - SQUARES)
_ONE, _HALF = np.float32(1.0), np.float32(0.5)
# tanh(x) = x p(x^2) / q(x^2) to 3e-7, and +-1 beyond the bound [Eigen 3.3, MathFunctionsImpl.h]
_BOUND = np.float32(7.90531110763549805)
_P0, _P1, _P2, _P3, _P4, _P5, _P6 = (
    np.float32(value)
    for value in (
        4.89352455891786e-03,
        6.37261928875436e-04,
        1.48572235717979e-05,
        5.12229709037114e-08,
        -8.60467152213735e-11,
        2.00018790482477e-13,
        -2.76076847742355e-16,
    )
)
_Q0, _Q1, _Q2, _Q3 = (
    np.float32(value)
    for value in (4.89352518554385e-03, 2.26843463243900e-03, 1.18534705686654e-04, 1.19825839466702e-06)
)


@inlined
def _tanh(x: np.float32) -> np.float32:
    x = min(max(x, -_BOUND), _BOUND)
    s = x * x
    p = _P0 + s * (_P1 + s * (_P2 + s * (_P3 + s * (_P4 + s * (_P5 + s * _P6)))))
    return x * p / (_Q0 + s * (_Q1 + s * (_Q2 + s * _Q3)))


@compiled
def tanh_units(layer: Singles, bias: Singles) -> None:
    """Write tanh(layer + bias) into layer (N, units)."""
    for row in range(layer.shape[0]):
        for k in range(layer.shape[1]):
            layer[row, k] = _tanh(layer[row, k] + bias[k])


@compiled
def logistic_units(layer: Singles, bias: Singles) -> None:
    """Write 1 / (1 + exp(-layer - bias)) into layer (N, units)."""
    for row in range(layer.shape[0]):
        for k in range(layer.shape[1]):
            layer[row, k] = _HALF + _HALF * _tanh(_HALF * (layer[row, k] + bias[k]))


@compiled
def tanh_slopes(delta: Singles, layer: Singles) -> None:
    """Multiply delta (N, units) by the slope of tanh where it gave `layer`."""
    for row in range(layer.shape[0]):
        for k in range(layer.shape[1]):
            delta[row, k] *= _ONE - layer[row, k] * layer[row, k]


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
