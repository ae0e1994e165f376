import math
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics
from catenary.errors import InputError
from catenary.robots.catalog import load_robot
from catenary.sensing.bases import BASES
from catenary.sensing.checks import Fault
from catenary.sensing.imu import SensedGravity
from catenary.sensing.mounting import Mounting
from catenary.sensing.vector import Kind, Mailbox, ReadingStatus, tilted_gravity
from catenary.spatial import LEVEL

TILTED = tilted_gravity(0.2, -0.1)
IDENTITY = np.eye(3)


class Base:
    """An accelerometer, and a gyroscope, that a test writes samples for; read every millisecond."""

    def __init__(self, *, angular=False, **options):
        self.mailbox = Mailbox()
        options.setdefault("stuck_samples", 0)
        self.source = SensedGravity(self.mailbox, angular=angular, **options)
        self.angular = angular
        self.time = 0.0

    def run(self, seconds, gravity=None, rate=None, *, kind=Kind.FREE_FALL, hz=100.0, step=1):
        """Let time go by, with samples of gravity(t); give the readings, one every `step` [ms]."""
        readings = []
        every = round(1000.0 / hz)
        for _ in range(round(seconds * 1000 / step)):
            tick = round(self.time * 1000)
            if gravity is not None and tick % every == 0:
                value = gravity(self.time) if callable(gravity) else gravity
                self.mailbox.put(self.time, value, kind)
                if self.angular and rate is not None:
                    self.mailbox.put(self.time, rate(self.time) if callable(rate) else rate, Kind.ANGULAR_RATE)
            readings.append(self.source.read(self.time))
            self.time = (tick + step) / 1000.0
        return readings


def fed(base, rng, times, gravity, rates, noise=0.03, distorted=IDENTITY):
    """Readings at times (T,) of samples of gravity and rates, (T, 3) or (3,), with the noise of an MPU-6050.

    The gyroscope writes `distorted` (3, 3) times what it should.
    """
    said = (rates + 9e-4 * rng.normal(size=(len(times), 3))) @ distorted.T
    sensed = gravity + noise * rng.normal(size=(len(times), 3))
    readings = []
    for now, omega, g in zip(times.tolist(), said, sensed, strict=True):
        base.mailbox.put(now, omega, Kind.ANGULAR_RATE)
        base.mailbox.put(now, g, Kind.FREE_FALL)
        readings.append(base.source.read(now))
    return readings


def is_live(readings):
    return np.array([r.status is ReadingStatus.LIVE for r in readings])


def rocking(amplitude, frequency, middle=0.0, pitch=0.0):
    """Gravity(t), and rates(t), of a base that rolls by an amplitude [rad] at a frequency [Hz] about a middle [rad]."""
    w = 2.0 * math.pi * frequency
    return (
        lambda t: tilted_gravity(middle + amplitude * math.sin(w * t), pitch),
        lambda t: [amplitude * w * math.cos(w * t), 0.0, 0.0],
    )


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


def turned(angle, rate, ramp, t):
    """Angle [rad] and rate [rad/s] at times (N,) of a turn that begins at 1 s: a trapezoid of rates."""
    inside, whole = np.clip(t - 1.0, 0.0, angle / rate + ramp), angle / rate
    w = rate * np.clip(np.minimum(inside, whole + ramp - inside) / ramp, 0.0, 1.0)
    return np.concatenate([[0.0], np.cumsum(0.5 * np.diff(t) * (w[1:] + w[:-1]))]), w


MOUNTS = [("table", True), ("table", False), ("vehicle", True), ("ship", True)]


@pytest.mark.alike
@pytest.mark.parametrize(("mounted_on", "angular"), MOUNTS)
@pytest.mark.parametrize(
    ("angle", "rate", "axis", "ramp"),
    [
        (90, 40, (1.0, 0.0, 0.0), 0.2),
        (180, 60, (0.0, 1.0, 0.0), 0.2),
        (360, 200, (1.0, 1.0, 0.5), 0.2),
        (180, 200, (1.0, 0.0, 0.0), 0.02),  # as no base begins to
        (360, 200, (1.0, 0.0, 0.0), 0.1),
        (360, 100, (0.0, 0.0, 1.0), 0.1),
    ],
)
def test_a_base_that_turns_is_live_where_gravity_is_known_and_nowhere_else(
    angle, rate, axis, ramp, mounted_on, angular, rng
):
    t = np.arange(round(100 * (2.0 + angle / rate))) / 100.0
    along = np.asarray(axis) / np.linalg.norm(axis)
    turn, w = turned(np.radians(angle), np.radians(rate), ramp, t)
    # about the axis backwards, by Rodrigues' formula
    c, s, start = np.cos(turn)[:, None], -np.sin(turn)[:, None], tilted_gravity(0.2, 0.1)
    gravity = c * start + s * np.cross(along, start) + (1.0 - c) * (along @ start) * along
    base = Base(angular=angular, mounted_on=mounted_on, stuck_samples=10)
    readings = fed(base, rng, t, gravity, np.outer(w, along))
    off, live = np.linalg.norm([r.gravity for r in readings] - gravity, axis=1), is_live(readings)
    assert off[live & (t > 0.5)].max() < 0.5
    fastest = math.radians(rate) * 9.81 * (abs(along[2]) < 1.0)  # [m/s3]
    if mounted_on != "ship" or fastest < 12.0:  # what its filter follows, half a second long
        assert live[t > 0.5].mean() > (0.99 if ramp > 0.1 else 0.9)
        slow = ramp > 0.1 and math.radians(rate) < 4.0
        assert not slow or {r.faults for r, at in zip(readings, t, strict=True) if at > 0.5} == {Fault.NONE}


@pytest.mark.alike
@pytest.mark.parametrize(("scale", "angle", "rate"), [(0.5, 60, 5), (0.5, 90, 200), (1.25, 90, 60), (2.0, 45, 5)])
def test_a_wrong_scale_is_named_within_a_second_of_when_no_push_of_a_table_explains_it(scale, angle, rate, rng):
    # after rest for three seconds more, which tell the bias; gravity foretold is then off by (1 - scale) of the turn
    seen = BASES["table"].push / (9.81 * abs(1.0 - scale) * math.radians(rate))
    t = np.arange(-300, round(100 * (seen + 2.0))) / 100.0
    turn, w = turned(np.radians(angle), np.radians(rate), 0.1, t)
    base, gravity = Base(angular=True, stuck_samples=10), np.array([tilted_gravity(0.2 + roll, 0.0) for roll in turn])
    readings = fed(base, rng, t, gravity, np.outer(scale * w, [1.0, 0.0, 0.0]) + 0.01, 0.04)
    assert {r.faults for r, at in zip(readings, t, strict=True) if at < 1.0} == {Fault.NONE}
    assert Fault.RATE_SCALE in readings[-1].faults
    assert float(base.source.remedy.split()[2]) == pytest.approx(1.0 / scale, rel=0.1)  # "gravity turns 1.98 times ..."


@pytest.mark.alike
@pytest.mark.parametrize(("mounted_on", "angular"), MOUNTS)
@pytest.mark.parametrize(("rate", "ramp"), [(60, 0.3), (200, 0.2)])
@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (1.0, 1.0, 0.5), (0.0, 0.0, 1.0)])
def test_a_sensor_away_from_the_origin_is_live_where_its_lever_is_known(axis, rate, ramp, mounted_on, angular, rng):
    # 0.22 m feel up to 6 m/s2 where the turn begins or ends, and 2.7 in it: real accelerations, and no fault
    t, along = np.arange(350) / 100.0, np.asarray(axis) / np.linalg.norm(axis)
    begun = np.clip((t - 1.0) / ramp, 0.0, 1.0) * np.pi, np.clip((2.5 - t) / ramp, 0.0, 1.0) * np.pi
    share = [0.5 - 0.5 * np.cos(s) for s in begun]
    change = np.sin(begun[0]) - np.sin(begun[1])  # each zero where the other is not
    omega, alpha = math.radians(rate) * share[0] * share[1], math.radians(rate) * np.pi / 2.0 / ramp * change
    turn = np.concatenate([[0.0], np.cumsum(0.005 * (omega[1:] + omega[:-1]))])
    true = Rotation.from_rotvec(-np.outer(turn, along)).apply(tilted_gravity(0.2, 0.1))
    omega, alpha, place = np.outer(omega, along), np.outer(alpha, along), np.array([0.1, 0.0, 0.2])
    sensed = true - np.cross(alpha, place) - np.cross(omega, np.cross(omega, place))
    base = Base(angular=angular, stuck_samples=10, mounted_on=mounted_on, mounting=Mounting(position=place))
    readings = fed(base, rng, t, sensed, omega)
    off, live = np.linalg.norm([r.gravity for r in readings] - true, axis=1), is_live(readings)
    assert off[live & (t > 0.5)].max() < 0.5
    assert live[(t > 0.5) & (t < 1.0)].all()
    if angular and math.radians(rate) < {"ship": 1.5}.get(mounted_on, 4.0):
        assert live[-30:].all()
        assert {f for r in readings[50:] for f in r.faults.names} <= {
            "unchecked_turn",
            "vibration",
            "recovering",
            "not_followed",
        }


@pytest.mark.alike
@pytest.mark.parametrize(("rate", "late"), [(60, 0.1), (120, 0.2), (200, 0.1), (60, -0.1)])
def test_a_delay_is_named_in_a_turn_and_is_never_live_and_wrong(rate, late, rng):
    t = np.arange(-200, 500) / 100.0  # at rest for three seconds, which tell the bias
    turn, _ = turned(np.radians(120), np.radians(rate), 0.2, t)
    said, base = turned(np.radians(120), np.radians(rate), 0.2, t - late)[1], Base(angular=True, stuck_samples=10)
    gravity = np.array([tilted_gravity(0.2 + roll, 0.0) for roll in turn])
    readings = fed(base, rng, t, gravity, np.outer(said, [1.0, 0.0, 0.0]), 0.04)
    off, live = np.linalg.norm([r.gravity for r in readings] - gravity, axis=1), is_live(readings)
    assert off[live & (t > -1.5)].max() < 0.5
    named = np.array([Fault.RATE_DELAY in r.faults for r in readings])
    assert t[named][0] < 2.0  # the turn begins at 1 s
    assert named[-1] or late < 0.0


def test_a_fallback_turns_with_the_rates():
    base, (gravity, rate) = Base(angular=True), rocking(0.1, 1.0)
    base.run(2.0, gravity, rate, step=5)  # checks the gyroscope
    base.run(1.0, LEVEL, [0.0, 0.0, 0.0], step=5)
    # the accelerometer alone is silent while the base rolls by 0.25 rad
    for k in range(2000):
        if k % 10 == 0:
            base.mailbox.put(base.time, [0.25 * (k < 1000), 0.0, 0.0], Kind.ANGULAR_RATE)
        reading = base.source.read(base.time)
        base.time = (round(base.time * 1000) + 1) / 1000.0
    assert reading.status is ReadingStatus.FALLBACK
    assert_allclose(reading.gravity, tilted_gravity(0.25, 0.0), atol=0.4)  # of 2.4; its first moments are doubted


@pytest.mark.parametrize("hz", [20.0, 25.0, 50.0])
def test_a_slow_unit_tells_the_turning_too(hz):
    base, (gravity, rate) = Base(angular=True), rocking(0.1, 0.5)
    base.run(1.0, gravity, rate, hz=hz, step=10)
    readings = base.run(2.0, gravity, rate, hz=hz)
    assert {r.faults for r in readings} <= {Fault.NONE}
    said = [r.base_rates[0, 0] for r in readings]
    assert_allclose(said, [rate(1.0 + 0.001 * k)[0] for k in range(2000)], atol=0.03)  # of 0.31 rad/s


def test_a_jump_that_no_base_makes_is_believed_after_ten_seconds():
    base = Base()
    base.run(1.0, LEVEL, step=5)
    readings = base.run(11.0, tilted_gravity(0.4, 0.25), step=10)
    assert Fault.JUMP in readings[950].faults
    assert readings[-1].faults is Fault.NONE


def test_what_is_not_live_while_it_comes_back_is_stale():
    base = Base(fallback="static")
    base.run(1.0, TILTED, step=5)
    base.run(2.0, step=5)
    readings = base.run(1.5, TILTED)
    off = np.linalg.norm([r.gravity - TILTED for r in readings], axis=1)
    assert all(r.status is not ReadingStatus.LIVE for r, o in zip(readings, off, strict=True) if o > 0.35)
    assert readings[-1].status is ReadingStatus.LIVE


GYROSCOPES = {
    "right": np.eye(3), "negated": -np.eye(3), "x negated": np.diag([-1.0, 1.0, 1.0]), "swapped": np.eye(3)[[1, 0, 2]],
    "in another order": np.eye(3)[[2, 0, 1]], "deg/s": np.degrees(np.eye(3)), "/57.3": np.radians(np.eye(3)),
    "twice": 2.0 * np.eye(3), "half": 0.5 * np.eye(3), "late": 0.15, "early": -0.1,
}  # fmt: skip


ON_AXIS, OFF_AXIS = ((1.0, 0.4, 0.0), (0.0, 0.0, 0.0)), ((1.0, 0.4, 0.8), (0.1, 0.0, 0.2))  # axis and place
TURNED = [(name, *how) for how in ((ON_AXIS, 0.0), (OFF_AXIS, 0.0), (OFF_AXIS, 1.5)) for name in GYROSCOPES]


def moved(times, rest):
    """Angle [rad] and its two rates of a turn from rest, by 10 degrees at 1 Hz."""
    w, s = 2.0 * math.pi, np.maximum(times - rest, 0.0)
    return (0.09 * f for f in (1.0 - np.cos(w * s), w * np.sin(w * s), w * w * np.cos(w * s) * (times >= rest)))


@cache
def swung(axis, place, rest):
    """Times, gravity, rates and accelerations of a base that rocks; what is sensed at a place, and read of it alone."""
    t, along = np.arange(round(100 * (rest + 2.5))) / 100.0, np.array(axis) / np.linalg.norm(axis)
    turn, omega, alpha = (np.outer(value, along) for value in moved(t, rest))
    level = Rotation.from_rotvec(-turn).apply(tilted_gravity(0.15, 0.1))
    sensed = level - np.cross(alpha, place) - np.cross(omega, np.cross(omega, place))
    base = Base(stuck_samples=10, mounting=Mounting(position=np.array(place)))
    alone = fed(base, np.random.default_rng(0), t, sensed, omega, 0.04)
    return t, level, omega, alpha, sensed, [r.gravity for r in alone]


@pytest.mark.alike
@pytest.mark.parametrize(("name", "mounted", "rest"), TURNED)
def test_a_wrong_gyroscope_costs_no_more_torque_than_none_also_in_the_first_second(name, mounted, rest, rng):
    wrong, arm = GYROSCOPES[name], load_robot("ur10e")
    t, level, omega, alpha, sensed, blind = swung(*mounted, rest)
    late, distorted = (wrong, IDENTITY) if isinstance(wrong, float) else (0.0, wrong)
    axis, place = np.array(mounted)
    said = np.outer(list(moved(t - late, rest))[1], axis / np.linalg.norm(axis))
    base = Base(angular=True, stuck_samples=10, mounting=Mounting(position=place))
    readings = fed(base, rng, t, sensed, said, 0.04, distorted)
    gravity, rates = [r.gravity for r in readings], np.array([r.base_rates for r in readings]).swapaxes(0, 1)
    q, still = np.tile([0.3, -0.9, 1.1, -0.7, -1.5, 0.2], (len(t), 1)), np.zeros((len(t), 6))
    true, alone, used = (
        inverse_dynamics(arm, q, still, still, g, BaseMotion(*turning))
        for g, turning in (
            (level, (omega, alpha)), (blind, np.zeros((2, 3))), (gravity, rates),
        )
    )  # fmt: skip
    for part in ((t >= rest + 0.2 * (rest == 0.0)) & (t < rest + 1.0), t >= rest + 1.0):
        off, without = (np.sqrt(np.mean((tau[part] - true[part]) ** 2)) for tau in (used, alone))
        assert off < 1.03 * without
    assert name != "right" or off < 0.35 * without


def turned_about(axis, angle, place):
    """Gravity at a sensor and rates over time of a level or tilted base that turns by `angle` (T,) about an axis."""
    along = np.array(axis) / np.linalg.norm(axis)
    omega, alpha = (
        np.outer(f(f(angle)) if two else f(angle), along) for f, two in ((rates_of, False), (rates_of, True))
    )
    level = Rotation.from_rotvec(-np.outer(angle, along)).apply(tilted_gravity(0.05, 0.0))
    return level, level - np.cross(alpha, place) - np.cross(omega, np.cross(omega, place)), omega


def rates_of(values):
    return np.gradient(values, 0.005, edge_order=2)


TURNS = np.arange(0.0, 9.0, 0.005)
BEGUN = np.clip(TURNS - 2.0, 0.0, 1.0)
SMOOTHLY = BEGUN**3 * (10.0 - 15.0 * BEGUN + 6.0 * BEGUN**2)
SPUN = np.cumsum(SMOOTHLY) * 0.005
ROCKED = SMOOTHLY * np.sin(2.0 * math.pi * (TURNS - 2.0))
PLACED = [
    pytest.param(axis, size * motion, place, id=f"{name}-{place}")
    for name, axis, motion, size, places in (
        ("120 deg/s", (0.0, 0.0, 1.0), SPUN, math.radians(120.0), ((0.3, 0.0, 0.0), (0.1, -0.2, 0.5))),
        ("180 deg/s", (0.0, 0.0, 1.0), SPUN, math.radians(180.0), ((0.3, 0.0, 0.0), (-0.1, 0.2, 3.0))),
        ("5 deg at 1 Hz", (1.0, 0.0, 0.0), ROCKED, math.radians(5.0), ((0.0, 0.0, -0.2), (0.0, 0.0, -0.3), (0.0, 0.0, -1.0))),
    )
    for place in places
]  # fmt: skip


@pytest.mark.parametrize(("axis", "angle", "place"), PLACED)
def test_a_right_gyroscope_is_not_condemned_for_the_place_that_was_told(axis, angle, place, rng):
    level, sensed, omega = turned_about(axis, angle, place)
    base = Base(angular=True, mounting=Mounting(position=np.array(place), checked=True))
    readings = fed(base, rng, TURNS, sensed, omega)
    assert not any(
        {Fault.RATE_SIGN, Fault.RATE_AXES, Fault.RATE_SCALE, Fault.RATE_UNIT} & {*r.faults} for r in readings
    )
    off = np.linalg.norm(np.array([r.gravity for r in readings]) - level, axis=1)
    assert not any(r.status is ReadingStatus.LIVE and e > 0.3 for r, e in zip(readings, off, strict=True))


@pytest.mark.parametrize("wrong", [-np.eye(3), np.eye(3)[[1, 0, 2]] * [1, -1, 1], np.degrees(np.eye(3))])
def test_a_wrong_gyroscope_is_named_and_gravity_without_its_lever_is_not_live(wrong, rng):
    place = (0.0, 0.0, -0.3)
    level, sensed, omega = turned_about((1.0, 0.0, 0.0), math.radians(5.0) * ROCKED, place)
    base = Base(angular=True, mounting=Mounting(position=np.array(place)))
    readings = fed(base, rng, TURNS, sensed, omega, distorted=wrong)
    named = {Fault.RATE_SIGN, Fault.RATE_AXES, Fault.RATE_UNIT, Fault.RATE_SCALE, Fault.RATE_CONTRADICTS}
    assert all(named & {*r.faults} for r in readings[round(4.0 / 0.005) :])
    off = np.linalg.norm(np.array([r.gravity for r in readings]) - level, axis=1)
    assert sum(r.status is ReadingStatus.LIVE and e > 0.3 for r, e in zip(readings, off, strict=True)) < 0.5 / 0.005


def test_a_base_of_no_name_is_refused():
    with pytest.raises(InputError, match="mounted on"):
        SensedGravity(Mailbox(), mounted_on=None)
