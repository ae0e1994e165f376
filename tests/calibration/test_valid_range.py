import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.calibration.dataset import calibration_data
from catenary.calibration.evaluate import evaluate
from catenary.calibration.valid_range import ValidRange, fit_valid_range
from catenary.kernels.bind import run
from recordings import fitted
from tests.truth.recordings import raven

MARGIN = 0.1


def inside(valid: ValidRange, X: np.ndarray) -> np.ndarray:
    """Whether each row lies within both boxes."""
    flags = np.ones(len(X), dtype=bool)
    run(valid.steps(X, flags, np.empty((len(X), 1))))
    return flags


def far_of(valid: ValidRange, X: np.ndarray) -> np.ndarray:
    """How far each row is from the middle of the boxes."""
    far = np.empty((len(X), 1))
    run(valid.steps(X, np.ones(len(X), dtype=bool), far))
    return far[:, 0]


def test_axes_are_the_principal_ones_with_their_margin() -> None:
    rng = np.random.default_rng(3)
    X = rng.normal(size=(300, 4)) @ rng.normal(size=(4, 4))
    Z = (X - X.mean(axis=0)) / X.std(axis=0)
    _, vectors = np.linalg.eigh(np.cov(Z.T))
    spans = np.sort(np.ptp(Z @ vectors, axis=0))
    valid = fit_valid_range(X, MARGIN)
    # MIN_RANGE is added, 1e-6 on each side
    assert_allclose(np.sort(valid.axis_upper - valid.axis_lower), spans * (1.0 + 2.0 * MARGIN), rtol=1e-5)


def test_a_row_may_go_farther_along_axes_and_widths_reach_as_far_as_before() -> None:
    rng = np.random.default_rng(6)
    X = np.column_stack([(x := rng.uniform(-1.0, 1.0, 500)), x + rng.uniform(-0.01, 0.01, 500)])
    narrow, wide = fit_valid_range(X, 0.5), fit_valid_range(X, 0.5, along_axes=2.0)
    across = np.array([[0.0, 0.0], [0.007, -0.007], [0.016, -0.016], [0.1, -0.1]])  # training reaches 0.005 that way
    assert inside(narrow, across).tolist() == [True, True, False, False]
    assert inside(wide, across).tolist() == [True, True, True, False]
    assert_allclose(far_of(wide, across), far_of(narrow, across), atol=1e-3)
    assert inside(wide, np.array([[1.9, 1.9], [2.4, 2.4]])).tolist() == [True, False]  # a half and 0.7 ranges beyond


def test_range_does_not_depend_on_units() -> None:
    rng = np.random.default_rng(4)
    X, asked = rng.normal(size=(200, 3)), 2.0 * rng.normal(size=(500, 3))
    factors = np.array([1.0, 1000.0, 57.3])
    assert_array_equal(
        inside(fit_valid_range(X, MARGIN), asked), inside(fit_valid_range(X * factors, MARGIN), asked * factors)
    )


@pytest.mark.parametrize("constant", [0.0, 0.1, -7.3, 1e6])
def test_joint_that_never_moved_is_outside_as_soon_as_it_does(constant: float) -> None:
    rng = np.random.default_rng(5)
    X = np.column_stack([rng.normal(size=10_001), np.full(10_001, constant)])
    valid = fit_valid_range(X, MARGIN)
    assert inside(valid, X).all()
    assert not inside(valid, X + np.array([0.0, 1e-3])).any()
    assert inside(valid, X + np.array([0.0, np.spacing(constant)])).all()  # rounding


def test_directions_beyond_a_few_rows_are_watched() -> None:
    rng = np.random.default_rng(7)
    X = rng.normal(size=(12, 40))
    middle = X.mean(axis=0)
    across = np.linalg.svd(X - middle)[2][-1]  # no row moved along it
    assert not inside(fit_valid_range(X, MARGIN), (middle + 0.1 * across)[None]).any()


def test_valid_range_is_the_two_boxes_of_its_definition() -> None:
    rng = np.random.default_rng(4)
    for inputs in (1, 2, 5, 9):
        valid = fit_valid_range(rng.normal(size=(50, inputs)) @ rng.normal(size=(inputs, inputs)), MARGIN)
        X = rng.uniform(1.3 * valid.lower, 1.3 * valid.upper, size=(4000, inputs))
        projection = (X - valid.mean) @ valid.axes
        box = ((X >= valid.lower) & (X <= valid.upper)).all(axis=1)
        along = ((projection >= valid.axis_lower) & (projection <= valid.axis_upper)).all(axis=1)
        found = inside(valid, X)
        assert_array_equal(found, box & along)
        assert 0.0 < found.mean() < 1.0


@pytest.mark.parametrize("kind", ["linear", "learned"])
def test_one_zig_zag_is_worth_its_correction_in_random_motion(kind: str) -> None:
    """Joints move together along a zig-zag: combinations that it lacks are no reason to fall back to the offset."""
    known = raven("zigzag")
    model = fitted(*known.logs, kind=kind)
    all_rows = calibration_data(known.again, model.features)
    assert len(all_rows) == known.again[0].ok.sum()
    for joint in evaluate(model, all_rows).joints:
        assert joint.outside_valid_range < 0.05
        assert joint.rmse < 0.6 * joint.offset_rmse
