from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from catenary.arrays import Floats
from catenary.calibration.corrector import Corrector
from catenary.calibration.dataset import calibration_data
from catenary.calibration.features import FeatureSet
from catenary.calibration.fit import FitOptions, choose_inputs, fit
from catenary.calibration.leaps import MARGIN, largest_step, room_of
from catenary.errors import InputError
from catenary.plant import MotionLog

T = np.arange(800) / 50.0
SLOW = 0.5 * np.sin(0.5 * T)
STEP = 0.02  # SLOW moves by 0.005 a row
PLAIN = FeatureSet(("q:J1",), ("rad",), play=(("q:J1", 0.05), ("q:J1", 0.2)))
LIMITED = replace(PLAIN, steps=(("q:J1", STEP),), period=0.02)
repeatable = settings(derandomize=True, deadline=None, max_examples=25)  # the first call compiles


def log_of(q: Floats, time: Floats | None = T, **more: Any) -> MotionLog:
    return MotionLog("run", ("J1",), ("rad",), q[:, None], np.ones(len(q), dtype=bool), time=time, **more)


def spiked(rows: list[int], to: float = 3.0) -> Floats:
    q = SLOW.copy()
    q[rows] = to
    return q


@pytest.mark.parametrize("to", [3.0, -0.4, 1e300])
def test_a_spike_leaves_no_trace_in_the_rows_after_it(to: float) -> None:
    X, leaps = LIMITED.matrix_and_leaps(log_of(spiked([300], to)))
    clean = LIMITED.matrix(log_of(SLOW))
    assert leaps == {"q:J1": 1}
    assert X[300, 0] == to
    assert np.all(np.abs(X[300, 1:]) <= [0.05, 0.2])
    assert_array_equal(np.delete(X, 300, axis=0), np.delete(clean, 300, axis=0))


def test_without_limits_play_states_follow_a_spike() -> None:
    X, leaps = PLAIN.matrix_and_leaps(log_of(spiked([300], -3.0)))  # while the joint falls
    assert leaps == {"q:J1": 0}
    assert not np.array_equal(X[301:320], PLAIN.matrix(log_of(SLOW))[301:320])


@repeatable
@given(st.lists(st.floats(-STEP, STEP), min_size=1, max_size=60))
def test_no_motion_within_the_limits_changes_a_bit(moves: list[float]) -> None:
    q = 0.999999 * np.cumsum(moves)  # sums are rounded
    log = log_of(q, None)
    X, leaps = LIMITED.matrix_and_leaps(log)
    assert leaps == {"q:J1": 0}
    assert_array_equal(X, PLAIN.matrix(log))


@repeatable
@given(st.sets(st.integers(1, 798), max_size=20), st.floats(2.0, 1e6))
def test_single_spikes_are_counted_and_count_as_rows_that_were_not_there(rows: set[int], to: float) -> None:
    alone = sorted(row for row in rows if not rows & {row - 1, row - 2})
    X, leaps = LIMITED.matrix_and_leaps(log_of(spiked(alone, to)))
    assert leaps == {"q:J1": len(alone)}
    held = SLOW.copy()
    held[alone] = SLOW[np.array(alone, dtype=int) - 1]
    kept = np.delete(np.arange(800), alone)
    assert_array_equal(X[kept], PLAIN.matrix(log_of(held))[kept])


def test_a_leap_that_stays_is_the_truth_from_its_third_row_on() -> None:
    moved = SLOW + 1.0 * (T > 5.0)
    first = int(np.argmax(T > 5.0))
    X, leaps = LIMITED.matrix_and_leaps(log_of(moved))
    assert leaps == {"q:J1": 2}
    held = moved.copy()
    held[first : first + 2] = SLOW[first - 1]
    assert_array_equal(X[first + 2 :], PLAIN.matrix(log_of(held))[first + 2 :])


def test_garbage_is_no_truth_however_long_it_lasts_and_the_joint_is_found_again() -> None:
    q = SLOW.copy()
    q[300:310] = np.where(np.arange(10) % 2, 5.0, -5.0)
    X, leaps = LIMITED.matrix_and_leaps(log_of(q))
    assert leaps == {"q:J1": 10}
    assert_array_equal(X[310:], LIMITED.matrix(log_of(SLOW))[310:])


def test_a_pause_gives_room_to_move() -> None:
    time, q = np.delete(T, np.s_[300:320]), np.delete(SLOW, np.s_[300:320])
    assert room_of(log_of(q, time), 0.02)[300] == pytest.approx(21.0)
    X, leaps = LIMITED.matrix_and_leaps(log_of(q, time))
    assert leaps == {"q:J1": 0}
    assert_array_equal(X, PLAIN.matrix(log_of(q, time)))


def test_limits_come_from_the_joints_fastest_step_and_not_from_spikes() -> None:
    alone, room = largest_step([(SLOW, np.ones(800))]), np.ones(800)
    assert alone == pytest.approx(MARGIN * np.abs(np.diff(SLOW)).max(), rel=1e-3)
    assert largest_step([(spiked([100, 500]), room)]) == pytest.approx(alone, rel=0.1)
    moved = np.where(T > 5.0, 1.0, 0.0)  # a step that stays is a motion
    assert largest_step([(moved, room)]) == MARGIN


@pytest.mark.parametrize("rate_hz", [50.0, 1000.0])
def test_model_corrector_and_evaluation_reject_the_same_leap(rate_hz: float) -> None:
    held = round(rate_hz / 50.0)
    log = log_of(SLOW, q_encoder=1.01 * SLOW[:, None])
    options = FitOptions(kind="linear", inputs=["q"], play=(0.05, 0.2))
    inputs = choose_inputs([log], options)
    assert dict(inputs.features.steps)["q:J1"] == pytest.approx(0.005 * MARGIN, rel=0.01)
    model = fit(calibration_data([log], inputs.features), inputs, options)
    bad = replace(log, q_nominal=spiked([300])[:, None])
    assert calibration_data([bad], inputs.features).sources[0].leaps == 1
    q = np.repeat(bad.q_nominal, held, axis=0)
    q[300 * held + 1 : 301 * held] = SLOW[299]  # one sample at any rate
    corrector = Corrector(model, rate_hz=rate_hz)
    out, inside = corrector.run(q, q)
    assert corrector.leaps == {"q:J1": 1}
    assert not inside[300 * held].any()
    assert_array_equal(np.delete(out[::held], 300, axis=0), np.delete(model.calibrate(log), 300, axis=0))


@pytest.mark.parametrize("step", [0.0, -1.0, np.nan, np.inf])
def test_limits_that_make_no_sense_are_refused(step: float) -> None:
    with pytest.raises(InputError, match="steps: expected positive limits"):
        replace(PLAIN, steps=(("q:J1", step),))
