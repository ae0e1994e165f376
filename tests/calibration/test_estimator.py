"""A calibration holds to scikit-learn's conventions."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from sklearn.utils.estimator_checks import check_estimator

from catenary.calibration.calibration import fit
from catenary.calibration.estimator import CalibrationRegressor
from catenary.errors import InputError
from catenary.verdict.finding import FINDINGS
from recordings import recording


@pytest.mark.filterwarnings("ignore")
# a fixed offset alone is refused as a regression: it explains no slope
@pytest.mark.parametrize("model", ["linear", "polynomial", pytest.param("learned", marks=pytest.mark.slow)])
def test_scikit_learn_finds_nothing_wrong_with_it(model):
    # its tables of numbers are no motions of an arm
    results = check_estimator(CalibrationRegressor(model, accept=tuple(FINDINGS)), on_fail=None, on_skip=None)
    assert not [one["check_name"] for one in results if one["status"] not in ("passed", "skipped")]
    assert len(results) > 40


def test_it_is_the_calibration_of_the_same_rows_and_wants_a_position_for_each_joint():
    load = np.sin(0.4 * np.arange(300))
    log = recording(np.random.default_rng(0), units=("rad", "m"), error=lambda q: 0.02 * q + 0.01 * load[:, None],
                    signals={"load": load})  # fmt: skip
    X = np.column_stack([log.q_nominal, load])
    found = CalibrationRegressor("linear", units=("rad", "m")).fit(X, log.q_encoder).predict(X)
    assert_allclose(found, fit(log, model="linear", inputs=["q", "load"], folds=0).predict(log), atol=1e-12)
    assert_allclose(found, log.q_encoder, atol=1e-12)
    with pytest.raises(InputError, match="expected a reported position for each of 2 joints, got 1"):
        CalibrationRegressor("linear").fit(X[:, :1], log.q_encoder)
