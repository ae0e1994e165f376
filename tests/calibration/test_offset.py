import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from catenary.calibration.offset import fit_offset


def test_offset_is_the_mean_of_the_training_rows() -> None:
    rng = np.random.default_rng(0)
    Y = rng.normal(size=(50, 3))
    expected = [sum(column) / 50 for column in Y.T]
    assert_allclose(fit_offset(rng.normal(size=(50, 2)), Y).value, expected, rtol=1e-12)  # order of summation


def test_offset_is_the_same_wherever_the_robot_is() -> None:
    rng = np.random.default_rng(1)
    constant = fit_offset(rng.normal(size=(50, 2)), rng.normal(size=(50, 3)))
    assert_array_equal(constant.predict(rng.normal(size=(4, 2))), np.tile(constant.value, (4, 1)))


def test_offset_of_one_joint_has_one_column() -> None:
    rng = np.random.default_rng(2)
    assert fit_offset(rng.normal(size=(50, 2)), rng.normal(size=(50, 1))).predict(np.zeros((7, 2))).shape == (
        7,
        1,
    )
