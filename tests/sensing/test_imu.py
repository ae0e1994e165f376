import math

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import InputError
from catenary.sensing.gravity_vector import Kind, Mailbox, ReadingStatus, tilted_gravity
from catenary.sensing.imu import SensedGravity
from catenary.sensing.imu_faults import Fault
from catenary.sensing.mounting import Mounting
from catenary.spatial import LEVEL
from oracles.sensed_base import Base, rocking

TILTED = tilted_gravity(0.2, -0.1)


def steps(readings):
    return np.linalg.norm(np.diff([r.gravity for r in readings], axis=0), axis=1)


def test_before_anything_is_received_gravity_is_that_of_a_level_base():
    readings = Base().run(0.3)
    for reading in readings:
        assert_array_equal(reading.gravity, LEVEL)
        assert_array_equal(reading.base_rates, np.zeros((2, 3)))
        assert (reading.status, reading.age) == (ReadingStatus.NOMINAL, math.inf)
    assert readings[-1].faults is Fault.NOTHING_RECEIVED


@pytest.mark.parametrize(("kind", "sign"), [(Kind.FREE_FALL, 1.0), (Kind.SPECIFIC_FORCE, -1.0)])
def test_both_ways_to_say_acceleration_give_gravity(kind, sign):
    last = Base().run(1.0, sign * TILTED, kind=kind, step=5)[-1]
    assert_allclose(last.gravity, TILTED, atol=1e-9)
    assert (last.status, last.faults) == (ReadingStatus.LIVE, Fault.NONE)


def test_what_was_measured_before_the_first_read_is_known_at_once():
    base = Base()
    for k in range(2000):
        base.mailbox.put(-20.0 + 0.01 * k, TILTED, Kind.FREE_FALL)
    first = base.source.read(0.0)
    assert_allclose(first.gravity, TILTED)
    assert (first.status, first.faults) == (ReadingStatus.LIVE, Fault.NONE)


def test_tilting_by_hand_is_followed_without_delay():
    base, (gravity, _) = Base(), rocking(0.3, 0.5, pitch=0.1)
    base.run(1.0, gravity, step=5)
    for k, reading in enumerate(base.run(2.0, gravity)):
        # of 2.9 m/s2, at up to 9 m/s3: 2 ms, or half a percent
        assert_allclose(reading.gravity, gravity(1.0 + 0.001 * k), atol=0.02)


def test_turning_and_its_acceleration_come_from_the_gyroscope():
    w = 2.0 * math.pi

    def rate(t):
        return [0.0, 0.0, 0.2 + 0.5 * math.sin(w * t)]  # about the vertical

    base = Base(angular=True)
    base.run(1.5, LEVEL, rate, hz=200.0)  # still for half a second, and turned by 0.1 rad: the rates are checked
    for k, reading in enumerate(base.run(1.0, LEVEL, rate, hz=200.0)):
        t = 1.5 + 0.001 * k
        assert_allclose(reading.base_rates[0], rate(t), atol=0.005)
        assert_allclose(reading.base_rates[1], [0.0, 0.0, 0.5 * w * math.cos(w * t)], atol=0.3)  # 10 % of 3.1


def test_a_sensor_away_from_the_origin_feels_the_turning_and_the_origin_does_not():
    position, omega = np.array([0.3, 0.0, 0.1]), np.array([0.0, 0.0, 2.0])
    at_sensor = LEVEL - np.cross(omega, np.cross(omega, position))  # outwards by omega^2 0.3 m = 1.2 m/s2
    base = Base(angular=True, fallback="hold", mounting=Mounting(position=position))
    last = base.run(1.5, at_sensor, omega, step=5)[-1]
    assert_allclose(last.gravity, LEVEL, atol=2e-3)
    assert_allclose(last.base_rates, [omega, np.zeros(3)], atol=1e-6)
    assert_allclose(base.run(2.0, step=5)[-1].gravity, LEVEL, atol=5e-3)  # and it is what is held without the sensor


@pytest.mark.alike
@pytest.mark.parametrize(
    ("fallback", "expected"), [("hold", TILTED), ("fade", TILTED), ("static", LEVEL), ("stop", TILTED)]
)
def test_an_interrupted_sensor_is_held_then_falls_back_without_a_leap_and_no_base_turns_on(fallback, expected):
    base = Base(angular=True, fallback=fallback, stale_after=0.05, age_limit=0.2)
    base.run(1.0, TILTED, -0.1 * TILTED / 9.81, step=5)  # about the vertical
    readings = base.run(2.0)
    statuses = [r.status for r in readings]
    # the last sample was taken 10 ms before they stopped
    assert statuses[:40] == [ReadingStatus.LIVE] * 40
    assert statuses[41:189] == [ReadingStatus.STALE] * 148
    fallen = ReadingStatus.STOP if fallback == "stop" else ReadingStatus.FALLBACK
    assert statuses[191:500] == [fallen] * 309
    assert readings[100].faults is Fault.INTERRUPTED
    assert readings[100].age == pytest.approx(0.11)
    assert_allclose(readings[150].gravity, TILTED, atol=1e-9)
    assert_array_equal(readings[-1].base_rates, np.zeros((2, 3)))
    assert_allclose(readings[-1].gravity, expected, atol=1e-6)
    assert steps(readings).max() <= 10.0 * 0.001 + 1e-9
    assert readings[-1].age == (math.inf if fallback == "static" else pytest.approx(2.009))


def test_hold_keeps_gravity_of_the_newest_sample_and_not_what_a_parabola_made_of_it():
    base, (gravity, _) = Base(fallback="hold"), rocking(0.1, 1.0)
    base.run(2.001, gravity)  # upright, where it moves fastest: 6 m/s3 by 0.1 rad at 1 Hz
    assert_allclose(base.run(2.0, step=5)[-1].gravity, gravity(2.0), atol=0.01)


@pytest.mark.parametrize(("amplitude", "frequency"), [(0.02, 2.0), (0.01, 5.0)])
def test_a_gyroscope_that_was_checked_is_believed_in_small_quick_rocking_which_a_place_may_explain_too(
    amplitude, frequency
):
    base, (gravity, rate) = Base(angular=True, mounting=Mounting(checked=True)), rocking(amplitude, frequency)
    base.run(1.0, gravity, rate, hz=200.0, step=5)
    readings = base.run(3.0, gravity, rate, hz=200.0)
    assert {r.faults for r in readings} == {Fault.NONE}
    said = np.array([r.base_rates[0, 0] for r in readings])
    fastest = amplitude * 2.0 * math.pi * frequency
    # 5 Hz is near the cut-off
    assert_allclose(said, [rate(1.0 + 0.001 * k)[0] for k in range(3000)], atol=0.15 * fastest)


SLIGHTLY, RATE = rocking(0.003, 2.0)


@pytest.mark.alike
@pytest.mark.parametrize(
    ("gravity", "rate"),
    [
        (LEVEL, [0.3, 0.0, 0.0]),
        (LEVEL, [0.0, -1.0, 1.0]),
        (LEVEL, lambda t: [2.0 * math.sin(2.0 * math.pi * t), 0.0, 0.0]),
        (SLIGHTLY, lambda t: np.degrees(RATE(t))),  # degrees a second
    ],
)
def test_a_gyroscope_that_turns_while_gravity_hardly_moves_is_not_believed(gravity, rate):
    base = Base(angular=True)
    base.run(1.5, gravity, rate, hz=200.0, step=5)
    readings = base.run(1.0, gravity, rate, hz=200.0, step=5)
    wrong = {Fault.RATE_CONTRADICTS, Fault.RATE_AXES, Fault.RATE_UNIT, Fault.RATE_SCALE}
    assert all(wrong & {*r.faults} for r in readings)
    assert_array_equal(readings[-1].base_rates, np.zeros((2, 3)))


def test_a_gyroscope_that_spoke_in_degrees_is_believed_soon_after_its_return():
    base, (gravity, rate) = Base(angular=True), rocking(0.04, 0.5, middle=0.2)
    base.run(2.0, gravity, rate, hz=100.0, step=5)
    wrong = base.run(1.5, gravity, lambda t: np.degrees(rate(t)), step=5)
    assert any({Fault.RATE_UNIT, Fault.RATE_TOO_FAST} & {*r.faults} for r in wrong)
    readings = base.run(2.0, gravity, rate, step=5)
    assert {r.faults for r in readings[300:]} == {Fault.NONE}  # 1.5 s


# degrees within a second, as a hand tips a base: at a steady rate, and beginning and ending gently
TIPS = {
    "steady": lambda t: np.clip(t, 0.0, 1.0),
    "gentle": lambda t: 0.5 - 0.5 * math.cos(math.pi * min(max(t, 0.0), 1.0)),
}


def noisy(base, rng, seconds, roll, rate=(0.0, 0.0, 0.0), push=lambda t: 0.0):
    """Readings, 100 a second, under a roll [rad], rates and a push along y [m/s2], with the noise of an MPU-6050."""
    readings = []
    for t in np.arange(round(100 * seconds)) / 100.0:
        gravity = tilted_gravity(roll(t), 0.0) - [0.0, push(t), 0.0]
        said = np.asarray(rate(t) if callable(rate) else rate)
        base.mailbox.put(t, gravity + 0.03 * rng.normal(size=3), Kind.FREE_FALL)
        base.mailbox.put(t, said + 0.001 * rng.normal(size=3), Kind.ANGULAR_RATE)
        readings.append(base.source.read(t))
    return readings


@pytest.mark.alike
@pytest.mark.parametrize("bias", [0.0, -0.05])  # 3 deg/s
@pytest.mark.parametrize("tip", TIPS.values(), ids=TIPS)
def test_a_base_that_tips_while_its_gyroscope_says_still_is_found_and_off_by_so_much_from_then_on(tip, bias, rng):
    base, tilt = Base(angular=True), math.radians(25.0)
    readings = noisy(base, rng, 4.5, lambda t: tilt * tip(t - 2.0), (bias, 0.0, 0.0))
    assert not any(r.faults for r in readings[10:200])
    found = [Fault.DISAGREEMENT in r.faults for r in readings]
    assert any(found[200:250])
    assert all(found[found.index(True) : 300])
    # neither is believed, and so the fallback takes over
    assert readings[299].status is ReadingStatus.FALLBACK
    assert_array_equal(readings[299].base_rates[0], np.zeros(3))
    for reading in readings[400:]:  # a second after it came to rest
        assert (reading.status, reading.faults) == (ReadingStatus.DEGRADED, Fault.DISAGREEMENT)
    assert_allclose(readings[-1].gravity, tilted_gravity(tilt, 0.0), atol=0.2)
    # by 25 degrees, two deviations of three axes; a few tenths were drawn meanwhile
    assert readings[-1].deviation * 2.0 * math.sqrt(3.0) == pytest.approx(2.0 * 9.81 * math.sin(0.5 * tilt), rel=0.15)


@pytest.mark.parametrize("stayed", [0.0, 1.0])
def test_a_sensor_that_tipped_on_its_own_is_believed_within_a_second_of_its_return(stayed, rng):
    base, back = Base(angular=True), 3.0 + stayed
    readings = noisy(base, rng, back + 1.5, lambda t: 0.44 * np.clip(t - 2.0, 0.0, 1.0) * (t < back))
    late = readings[round(100 * back) + 100 :]
    assert {(r.status, r.faults) for r in late} == {(ReadingStatus.LIVE, Fault.NONE)}
    assert_allclose(late[-1].gravity, LEVEL, atol=0.2)


def test_a_vehicle_that_asks_for_no_agreement_hears_of_none(rng):
    base = Base(angular=True, mounted_on="ship")
    readings = noisy(base, rng, 3.5, lambda t: 0.44 * np.clip(t - 2.0, 0.0, 1.0))
    assert not any(r.faults for r in readings[10:])


def pushes(t, a):
    """Forth for a second, back for another: what a cart does [m/s2], eased over a quarter of a second."""
    return sum(
        share * a * (0.5 - 0.5 * math.cos(math.pi * min(max(4.0 * (t - at), 0.0), 1.0)))
        for share, at in ((1.0, 2.0), (-2.0, 3.0), (1.0, 4.0))
    )


GENTLY = TIPS["gentle"]
GOOD = {
    "rest, a gyroscope with bias": {"roll": lambda t: 0.1, "rate": (0.05, -0.05, 0.05)},
    "pushed forth and back": {"roll": lambda t: 0.0, "push": lambda t: pushes(t, 2.0)},
    "pushed gently on a slope": {"roll": lambda t: 0.17, "push": lambda t: pushes(t, 1.0)},
    "a table that sways": {"roll": lambda t: 0.0, "push": lambda t: 1.5 * math.sin(4.0 * math.pi * t)},
    "tipped by hand, and the gyroscope says so": {
        "roll": lambda t: 0.44 * GENTLY(t - 2.0),
        "rate": lambda t: (0.22 * math.pi * math.sin(math.pi * (t - 2.0)) * (2.0 <= t < 3.0), 0.0, 0.0),
    },
}


@pytest.mark.alike
@pytest.mark.parametrize("motion", GOOD.values(), ids=GOOD)
def test_pushes_and_biases_of_a_table_or_a_cart_are_no_disagreement(motion, rng):
    readings = noisy(Base(angular=True), rng, 5.5, **motion)
    assert {r.faults for r in readings[10:]} == {Fault.NONE}


@pytest.mark.alike
@pytest.mark.parametrize("lever", [0.0, 0.3])
@pytest.mark.parametrize(("amplitude", "frequency"), [(0.09, 1.0), (0.02, 2.0)])
def test_a_base_that_rocks_about_an_axis_far_from_its_sensor_is_no_disagreement(amplitude, frequency, lever, rng):
    w = 2.0 * math.pi * frequency
    readings = noisy(
        Base(angular=True),
        rng,
        4.0,
        lambda t: 0.2 + amplitude * math.sin(w * t),
        lambda t: (amplitude * w * math.cos(w * t), 0.0, 0.0),
        lambda t: lever * amplitude * w * w * math.sin(w * t),
    )
    assert {r.faults for r in readings[10:]} == {Fault.NONE}


def test_stop_asks_for_a_stop_when_nothing_is_heard_at_the_start():
    statuses = [r.status for r in Base(fallback="stop", start_limit=0.5).run(0.6)]
    assert statuses[:500] == [ReadingStatus.NOMINAL] * 500
    assert statuses[-1] is ReadingStatus.STOP


@pytest.mark.parametrize(("fallback", "before"), [("static", TILTED), ("fade", LEVEL)])
def test_recovery_is_as_smooth_as_the_loss_also_of_a_base_that_was_moved_meanwhile(fallback, before):
    base = Base(fallback=fallback)
    base.run(1.0, before, step=5)
    base.run(3.0, step=5)
    moved = tilted_gravity(0.5, 0.4) if before is LEVEL else TILTED
    readings = base.run(2.0, moved)
    assert_allclose(readings[-1].gravity, moved, atol=1e-6)
    assert readings[-1].status is ReadingStatus.LIVE
    assert steps(readings).max() <= 10.0 * 0.001 + 1e-9


def test_without_rates_where_a_gyroscope_should_be_gravity_goes_on():
    base = Base(angular=True)
    last = base.run(1.0, TILTED, step=5)[-1]
    assert last.status is ReadingStatus.LIVE
    assert last.faults is Fault.RATES_INTERRUPTED


def test_samples_that_were_lost_are_told():
    base = Base()
    base.run(0.5, TILTED, step=5)
    for k in range(3000):
        base.mailbox.put(base.time - 0.004 + 1e-6 * k, TILTED, Kind.FREE_FALL)
    assert Fault.SAMPLES_LOST in base.source.read(base.time).faults


def test_a_clock_that_lags_is_told():
    base = Base()
    base.run(0.5, lambda t: TILTED, step=5)
    for k in range(5):
        base.mailbox.put(base.time + 0.002 * k, TILTED, Kind.FREE_FALL)
    last = base.source.read(base.time + 1.0)
    assert last.status is not ReadingStatus.LIVE
    base.mailbox.put(base.time + 0.1, TILTED, Kind.FREE_FALL)
    assert Fault.STAMP_OLD in base.source.read(base.time + 1.001).faults


def test_garbage_never_raises_nor_makes_gravity_leap(rng):
    base = Base(angular=True, stuck_samples=10)
    base.run(1.0, lambda t: TILTED + 0.01 * rng.normal(size=3), lambda t: 0.001 * rng.normal(size=3))

    def garbage(t):
        return rng.choice([0.0, 1.0, -9.81, 9.81, 1e300, -1e300, math.nan, math.inf, 30.0], 3)

    with np.errstate(all="raise", under="ignore"):
        readings = base.run(2.0, garbage, garbage, hz=1000.0)
    assert np.isfinite([r.gravity for r in readings]).all()
    assert np.isfinite([r.base_rates for r in readings]).all()
    assert steps(readings).max() <= (100.0 + 10.0) * 0.001 + 1e-9


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"fallback": "freeze"}, '"freeze": expected one of hold, fade, static, stop'),
        ({"stale_after": 0.3}, "stale_after"),
        ({"age_limit": math.inf}, "age_limit"),
        ({"stuck_samples": -1}, "stuck_samples"),
        ({"attitude_time": 0.0}, "attitude_time"),
    ],
)
def test_options_that_make_no_sense_are_refused(options, said):
    with pytest.raises(InputError, match=said):
        SensedGravity(Mailbox(), **options)


def test_what_is_not_live_while_it_comes_back_is_stale():
    base = Base(fallback="static")
    base.run(1.0, TILTED, step=5)
    base.run(2.0, step=5)
    readings = base.run(1.5, TILTED)
    off = np.linalg.norm([r.gravity - TILTED for r in readings], axis=1)
    assert all(r.status is not ReadingStatus.LIVE for r, o in zip(readings, off, strict=True) if o > 0.35)
    assert readings[-1].status is ReadingStatus.LIVE


def test_a_base_of_no_name_is_refused():
    with pytest.raises(InputError, match="mounted on"):
        SensedGravity(Mailbox(), mounted_on=None)
