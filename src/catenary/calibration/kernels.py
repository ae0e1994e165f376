"""The arithmetic of every predictor and of the valid range, one row at a time, in machine code.

Batches and the control loop run the same functions, so a deployed model gives the bits that it was evaluated with.
Sums run along the rows of the weights, a whole row of outputs at a time: that vectorises without reordering
any sum, so fast mathematics stay off and the bits do not depend on the machine either. Only +, -, *, / and, in
networks (layers.py), products fused with sums occur, each rounded as IEEE 754 says.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats, as_array
from catenary.calibration.layers import LINE, bend, layer, lines
from catenary.compiled import compiled, inlined

CONSTANT, LINEAR, QUADRATIC, NETWORK = range(4)
Integers = NDArray[np.int64]


class Packed(NamedTuple):
    """A predictor as two flat arrays, of the same types whatever its kind, so that one compiled loop runs all."""

    layout: Integers  # kind, inputs F, outputs m, then for a network: activation, skip (0, 1), widths of the layers
    numbers: Floats  # the predictor's arrays, one after the other, each beginning with a line


def pack(
    kind: int,
    parts: Sequence[tuple[str, Floats, tuple[int, ...]]],
    *,
    sizes: tuple[int, int],
    more: Sequence[int] = (),
) -> Packed:
    """Put a predictor's arrays one after the other.

    Args:
        kind: CONSTANT, LINEAR, QUADRATIC or NETWORK.
        parts: Name, values and expected shape of each array.
        sizes: Inputs F and outputs m.
        more: What the layout of a network holds beside.

    Raises:
        InputError: An array has another shape.
    """
    arrays = [as_array(name, values, shape, finite=False) for name, values, shape in parts]
    return Packed(np.array([kind, *sizes, *more], dtype=np.int64), in_lines(arrays))


def with_whole_lines(weights: Floats) -> Floats:
    """Fill rows up with zeros to whole lines, as layers.py takes them."""
    rows, columns = weights.shape
    wide = np.zeros((rows, lines(columns)))
    wide[:, :columns] = weights
    return wide


def in_lines(arrays: Sequence[Floats]) -> Floats:
    """Put arrays one after the other, each beginning with a line; what lies between is zero."""
    sizes = [lines(array.size) for array in arrays]
    room = np.zeros(sum(sizes) + LINE)
    begin = -(room.ctypes.data // room.itemsize) % LINE
    numbers = room[begin : begin + sum(sizes)]
    at = 0
    for array, size in zip(arrays, sizes, strict=True):
        numbers[at : at + array.size] = array.ravel()
        at += size
    return numbers


def work_size(packed: Packed) -> int:
    """How many floats of working memory a row takes."""
    return 2 * lines(int(max(packed.layout[1:]))) if packed.layout[0] == NETWORK else int(packed.layout[1])


def predict_rows(packed: Packed, X: Floats) -> Floats:
    """Give a predictor's outputs (N, m) for features (N, F).

    Raises:
        InputError: X has another shape.
    """
    kind, inputs, outputs = (int(size) for size in packed.layout[:3])
    rows = as_array("features", X, (None, X.shape[1] if kind == CONSTANT else inputs), finite=False)
    out = np.empty((len(rows), outputs))
    _predict_rows(packed.layout, packed.numbers, rows, np.empty(work_size(packed)), out)
    return out


@compiled
def _predict_rows(layout: Integers, numbers: Floats, X: Floats, work: Floats, out: Floats) -> None:
    for k in range(len(X)):
        predict_row(layout, numbers, X[k], work, out[k])


@inlined
def predict_row(layout: Integers, numbers: Floats, x: Floats, work: Floats, out: Floats) -> None:
    """Write a predictor's outputs (m,) for one row of features (F,)."""
    kind, inputs, outputs = layout[0], layout[1], layout[2]
    if kind == CONSTANT:
        for k in range(outputs):
            out[k] = numbers[k]
    elif kind == LINEAR:
        linear_at(x, 0, numbers, 0, inputs, outputs, out, 0)
    elif kind == QUADRATIC:
        _quadratic(inputs, outputs, numbers, x, work, out)
    else:
        _network(layout, numbers, x, work, out)


@inlined
def linear_at(
    x: Floats, x_at: int, numbers: Floats, at: int, inputs: int, outputs: int, out: Floats, out_at: int
) -> None:
    """Write bias + x @ weights of a linear predictor, each array from a place on: slices cost more than the sums."""
    bias = at + lines(inputs * outputs)
    for k in range(outputs):
        out[out_at + k] = numbers[bias + k]
    add_product_at(x, x_at, numbers, at, inputs, outputs, out, out_at)


@inlined
def dense(x: Floats, weights: Floats, bias: Floats, out: Floats) -> None:
    """Write bias + x @ weights; x (F,) or longer, weights (F, m), bias and out (m,) or longer."""
    for k in range(weights.shape[1]):
        out[k] = bias[k]
    add_product(x, weights, out)


@inlined
def add_product_at(
    x: Floats, x_at: int, weights: Floats, at: int, inputs: int, outputs: int, out: Floats, out_at: int
) -> None:
    """Add x (F,) @ weights (F, m) to out (m,), each from a place in a flat array on; the sums of `add_product`."""
    whole = inputs - inputs % 4
    for i in range(0, whole, 4):
        x0, x1, x2, x3 = x[x_at + i], x[x_at + i + 1], x[x_at + i + 2], x[x_at + i + 3]
        w0 = at + i * outputs
        w1, w2, w3 = w0 + outputs, w0 + 2 * outputs, w0 + 3 * outputs
        for k in range(outputs):
            out[out_at + k] = (
                out[out_at + k]
                + x0 * weights[w0 + k]
                + x1 * weights[w1 + k]
                + x2 * weights[w2 + k]
                + x3 * weights[w3 + k]
            )
    for i in range(whole, inputs):
        for k in range(outputs):
            out[out_at + k] += x[x_at + i] * weights[at + i * outputs + k]


@inlined
def add_product(x: Floats, weights: Floats, out: Floats) -> None:
    """Add x @ weights to out."""
    inputs, outputs = weights.shape
    # four rows at a time: `out` is read and written a quarter as often; the order of the sum is the plain one
    whole = inputs - inputs % 4
    for i in range(0, whole, 4):
        x0, x1, x2, x3 = x[i], x[i + 1], x[i + 2], x[i + 3]
        for k in range(outputs):
            out[k] = (
                out[k]
                + x0 * weights[i, k]
                + x1 * weights[i + 1, k]
                + x2 * weights[i + 2, k]
                + x3 * weights[i + 3, k]
            )
    for i in range(whole, inputs):
        for k in range(outputs):
            out[k] += x[i] * weights[i, k]


@inlined
def _standardise(x: Floats, numbers: Floats, inputs: int, out: Floats) -> None:
    """Write (x - mean) / scale, the first numbers."""
    scale = lines(inputs)
    for i in range(inputs):
        out[i] = (x[i] - numbers[i]) / numbers[scale + i]


@inlined
def _quadratic(inputs: int, outputs: int, numbers: Floats, x: Floats, work: Floats, out: Floats) -> None:
    _standardise(x, numbers, inputs, work)
    at = 2 * lines(inputs)
    linear = numbers[at : at + inputs * outputs].reshape((inputs, outputs))
    at += lines(inputs * outputs)
    pairs = inputs * (inputs + 1) // 2
    quadratic = numbers[at : at + pairs * outputs].reshape((pairs, outputs))
    dense(work, linear, numbers[at + lines(pairs * outputs) :], out)
    pair = 0
    for i in range(inputs):
        for j in range(i, inputs):
            product = work[i] * work[j]
            for k in range(outputs):
                out[k] += product * quadratic[pair, k]
            pair += 1


@inlined
def _network(layout: Integers, numbers: Floats, x: Floats, work: Floats, out: Floats) -> None:
    inputs, outputs, activation, skip = layout[1], layout[2], layout[3], layout[4]
    # places in `work`, of the inputs of a layer and of its outputs
    below, above = 0, len(work) // 2
    _standardise(x, numbers, inputs, work)
    at, width = 2 * lines(inputs), inputs
    layers = len(layout) - 5
    for k in range(layers):
        wider = layout[5 + k]
        layer(work, below, numbers, at, width, wider, work, above)
        at += (width + 1) * lines(wider)
        width = wider
        if k < layers - 1:
            bend(activation, work, above, width)
        below, above = above, below
    out_mean, out_scale = numbers[at : at + outputs], numbers[at + lines(outputs) :]
    if skip:
        at += 2 * lines(outputs)
        weights = numbers[at : at + inputs * outputs].reshape((inputs, outputs))
        dense(x, weights, numbers[at + lines(inputs * outputs) :], out)
        for k in range(outputs):
            out[k] += work[below + k] * out_scale[k] + out_mean[k]
    else:
        for k in range(outputs):
            out[k] = work[below + k] * out_scale[k] + out_mean[k]


@inlined
def inside_row(
    x: Floats, x_at: int, count: int, axes: int, numbers: Floats, at: int, work: Floats, work_at: int
) -> bool:
    """Whether one row of features (F,) lies within both boxes of a valid range; never true for NaN.

    Args:
        x: Features, from `x_at` on.
        x_at: Where they begin.
        count: Number of features F.
        axes: Number of axes A.
        numbers: From `at` on lower (F,), upper (F,), mean (F,), directions (F, A), axis_lower (A,), axis_upper (A,),
            one after the other, each beginning with a line.
        at: Where they begin.
        work: (F + A,) or longer from `work_at` on.
        work_at: Where it begins.
    """
    step = lines(count)
    upper, mean = at + step, at + 2 * step
    for i in range(count):
        value = x[x_at + i]
        if not (value >= numbers[at + i] and value <= numbers[upper + i]):
            return False
    projection, directions = work_at + count, at + 3 * step
    for i in range(count):
        work[work_at + i] = x[x_at + i] - numbers[mean + i]
    for a in range(axes):
        work[projection + a] = 0.0
    add_product_at(work, work_at, numbers, directions, count, axes, work, projection)
    axis_lower = directions + lines(count * axes)
    axis_upper = axis_lower + lines(axes)
    inside = True
    for a in range(axes):
        inside &= (
            work[projection + a] >= numbers[axis_lower + a]
            and work[projection + a] <= numbers[axis_upper + a]
        )
    return inside


@compiled
def inside_rows(X: Floats, axes: int, numbers: Floats, work: Floats, out: NDArray[np.bool_]) -> None:
    """Write `inside_row` of every row of X (N, F) into out (N,)."""
    for k in range(len(X)):
        out[k] = inside_row(X[k], 0, X.shape[1], axes, numbers, 0, work, 0)
