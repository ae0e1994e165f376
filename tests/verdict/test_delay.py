"""Delays of either sign are found in fractions of a row, told from hysteresis, and mended."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.calibration.fit_options import FitOptions
from catenary.calibration.fit_recordings import fit_logs
from catenary.plant import MotionLog
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.verdict.check import findings_of
from catenary.verdict.corrections import NO_MEND, Mend
from catenary.verdict.delay import delay_of
from drawn_arms.arm import Arm
from hysteretic_arm import play
from tests.truth.spoilings import late

RATE = 30.0  # [Hz]


def cable_arm(seed=0, seconds=120.0, slack=(1.5, 0.8, 2.0), *, sines=False):
    """Two turning joints and a sliding one, each behind slack and a bent curve, seen with noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    if sines:
        q = np.column_stack([np.sin(2.0 * np.pi * f * t) for f in (0.11, 0.23, 0.31)]) * [0.4, 0.4, 0.04]
    else:
        q = random_sinusoids(
            rng, seconds, lower=(-0.5, -0.5, 0.1), upper=(0.5, 0.5, 0.2), turning_band=(0.2, 0.2, 0.02),
            slowest=(0.1, 0.1, 0.01), fastest=(0.5, 0.5, 0.05),
        ).sample(t)[0]  # fmt: skip
    size = np.array([np.deg2rad(1.0), np.deg2rad(1.0), 1e-3])
    true = np.column_stack([play(q[:, k], slack[k] * size[k]) for k in range(3)])
    true = true + 0.02 * true**2 + 0.01 * q[:, [1, 0, 0]] * [1.0, 1.0, 0.1]
    seen = true + rng.normal(size=true.shape) * 0.03 * size
    ok = np.ones(len(t), dtype=bool)
    return MotionLog("arm", ("J1", "J2", "J3"), ("rad", "rad", "m"), q, ok, q_encoder=seen, time=t)


@pytest.mark.alike
@pytest.mark.parametrize("seconds", [-0.5, -0.02, 0.017, 0.15, 0.9])
def test_a_delay_is_found_within_its_interval_and_mended(seconds):
    log = cable_arm()
    found = delay_of(late(log, seconds))
    assert found.sure in ("certain", "likely")
    assert found.low < seconds < found.high
    assert abs(found.seconds - seconds) < 0.01
    mended = Mend(delay=found.seconds)(late(log, seconds))
    assert delay_of(mended).sure == "none"
    error = (mended.q_encoder - log.q_encoder)[mended.ok]
    assert (np.sqrt(np.mean(error**2, axis=0)) < [*np.deg2rad([0.3, 0.3]), 3e-4]).all()
    assert mended.settled == {"delay": (f"{found.seconds:g}",)}


@pytest.mark.alike
@pytest.mark.parametrize("seconds", [0.0, 0.05, 0.15])
@pytest.mark.parametrize("seed", [1, 3])
def test_of_one_joint_alone_a_wide_interval_holds_its_delay_and_a_zig_zag_tells_none(seed, seconds):
    arm = Arm(seed)
    log = arm.moved("random", 7, 90.0).log
    behind = late(log, seconds).q_encoder[:, -1]
    one_late = replace(log, q_encoder=np.column_stack([log.q_encoder[:, :-1], behind]))
    _, low, high = delay_of(one_late).alone[-1]
    assert low <= seconds <= high
    assert high - low < 0.5
    repeated = delay_of(arm.moved("zigzag", 7, 90.0).log)
    assert "half a minute of random motion would show it" in str(replace(repeated, sure="none"))


@pytest.mark.alike
@pytest.mark.parametrize("slack", [(0.0, 0.0, 0.0), (1.5, 0.8, 2.0), (8.0, 8.0, 8.0)])
@pytest.mark.parametrize("sines", [False, True])
def test_hysteresis_is_no_delay(slack, sines):
    assert delay_of(cable_arm(slack=slack, sines=sines)).sure != "certain"


def periodic_arm(count: int) -> MotionLog:
    """`cable_arm` along sines that begin again after 100 s."""
    once = cable_arm(seconds=200.0, sines=True).part(3000, 6000)  # without the start, when slack is not taken up
    rows = np.arange(count) % 3000
    noise = np.random.default_rng(1).normal(size=(len(rows), 3)) * [5e-4, 5e-4, 3e-5]
    q, seen, ok = once.q_nominal[rows], once.q_encoder[rows] + noise, once.ok[rows]
    return replace(once, q_nominal=q, q_encoder=seen, ok=ok, time=np.arange(len(rows)) / RATE)


@pytest.mark.alike
@pytest.mark.parametrize("seconds", [0.0, 0.1])
def test_a_delay_of_hours_is_that_of_minutes_though_the_motion_repeats_itself(seconds):
    minutes, hours = (delay_of(late(periodic_arm(rows), seconds)) for rows in (27_000, 999_600))
    for found in (minutes, hours):
        assert found.sure == ("certain" if seconds else "none")
        assert found.low < seconds < found.high
        assert not found.apart
    assert abs(hours.seconds - minutes.seconds) < 0.01


def test_a_zero_that_wanders_over_an_hour_hides_no_delay():
    log = periodic_arm(108_000)
    wander = np.sin(np.linspace(0.0, 20.0, len(log)))[:, None] * np.deg2rad([2.0, 2.0, 0.1])
    found = delay_of(late(replace(log, q_encoder=log.q_encoder + wander), 0.1))
    assert found.sure == "certain"
    assert found.low < 0.1 < found.high


@pytest.mark.alike
@pytest.mark.parametrize("seconds", [-0.2, 0.3])
@pytest.mark.parametrize("joints", [slice(1, 2), slice(0, 2)])
def test_joints_that_lie_unlike_times_behind_are_named_and_refused(seconds, joints):
    told, *common = (
        each for each in findings_of(late(cable_arm(), seconds, joints)) if each.name in ("delay", "clock")
    )
    assert (told.name, told.refuses) == ("clock", True)
    assert [each.name for each in common] == ["delay"] * (joints == slice(0, 2))  # that of most joints is one beside it
    true = dict.fromkeys(("J1", "J2", "J3"), 0.0) | dict.fromkeys(("J1", "J2", "J3")[joints], seconds)
    found = told.says.split(" lie ")[1].split(" s behind")[0].split(", ")
    assert told.joints
    for joint, text in zip(told.joints, found, strict=True):
        assert abs(float(text) - true[joint]) < 0.02


@pytest.mark.parametrize("seconds", [-0.2, 0.3])
def test_a_joint_that_is_late_alone_is_mended_and_the_recording_is_then_as_a_clean_one(seconds):
    log = cable_arm()
    (told,) = (each for each in findings_of(late(log, seconds, slice(1, 2))) if each.refuses)
    (low, high) = map(float, told.says.split("(J2 ")[1].split(")")[0].split(" to "))
    assert low < seconds < high
    mended = NO_MEND.and_then(told.remedy)(late(log, seconds, slice(1, 2)))
    assert not [each for each in findings_of(mended) if each.refuses]
    assert_allclose(mended.q_encoder[mended.ok], log.q_encoder[mended.ok], atol=np.deg2rad(0.5))


def test_wild_rows_lost_rows_and_pauses_do_not_hide_it():
    log = late(cable_arm(), 0.1)
    rng, measured, ok = np.random.default_rng(1), log.q_encoder.copy(), log.ok.copy()
    measured[rng.choice(len(log), 40)] += 0.5
    ok[rng.choice(len(log), 500)] = False
    time = log.time + 20.0 * (np.arange(len(log)) > 1800)
    found = delay_of(replace(log, q_encoder=measured, ok=ok, time=time))
    assert found.sure == "certain"
    assert abs(found.seconds - 0.1) < 0.01


def test_without_stamps_it_is_in_rows():
    found = delay_of(replace(late(cable_arm(), 4.0 / RATE), time=None))
    assert (found.sure, found.unit) == ("certain", "rows")
    assert abs(found.seconds - 4.0) < 0.3


def test_clocks_that_run_apart_are_told():
    log = cable_arm(seconds=600.0)
    ahead = np.column_stack([np.interp(log.time * (1.0 + 3e-4), log.time, c) for c in log.q_encoder.T])
    found = next(f for f in findings_of(replace(log, q_encoder=ahead)) if f.name in ("delay", "clock"))
    assert found.name == "clock"
    assert_allclose(found.delay.change[0], -0.18, atol=0.003)
    mended = NO_MEND.and_then(found.remedy)(replace(log, q_encoder=ahead))
    assert not any(each.refuses for each in findings_of(mended))


def test_a_clock_is_mended_from_the_first_row_on_where_measurements_begin_late():
    log = cable_arm(seconds=600.0)
    behind = np.column_stack([np.interp(log.time * (1.0 - 3e-4) - 0.1, log.time, c) for c in log.q_encoder.T])
    found = next(f for f in findings_of(replace(log, q_encoder=behind, ok=log.time > 200.0)) if f.name == "clock")
    ahead, ppm = map(float, found.remedy.removeprefix("--clock ").split(","))
    assert abs(ahead - 0.1) < 0.005
    assert abs(ppm - 300.0) < 3.0


@pytest.mark.parametrize("change", ["still", "short", "unmeasured"])
def test_too_little_motion_is_said(change):
    log = cable_arm()
    if change == "still":
        log = replace(log, q_nominal=np.tile(log.q_nominal[:1], (len(log), 1)))
    elif change == "unmeasured":
        log = replace(log, ok=np.arange(len(log)) < 50)
    else:
        rows = slice(0, 60)
        log = replace(log, q_nominal=log.q_nominal[rows], q_encoder=log.q_encoder[rows], ok=log.ok[rows], time=log.time[rows])  # fmt: skip
    assert delay_of(log).sure == "unknown"


def test_a_model_keeps_the_delays_of_its_recordings_and_how_they_were_mended():
    late_by = Mend(delay=0.1)(late(cable_arm(), 0.1))
    card = fit_logs([late_by], FitOptions(kind="linear")).card
    assert card["mends"] == {"delay": ["0.1"]}
    ((delay,),) = (card["delays"],)
    assert delay["recording"] == "arm"
    assert delay["sure"] == "none"
    assert delay["low"] < 0.0 < delay["high"]
    assert any("would hide in hysteresis" in note for note in card["notes"])


@pytest.mark.alike
@pytest.mark.parametrize("change", ["shuffled", "swapped", "copied"])
@pytest.mark.parametrize("seed", range(2))
def test_columns_that_are_not_the_joints_have_no_certain_delay(seed, change):
    log = cable_arm(seed)
    seen = log.q_encoder
    if change == "shuffled":
        seen = np.random.default_rng(seed).permutation(seen)
    elif change == "swapped":
        seen = seen[:, [1, 0, 2]]
    else:
        seen = log.q_nominal
    assert delay_of(replace(log, q_encoder=seen)).sure != "certain"
