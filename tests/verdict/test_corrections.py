"""Mends undo what spoilt a recording."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.verdict.corrections import NO_MEND, Mend
from recordings import recording as made


def recording() -> MotionLog:
    rng = np.random.default_rng(0)
    log = made(rng, rows=40, error=lambda q: np.full_like(q, 0.01))
    return replace(log, time=np.arange(40.0), tau=rng.standard_normal((40, 3)))


def test_nothing_to_mend_is_the_same_recording() -> None:
    log = recording()
    assert Mend()(log) is log


def test_numbers_in_deg_and_mm_become_rad_and_m() -> None:
    log = recording()
    factor = np.array([180.0 / np.pi, 180.0 / np.pi, 1000.0])
    spoilt = replace(log, q_nominal=log.q_nominal * factor, q_encoder=log.q_encoder * factor)
    mended = Mend(units=("deg,deg,mm",))(spoilt)
    assert_allclose(mended.q_nominal, log.q_nominal, rtol=1e-14)
    assert_allclose(mended.q_encoder, log.q_encoder, rtol=1e-14)
    assert mended.notes == ("corrected by --units deg,deg,mm",)


def test_the_units_of_one_array_leave_the_others() -> None:
    log = recording()
    mended = Mend(units=("q_encoder:rad,rad,mm",))(log)
    assert_array_equal(mended.q_nominal, log.q_nominal)
    assert_allclose(mended.q_encoder[:, 2], 1e-3 * log.q_encoder[:, 2])


@given(st.permutations([0, 1, 2]))
def test_exchanges_put_any_order_in_place(order: list[int]) -> None:
    log = recording()
    spoilt = replace(log, q_encoder=log.q_encoder[:, order])
    swaps, at = [], list(order)
    for joint in range(3):
        if (other := at.index(joint)) != joint:
            swaps.append(f"{log.joint_names[joint]},{log.joint_names[other]}")
            at[joint], at[other] = at[other], at[joint]
    assert_array_equal(Mend(swap=tuple(swaps))(spoilt).q_encoder, log.q_encoder)


@given(st.integers(-10, 10))
def test_a_shift_brings_rows_in_step_within_each_recording(rows: int) -> None:
    log = recording()
    log = replace(log, time=np.concatenate([np.arange(25.0), np.arange(15.0)]))
    spoilt = replace(log, q_encoder=np.roll(log.q_encoder, rows, axis=0))
    mended = Mend(shift=rows)(spoilt)
    assert mended.ok.sum() == len(log) - 2 * abs(rows)
    inner = mended.ok.copy()
    inner[:10] = inner[-10:] = inner[15:35] = False  # np.roll mixes the ends of the two recordings
    assert_array_equal(mended.q_encoder[inner], log.q_encoder[inner])


def test_signs_scales_torques_and_stamps() -> None:
    log = recording()
    mended = Mend(sign=("J1", "tau:J2"), scale=("J3=0.5",), time_unit="ms", leave_out=("3:5,10:11",))(log)
    assert_array_equal(mended.q_encoder, log.q_encoder * [-1.0, 1.0, 0.5])
    assert_array_equal(mended.tau, log.tau * [1.0, -1.0, 1.0])
    assert_allclose(mended.time, 1e-3 * log.time)
    assert np.flatnonzero(~mended.ok).tolist() == [3, 4, 10]


def test_couplings_add_other_columns_as_recorded_and_speeds_go_with_positions() -> None:
    log = replace(recording(), qd=recording().q_nominal)
    matrix = np.array([[1.0, 0.3, 0.0], [-0.2, 1.1, 0.0], [0.0, 0.0, 1.0]])
    entries = "J1/J2=0.3,J2/J1=-0.2,J2/J2=0.1"
    mended = Mend(couple=(entries, f"q_nominal:{entries}"))(log)
    for key in ("q_encoder", "q_nominal", "qd"):
        assert_allclose(getattr(mended, key), getattr(log, key) @ matrix.T, rtol=1e-14)
    assert_array_equal(mended.tau, log.tau)


def test_a_coupling_names_joints_that_hold_a_slash() -> None:
    log = replace(recording(), joint_names=("arm/J1", "arm/J2", "J3"))
    mended = Mend(couple=("arm/J2/arm/J1=0.5,J3/arm/J1=-1",))(log)
    assert_allclose(mended.q_encoder[:, 1:], log.q_encoder[:, 1:] + log.q_encoder[:, :1] * [0.5, -1.0])


def test_a_clock_s_offset_and_rate_are_taken_out() -> None:
    t = np.arange(2000) / 100.0
    q = np.sin(np.outer(t, [1.0, 2.0, 3.0]))
    log = MotionLog("run", ("J1", "J2", "J3"), ("rad", "rad", "m"), q, np.ones(2000, dtype=bool), q_encoder=q, time=t)
    late = replace(log, q_encoder=np.sin(np.outer(t - 0.3 - 2e-3 * t, [1.0, 2.0, 3.0])))  # of the time before it grew
    mended = Mend(clock=(f"{0.3 / (1 - 2e-3)},{1e6 * (1 / (1 - 2e-3) - 1)}",))(late)
    assert mended.ok.mean() > 0.98
    assert_allclose(mended.q_encoder[mended.ok], log.q_encoder[mended.ok], atol=2e-4)


def test_a_clock_of_one_joint_moves_its_column_alone() -> None:
    t = np.arange(2000) / 100.0
    q = np.sin(np.outer(t, [1.0, 2.0, 3.0]))
    late = np.column_stack([q[:, 0], np.sin(2.0 * (t - 0.25)), q[:, 2]])
    log = MotionLog(
        "run", ("J1", "J2", "J3"), ("rad", "rad", "m"), q, np.ones(2000, dtype=bool), q_encoder=late, time=t
    )
    mended = NO_MEND.and_then("--sign J1 --clock J2=0.25")(log)
    assert mended.settled == {"sign:q_encoder": ("q_encoder:J1",), "clock": ("J2=0.25",)}
    assert_array_equal(np.flatnonzero(~mended.ok), np.arange(1975, 2000))
    assert_allclose(mended.q_encoder[mended.ok], (q * [-1.0, 1.0, 1.0])[mended.ok], atol=1e-9)


@pytest.mark.parametrize(
    ("mend", "says"),
    [
        (Mend(units=("deg,deg,deg",)), "--units: expected one per joint"),
        (Mend(units=("deg,furlong,mm",)), "unknown furlong; choices: rad"),
        (Mend(swap=("J1,J9",)), "no joint 'J9'; joints: J1, J2, J3"),
        (Mend(swap=("J1",)), "expected two joints"),
        (Mend(sign=("qd:J1",)), "it has no qd"),
        (Mend(scale=("J1=0",)), "expected JOINT=FACTOR"),
        (Mend(scale=("J1",)), "expected JOINT=FACTOR"),
        (Mend(couple=("J2=0.1",)), "no joint ''"),
        (Mend(couple=("J2/J9=0.1",)), "no joint 'J9'"),
        (Mend(clock=("now",)), "expected seconds and ppm"),
        (Mend(shift=40), "no row of 40 is left"),
        (Mend(time_unit="h"), "choices: s, ms"),
        (Mend(leave_out=("30:50",)), "has rows 0 to 40"),
        (Mend(leave_out=("a:b",)), "expected FIRST:LAST"),
    ],
)
def test_an_option_that_does_not_fit_is_refused(mend: Mend, says: str) -> None:
    with pytest.raises(InputError, match=says):
        mend(recording())


def test_a_shift_does_not_reach_across_a_gap_in_time() -> None:
    log = recording()
    time = np.arange(40) / 10.0
    time[20:] += 5.0
    shifted = Mend(shift=2)(replace(log, time=time))
    assert_array_equal(np.flatnonzero(~shifted.ok), [18, 19, 38, 39])
