"""What an inertial unit tells of a base that turns, by right gyroscopes and wrong ones, at the origin and away."""

import math
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics
from catenary.robots.catalog import load_robot
from catenary.sensing.gravity_vector import Kind, ReadingStatus, tilted_gravity
from catenary.sensing.imu_faults import Fault
from catenary.sensing.mounting import Mounting
from catenary.sensing.platforms import BASES
from catenary.spatial import LEVEL
from oracles.sensed_base import IDENTITY, Base, fed, is_live, rocking


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
