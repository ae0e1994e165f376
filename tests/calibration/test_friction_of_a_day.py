"""The level of friction of another day, on a simulated wrist whose law is known."""

import numpy as np
import pytest

from catenary.calibration.dataset import calibration_data
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.friction_fit import find_friction
from catenary.calibration.friction_states import Matrix
from catenary.calibration.model import CalibrationModel
from catenary.calibration.model_refresh import FRICTION_LEVEL, Refreshed, refresh_model
from catenary.calibration.recordings import Recordings
from catenary.plant import MotionLog
from recordings import coupled_arm, fitted

MINUTES = 400  # rows


@pytest.fixture(scope="module")
def model() -> CalibrationModel:
    log, options = coupled_arm(), FitOptions(coupled=("J5", "J6"))
    return fitted(log, kind="learned", friction=find_friction(Recordings.of([log]), options))


def errors(model: CalibrationModel, log: MotionLog) -> np.ndarray:
    """RMS errors on the rows that come after the minutes of a refresh [rad]."""
    data = calibration_data([log], model.features)
    left = (data.error - model.correction(data.X, data.q_nominal))[MINUTES:]
    return np.sqrt(np.mean(left**2, axis=0))


def refreshed_by(model: CalibrationModel, minutes: MotionLog) -> Refreshed:
    return refresh_model(model, calibration_data([minutes], model.features), Recordings.of([minutes]))


def thresholds(model: CalibrationModel) -> Matrix:
    assert model.features.friction is not None
    return model.features.friction.thresholds


@pytest.mark.parametrize("level", [0.6, 1.3])
def test_minutes_take_the_model_to_the_level_of_their_day(model, level) -> None:
    log = coupled_arm(seed=3, level=level)
    minutes = log.part(0, MINUTES)
    refreshed = refreshed_by(model, minutes)
    factors = np.divide(thresholds(refreshed.model), thresholds(model))[0]
    assert np.log(factors) == pytest.approx(np.log(level), abs=0.05)  # 400 rows
    before, after = errors(model, log), errors(refreshed.model, log)
    assert (after[2:] < 0.1 * before[2:]).all()
    assert (after < 1.05 * before).all()
    changes = {change.name: change for change in refreshed.changes}
    assert all(changes[name].change.startswith(FRICTION_LEVEL) for name in ("J5", "J6"))
    # what is said of minutes that no fit saw, and of the old model on them
    truth = np.rad2deg(after[2:])
    assert ([changes[n].rmse_low for n in ("J5", "J6")] < 1.15 * truth).all()
    assert ([changes[n].rmse_high for n in ("J5", "J6")] > 0.85 * truth).all()
    old = calibration_data([minutes], model.features)
    left = np.sqrt(np.mean((old.error - model.correction(old.X, old.q_nominal)) ** 2, axis=0))
    assert [change.rmse_before for change in refreshed.changes] == pytest.approx(np.rad2deg(left))
    assert any(note.startswith("friction of this day over the model's: J5 ") for note in refreshed.notes)


def test_a_day_of_the_same_friction_shows_no_other(model) -> None:
    refreshed = refreshed_by(model, coupled_arm(seed=4, rows=MINUTES))
    assert thresholds(refreshed.model) == thresholds(model)
    assert not any(FRICTION_LEVEL in change.change for change in refreshed.changes)
