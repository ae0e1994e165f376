"""A calibration holds to scikit-learn's conventions."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from sklearn.utils.estimator_checks import check_estimator

from catenary.calibration.calibration import fit
from catenary.calibration.estimator import CalibrationRegressor
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.verdict.finding import FINDINGS


@pytest.mark.filterwarnings("ignore")
# a fixed offset alone is refused as a regression: it explains no slope
@pytest.mark.parametrize("model", ["linear", "polynomial", pytest.param("learned", marks=pytest.mark.slow)])
def test_scikit_learn_finds_nothing_wrong_with_it(model):
    # its tables of numbers are no motions of an arm
    results = check_estimator(CalibrationRegressor(model, accept=tuple(FINDINGS)), on_fail=None, on_skip=None)
    assert not [one["check_name"] for one in results if one["status"] not in ("passed", "skipped")]
    assert len(results) > 40


def recorded(rng, minutes=2.0):
    """Return reported positions [rad, m] with a load, and true ones: a line, the load's share, noise."""
    t = np.arange(0.0, 60.0 * minutes, 0.1)
    q = np.column_stack([np.sin(0.7 * t) + 0.3 * np.sin(2.3 * t + 1.0), 0.1 * np.cos(1.1 * t)])
    load = np.sin(0.4 * t + rng.uniform())
    truth = q * [1.02, 0.99] + [0.05, 0.003] + load[:, None] * [0.01, 0.0] + rng.normal(0.0, 1e-4, q.shape)
    return np.column_stack([q, load]), truth


def test_it_is_the_calibration_of_the_same_rows():
    X, y = recorded(np.random.default_rng(0))
    found = CalibrationRegressor("linear", units=("rad", "m")).fit(X, y)
    names = ("J1", "J2")
    ok = np.ones(len(X), dtype=bool)
    log = MotionLog("X", names, ("rad", "m"), X[:, :2], ok, y, signals={"load": X[:, 2]})
    assert_allclose(found.predict(X), fit(log, model="linear", inputs=["q", "load"], folds=0).predict(log), atol=1e-12)
    assert_allclose(found.predict(X), y, atol=1e-3)


def test_more_joints_than_positions_are_refused():
    X, y = recorded(np.random.default_rng(2))
    with pytest.raises(InputError, match="expected a reported position for each of 2 joints, got 1"):
        CalibrationRegressor("linear").fit(X[:, :1], y)
