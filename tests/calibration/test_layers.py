import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.calibration import layers
from catenary.calibration.kernels import in_lines
from catenary.calibration.layers import BLOCK, LINE, LOGISTIC, TANH, bend, layer, lines
from catenary.kernels.compiled import compiled, fma, in_memory, instructions

GUARD = 7.0


@compiled
def run_layer(x, x_at, numbers, at, inputs, outputs, out, out_at):
    layer(x, x_at, numbers, at, inputs, outputs, out, out_at)


@compiled
def run_bend(activation, values, at, count):
    bend(activation, values, at, count)


def written(x: np.ndarray, weights: np.ndarray, bias: np.ndarray, *, shift: int = 0) -> np.ndarray:
    """A layer's outputs, from arrays that begin `shift` numbers from where they are allocated."""
    inputs, outputs = weights.shape
    numbers = np.concatenate([np.full(shift, GUARD), in_lines([weights, bias])])
    taken = np.concatenate([np.full(shift, GUARD), x])
    out = np.full(shift + lines(outputs) + 1, GUARD)
    run_layer(taken, shift, numbers, shift, inputs, outputs, out, shift)
    assert (out[:shift] == GUARD).all()
    assert out[-1] == GUARD
    return out[shift : shift + outputs]


@pytest.mark.parametrize("inputs", [0, 1, 2, 3, 4, 5, 16, 101])
@pytest.mark.parametrize("outputs", [1, 3, 8, 9, 17, 30, 40, 48, 49, 100, 200])
def test_layers_are_matrix_products(inputs: int, outputs: int) -> None:
    rng = np.random.default_rng([inputs, outputs])
    x, weights, bias = rng.normal(size=inputs), rng.normal(size=(inputs, outputs)), rng.normal(size=outputs)
    # sums of a hundred terms of order one, in another order
    assert_allclose(written(x, weights, bias), x @ weights + bias, rtol=0.0, atol=1e-12)


def test_arrays_may_begin_anywhere() -> None:
    rng = np.random.default_rng(0)
    x, weights, bias = rng.normal(size=13), rng.normal(size=(13, 21)), rng.normal(size=21)
    for shift in range(1, 9):
        assert (written(x, weights, bias, shift=shift) == written(x, weights, bias)).all()


def test_sums_run_along_the_rows_with_every_product_fused() -> None:
    rng = np.random.default_rng(1)
    outputs = 4 * LINE  # a block so wide sums one row after the other
    x, weights, bias = rng.normal(size=5), rng.normal(size=(5, outputs)), rng.normal(size=outputs)
    expected = bias.copy()
    for i in range(5):
        expected = np.array([fma(x[i], w, y) for w, y in zip(weights[i], expected, strict=True)])
    assert (written(x, weights, bias) == expected).all()


def test_bits_do_not_depend_on_how_many_columns_lie_beside() -> None:
    rng = np.random.default_rng(2)
    x, weights, bias = rng.normal(size=9), rng.normal(size=(9, 100)), rng.normal(size=100)
    whole = written(x, weights, bias)
    sums = LINE * BLOCK
    assert (written(x, weights[:, :sums], bias[:sums]) == whole[:sums]).all()


@pytest.mark.parametrize("outputs", [1, 9, 30, 49, 56, 57, 100, 200])
def test_bits_do_not_depend_on_the_processors_registers(
    monkeypatch: pytest.MonkeyPatch, outputs: int
) -> None:
    rng = np.random.default_rng(outputs)
    x, weights, bias = rng.normal(size=21), rng.normal(size=(21, outputs)), rng.normal(size=outputs)
    numbers, found = in_lines([weights, bias]), []
    for block in (6, 14):
        monkeypatch.setattr(layers, "BLOCK", block)
        made = instructions(layers._write_layer)

        @in_memory(compiled)
        def by_blocks(x, numbers, outputs, out, made=made):
            made((x, 0, numbers, 0, len(x), outputs, out, 0))

        out = np.empty(lines(outputs))
        by_blocks(x, numbers, outputs, out)
        found.append(out[:outputs])
    assert (found[0] == found[1]).all()
    assert (found[0] == written(x, weights, bias)).all()


def test_nan_reaches_what_depends_on_it() -> None:
    x, weights, bias = np.array([np.nan, 1.0]), np.ones((2, 3)), np.zeros(3)
    assert np.isnan(written(x, weights, bias)).all()
    bent = np.full(LINE, np.nan)
    for activation in (TANH, LOGISTIC):
        run_bend(activation, bent, 0, LINE)
        assert np.isnan(bent).all()


def test_tanh_is_that_of_the_c_library() -> None:
    exponents = 10.0 ** np.linspace(-300.0, 300.0, 10_001)
    v = np.concatenate([np.linspace(-25.0, 25.0, 100_001), exponents, -exponents, [0.0, np.inf, -np.inf]])
    bent = np.resize(v, lines(len(v)))
    run_bend(TANH, bent, 0, len(v))
    assert_allclose(bent[: len(v)], np.tanh(v), rtol=3e-15)  # six doublings, each within a rounding or two


def test_logistic_function_is_that_of_the_c_library() -> None:
    v = np.concatenate([np.linspace(-50.0, 50.0, 100_001), [0.0, 1e300, -1e300, np.inf, -np.inf]])
    bent = np.resize(v, lines(len(v)))
    run_bend(LOGISTIC, bent, 0, len(v))
    with np.errstate(over="ignore"):
        assert_allclose(bent[: len(v)], 1.0 / (1.0 + np.exp(-v)), rtol=0.0, atol=1e-15)
