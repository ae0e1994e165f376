"""Compiled passes of training against the functions that they stand for, in double precision."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.calibration.training_steps import (
    adam_step,
    logistic_slopes,
    logistic_units,
    tanh_slopes,
    tanh_units,
)

FAR = np.array([-np.inf, -3e38, -90.0, -8.0, 8.0, 90.0, 3e38, np.inf])
POINTS = np.concatenate([FAR, np.linspace(-20.0, 20.0, 40_001), np.geomspace(1e-30, 1.0, 500)])


def logistic(x: np.ndarray) -> np.ndarray:
    return 0.5 + 0.5 * np.tanh(0.5 * x)


@pytest.mark.parametrize(("units", "exact"), [(tanh_units, np.tanh), (logistic_units, logistic)])
def test_units_give_their_function_wherever_they_are_asked(units, exact) -> None:
    layer = POINTS.astype(np.float32)[:, None]
    expected = exact(layer.astype(np.float64))
    units(layer, np.zeros(1, np.float32))
    assert_allclose(layer, expected, rtol=0.0, atol=3e-7)


@pytest.mark.parametrize("units", [tanh_units, logistic_units])
def test_a_unit_adds_its_own_bias(units) -> None:
    rng = np.random.default_rng(0)
    layer, bias = rng.normal(size=(7, 5)).astype(np.float32), rng.normal(size=5).astype(np.float32)
    added = layer + bias
    units(layer, bias)
    units(added, np.zeros(5, np.float32))
    assert_allclose(layer, added, rtol=0.0, atol=0.0)


def test_tanh_is_odd_and_keeps_small_numbers() -> None:
    layer = np.array([[1e-30, -1e-30, 1e-4, -1e-4, 0.3, -0.3]], np.float32)
    given = layer.copy()
    tanh_units(layer, np.zeros(6, np.float32))
    assert_allclose(layer[:, ::2], -layer[:, 1::2], rtol=0.0, atol=0.0)
    assert_allclose(layer, np.tanh(given.astype(np.float64)), rtol=1e-6)


@pytest.mark.parametrize(
    ("slopes", "exact"), [(tanh_slopes, np.tanh), (logistic_slopes, logistic)], ids=["tanh", "logistic"]
)
def test_slopes_are_finite_differences(slopes, exact) -> None:
    x, h = np.linspace(-6.0, 6.0, 201)[:, None], 1e-5
    delta = np.full_like(x, 2.0, np.float32)
    slopes(delta, exact(x).astype(np.float32))
    assert_allclose(delta, 2.0 * (exact(x + h) - exact(x - h)) / (2.0 * h), rtol=0.0, atol=1e-6)


def test_a_first_step_of_adam_is_the_rate_whatever_the_slope() -> None:
    # of the first step both means are unbiased: the step is rate * g / (|g| + epsilon)
    slopes = np.array([1e-3, -5.0, 40.0, 0.0], np.float32)
    values, means, squares = np.ones(4, np.float32), np.zeros(4, np.float32), np.zeros(4, np.float32)
    rate = 0.01 * np.sqrt(1.0 - 0.999) / (1.0 - 0.9)
    adam_step(values, slopes, means, squares, np.float32(rate))
    assert_allclose(values, 1.0 - 0.01 * np.sign(slopes), rtol=1e-5)
    assert_allclose(means, 0.1 * slopes, rtol=1e-6)
    assert_allclose(squares, 0.001 * slopes**2, rtol=1e-5)
