import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from catenary.errors import InputError
from catenary.simulation.base_motion import (
    _CHANGE_TIME_S,
    BaseTimeline,
    FixedBase,
    RockingBase,
    SteeredBase,
    SwayingBase,
    Wave,
    imu_reading,
    tilt,
)
from catenary.simulation.cable_plant import CablePlant

DOWN = np.array([0.0, 0.0, -9.81])
ROCKING = RockingBase(
    mean=0.1, amplitude=0.3, frequency=0.7, axis=(1.0, 2.0, -0.5), lever=(0.1, -0.2, 0.4), start=FixedBase(0.2, -0.3)
)


SWAYING = SwayingBase(
    (Wave(0.3, 0.7, (1.0, 0.0, 0.0), 0.2), Wave(0.2, 0.9, (0.0, 1.0, 0.5), 1.1)),
    (Wave(2.0, 0.12, (0.0, 0.0, 1.0), 0.4), Wave(1.0, 0.3, (1, 0, 0))),
    FixedBase(0.2, -0.3),
)


def attitude(base, t):
    """R_world_base from the definition: the tilt, then the rocking about own axes."""
    R = Rotation.from_matrix(tilt(base.start.roll, base.start.pitch))
    if base is ROCKING:
        angle = base.mean + base.amplitude * np.sin(2.0 * np.pi * base.frequency * t)
        return R * Rotation.from_rotvec(angle * np.array(base.axis) / np.linalg.norm(base.axis))
    for wave in base.rocking:
        R = R * Rotation.from_rotvec(np.sin(2.0 * np.pi * wave.frequency * t + wave.phase) * wave.along())
    return R


def omega(base, t, h=1e-4):
    return (attitude(base, t - h).inv() * attitude(base, t + h)).as_rotvec() / (2.0 * h)


def acceleration(base, t, h=1e-4):
    """Of the origin, in world axes."""
    if base is SWAYING:
        return [np.sin(0.6 * np.pi * t), 0.0, 2.0 * np.sin(2.0 * np.pi * 0.12 * t + 0.4)]
    before, here, after = (attitude(base, t + s).apply(base.lever) for s in (-h, 0.0, h))
    return (before - 2.0 * here + after) / h**2


@pytest.mark.parametrize(
    ("base", "gravity"),
    [
        (FixedBase(), [0.0, 0.0, -9.81]),
        (FixedBase(roll=np.pi / 2), [0.0, -9.81, 0.0]),  # its y axis has turned up
        (FixedBase(pitch=np.pi / 2), [9.81, 0.0, 0.0]),  # its x axis has turned down
    ],
)
def test_gravity_of_a_base_that_stands_still(base, gravity):
    samples = base.sample(np.zeros(1))
    assert_allclose(samples.gravity, [gravity], atol=1e-14)
    force, rate = imu_reading(samples)
    assert_allclose(force, [np.negative(gravity)], atol=1e-14)  # an IMU at rest reads gravity upwards
    assert_allclose(rate, 0.0)


def test_tilt_rolls_first_and_then_pitches_about_its_own_axis():
    assert_allclose(tilt(0.3, -0.7), Rotation.from_euler("XY", [0.3, -0.7]).as_matrix(), atol=1e-15)


@pytest.mark.parametrize("base", [ROCKING, SWAYING])
def test_a_base_that_moves_turns_and_accelerates_as_its_pose_does_and_an_imu_reads_it(base):
    times = np.linspace(0.0, 3.0, 20)
    samples = base.sample(times)
    for t, gravity, motion, force, rate in zip(times, *samples, *imu_reading(samples), strict=True):
        to_base = attitude(base, t).inv()
        felt = to_base.apply(acceleration(base, t))
        assert_allclose(gravity, to_base.apply(DOWN), atol=1e-12)
        # central differences: h^2 of the third and fourth derivatives, roundings of 1e-16 / h^2
        assert_allclose(
            [*motion[[0, 2]], force, rate], [omega(base, t), felt, felt - gravity, omega(base, t)], atol=1e-6
        )
        # rates of change in axes that turn are those in axes that do not
        assert_allclose(motion[1], (omega(base, t + 1e-4) - omega(base, t - 1e-4)) / 2e-4, atol=1e-4)


@pytest.mark.parametrize("pieces", [[1] * 3000, [3000], [1000, 24, 1000, 976]])
def test_timeline_gives_the_same_numbers_however_it_is_asked(pieces):
    timeline, tick = BaseTimeline(ROCKING, 1e-3), 0
    gravity, motion = [], []
    for piece in pieces:
        end = tick + piece
        while tick < end:
            samples, count = timeline.rows(tick, end - tick)
            gravity.append(samples.gravity)
            motion.append(samples.motion)
            tick += count
    whole = ROCKING.sample(np.arange(3000) * 1e-3)
    assert_allclose(np.concatenate(gravity), whole.gravity, rtol=0, atol=1e-14)
    assert_allclose(np.concatenate(motion), whole.motion, rtol=0, atol=1e-12)


def test_timeline_of_a_fixed_base_holds_for_as_long_as_asked():
    samples, count = BaseTimeline(FixedBase(0.1), 1e-3).rows(5000, 100_000)
    assert count == 100_000
    assert samples.gravity.shape == (1, 3)


ANGLES = st.floats(-1.0, 1.0)


@given(ANGLES, ANGLES)
def test_base_that_has_arrived_stands_as_a_fixed_one(roll: float, pitch: float) -> None:
    base = SteeredBase().toward(3.0, roll, pitch)
    samples = base.sample(np.array([3.0 + _CHANGE_TIME_S, 60.0]))
    assert_allclose(samples.gravity, np.tile(FixedBase(roll, pitch).sample(np.zeros(1)).gravity, (2, 1)), atol=1e-12)
    assert_allclose(samples.motion, 0.0, atol=1e-12)


@given(ANGLES, ANGLES, st.floats(0.0, 0.3), st.floats(0.1, 2.0), st.floats(0.1, 5.0), ANGLES)
def test_turning_is_the_derivative_of_the_attitude(roll, pitch, amplitude, frequency, again, after) -> None:
    base = SteeredBase().toward(1.0, roll, pitch, amplitude=amplitude, frequency=frequency)
    base = base.toward(1.0 + again, after, -pitch, amplitude=0.5 * amplitude, frequency=frequency)
    h, times = 1e-4, np.array([1.3, 2.0, 7.0]) + again

    def attitude(t: np.ndarray) -> Rotation:
        return Rotation.from_euler("XY", np.column_stack([base.roll.at(t)[0], base.pitch.at(t)[0]]))

    samples = base.sample(times)
    # of the base's own axes: R(t)^T R(t + h) = exp(h omega)
    omega = (attitude(times - h).inv() * attitude(times + h)).as_rotvec() / (2.0 * h)
    assert_allclose(samples.motion[:, 0], omega, atol=1e-5 * (1.0 + np.abs(omega).max()) ** 3)
    later, earlier = (base.sample(times + d).motion[:, 0] for d in (h, -h))
    alpha = (later - earlier) / (2.0 * h)
    assert_allclose(samples.motion[:, 1], alpha, atol=1e-4 * (1.0 + np.abs(alpha).max()))
    assert_allclose(attitude(times).apply(samples.gravity), np.tile([0.0, 0.0, -9.81], (3, 1)), atol=1e-3)


@given(st.floats(0.0, 4.0), ANGLES, ANGLES, st.floats(0.0, 0.3), st.floats(0.0, 2.0))
def test_nothing_leaps_when_somebody_steers(time, roll, pitch, amplitude, frequency) -> None:
    before = SteeredBase().toward(0.0, 0.4, -0.2, amplitude=0.1, frequency=0.7)
    after = before.toward(time, roll, pitch, amplitude=amplitude, frequency=frequency)
    now = np.array([time])
    assert_allclose(after.sample(now).gravity, before.sample(now).gravity, atol=1e-9)
    assert_allclose(after.sample(now).motion, before.sample(now).motion, atol=1e-9)


def test_wrong_rocking_is_refused() -> None:
    with pytest.raises(InputError, match="rocking: expected"):
        SteeredBase().toward(0.0, 0.0, 0.0, amplitude=-0.1)
    with pytest.raises(InputError):
        SteeredBase().toward(0.0, float("nan"), 0.0)


def test_plant_feels_the_base_that_it_stands_on_from_now_on() -> None:
    plant = CablePlant()
    assert_allclose(plant.measured_js().gravity, [0.0, 0.0, -9.81], atol=1e-3)
    plant.set_base(FixedBase(np.deg2rad(30.0)))
    assert_allclose(plant.measured_js().gravity, FixedBase(np.deg2rad(30.0)).sample(np.zeros(1)).gravity[0])
