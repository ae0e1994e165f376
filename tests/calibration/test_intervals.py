from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.calibration.conformal import unseen_by_blocks
from catenary.calibration.corrector import Corrector
from catenary.calibration.dataset import calibration_data
from catenary.calibration.evaluate import CrossValidation, evaluate
from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.calibration.fit_recordings import FitResult, fit_logs
from catenary.calibration.intervals import MAX_HALF_RANGES, Intervals
from catenary.calibration.model import CalibrationModel
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.verdict.delay import Delay
from drawn_arms.arm import Arm
from oracles.calibration_models import random_model, ticked
from recordings import recording
from tests.truth.recordings import raven
from tests.truth.spoilings import late

RNG = np.random.default_rng(0)
SIGNALS = np.cumsum(0.2 * RNG.normal(size=(300, 5)), axis=0)  # three positions, two torques
WIDTHS = Intervals(0.9, np.array([0.1, 0.2, 0.3]), np.array([0.3, 0.2, 0.7]))
WITH_MEMORY = {"plays": 1}


def model(**options: Any) -> CalibrationModel:
    made = random_model("linear", SIGNALS[:150], np.random.default_rng(1), joints=3, torques=2, **options)
    return replace(made, intervals=WIDTHS)


def half_widths(at: CalibrationModel, X: np.ndarray) -> np.ndarray:
    return at.correct(X, X[:, :3])[2]


def test_half_widths_are_constant_where_rows_lay_and_grow_from_there_to_a_bound() -> None:
    made = model()
    box = made.groups[0].valid_range
    middle, reach = 0.5 * (box.upper + box.lower), 0.5 * (box.upper - box.lower)
    seen = SIGNALS[:150, :5]
    assert_array_equal(half_widths(made, seen), np.tile(WIDTHS.inside, (150, 1)))
    lone = replace(made, groups=(replace(made.groups[0], valid_range=replace(box, axes=0.0 * box.axes)),))
    times = np.array([0.0, 0.8, 0.85, 0.9, 0.95, 1.0, 1.5, 3.0, 9.0, 100.0])
    X = np.tile(box.mean, (len(times), 1))
    X[:, 0] = (middle + reach * times[:, None])[:, 0]
    share = np.clip((times - box.seen) / (0.5 * (1.0 - box.seen)), 0.0, 1.0)[:, None]
    expected = (1.0 - share) * WIDTHS.inside + share * WIDTHS.outside * np.clip(times, 1.0, MAX_HALF_RANGES)[:, None]
    assert_allclose(half_widths(lone, X), expected, rtol=1e-12)


@given(st.integers(0, 4), st.floats(1.0, 1e6), st.floats(1.0, 1e6))
def test_half_widths_never_shrink_on_the_way_out(feature: int, near: float, far: float) -> None:
    made = model()
    box = made.groups[0].valid_range
    X = np.tile(box.mean, (2, 1))
    X[:, feature] = box.mean[feature] + np.sort([near, far]) * (box.upper - box.lower)[feature]
    nearer, farther = half_widths(made, X)
    assert (nearer >= WIDTHS.inside).all()
    assert (farther >= nearer).all()


def test_a_model_without_intervals_gives_nan() -> None:
    assert np.isnan(half_widths(replace(model(), intervals=None), SIGNALS[:, :5])).all()


@pytest.mark.parametrize("options", [{}, WITH_MEMORY])
def test_ticks_give_the_half_widths_of_the_batch_to_the_bit(options: Any) -> None:
    made = model(**options)
    q, widths = SIGNALS[:, :3], np.empty((300, 3))
    memory, out, inside = made.features.memory(), np.empty((300, 3)), np.empty((300, 3), dtype=bool)
    for step in made.tick_steps(memory, q, SIGNALS, out, inside, widths):
        step.function(*step.inputs, *step.outputs)
    ticked(Corrector(made), q, SIGNALS, one_by_one := np.empty((300, 3)))
    assert_array_equal(one_by_one, widths)
    assert {False, True} == set(inside.ravel())


@pytest.mark.parametrize(
    ("level", "inside", "outside"),
    [(1.0, [0.1], [0.1]), (0.9, [-0.1], [0.1]), (0.9, [0.2], [0.1]), (0.9, [np.nan], [0.1]), (0.9, [0.1], [0.1, 0.1])],
)
def test_impossible_intervals_are_refused(level: float, inside: list[float], outside: list[float]) -> None:
    with pytest.raises(InputError):
        Intervals(level, np.array(inside), np.array(outside))


def run(rows: int = 600, **changes: Any) -> FitResult:
    rng = np.random.default_rng(3)
    return fit_logs([recording(rng, rows=rows)], FitOptions(kind="linear"), FitRun(**changes))


def test_a_fit_has_intervals_that_hold_on_what_it_has_not_seen() -> None:
    result = run(rows=3000, held_out=0.3)
    assert result.held_out is not None
    assert result.card["intervals"]["coverage"] == 0.9
    for joint in result.held_out.joints:
        assert 0.87 <= joint.coverage <= 0.97  # independent errors, 900 rows: three standard deviations and K + 1
    scale = np.array([180.0 / np.pi, 180.0 / np.pi, 1000.0])
    widths = [joint.half_width for joint in result.held_out.joints]
    # noise of 0.01 rad and 1 mm: 90 % lie within 1.64 standard deviations
    assert_allclose(widths, 1.645 * np.array([0.01, 0.01, 0.001]) * scale, rtol=0.15)


def test_a_fit_that_cannot_know_its_intervals_says_why() -> None:
    without = run(folds=0)
    assert without.model.intervals is None
    assert without.card["intervals"] is None
    assert any("no intervals: they are estimated from the cross-validation" in note for note in without.notes)
    assert any(
        "39 rows are too few to hold 90% of errors; this needs 40" in note for note in run(39, accept=("short",)).notes
    )
    wide, narrow = run(coverage=0.95).model.intervals, run(coverage=0.5).model.intervals
    assert wide is not None
    assert narrow is not None
    assert (wide.inside > narrow.inside).all()


def test_an_unknown_input_has_the_offsets_half_width_and_an_unknown_position_none() -> None:
    X = np.tile(np.median(SIGNALS[:150], axis=0), (2, 1))
    q = X[:, :3].copy()
    X[0, 4] = np.nan
    q[1, 2] = np.nan
    assert_array_equal(model().correct(X, q)[2], [WIDTHS.outside, [WIDTHS.inside[0], WIDTHS.inside[1], np.nan]])


def two_layers(*, apart: bool) -> MotionLog:
    """An arm whose second joint sweeps high while the first stands high, and low while low; or both at random.

    Where they go together something hidden bends the error, as friction does along one path.
    """
    rng, t = np.random.default_rng(5), 0.05 * np.arange(6000)
    level = rng.uniform(-1.0, 1.0, len(t)) if apart else np.sign(np.sin(0.01 * np.pi * t))
    swing = rng.uniform(-1.0, 1.0, len(t)) if apart else 0.45 * np.sin(0.7 * t)
    q = np.column_stack([0.5 * level, 0.5 * level + swing]) + 0.02 * rng.normal(size=(len(t), 2))
    hidden = np.zeros(len(t)) if apart else 0.05 * swing**2
    error = 0.03 * q[:, ::-1] + hidden[:, None] + 0.002 * rng.normal(size=q.shape)
    return MotionLog("layers", ("J1", "J2"), ("rad", "rad"), q, np.ones(len(t), bool), time=t, q_encoder=q + error)


def test_a_polynomial_says_that_it_may_be_off_where_joints_meet_that_training_has_apart() -> None:
    options, truth = FitOptions(kind="polynomial", inputs=("q",)), two_layers(apart=True)
    path, random = (fit_logs([log], options) for log in (two_layers(apart=False), truth))
    said = [[note for note in found.notes if note.startswith("where joints meet")] for found in (path, random)]
    assert [len(each) for each in said] == [1, 0]
    assert all(joint.rmse_high > 1.7 * joint.rmse_mean for joint in path.spread)
    assert all(joint.rmse_high < 1.1 * joint.rmse_mean for joint in random.spread)


@pytest.mark.parametrize(("motion", "low", "high"), [("zigzag", 1.2, 2.0), ("random", 1.0, 1.1)])
def test_a_line_learnt_where_joints_move_together_is_doubted_where_they_do_not(
    motion: str, low: float, high: float
) -> None:
    """Products of inputs explain a zig-zag as well: what they say elsewhere is what its minutes cannot tell."""
    widening = fit_logs(raven(motion).logs, FitOptions(kind="linear"), FitRun()).model.widening
    assert widening is not None
    assert ((widening > low) & (widening < high)).all()


@pytest.mark.parametrize("motion", ["zigzag", "random"])
def test_a_claim_holds_where_one_joint_alone_is_late(motion: str) -> None:
    """An even speed hides a lag in hysteresis, so that the claim is as wide as the joint's own delay may be.

    Half-widths are not, or no zig-zag would have any that say something; a note says what to record.
    """
    arm = Arm(8)
    log, test = arm.moved(motion, 1, 120.0).log, arm.moved(motion, 2, 60.0).log
    spoilt = fit_logs([late(log, 0.05, slice(1, 2))], FitOptions(), FitRun())
    found = evaluate(spoilt.model, calibration_data([test], spoilt.model.features)).joints[1]
    stated = spoilt.spread[1]
    assert stated.rmse_low is not None
    assert stated.rmse_high is not None
    assert 0.87 * stated.rmse_low < found.rmse < 1.15 * stated.rmse_high
    assert found.coverage > 0.8 or any("alone is late" in note for note in spoilt.notes)


def moving(speed: np.ndarray) -> MotionLog:
    """A joint that turns every 100 rows, at a speed (rows,) [rad/s]."""
    t = 0.1 * np.arange(len(speed))
    q = 0.1 * np.cumsum(speed * np.where(np.arange(len(t)) // 100 % 2, -1.0, 1.0))[:, None]
    return MotionLog("one", ("J1",), ("rad",), q, np.ones(len(t), bool), time=t, q_encoder=q)


def test_claims_grow_by_what_a_joints_own_delay_may_add_where_motion_does_not_tell_it() -> None:
    """At even speed all that it may be; else what errors on blocks of time show in the speed that is not even.

    Half-widths take the middle of the delay's interval.
    """
    rng, e = np.random.default_rng(3), np.full((2000, 1), 0.01)

    def unseen(
        speed: np.ndarray, *own: tuple[float, float], left: Callable[[np.ndarray], np.ndarray] = lambda rates: e
    ) -> tuple[float, float, float]:
        told = [Delay(0, 0, 0, "none", (0, 0, 0), "s", alone=(("J1", low, high),)) for low, high in own]
        one = moving(speed)
        rates = np.gradient(one.q_nominal, one.time, axis=0)
        errors = CrossValidation((), e, left(rates), e > 0, np.zeros(2000, int), np.arange(2000) // 100)
        found = unseen_by_blocks([one] * len(own), told, errors, rates, 0.9)
        return found.late[0], found.rms[0], found.within[0]

    even, uneven = np.full(2000, 0.5), rng.uniform(0.1, 1.0, 2000)
    assert_allclose(unseen(even, (-0.9, 0.2)), [0.2, 0.1, 0.0], rtol=1e-6)
    assert_allclose(unseen(even, (-0.02, 0.02)), 0.0)
    assert_allclose(unseen(even, (-0.9, 0.2), (-0.02, 0.02)), 0.0)  # another recording tells
    assert_allclose(unseen(even, (-0.01, 0.02), (0.1, 0.12)), [0.12, 0.06, 0.0275], rtol=1e-6)  # they contradict

    # of a speed between .1 and 1 the square of the mean is .3025, the mean of the square .37
    def late(rates: np.ndarray) -> np.ndarray:
        return rng.normal(0.0, 0.01, rates.shape) - 0.05 * (rates - 0.55 * np.sign(rates))

    assert_allclose(unseen(uneven, (-0.2, 0.2), left=late), [0.2, 0.05 * 0.37**0.5, 0.0], rtol=0.1)
    assert 0.0 < unseen(uneven, (-0.2, 0.2))[1] < 0.2 * 0.01 * (0.3025 / 0.0675) ** 0.5  # errors that follow no speed
    assert_allclose(unseen(uneven, (-0.1, 0.2), left=late), [0.2, 0.05 * 0.37**0.5, 0.05 * 0.91], rtol=0.1)
