import pickle
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.arrays import Floats
from catenary.calibration.corrector import Corrector
from catenary.calibration.model import CalibrationModel
from catenary.errors import InputError
from catenary.plant import JointState
from oracles.calibration_models import random_model

RNG = np.random.default_rng(0)
SIGNALS = np.cumsum(0.2 * RNG.normal(size=(200, 5)), axis=0)  # three positions, two torques
NAMES, UNITS = ("j0", "j1", "j2"), ("rad", "rad", "m")


def model(**options: object) -> CalibrationModel:
    return random_model("linear", SIGNALS, np.random.default_rng(1), joints=3, torques=2, **options)  # type: ignore[arg-type]


def state(q: Floats, tau: Floats) -> JointState:
    return JointState(0.0, q, np.zeros_like(q), tau, np.zeros(0), np.zeros(3), 0.0)


def test_history_at_a_multiple_of_the_training_rate_looks_as_far_back_in_time() -> None:
    slow = model(history=3, rate_hz=50.0)
    calibrated, flags = Corrector(slow, rate_hz=50.0).run(SIGNALS[:, :3], SIGNALS)
    held = np.repeat(SIGNALS, 20, axis=0)  # the same motion at 1 kHz, each row for 20 ticks
    corrector = Corrector(slow, rate_hz=1000.0)
    assert corrector.decimation == 20
    out, inside = corrector.run(held[:, :3], held)
    assert_array_equal(out[::20], calibrated)
    assert_array_equal(inside[::20], flags)


def test_play_states_need_no_rate() -> None:
    hysteretic = model(plays=2)
    calibrated, _ = Corrector(hysteretic).run(SIGNALS[:, :3], SIGNALS)
    held = np.repeat(SIGNALS, 7, axis=0)
    out, _ = Corrector(hysteretic, rate_hz=333.0).run(held[:, :3], held)
    assert_array_equal(out[::7], calibrated)


@pytest.mark.parametrize(
    ("trained", "options", "message"),
    [
        (40.0, {"rate_hz": 66.0}, r"0\.025 s apart \(40 Hz\); 2 tick\(s\) at 66 Hz are 0\.0303 s"),
        (50.0, {"decimation": 10}, r"previous positions lie 0\.02 s apart"),
        (2000.0, {}, "more than 3% off"),
        (None, {}, r"takes 2 previous positions, .* give `decimation`"),
        (50.0, {"rate_hz": 0.0}, "rate_hz: expected a positive"),
        (50.0, {"decimation": 0}, "decimation: expected one or more"),
    ],
)
def test_rates_at_which_history_would_be_another_are_refused(
    trained: float | None, options: dict[str, float], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        Corrector(model(history=2, rate_hz=trained), **options)  # type: ignore[arg-type]


def test_a_few_per_cent_of_rate_are_taken_and_a_decimation_that_is_said() -> None:
    assert Corrector(model(history=2, rate_hz=30.0), rate_hz=1000.0).decimation == 33
    assert Corrector(model(history=2, rate_hz=None), decimation=33).decimation == 33


def test_reset_forgets_previous_ticks() -> None:
    remembering = model(history=2, plays=1, rate_hz=1000.0)
    corrector = Corrector(remembering)
    first = corrector.run(SIGNALS[:, :3], SIGNALS)
    corrector.run(SIGNALS[::-1, :3], SIGNALS[::-1])
    again = corrector.run(SIGNALS[:, :3], SIGNALS)
    assert_array_equal(first[0], again[0])
    assert_array_equal(first[1], again[1])


def test_nan_among_previous_positions_clears_the_flag_for_as_long_as_it_is_one() -> None:
    corrector = Corrector(model(history=3, rate_hz=1000.0))
    still = np.tile(np.median(SIGNALS, axis=0), (20, 1))
    broken = still.copy()
    broken[10, 0] = np.nan
    _, sound = corrector.run(still[:, :3], still)
    _, inside = corrector.run(still[:, :3], broken)
    assert sound[3:].all()
    assert not inside[10:14].any()
    assert inside[14:].all()


def test_nan_before_the_first_number_does_not_stick_in_the_play_states() -> None:
    corrector = Corrector(model(plays=2))
    late = SIGNALS.copy()
    late[:5] = np.nan
    out, _ = corrector.run(late[:, :3], late)
    expected, _ = corrector.run(SIGNALS[5:, :3], SIGNALS[5:])
    assert np.isnan(out[:5]).all()
    assert_array_equal(out[5:], expected)


def test_unmeasured_joint_is_outside_the_valid_range() -> None:
    corrector = Corrector(model())
    q = SIGNALS[:3, :3].copy()
    q[1, 2] = np.nan
    _, inside = corrector.run(q, np.tile(np.median(SIGNALS, axis=0), (3, 1)))
    assert inside[1].tolist() == [True, True, False]


def test_joint_state_of_a_robot_with_more_joints_in_another_order() -> None:
    corrector = Corrector(model(history=1, plays=1, rate_hz=1000.0))
    corrector.prepare(["wrist", "j2", "j0", "j1"], ["rad", "m", "rad", "rad"], 1000.0)
    expected, flags = corrector.run(SIGNALS[:, :3], SIGNALS)
    corrector.reset()
    out, inside = np.empty(4), np.empty(4, dtype=bool)
    for k, row in enumerate(SIGNALS):
        q = np.array([7.0, row[2], row[0], row[1]])
        tau = np.array([9.0, 0.0, row[3], row[4]])
        corrector.correct_state(state(q, tau), out, inside)
        assert_array_equal(out, [7.0, expected[k, 2], expected[k, 0], expected[k, 1]])
        assert_array_equal(inside, [True, flags[k, 2], flags[k, 0], flags[k, 1]])


def test_calibrated_positions_may_overwrite_the_reported_ones() -> None:
    corrector = Corrector(model())
    expected, _ = corrector.run(SIGNALS[:1, :3], SIGNALS[:1])
    q = SIGNALS[0, :3].copy()
    corrector.correct(q, SIGNALS[0], q, np.empty(3, dtype=bool))
    assert_array_equal(q, expected[0])


FEATURES = model().features
HOT = replace(FEATURES, signals=(*FEATURES.signals[:4], "motor_temperature"))


@pytest.mark.parametrize(
    ("made", "robot", "message"),
    [
        (model(), (NAMES[:2], UNITS[:2], 1000.0), 'the robot has no joint "j2"; it has j0, j1'),
        (model(), (NAMES, ("rad",) * 3, 1000.0), 'joint "j2" is in rad, the model in m'),
        (replace(model(), features=HOT), (NAMES, UNITS, 1e3), '"motor_temperature" is in no joint state'),
        (model(history=1, rate_hz=50.0), (NAMES, UNITS, 500.0), "made for 1000 Hz, the loop runs at 500 Hz"),
    ],
)
def test_robots_that_a_model_is_not_of_are_refused(made: CalibrationModel, robot: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        Corrector(made).prepare(*robot)


def test_without_history_any_rate_does() -> None:
    Corrector(model(), rate_hz=1000.0).prepare(NAMES, UNITS, 500.0)


def test_arrays_that_cannot_be_taken_are_refused() -> None:
    fixed, inside = np.zeros(3), np.empty(3, dtype=bool)
    fixed.setflags(write=False)
    corrector = Corrector(model())
    with pytest.raises(InputError, match=r"signals: expected shape \(200, 5\), got \(200, 4\)"):
        corrector.run(SIGNALS[:, :3], SIGNALS[:, :4])
    with pytest.raises(ValueError, match="read-only"):
        corrector.correct(np.zeros(3), np.zeros(5), fixed, inside)
    with pytest.raises(InputError, match="not of the robot that it was prepared for"):
        corrector.correct_state(state(np.zeros(3), np.zeros(3)), np.empty(3), inside)


@pytest.mark.parametrize("sizes", [(2, 5, 3, 3), (3, 4, 3, 3), (3, 5, 4, 3), (3, 5, 3, 2)])
def test_arrays_of_another_size_are_refused(sizes: tuple[int, int, int, int]) -> None:
    q, signals, out, inside = (np.zeros(size) for size in sizes)
    with pytest.raises(InputError, match=r"expected q_nominal \(3,\), signals \(5,\)"):
        Corrector(model()).correct(q, signals, out, inside.astype(bool))


def test_arrays_of_another_type_or_layout_are_copied() -> None:
    plain, corrector = model(history=1, rate_hz=1000.0), Corrector(model(history=1, rate_hz=1000.0))
    q, signals = np.ascontiguousarray(SIGNALS[:, :3]), SIGNALS
    expected, flags = Corrector(plain).run(q, signals)
    apart, single = np.repeat(signals, 2, axis=1)[:, ::2], np.empty((3, 2))[:, 0]
    for k in range(50):
        inside = np.empty(3, dtype=bool) if k % 2 else np.empty(3)
        corrector.correct(np.asfortranarray(q)[k] if k % 3 else q[k], apart[k], single, inside)  # type: ignore[arg-type]
        assert_array_equal(single, expected[k])
        assert_array_equal(inside, flags[k])
    whole = Corrector(model())
    whole.correct(np.zeros(3, dtype=int), np.zeros(5, dtype=np.float32), np.empty(3), np.empty(3, dtype=bool))


def test_a_copy_has_a_memory_of_its_own() -> None:
    first = Corrector(model(history=2, rate_hz=1000.0))
    first.prepare(NAMES, ("rad", "rad", "m"), 1000.0)
    expected, _ = first.run(SIGNALS[:, :3], SIGNALS)
    first.reset()
    second, out, inside = deepcopy(first), np.empty(3), np.empty(3, dtype=bool)
    for k in range(20):
        first.correct(SIGNALS[k, :3].copy(), SIGNALS[k], out, inside)
        assert_array_equal(out, expected[k])
        second.correct(np.zeros(3), np.zeros(5), out, inside)


def test_a_bound_tick_runs_on_the_arrays_that_it_was_given() -> None:
    options = {"history": 2, "plays": 1, "rate_hz": 1000.0}
    expected, flags = Corrector(model(**options)).run(SIGNALS[:, :3], SIGNALS)
    q, signals, out, inside = np.empty(3), np.empty(5), np.empty(3), np.empty(3, dtype=bool)
    tick = Corrector(model(**options)).bind(q, signals, out, inside)
    for k in range(20):
        q[:], signals[:] = SIGNALS[k, :3], SIGNALS[k]
        tick()
        assert_array_equal(out, expected[k])
        assert_array_equal(inside, flags[k])


def test_arrays_that_cannot_be_bound_are_refused() -> None:
    q, signals, out, inside = np.empty(3), np.empty(5), np.empty(3), np.empty(3, dtype=bool)
    corrector = Corrector(model())
    with pytest.raises(InputError, match=r"expected q_nominal \(3,\), signals \(5,\), .* got \(3,\), \(4,\)"):
        corrector.bind(q, signals[:4], out, inside)
    with pytest.raises(InputError, match="overlaps"):
        corrector.bind(q, signals, q, inside)
    with pytest.raises(InputError, match="float32"):
        corrector.bind(q, signals, out.astype(np.float32), inside)


def test_a_pickled_corrector_goes_on_from_the_same_memory() -> None:
    corrector = Corrector(model(history=2, plays=1, rate_hz=1000.0))
    expected, _ = corrector.run(SIGNALS[:, :3], SIGNALS)
    corrector.run(SIGNALS[:50, :3], SIGNALS[:50])
    again, out = pickle.loads(pickle.dumps(corrector)), np.empty(3)
    again.correct(SIGNALS[50, :3], SIGNALS[50], out, np.empty(3, dtype=bool))
    assert_array_equal(out, expected[50])
