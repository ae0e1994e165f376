"""The level of friction of another day, on a simulated wrist whose law is known."""

import numpy as np
import pytest

from catenary.calibration.cable_search import find_friction, play_states
from catenary.calibration.dataset import calibration_data
from catenary.calibration.features import Matrix
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.model import CalibrationModel
from catenary.calibration.model_refresh import FRICTION, UNCHANGED, ZERO_AND_SCALE, Refreshed, refresh_model
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
    assert all(changes[name].change.startswith(FRICTION) for name in ("J5", "J6"))
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
    assert not any(FRICTION in change.change for change in refreshed.changes)


def a_joint_with_slack(seed: int, *, friction: float = 1.0, zero: float = 0.0, rows: int = 3000) -> MotionLog:
    rng, time = np.random.default_rng(seed), np.arange(rows) / 30.0
    q = np.sin(0.9 * time + rng.uniform(0.0, 6.0)) + 0.5 * np.sin(0.37 * time + rng.uniform(0.0, 6.0))
    lag = 0.01 * play_states(q, np.array([0.03]))[:, 0] / 0.03
    truth = q + 0.02 * np.cos(q) + friction * lag + zero + 2e-4 * rng.standard_normal(rows)
    return MotionLog("day", ("J1",), ("rad",), q[:, None], np.ones(rows, dtype=bool), truth[:, None], time)


@pytest.mark.parametrize(
    ("friction", "zero", "change"),
    [(1.0, 0.0, UNCHANGED), (1.5, 0.0, FRICTION), (1.0, 0.01, ZERO_AND_SCALE), (1.5, 0.01, f"{FRICTION} and zero")],
)
def test_a_day_is_told_as_friction_or_zero_and_scale_or_both(friction: float, zero: float, change: str) -> None:
    model, day = fitted(a_joint_with_slack(0), kind="learned"), a_joint_with_slack(1, friction=friction, zero=zero)
    refreshed = refresh_model(model, calibration_data([day], model.features))
    assert [joint.change for joint in refreshed.changes] == [change]
    told = [float(note.split()[-1]) for note in refreshed.notes if note.startswith("friction of this day")]
    assert told == pytest.approx([friction] * (FRICTION in change), abs=0.05)
    rest = a_joint_with_slack(2, friction=friction, zero=zero)
    assert rest.q_encoder is not None
    assert np.std((rest.q_encoder - refreshed.model.calibrate(rest))[300:]) < 5e-4
