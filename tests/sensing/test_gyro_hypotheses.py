"""Accelerometer and gyroscope hold each other to dg/dt = -omega x g: motions by Rodrigues' formula, mistakes put in."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catenary.sensing.gyro_hypotheses import TurningWatch, compare, evidence
from catenary.sensing.imu_faults import Fault

HZ, SPAN = 100, 4.0
NOWHERE = np.zeros(3)
SIGN, AXES, UNIT, SCALE = Fault.RATE_SIGN, Fault.RATE_AXES, Fault.RATE_UNIT, Fault.RATE_SCALE
SWAP = np.eye(3)[[1, 0, 2]]
# what the gyroscope makes of its rates, what is found, and what is said of it
MISTAKES = {
    "none": (np.eye(3), Fault.NONE, ""),
    "negated": (-np.eye(3), SIGN, "-x,-y,-z"),
    "x negated": (np.diag([-1.0, 1.0, 1.0]), SIGN, "-x,y,z"),
    "NED by half": (np.diag([1.0, -1.0, -1.0]), SIGN, "x,-y,-z"),
    "x and y swapped": (SWAP, AXES, "y,x,-z"),
    "in another order": (np.eye(3)[[2, 0, 1]], AXES, "y,z,x"),
    "deg/s": (np.degrees(np.eye(3)), UNIT, "in deg/s"),
    "divided by 57.3": (np.radians(np.eye(3)), UNIT, "divided by 57.3"),
    "three times": (3.0 * np.eye(3), SCALE, "gravity turns 0.3"),
}


def rocking(rng, *, amplitude, hz, axis, lever=(0.0, 0.0, 0.0), late=0.0, seconds=SPAN):
    """Times, gravity and rates of a base that rocks about an axis, seen from `lever`, with an MPU-6050's noise."""
    t = np.arange(round(seconds * HZ)) / HZ
    along, w = np.asarray(axis) / np.linalg.norm(axis), 2.0 * np.pi * hz
    turned, omega, late_omega, alpha = (
        size * f(w * s)[:, None] * along
        for size, f, s in (
            (amplitude, np.sin, t), (amplitude * w, np.cos, t), (amplitude * w, np.cos, t - late),
            (-amplitude * w * w, np.sin, t),
        )
    )  # fmt: skip
    at_rest = Rotation.from_euler("XY", [0.2, 0.1]).inv().apply([0.0, 0.0, -9.81])
    acceleration = np.cross(alpha, lever) + np.cross(omega, np.cross(omega, lever))
    gravity = Rotation.from_rotvec(-turned).apply(at_rest) - acceleration
    return t, gravity + 0.04 * rng.normal(size=gravity.shape), late_omega + 9e-4 * rng.normal(size=gravity.shape)


def compared(t, gravity, rates):
    sums = evidence(NOWHERE, [np.inf])
    for stamp, rate, down in zip(t.tolist(), rates, gravity, strict=True):
        sums.add_rate(stamp, rate)
        sums.add_gravity(stamp, down)
    return compare(sums, noise=(0.04, 9e-4))


MOTIONS = {
    "slow": {"amplitude": 0.17, "hz": 0.4, "axis": (1.0, 0.5, 0.0)},
    "at 1 Hz": {"amplitude": 0.09, "hz": 1.0, "axis": (1.0, -0.6, 0.0)},
    "far": {"amplitude": 0.8, "hz": 0.2, "axis": (1.0, 0.4, 0.0)},
}


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_of_a_gyroscope_is_named_with_what_mends_it(mistake, motion, rng):
    matrix, fault, said = MISTAKES[mistake]
    t, gravity, rates = rocking(rng, **MOTIONS[motion])
    found = compared(t, gravity, rates @ matrix.T)
    assert (found.fault, found.is_right) == (fault, fault is Fault.NONE)
    assert said in found.remedy


@pytest.mark.parametrize("late", [0.1, -0.1, 0.15])
def test_a_delay_is_named_with_its_size_and_side(late, rng):
    found = compared(*rocking(rng, amplitude=0.09, hz=1.0, axis=(1.0, 0.0, 0.0), late=late))
    assert found.fault is Fault.RATE_DELAY
    assert f"{1000 * abs(late):.0f} ms {'late' if late > 0.0 else 'early'}" in found.remedy


@pytest.mark.parametrize("lever", [0.3, 0.6, -0.05])  # above the axis, and a little below
@pytest.mark.parametrize(("amplitude", "hz"), [(0.09, 1.0), (0.03, 2.0), (0.2, 0.5)])
def test_a_gyroscope_far_from_the_axis_of_turning_is_not_doubted(amplitude, hz, lever, rng):
    found = compared(*rocking(rng, amplitude=amplitude, hz=hz, axis=(1.0, 0.0, 0.0), lever=(0.0, 0.0, lever)))
    assert found.fault is Fault.NONE


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.0, 0.0, 0.5)])
def test_nothing_is_told_of_a_base_at_rest_nor_of_one_that_turns_about_the_vertical(turn, rng):
    t = np.arange(400) / HZ
    gravity = np.array([0.0, 0.0, -9.81]) + 0.04 * rng.normal(size=(400, 3))
    found = compared(t, gravity, -np.array(turn) + 9e-4 * rng.normal(size=(400, 3)))
    assert (found.fault, found.is_right) == (Fault.NONE, False)


def test_a_gyroscope_that_was_wrong_is_wrong_until_a_turn_shows_that_it_agrees(rng):
    watch, clock = TurningWatch(NOWHERE, 0.0), 0.0
    said = []
    # x negated, which rocking about y does not show; then all of it right
    x, y, wrong = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), np.diag([-1.0, 1.0, 1.0])
    for axis, matrix in ((x, wrong), (y, np.eye(3)), (x, np.eye(3))):
        t, gravity, rates = rocking(rng, amplitude=0.1, hz=0.8, axis=axis)
        for k in range(len(t)):
            watch.add_rate(clock + t[k], rates[k] @ matrix.T, None)
            watch.add_gravity(clock + t[k], gravity[k], (0.04, 9e-4))
        said.append(watch.result.fault)
        clock += SPAN + 1.0
    assert said == [Fault.RATE_SIGN, Fault.RATE_SIGN, Fault.NONE]
    assert watch.result.is_right
