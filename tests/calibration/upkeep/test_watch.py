import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.arrays import Floats
from catenary.calibration.files import load_model, save_model
from catenary.calibration.fit import FitOptions
from catenary.calibration.fitting import FitResult, FitRun, fit_logs
from catenary.calibration.trained_day.day import UsualBounds
from catenary.calibration.upkeep.learn_day import on_new_day, prediction_bounds, share_bounds
from catenary.calibration.upkeep.watch import DriftWatch, WatchResult
from catenary.errors import FileFormatError, InputError
from catenary.plant import MotionLog
from catenary.recording.raven_transmission import COUNTS_PER_RADIAN, RATIO, shift_of

RATE = 20.0
NAMES, UNITS = ("shoulder", "elbow", "insertion"), ("rad", "rad", "m")


def a_day(seed: int, seconds: float = 300.0, *, load: float = 0.0, counts: float = 0.0) -> MotionLog:
    """Sinusoids of three joints; torque by a law of gravity and friction, an elbow homed some counts away."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    phase = rng.uniform(0.0, 6.0, 3)
    reach, rates = np.array([0.5, 0.4, 0.05]), np.array([1.1, 0.73, 0.91])
    q = reach * np.sin(time[:, None] * rates + phase)
    tau = np.column_stack(
        [(2.0 + load) * np.cos(q[:, 0]), (1.0 + load) * np.sin(q[:, 1]), (5.0 + load) * np.ones(len(q))]
    )
    tau += 0.3 * np.sign(np.cos(time[:, None] * rates + phase)) + 0.05 * rng.standard_normal(q.shape)
    zeros = np.zeros(len(q))
    offsets = {
        "encoffsets:shoulder": zeros,
        "encoffsets:elbow": zeros + counts,
        "encoffsets:insertion": zeros,
    }
    truth = q + 0.02 * q + 1e-3 * reach * rng.standard_normal(q.shape)
    return MotionLog(
        f"day {seed}", NAMES, UNITS, q, np.ones(len(q), dtype=bool), truth, time, tau=tau, signals=offsets,
    )  # fmt: skip


@pytest.fixture(scope="module")
def monday() -> FitResult:
    return fit_logs([a_day(0)], FitOptions(kind="linear", inputs=("q",)), FitRun())


def watched(result: FitResult, log: MotionLog, *, registered: bool = True) -> WatchResult:
    watch = DriftWatch(result.model, log.joint_names, log.joint_units)
    if registered:
        watch.registered(0.0, shift_of([log.signals[f"encoffsets:{name}"][0] for name in NAMES]))
    inside = result.model.inside(result.model.features.matrix(log))
    assert log.time is not None
    assert log.tau is not None
    for time, q, tau, flags in zip(log.time, log.q_nominal, log.tau, inside, strict=True):
        watch.update(float(time), q, tau, flags)
    return watch.result()


def test_another_day_of_the_same_robot_raises_nothing(monday: FitResult) -> None:
    found = watched(monday, a_day(1))
    assert not found.flags
    assert not found.not_watched
    assert found.windows >= 18


def test_a_load_is_seen_in_the_torque(monday: FitResult) -> None:
    flags = watched(monday, a_day(1, load=0.5)).flags
    assert {flag.aspect for flag in flags} == {"torque"}
    (third,) = (flag for flag in flags if flag.joint == "insertion")
    assert re.match(
        r"insertion takes \+0\.(49|5) N against what training saw in the same motion", third.reason
    )


def test_a_homing_elsewhere_is_told_in_the_joints_own_unit(monday: FitResult) -> None:
    two_degrees = -np.deg2rad(2.0) * RATIO["elbow"] * COUNTS_PER_RADIAN
    (flag,) = (f for f in watched(monday, a_day(1, counts=two_degrees)).flags if f.joint == "elbow")
    assert flag.aspect == "homing"
    assert "+2 deg away" in flag.reason


def test_counts_that_began_anew_say_nothing(monday: FitResult) -> None:
    found = watched(monday, a_day(1, counts=1e6))
    assert not found.flags
    assert any("count from elsewhere" in why for why in found.not_watched)


def test_motion_beyond_the_valid_range_is_seen(monday: FitResult) -> None:
    log = a_day(1)
    found = watched(monday, replace(log, q_nominal=log.q_nominal * [1.0, 6.0, 1.0]))
    assert ("elbow", "range") in {(flag.joint, flag.aspect) for flag in found.flags}
    assert any(
        why.startswith("torque: the robot moves where the training did not") for why in found.not_watched
    )


def test_what_cannot_be_watched_is_said(monday: FitResult) -> None:
    short = watched(monday, a_day(1, seconds=20.0), registered=False)
    assert any("of which 1 ended" in why for why in short.not_watched)
    assert any("not told its encoders' offsets" in why for why in short.not_watched)
    bare = fit_logs([replace(a_day(0), tau=None, signals={})], FitOptions(kind="linear"), FitRun(folds=0))
    day = bare.model.trained_day
    assert day is not None
    assert len(day.not_watched) == 3
    timeless = fit_logs([replace(a_day(0), time=None)], FitOptions(kind="linear", inputs=("q",)), FitRun())
    assert timeless.model.trained_day is None
    assert "anything" in watched(timeless, a_day(1)).not_watched[0]


def test_torques_that_are_missing_are_no_drift(monday: FitResult) -> None:
    log = a_day(1)
    watch = DriftWatch(monday.model, NAMES, UNITS)
    assert log.time is not None
    for time, q in zip(log.time, log.q_nominal, strict=True):
        watch.update(float(time), q, np.full(3, np.nan), np.ones(3, dtype=bool))
    assert not watch.result().flags
    assert any("or reports none" in why for why in watch.result().not_watched)


def test_joints_are_matched_by_name(monday: FitResult) -> None:
    log = a_day(1, load=0.5)
    order = [2, 0, 1]
    watch = DriftWatch(monday.model, [NAMES[j] for j in order], [UNITS[j] for j in order])
    assert log.time is not None
    assert log.tau is not None
    for time, q, tau in zip(log.time, log.q_nominal, log.tau, strict=True):
        watch.update(float(time), q[order], tau[order], np.ones(3, dtype=bool))
    assert {(f.joint, f.aspect) for f in watch.result().flags} == {
        (f.joint, f.aspect) for f in watched(monday, log, registered=False).flags
    }
    with pytest.raises(InputError, match='no joint "elbow"'):
        DriftWatch(monday.model, ("shoulder", "insertion"), ("rad", "m"))


def test_a_file_keeps_the_day(monday: FitResult, tmp_path: Path) -> None:
    save_model(monday.model, monday.card, tmp_path / "m.npz")
    read, card = load_model(tmp_path / "m.npz")
    day, old = read.trained_day, monday.model.trained_day
    assert day is not None
    assert old is not None
    assert day.torque is not None
    assert old.torque is not None
    assert card["watch"]["watched"] == ["homing", "torque", "range"]
    assert_allclose(day.torque.predictor.quadratic, old.torque.predictor.quadratic, rtol=0.0)
    log = a_day(2, load=0.5)
    again = replace(monday, model=read)
    assert watched(again, log) == watched(monday, log)


def test_a_damaged_day_is_refused(monday: FitResult, tmp_path: Path) -> None:
    path = tmp_path / "m.npz"
    save_model(monday.model, monday.card, path)
    arrays = dict(np.load(path))
    np.savez(path, **(arrays | {"day.usual.lower": arrays["day.usual.upper"] + 1.0}))
    with pytest.raises(FileFormatError, match="bounds"):
        load_model(path)
    np.savez(path, **{name: values for name, values in arrays.items() if name != "day.reach"})
    with pytest.raises(FileFormatError, match="reach"):
        load_model(path)


def test_a_refreshed_models_watch_takes_the_new_day_as_usual(monday: FitResult) -> None:
    counts = -np.deg2rad(2.0) * RATIO["elbow"] * COUNTS_PER_RADIAN
    tuesday = on_new_day(monday.model, [a_day(3, seconds=120.0, load=0.5, counts=counts)])
    refreshed = replace(monday, model=tuesday)
    assert not [f for f in watched(refreshed, a_day(4, counts=counts)).flags if f.aspect == "homing"]
    third = [f for f in watched(refreshed, a_day(4, load=0.5, counts=counts)).flags if f.joint == "insertion"]
    assert not third
    assert [f for f in watched(refreshed, a_day(4, counts=counts)).flags if f.joint == "insertion"]


@given(st.integers(0, 2**32 - 1), st.integers(8, 40))
@settings(max_examples=25, deadline=None)
def test_bounds_hold_further_values_of_a_normal_distribution(seed: int, windows: int) -> None:
    rng = np.random.default_rng(seed)
    values: Floats = 3.0 + 0.1 * rng.standard_normal((windows + 1, 200))
    bounds = prediction_bounds(values[:-1])
    # 200 columns, each beyond by chance one time in 10,000: three are beyond once in a million
    assert np.count_nonzero(bounds.beyond(values[-1])) <= 2


def test_shares_that_never_occurred_are_bounded_by_the_rule_of_three() -> None:
    assert_allclose(share_bounds(np.zeros((20, 2))), [0.15, 0.15])
    assert_allclose(share_bounds(np.tile([[0.0], [1.0]], (5, 1))), [1.0])


def test_bounds_tell_sides_apart() -> None:
    bounds = UsualBounds(np.array([-1.0, 0.0]), np.array([1.0, 0.0]))
    assert_allclose(bounds.beyond(np.array([-1.5, 0.2])), [-0.5, 0.2])
    with pytest.raises(InputError, match="above"):
        UsualBounds(np.array([1.0]), np.array([0.0]))
