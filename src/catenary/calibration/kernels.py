"""The arithmetic of every predictor and of the valid range, one row at a time, in machine code.

Batches and the control loop run the same functions, so a deployed model gives the bits that it was evaluated with.
All sums are those of layers.py: no compiler reorders them, fast mathematics stay off, and the bits do not depend on the
machine either. Only +, -, *, / and products fused with sums occur, each rounded as IEEE 754 says.

Functions take places in flat arrays: slices cost more than most sums.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats, as_array
from catenary.calibration.layers import LINE, bend, layer, lines
from catenary.kernels.compiled import borrowed, compiled, inlined

CONSTANT, LINEAR, QUADRATIC, NETWORK = range(4)
Integers = NDArray[np.int64]


class Packed(NamedTuple):
    """A predictor as two flat arrays, of the same types whatever its kind, so that one compiled loop runs all."""

    # kind, inputs F, outputs m, room to work in; then for a network: activation, skip (0, 1), number of layers, widths
    layout: Integers
    numbers: (
        Floats  # the predictor's arrays, one after the other; each of them, and each row, begins with a line
    )


def pack(
    kind: int,
    parts: Sequence[tuple[str, Floats, tuple[int, ...]]],
    *,
    sizes: tuple[int, int],
    room: int = 0,
    more: Sequence[int] = (),
) -> Packed:
    """Put a predictor's arrays one after the other.

    Args:
        kind: CONSTANT, LINEAR, QUADRATIC or NETWORK.
        parts: Name, values and expected shape of each array.
        sizes: Inputs F and outputs m.
        room: Floats of working memory that a row takes.
        more: What the layout of a network holds beside.

    Raises:
        InputError: An array has another shape.
    """
    arrays = [as_array(name, values, shape, finite=False) for name, values, shape in parts]
    return Packed(np.array([kind, *sizes, room, *more], dtype=np.int64), in_lines(arrays))


def in_lines(arrays: Sequence[Floats]) -> Floats:
    """Put arrays (N,) and (M, N) one after the other; each, and each row, begins with a line, filled up with zeros."""
    sizes = [lines(array.shape[-1]) * (len(array) if array.ndim == 2 else 1) for array in arrays]
    room = np.zeros(sum(sizes) + LINE)
    begin = -(room.ctypes.data // room.itemsize) % LINE
    numbers = room[begin : begin + sum(sizes)]
    at = 0
    for array, size in zip(arrays, sizes, strict=True):
        width = array.shape[-1]
        numbers[at : at + size].reshape(-1, max(1, lines(width)))[:, :width] = array
        at += size
    return numbers


def predict_rows(packed: Packed, X: Floats) -> Floats:
    """Give a predictor's outputs (N, m) for features (N, F).

    Raises:
        InputError: X has another shape.
    """
    kind, inputs, outputs = (int(size) for size in packed.layout[:3])
    rows = as_array("features", X, (None, X.shape[1] if kind == CONSTANT else inputs), finite=False)
    out = np.empty((len(rows), outputs))
    work = in_lines([np.zeros(lines(outputs) + int(packed.layout[3]))])
    _predict_rows(packed.layout, packed.numbers, rows.ravel(), rows.shape[1], work, out)
    return out


@compiled
def _predict_rows(
    layout: Integers, numbers: Floats, X: Floats, inputs: int, work: Floats, out: Floats
) -> None:
    layout, numbers, X, work = borrowed(layout), borrowed(numbers), borrowed(X), borrowed(work)
    outputs = layout[2]
    for k in range(len(out)):
        predict_at(layout, 0, X, k * inputs, numbers, 0, work, lines(outputs), work, 0)
        for j in range(outputs):
            out[k, j] = work[j]


@inlined
def predict_at(
    layout: Integers,
    layout_at: int,
    x: Floats,
    x_at: int,
    numbers: Floats,
    at: int,
    work: Floats,
    work_at: int,
    out: Floats,
    out_at: int,
) -> None:
    """Write a predictor's outputs, whole lines of them, for one row of features (F,), each from its place on."""
    kind, inputs, outputs = layout[layout_at], layout[layout_at + 1], layout[layout_at + 2]
    if kind == LINEAR:
        layer(x, x_at, numbers, at, inputs, outputs, out, out_at)
    elif kind == CONSTANT:
        for k in range(outputs):
            out[out_at + k] = numbers[at + k]
    elif kind == QUADRATIC:
        _quadratic(inputs, outputs, x, x_at, numbers, at, work, work_at, out, out_at)
    else:
        _network(layout, layout_at, x, x_at, numbers, at, work, work_at, out, out_at)


@inlined
def _standardise(
    x: Floats, x_at: int, numbers: Floats, at: int, inputs: int, out: Floats, out_at: int
) -> None:
    """Write (x - mean) / scale, the numbers from `at` on."""
    scale = at + lines(inputs)
    for i in range(inputs):
        out[out_at + i] = (x[x_at + i] - numbers[at + i]) / numbers[scale + i]


@inlined
def _quadratic(
    inputs: int,
    outputs: int,
    x: Floats,
    x_at: int,
    numbers: Floats,
    at: int,
    work: Floats,
    work_at: int,
    out: Floats,
    out_at: int,
) -> None:
    _standardise(x, x_at, numbers, at, inputs, work, work_at)
    pair = work_at + inputs
    for i in range(inputs):
        first = work[work_at + i]
        for j in range(i, inputs):
            work[pair + j - i] = first * work[work_at + j]
        pair += inputs - i
    layer(work, work_at, numbers, at + 2 * lines(inputs), pair - work_at, outputs, out, out_at)


@inlined
def _network(
    layout: Integers,
    layout_at: int,
    x: Floats,
    x_at: int,
    numbers: Floats,
    at: int,
    work: Floats,
    work_at: int,
    out: Floats,
    out_at: int,
) -> None:
    inputs, outputs, half = layout[layout_at + 1], layout[layout_at + 2], layout[layout_at + 3] // 2
    activation, skip, layers = layout[layout_at + 4], layout[layout_at + 5], layout[layout_at + 6]
    below, above = work_at, work_at + half  # inputs of a layer, and its outputs
    _standardise(x, x_at, numbers, at, inputs, work, below)
    at, width = at + 2 * lines(inputs), inputs
    for k in range(layers):
        wider = layout[layout_at + 7 + k]
        layer(work, below, numbers, at, width, wider, work, above)
        at += (width + 1) * lines(wider)
        width = wider
        if k < layers - 1:
            bend(activation, work, above, width)
        below, above = above, below
    mean, scale = at, at + lines(outputs)
    if skip:
        layer(x, x_at, numbers, scale + lines(outputs), inputs, outputs, out, out_at)
        for k in range(outputs):
            out[out_at + k] += work[below + k] * numbers[scale + k] + numbers[mean + k]
    else:
        for k in range(outputs):
            out[out_at + k] = work[below + k] * numbers[scale + k] + numbers[mean + k]


@inlined
def inside_at(
    x: Floats, x_at: int, count: int, axes: int, numbers: Floats, at: int, work: Floats, work_at: int
) -> bool:
    """Whether one row of features (F,) lies within both boxes of a valid range; never true for NaN.

    Args:
        x: Features, from `x_at` on.
        x_at: Where they begin.
        count: Number of features F.
        axes: Number of axes A.
        numbers: From `at` on lower (F,), upper (F,), mean (F,), directions (F, A), zeros (A,), axis_lower (A,),
            axis_upper (A,), as `in_lines` puts them.
        at: Where they begin.
        work: lines(F) + lines(A) or longer from `work_at` on.
        work_at: Where it begins.
    """
    step, wide = lines(count), lines(axes)
    upper, mean, directions = at + step, at + 2 * step, at + 3 * step
    inside = True
    for i in range(count):
        value = x[x_at + i]
        inside &= (value >= numbers[at + i]) & (value <= numbers[upper + i])
        work[work_at + i] = value - numbers[mean + i]
    along, axis_lower = work_at + step, directions + (count + 1) * wide
    axis_upper = axis_lower + wide
    layer(work, work_at, numbers, directions, count, axes, work, along)
    for a in range(axes):
        value = work[along + a]
        inside &= (value >= numbers[axis_lower + a]) & (value <= numbers[axis_upper + a])
    return inside


@compiled
def inside_rows(
    X: Floats, count: int, axes: int, numbers: Floats, work: Floats, out: NDArray[np.bool_]
) -> None:
    """Write `inside_at` of every row of X (N * F,) into out (N,)."""
    X, numbers, work = borrowed(X), borrowed(numbers), borrowed(work)
    for k in range(len(out)):
        out[k] = inside_at(X, k * count, count, axes, numbers, 0, work, 0)
