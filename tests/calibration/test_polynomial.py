import numpy as np
import pytest
from numpy.testing import assert_allclose
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from catenary.calibration.regression import fit_polynomial


def problem(seed: int, outputs: int = 2) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    X = rng.normal(size=(300, 3)) * [1.0, 0.05, 2.0] + [0.0, 0.1, -1.0]
    return X, np.column_stack([np.sin(X[:, 0] + 5.0 * X[:, 1] * (k + X[:, 2])) for k in range(outputs)])


@pytest.mark.parametrize("outputs", [1, 2])
def test_least_squares_agree_with_scikit_learn_on_raw_inputs(outputs: int) -> None:
    X, Y = problem(0, outputs)
    pipeline = make_pipeline(PolynomialFeatures(2), LinearRegression()).fit(X, Y)
    new = np.random.default_rng(1).normal(size=(50, 3)) * [1.0, 0.05, 2.0]
    # least squares do not depend on the scaling, but for rounding
    assert_allclose(
        fit_polynomial(X, Y).predict(new), pipeline.predict(new).reshape(50, -1), rtol=1e-6, atol=1e-9
    )


def test_ridge_agrees_with_scikit_learn_on_standardised_monomials() -> None:
    X, Y = problem(2)
    pipeline = make_pipeline(
        StandardScaler(), PolynomialFeatures(2, include_bias=False), StandardScaler(), Ridge(alpha=10.0)
    ).fit(X, Y)
    assert_allclose(fit_polynomial(X, Y, ridge=10.0).predict(X), pipeline.predict(X), rtol=1e-7, atol=1e-9)


def test_known_second_order_polynomial_is_found() -> None:
    def truth(x: np.ndarray) -> np.ndarray:
        return (3.0 + x[:, 0] - 2.0 * x[:, 0] * x[:, 2] + 4.0 * x[:, 1] ** 2)[:, None]

    X, _ = problem(3)
    new = np.random.default_rng(4).normal(size=(20, 3))
    # the second input spans 0.3: to 1 it is extrapolated, with its rounding
    assert_allclose(fit_polynomial(X, truth(X)).predict(new), truth(new), rtol=1e-8)


@pytest.mark.parametrize("constant", [0.0, 0.1, -50.0])
@pytest.mark.parametrize("ridge", [0.0, 10.0])
def test_input_that_never_moved_changes_nothing(constant: float, ridge: float) -> None:
    X, Y = problem(5)
    still = np.column_stack([X, np.full(len(X), constant)])
    assert_allclose(
        fit_polynomial(still, Y, ridge=ridge).predict(still),
        fit_polynomial(X, Y, ridge=ridge).predict(X),
        rtol=1e-7,
        atol=1e-9,
    )


def test_prediction_of_many_rows_is_that_of_each() -> None:
    rng = np.random.default_rng(6)
    X = rng.normal(size=(9000, 42))  # 903 products a row: more than are kept in memory at a time
    polynomial = fit_polynomial(X[:1500], rng.normal(size=(1500, 2)), ridge=10.0)
    rows = [0, 4428, 4429, 8999]
    assert_allclose(polynomial.predict(X)[rows], polynomial.predict(X[rows]), rtol=1e-9, atol=1e-12)


def test_no_rows_give_no_predictions() -> None:
    assert fit_polynomial(*problem(7)).predict(np.zeros((0, 3))).shape == (0, 2)
