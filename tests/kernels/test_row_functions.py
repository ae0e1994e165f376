import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.kernels.row_functions import dense, logistic, tanh
from oracles.calibration_models import PREDICTORS, predicted, random_network, random_predictor


def test_sums_run_along_the_inputs_and_do_not_depend_on_how_many_columns_lie_beside() -> None:
    rng = np.random.default_rng(1)
    X, W, b = rng.normal(size=(3, 9)), rng.normal(size=(9, 100)), rng.normal(size=100)
    expected = np.tile(b, (3, 1))
    for i in range(9):
        expected += X[:, i : i + 1] * W[i]
    for columns in (slice(0, 1), slice(0, 7), slice(0, 100)):
        Y = np.empty((3, len(b[columns])))
        dense(X, np.ascontiguousarray(W[:, columns]), b[columns], Y)
        assert_array_equal(Y, expected[:, columns])


def test_tanh_is_that_of_the_c_library() -> None:
    exponents = 10.0 ** np.linspace(-300.0, 300.0, 10_001)
    v = np.concatenate([np.linspace(-25.0, 25.0, 100_001), exponents, -exponents, [0.0, np.inf, -np.inf]])
    Z = v[None].copy()
    tanh(Z)
    assert_allclose(Z[0], np.tanh(v), rtol=3e-15)  # six doublings, each within a rounding or two


def test_logistic_function_is_that_of_the_c_library() -> None:
    v = np.concatenate([np.linspace(-50.0, 50.0, 100_001), [0.0, 1e300, -1e300, np.inf, -np.inf]])
    Z = v[None].copy()
    logistic(Z)
    with np.errstate(over="ignore"):
        assert_allclose(Z[0], 1.0 / (1.0 + np.exp(-v)), rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("name", PREDICTORS)
@pytest.mark.parametrize(("inputs", "outputs"), [(1, 1), (3, 2), (5, 7), (16, 3)])
def test_predictions_equal_matrix_products(name: str, inputs: int, outputs: int) -> None:
    rng = np.random.default_rng([len(name), inputs])
    for _ in range(5):
        predictor = random_predictor(name, inputs, outputs, rng)
        X = rng.normal(size=(20, inputs))
        # sums of at most some hundred terms of order one to ten, in another order
        assert_allclose(predictor.predict(X), predicted(predictor, X), rtol=0.0, atol=1e-11)


def test_wide_networks_equal_matrix_products_beyond_a_block_of_rows() -> None:
    rng = np.random.default_rng(1)
    network = random_network((48, 100, 100, 6), "tanh", rng)
    X = rng.normal(size=(1100, 48))
    assert_allclose(network.predict(X), predicted(network, X), rtol=0.0, atol=1e-11)
