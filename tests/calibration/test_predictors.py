"""Regressions against closed forms."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.calibration.predictors import fit_linear, fit_polynomial
from catenary.calibration.valid_range import standardisation


def problem(seed: int, outputs: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Inputs of very different sizes, far from zero, and outputs that are nearly linear in them."""
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(200, 4)) * [1.0, 0.05, 30.0, 1.0] + [0.0, 0.1, -200.0, 5.0]
    return X, X @ rng.normal(size=(4, outputs)) + rng.normal(size=(200, outputs))


@pytest.mark.parametrize("outputs", [1, 3])
def test_least_squares_solve_the_normal_equations(outputs: int) -> None:
    X, Y = problem(0, outputs)
    A = np.column_stack([X, np.ones(len(X))])
    expected = np.linalg.solve(A.T @ A, A.T @ Y)
    linear = fit_linear(X, Y)
    # cond(A.T A) is about 1e8 here
    assert_allclose(linear.weights, expected[:-1], rtol=1e-6)
    assert_allclose(linear.bias, expected[-1], rtol=1e-6)


@pytest.mark.parametrize("constant", [0.0, 0.1, -200.0])
@pytest.mark.parametrize("ridge", [0.0, 10.0])
@pytest.mark.parametrize("fit", [fit_linear, fit_polynomial])
def test_input_that_never_moved_changes_nothing(fit: Any, constant: float, ridge: float) -> None:
    X, Y = problem(3) if fit is fit_linear else waves(5)
    still = np.column_stack([X, np.full(len(X), constant)])
    # weights on rounding noise would show at 1e-9; monomials lose two digits more
    close = {"rtol": 1e-9} if fit is fit_linear else {"rtol": 1e-7, "atol": 1e-9}
    assert_allclose(fit(still, Y, ridge=ridge).predict(still), fit(X, Y, ridge=ridge).predict(X), **close)


@pytest.mark.parametrize("constant", [0.0, 0.1, 1e5])
def test_standardisation_takes_a_constant_column_for_one_of_unit_spread(constant: float) -> None:
    # 10,001 times 0.1 has a computed standard deviation of about 1e-14
    X = np.column_stack([np.full(10_001, constant), np.linspace(0.0, 1e-6, 10_001)])
    _, scale = standardisation(X)
    assert_array_equal(scale == 1.0, [True, False])


def waves(seed: int, outputs: int = 2) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(300, 3)) * [1.0, 0.05, 2.0] + [0.0, 0.1, -1.0]
    return X, np.column_stack([np.sin(X[:, 0] + 5.0 * X[:, 1] * (k + X[:, 2])) for k in range(outputs)])
