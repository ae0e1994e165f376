from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from sklearn.ensemble import HistGradientBoostingRegressor

from catenary.arrays import Floats
from catenary.calibration.dataset import CalibrationData, calibration_data
from catenary.calibration.intervals import Intervals
from catenary.calibration.model import CalibrationModel
from catenary.calibration.model_refresh import ZERO_AND_SCALE, refresh_model
from catenary.errors import InputError
from catenary.plant import MotionLog
from recordings import fitted

KINDS: dict[str, dict[str, Any]] = {
    **{kind: {"kind": kind} for kind in ("offset", "linear", "polynomial", "neural", "learned")},
    "position": {"kind": "linear", "target": "position"},
    "own": {"kind": "own", "estimator": HistGradientBoostingRegressor(max_iter=30)},
}
BEND = np.array([[0.03, -0.02], [0.01, 0.05]])
NOISE = 1e-3


def a_day(seed: int, rows: int, *, zero: Floats | float = 0.0, slope: float = 0.0) -> MotionLog:
    """Motion of two joints whose error is linear in their positions, with a drift of joint 2."""
    rng = np.random.default_rng(seed)
    time = np.arange(rows) / 30.0
    phase = rng.uniform(0.0, 6.0, (2, 2))
    q = np.column_stack([np.sin(0.7 * time + phase[0, 0]), np.sin(0.31 * time + phase[1, 0])])
    drift = np.zeros((rows, 2))
    drift[:, 1] = zero + slope * q[:, 1]
    error = q @ BEND + drift + NOISE * rng.standard_normal((rows, 2))
    return MotionLog("day", ("J1", "J2"), ("rad", "m"), q, np.ones(rows, dtype=bool), q + error, time)


def rows_of(model: CalibrationModel, log: MotionLog) -> CalibrationData:
    return calibration_data([log], model.features)


@pytest.fixture(scope="module")
def models() -> dict[str, CalibrationModel]:
    return {name: fitted(a_day(0, 3000), **options) for name, options in KINDS.items()}


def rmse(model: CalibrationModel, log: MotionLog) -> Floats:
    data = rows_of(model, log)
    left = data.error - model.correction(data.X, data.q_nominal)
    return np.asarray(np.sqrt(np.mean(left**2, axis=0)))


@pytest.mark.parametrize("kind", ["linear", "polynomial", "neural", "position"])
def test_a_corner_of_the_motion_does_not_turn_the_rest(models: dict[str, CalibrationModel], kind: str) -> None:
    whole = a_day(3, 1800)
    q = np.array([0.6, 0.7]) + 0.05 * whole.q_nominal  # a twentieth of what the model was trained on
    ripple = 0.01 * np.sin(40.0 * q)  # steep there, and nothing over the whole motion
    corner = replace(whole, q_nominal=q, q_encoder=q + q @ BEND + ripple)
    old, rest = models[kind], a_day(4, 3000)
    refreshed = refresh_model(old, rows_of(old, corner)).model
    # a slope of 0.4 would be off by 0.3 at the other end
    assert (rmse(refreshed, rest) < 0.03).all()


@pytest.mark.parametrize("kind", ["linear", "polynomial", "neural", "position", "own"])
def test_a_new_zero_is_found_in_a_minute_and_the_other_joint_is_left(
    models: dict[str, CalibrationModel], kind: str
) -> None:
    old, new_day = models[kind], a_day(1, 1800, zero=0.02)
    refreshed = refresh_model(old, rows_of(old, new_day))
    first, second = refreshed.changes
    assert second.change == ZERO_AND_SCALE
    assert abs(first.moved) < 2.0 * np.rad2deg(NOISE)
    assert_allclose(second.moved, 20.0, atol=1.0)  # the models' own errors, means of 1800 rows of noise
    rest = a_day(2, 9000, zero=0.02)
    assert rmse(refreshed.model, rest)[1] < 0.15 * rmse(old, rest)[1]


@pytest.mark.parametrize("kind", ["linear", "polynomial", "neural", "position", "offset"])
def test_a_slope_is_found(models: dict[str, CalibrationModel], kind: str) -> None:
    old = models[kind]
    refreshed = refresh_model(old, rows_of(old, a_day(3, 1800, slope=0.1)))
    assert refreshed.changes[1].change == ZERO_AND_SCALE
    rest = a_day(4, 9000, slope=0.1)
    assert rmse(refreshed.model, rest)[1] < 0.3 * rmse(old, rest)[1]


def test_a_joint_on_one_side_of_its_slack_hardly_moves_the_zero() -> None:
    """A joint that never turned back shows a zero or a side; the claimed error says how large a side may be."""
    slack, time = 0.03, np.arange(6000) / 30.0
    q = np.column_stack([np.sin(0.7 * time), np.sin(0.31 * time)])
    side = slack * np.sign(np.gradient(q, axis=0))
    log = MotionLog("day", ("J1", "J2"), ("rad", "m"), q, np.ones(len(q), dtype=bool), q + side, time)
    model = replace(fitted(log), intervals=Intervals(0.9, np.full(2, 1.64 * slack), np.full(2, 1.64 * slack)))
    one_way = log.part(470, 740)
    assert (np.diff(one_way.q_nominal[:, 1]) > 0.0).all()
    refreshed = refresh_model(model, rows_of(model, one_way)).model
    assert rmse(refreshed, log)[1] < 1.15 * rmse(model, log)[1]  # half a slack more is 1.12
    homed = replace(log, q_encoder=log.q_encoder + 0.02)
    assert_allclose(refresh_model(model, rows_of(model, homed)).model.offset - model.offset, 0.02, rtol=0.15)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=6)
def test_a_day_without_drift_costs_no_accuracy(models: dict[str, CalibrationModel], seed: int) -> None:
    old = models["linear"]
    refreshed = refresh_model(old, rows_of(old, a_day(seed, 900))).model
    rest = a_day(seed + 1, 3000)
    assert (rmse(refreshed, rest) < 1.05 * rmse(old, rest)).all()


def test_rows_outside_are_told_and_change_nothing_else(models: dict[str, CalibrationModel]) -> None:
    old, log = models["linear"], a_day(6, 1800)
    q = 6.0 * log.q_nominal
    error = np.where((np.abs(q) < 4.0).all(axis=1, keepdims=True), q @ BEND, 0.3)
    data = rows_of(old, replace(log, q_nominal=q, q_encoder=q + error))
    refreshed = refresh_model(old, data)
    assert (refreshed.model.inside(data.X) == old.inside(data.X)).all()
    assert any("lie outside" in note for note in refreshed.notes)
    assert (rmse(refreshed.model, a_day(7, 900)) < 1.2 * rmse(old, a_day(7, 900))).all()


def test_intervals_are_the_wider_of_both_days(models: dict[str, CalibrationModel]) -> None:
    edge = np.array([10.0 * NOISE, 20.0 * NOISE])
    old = replace(models["linear"], intervals=Intervals(0.9, np.array([1e-6, 10.0 * NOISE]), edge))
    new = refresh_model(old, rows_of(old, a_day(8, 1800))).model.intervals
    assert new is not None
    # 90 % of normal errors lie within 1.64 standard deviations; blocks differ by chance
    assert NOISE < new.inside[0] < 2.5 * NOISE
    assert new.inside[1] == 10.0 * NOISE


@pytest.mark.parametrize("kind", KINDS)
def test_arm_that_drifted_farther_than_any_correction_was_is_believed_again(
    models: dict[str, CalibrationModel], kind: str
) -> None:
    old, drifted = models[kind], a_day(9, 1800, zero=0.5)
    assert (old.largest < 0.1).all()
    refreshed, data = refresh_model(old, rows_of(old, drifted)).model, rows_of(old, a_day(10, 1800, zero=0.5))
    assert refreshed.correct(data.X, data.q_nominal)[1].all()
    assert 0.5 < refreshed.largest[1] < 0.7
    assert (refreshed.largest >= old.largest).all()


def test_too_few_rows_are_refused(models: dict[str, CalibrationModel]) -> None:
    old = models["linear"]
    with pytest.raises(InputError, match="30 usable rows of the new day, expected at least 40"):
        refresh_model(old, rows_of(old, a_day(7, 30)))
