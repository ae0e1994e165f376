"""Regressions against closed forms."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.calibration.predictors import fit_linear, fit_polynomial


def problem(seed: int, outputs: int = 3) -> tuple[np.ndarray, np.ndarray]:
    """Inputs of very different sizes, far from zero, and outputs that are nearly linear in them."""
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(200, 4)) * [1.0, 0.05, 30.0, 1.0] + [0.0, 0.1, -200.0, 5.0]
    return X, X @ rng.normal(size=(4, outputs)) + rng.normal(size=(200, outputs))


@pytest.mark.parametrize("constant", [0.0, 0.1, -200.0])
@pytest.mark.parametrize("ridge", [0.0, 10.0])
@pytest.mark.parametrize("fit", [fit_linear, fit_polynomial])
def test_input_that_never_moved_changes_nothing(fit: Any, constant: float, ridge: float) -> None:
    X, Y = problem(3) if fit is fit_linear else waves(5)
    still = np.column_stack([X, np.full(len(X), constant)])
    # weights on rounding noise would show at 1e-9; monomials lose two digits more
    close = {"rtol": 1e-9} if fit is fit_linear else {"rtol": 1e-7, "atol": 1e-9}
    assert_allclose(fit(still, Y, ridge=ridge).predict(still), fit(X, Y, ridge=ridge).predict(X), **close)


def waves(seed: int, outputs: int = 2) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(300, 3)) * [1.0, 0.05, 2.0] + [0.0, 0.1, -1.0]
    return X, np.column_stack([np.sin(X[:, 0] + 5.0 * X[:, 1] * (k + X[:, 2])) for k in range(outputs)])
