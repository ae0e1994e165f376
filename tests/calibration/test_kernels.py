import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.calibration.kernels import predict_rows
from catenary.calibration.linear import Linear
from catenary.calibration.valid_range import fit_valid_range
from catenary.errors import InputError
from oracles.calibration_models import PREDICTORS, predicted, random_network, random_predictor


@pytest.mark.parametrize("name", PREDICTORS)
@pytest.mark.parametrize(("inputs", "outputs"), [(1, 1), (3, 2), (5, 7), (16, 3)])
def test_predictions_equal_matrix_products(name: str, inputs: int, outputs: int) -> None:
    rng = np.random.default_rng([len(name), inputs])
    for _ in range(5):
        predictor = random_predictor(name, inputs, outputs, rng)
        X = rng.normal(size=(20, inputs))
        # sums of at most some hundred terms of order one to ten, in another order
        assert_allclose(predictor.predict(X), predicted(predictor, X), rtol=0.0, atol=1e-11)


def test_wide_networks_equal_matrix_products() -> None:
    rng = np.random.default_rng(1)
    network = random_network((48, 100, 100, 6), "tanh", rng)
    X = rng.normal(size=(100, 48))
    assert_allclose(network.predict(X), predicted(network, X), rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("name", PREDICTORS)
def test_a_row_has_the_same_bits_alone_and_in_any_batch(name: str) -> None:
    rng = np.random.default_rng(2)
    predictor = random_predictor(name, 9, 5, rng)
    X = rng.normal(size=(33, 9))
    batch = predictor.predict(X)
    for k in range(len(X)):
        assert (predictor.predict(X[k : k + 1]) == batch[k]).all()
    assert (predictor.predict(X[::-1]) == batch[::-1]).all()


@pytest.mark.parametrize("name", PREDICTORS)
def test_no_row_gives_no_row(name: str) -> None:
    predictor = random_predictor(name, 4, 3, np.random.default_rng(3))
    assert predictor.predict(np.zeros((0, 4))).shape == (0, 3)


def test_valid_range_is_the_two_boxes_of_its_definition() -> None:
    rng = np.random.default_rng(4)
    for inputs in (1, 2, 5, 9):
        valid = fit_valid_range(rng.normal(size=(50, inputs)) @ rng.normal(size=(inputs, inputs)), 0.1)
        X = rng.uniform(1.3 * valid.lower, 1.3 * valid.upper, size=(4000, inputs))
        projection = (X - valid.mean) @ valid.axes
        box = ((X >= valid.lower) & (X <= valid.upper)).all(axis=1)
        along = ((projection >= valid.axis_lower) & (projection <= valid.axis_upper)).all(axis=1)
        inside = valid.inside(X)
        assert (inside == (box & along)).all()
        assert 0.0 < inside.mean() < 1.0


def test_valid_range_never_holds_for_nan() -> None:
    valid = fit_valid_range(np.random.default_rng(5).normal(size=(50, 3)), 0.1)
    X = np.zeros((3, 3))
    X[np.arange(3), np.arange(3)] = np.nan
    assert not valid.inside(X).any()


def test_arrays_that_do_not_fit_together_are_refused_by_name() -> None:
    with pytest.raises(InputError, match=r"bias: expected shape \(2,\), got \(3,\)"):
        Linear(np.zeros((4, 2)), np.zeros(3)).pack()


def test_features_of_another_width_are_refused() -> None:
    linear = Linear(np.zeros((4, 2)), np.zeros(2))
    with pytest.raises(InputError, match=r"features: expected shape \(N, 4\), got \(5, 3\)"):
        predict_rows(linear.pack(), np.zeros((5, 3)))
