import math

import numpy as np
import pytest

from catenary.sensing.gravity_vector import tilted_gravity
from catenary.sensing.imu_faults import Fault, GravityCheck, RateCheck, RawCheck, explain
from catenary.sensing.platforms import BaseSpectrum
from catenary.spatial import LEVEL

NAMES = (Fault.NOT_FINITE, Fault.STUCK, Fault.SATURATED)
TILTED = tilted_gravity(0.2, 0.1)


def raw(stuck_samples=10):
    return RawCheck(stuck_samples, 19.6, NAMES)


def fed(check, gravities, *, start=0.0, period=0.01):
    """Faults of samples in a row; each believed one foretells the next."""
    out = []
    for k, gravity in enumerate(gravities):
        expected = check.reference if check.reference is not None else np.zeros(3)
        out.append(check.fault(start + k * period, np.asarray(gravity, dtype=float), expected, None))
    return out


def believing(gravity=TILTED):
    """A check that has believed a second of samples at rest."""
    check = GravityCheck(BaseSpectrum())
    assert not any(fed(check, [gravity] * 100))
    return check


@pytest.mark.parametrize(
    ("stamp", "fault"),
    [
        (1.02, Fault.STAMP_FUTURE),
        (math.nan, Fault.STAMP_FUTURE),
        (math.inf, Fault.STAMP_FUTURE),
        (0.99, Fault.NONE),
        (0.98, Fault.STAMP_REPEATED),
        (0.97, Fault.STAMP_BACKWARDS),
    ],
)
def test_stamps_that_cannot_be_are_named(stamp, fault):
    check = raw()
    assert check.fault(0.98, (0.0, 0.0, 9.8), 1.0) is Fault.NONE
    assert check.fault(stamp, (0.1, 0.0, 9.8), 1.0) is fault


def test_a_stamp_from_the_future_does_not_make_the_next_ones_old():
    check = raw()
    assert check.fault(5.0, (0.0, 0.0, 9.8), 1.0) is Fault.STAMP_FUTURE
    assert check.fault(1.0, (0.0, 0.0, 9.8), 1.0) is Fault.NONE


# 0: a sensor without noise is believed
@pytest.mark.parametrize(("stuck_samples", "good"), [(3, 2), (0, 50)])
def test_a_reading_repeated_bit_for_bit_is_stuck_until_it_changes(stuck_samples, good):
    check = raw(stuck_samples=stuck_samples)
    faults = [check.fault(0.01 * k, (0.0, 0.0, 9.8), 1.0) for k in range(50)]
    assert faults == [Fault.NONE] * good + [Fault.STUCK] * (50 - good)
    assert check.fault(0.5, (0.0, 0.0, 9.80001), 1.0) is Fault.NONE


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(
    ("value", "fault"),
    [
        (19.599, Fault.SATURATED),
        (-19.599, Fault.SATURATED),
        (math.nan, Fault.NOT_FINITE),
        (math.inf, Fault.NOT_FINITE),
        (-math.inf, Fault.NOT_FINITE),
    ],
)
def test_an_axis_at_its_end_or_without_a_number_is_named(axis, value, fault):
    assert raw().fault(0.0, tuple(np.where(np.eye(3)[axis], value, 0.0)), 0.0) is fault


def test_a_sensor_is_believed_after_a_few_samples_that_agree():
    check = GravityCheck(BaseSpectrum())
    fed(check, [TILTED] * 4)
    assert check.reference is None
    fed(check, [TILTED], start=0.04)
    assert check.reference is not None


@pytest.mark.parametrize(
    ("gravity", "fault"),
    [
        (-LEVEL, Fault.UPSIDE_DOWN),
        (LEVEL / 9.81, Fault.UNIT_G),
        (100.0 * LEVEL, Fault.UNIT_CM),
        (LEVEL * 1000.0 / 9.81, Fault.UNIT_CM),
        (0.0 * LEVEL, Fault.GRAVITY_STRIPPED),
        (0.02 * LEVEL, Fault.GRAVITY_STRIPPED),
        (0.9 * LEVEL, Fault.MAGNITUDE),
        (1.1 * LEVEL, Fault.MAGNITUDE),
        (5.0 * LEVEL, Fault.MAGNITUDE),
    ],
)
def test_a_sensor_that_begins_wrong_is_named_and_never_believed(gravity, fault):
    check = GravityCheck(BaseSpectrum())
    assert set(fed(check, [gravity] * 300)) == {fault}
    assert check.reference is None


@pytest.mark.parametrize(
    ("gravity", "fault"),
    [
        (-TILTED, Fault.WRONG_SIGN),
        (TILTED[[1, 2, 0]], Fault.AXES_SWAPPED),
        (TILTED[[0, 2, 1]], Fault.AXES_SWAPPED),
        (TILTED * [1.0, -1.0, 1.0], Fault.AXES_SWAPPED),
        (TILTED / 9.81, Fault.UNIT_G),
        (TILTED * 100.0, Fault.UNIT_CM),
        (TILTED * 0.0, Fault.GRAVITY_STRIPPED),
    ],
)
def test_a_wrong_sensor_is_named_as_long_as_it_lasts_and_then_believed(gravity, fault):
    check = believing()
    assert set(fed(check, [gravity] * 1000, start=1.0)) == {fault}
    after = fed(check, [TILTED] * 10, start=11.0)
    assert after == [fault] * 4 + [Fault.NONE] * 6


def test_a_spike_costs_one_sample():
    check = believing()
    spike = TILTED + np.array([0.0, 8.0, 8.0])
    faults = fed(check, [TILTED, spike, TILTED, TILTED], start=1.0)
    assert faults == [Fault.NONE, Fault.SPIKE, Fault.NONE, Fault.NONE]


def test_a_jump_that_no_base_can_make_is_never_believed():
    check = believing(LEVEL)
    faults = fed(check, [tilted_gravity(0.4, 0.25)] * 500, start=1.0)
    assert faults[:3] == [Fault.SPIKE] * 3
    assert set(faults[3:]) == {Fault.JUMP}


def test_another_attitude_after_a_gap_is_believed_after_a_while():
    check = believing(LEVEL)
    faults = fed(check, [tilted_gravity(0.4, 0.25)] * 100, start=1.5)
    assert Fault.JUMP in faults
    assert faults[-1] is Fault.NONE
    assert faults.index(Fault.NONE) == pytest.approx(50, abs=1)  # accept_jump_after


def test_a_scale_that_is_wrong_is_found_though_the_base_rocks():
    check, t = GravityCheck(BaseSpectrum()), np.arange(500) * 0.01
    faults = fed(check, [0.88 * tilted_gravity(0.1 * np.sin(6.28 * s), 0.0) for s in t])
    assert set(faults) == {Fault.MAGNITUDE}


@pytest.mark.parametrize("amplitude_deg", [5.0, 20.0])
@pytest.mark.parametrize("rate_hz", [50.0, 100.0, 200.0])
def test_a_base_that_rocks_is_believed_all_the_time(amplitude_deg, rate_hz):
    check, t = GravityCheck(BaseSpectrum()), np.arange(0.0, 5.0, 1.0 / rate_hz)
    angles = 0.2 + np.radians(amplitude_deg) * np.sin(2.0 * np.pi * t)
    assert not any(fed(check, [tilted_gravity(a, 0.1) for a in angles], period=1.0 / rate_hz))


def test_rates_faster_than_a_base_turns_or_far_from_what_was_foretold_are_named():
    check = RateCheck()
    assert check.fault(np.array([0.0, 30.0, 0.0]), None) is Fault.RATE_TOO_FAST
    assert check.fault(np.array([1.0, 0.0, 0.0]), np.zeros(3)) is Fault.RATE_SPIKE
    assert not check.believed


def test_the_first_rates_are_waited_for_without_complaint():
    check, rate = RateCheck(), np.array([0.1, 0.4, 0.6])
    seen = [(check.fault(rate, None), check.believed) for _ in range(6)]
    # each but the first agrees with one
    assert seen == [(Fault.NONE, False)] * 5 + [(Fault.NONE, True)]


def test_no_mistake_explains_gravity_that_only_turned():
    assert explain(tilted_gravity(0.5, 0.3), LEVEL)[0] is Fault.NONE


@pytest.mark.parametrize("fault", list(Fault))
def test_every_fault_has_a_message_of_its_own(fault):
    assert len(fault.message) > 20
    assert fault is not Fault.GRAVITY_STRIPPED or "driver takes gravity away" in fault.message
    assert sum(other.message == fault.message for other in Fault) == 1


def test_faults_that_come_together_are_told_together_and_none_has_nothing_to_say():
    assert (Fault.NONE.message, Fault.NONE.names) == ("", ())
    both = Fault.STUCK | Fault.INTERRUPTED
    assert set(both.names) == {"stuck", "interrupted"}
    assert Fault.STUCK.message in both.message
    assert Fault.INTERRUPTED.message in both.message
