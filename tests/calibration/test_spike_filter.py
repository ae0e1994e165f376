from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.arrays import Floats
from catenary.calibration.corrector import Corrector
from catenary.calibration.dataset import calibration_data
from catenary.calibration.features import FeatureSet
from catenary.calibration.intervals import Intervals
from catenary.calibration.spike_filter import _STEP_MARGIN, largest_step, room_of
from catenary.errors import InputError
from catenary.plant import MotionLog
from oracles.calibration_models import ticked
from recordings import fitted

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
    X, leaping, leaps = LIMITED.rows(log_of(spiked([300], to)))
    clean = LIMITED.matrix(log_of(SLOW))
    assert leaps == {"q:J1": 1}
    assert X[300, 0] == to
    assert np.all(np.abs(X[300, 1:]) <= np.array([0.05, 0.2]) + 1e-15)  # rounding of 3.0 - 0.2
    assert np.flatnonzero(leaping).tolist() == [300]
    assert_array_equal(np.delete(X, 300, axis=0), np.delete(clean, 300, axis=0))


@repeatable
@given(st.lists(st.floats(-STEP, STEP), min_size=1, max_size=60))
def test_no_motion_within_the_limits_changes_a_bit(moves: list[float]) -> None:
    q = 0.999999 * np.cumsum(moves)  # sums are rounded
    log = log_of(q, None)
    X, _, leaps = LIMITED.rows(log)
    assert leaps == {"q:J1": 0}
    assert_array_equal(X, PLAIN.matrix(log))


@repeatable
@given(st.sets(st.integers(1, 798), max_size=20), st.floats(2.0, 1e6))
def test_single_spikes_are_counted_and_count_as_rows_that_were_not_there(rows: set[int], to: float) -> None:
    alone = sorted(row for row in rows if not rows & {row - 1, row - 2})
    X, _, leaps = LIMITED.rows(log_of(spiked(alone, to)))
    assert leaps == {"q:J1": len(alone)}
    held = SLOW.copy()
    held[alone] = SLOW[np.array(alone, dtype=int) - 1]
    kept = np.delete(np.arange(800), alone)
    assert_array_equal(X[kept], PLAIN.matrix(log_of(held))[kept])


def test_a_leap_that_stays_is_believed() -> None:
    moved = SLOW + 1.0 * (T > 5.0)
    X, leaping, leaps = LIMITED.rows(log_of(moved))
    assert leaps == {"q:J1": 0}
    assert_allclose(X, PLAIN.matrix(log_of(moved)), atol=0.01)  # two rows of motion
    assert np.flatnonzero(leaping).tolist() == [251, 252]  # until it is confirmed


def sparse(rng: np.random.Generator, rows: int = 200) -> Floats:
    """Random targets, an order of magnitude farther from each other than training rows are."""
    return rng.uniform(-0.5, 0.5, rows)


def test_play_states_soon_follow_random_targets_as_without_limits(rng: np.random.Generator) -> None:
    log = log_of(sparse(rng), None)
    X, leaping, _ = LIMITED.rows(log)
    assert leaping.mean() > 0.5  # intervals are wider
    assert_array_equal(X[50:], PLAIN.matrix(log)[50:])  # they have swept the range


def test_a_spike_has_the_half_width_of_the_fixed_offset() -> None:
    log = log_of(SLOW, q_encoder=1.01 * SLOW[:, None])
    model = fitted(log, inputs=["q"], play=(0.05, 0.2))
    model = replace(model, intervals=Intervals(0.9, np.array([0.001]), np.array([0.01])))
    log = log_of(spiked([300], SLOW[300] + 0.1), T)
    widths = model.half_widths(log)
    assert np.flatnonzero(widths[:, 0] >= 0.01).tolist() == [300]
    out, inside, interval = np.empty(1), np.empty(1, dtype=bool), np.empty(1)
    corrector = Corrector(model, rate_hz=50.0)
    for row, q in enumerate(log.q_nominal):
        corrector.correct(q, q, out, inside, interval)
        assert interval == widths[row]


def test_a_pause_gives_room_to_move() -> None:
    time, q = np.delete(T, np.s_[300:320]), np.delete(SLOW, np.s_[300:320])
    assert room_of(log_of(q, time), 0.02)[300] == pytest.approx(21.0)
    X, _, leaps = LIMITED.rows(log_of(q, time))
    assert leaps == {"q:J1": 0}
    assert_array_equal(X, PLAIN.matrix(log_of(q, time)))


def test_limits_come_from_the_joints_fastest_step_and_not_from_spikes() -> None:
    alone, room = largest_step([(SLOW, np.ones(800))]), np.ones(800)
    assert alone == pytest.approx(_STEP_MARGIN * np.abs(np.diff(SLOW)).max(), rel=1e-3)
    assert largest_step([(spiked([100, 500]), room)]) == pytest.approx(alone, rel=0.1)
    moved = np.where(T > 5.0, 1.0, 0.0)  # a step that stays is a motion
    assert largest_step([(moved, room)]) == _STEP_MARGIN


@pytest.mark.parametrize("rate_hz", [50.0, 1000.0])
def test_model_corrector_and_evaluation_reject_the_same_leap(rate_hz: float) -> None:
    held = round(rate_hz / 50.0)
    log = log_of(SLOW, q_encoder=1.01 * SLOW[:, None])
    model = fitted(log, inputs=["q"], play=(0.05, 0.2))
    assert dict(model.features.steps)["q:J1"] == pytest.approx(0.005 * _STEP_MARGIN, rel=0.01)
    bad = replace(log, q_nominal=spiked([300])[:, None])
    assert calibration_data([bad], model.features).sources[0].leaps == {"q:J1": 1}
    q = np.repeat(bad.q_nominal, held, axis=0)
    q[300 * held + 1 : 301 * held] = SLOW[299]  # one sample at any rate
    corrector = Corrector(model, rate_hz=rate_hz)
    out, inside = ticked(corrector, q, q)
    assert corrector.leaps == {"q:J1": 1}
    assert not inside[300 * held].any()
    assert_array_equal(np.delete(out[::held], 300, axis=0), np.delete(model.calibrate(log), 300, axis=0))


@pytest.mark.parametrize("step", [0.0, -1.0, np.nan, np.inf])
def test_limits_that_make_no_sense_are_refused(step: float) -> None:
    with pytest.raises(InputError, match="steps: expected positive limits"):
        replace(PLAIN, steps=(("q:J1", step),))
