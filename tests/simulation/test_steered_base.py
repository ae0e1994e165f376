import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from catenary.errors import InputError
from catenary.simulation.base_motion import FixedBase, RockingBase
from catenary.simulation.cable_plant import CablePlant
from catenary.simulation.steered_base import CHANGE, SteeredBase

ANGLES = st.floats(-1.0, 1.0)


@given(ANGLES, ANGLES)
def test_base_that_has_arrived_stands_as_a_fixed_one(roll: float, pitch: float) -> None:
    base = SteeredBase().toward(3.0, roll, pitch)
    samples = base.sample(np.array([3.0 + CHANGE, 60.0]))
    assert_allclose(
        samples.gravity, np.tile(FixedBase(roll, pitch).sample(np.zeros(1)).gravity, (2, 1)), atol=1e-12
    )
    assert_allclose(samples.motion, 0.0, atol=1e-12)


@given(ANGLES, ANGLES, st.floats(0.0, 0.3), st.floats(0.1, 2.0), st.floats(0.1, 5.0), ANGLES)
def test_turning_is_the_derivative_of_the_attitude(roll, pitch, amplitude, frequency, again, after) -> None:
    base = SteeredBase().toward(1.0, roll, pitch, amplitude=amplitude, frequency=frequency)
    base = base.toward(1.0 + again, after, -pitch, amplitude=0.5 * amplitude, frequency=frequency)
    h, times = 1e-4, np.array([1.3, 2.0, 7.0]) + again

    def attitude(t: np.ndarray) -> Rotation:
        return Rotation.from_euler("XY", np.column_stack([base.roll.at(t).angle, base.pitch.at(t).angle]))

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


def test_rocking_is_that_of_a_rocking_base_once_the_change_is_over() -> None:
    base = SteeredBase().toward(0.0, 0.2, 0.0, amplitude=0.1, frequency=0.5)
    times = np.linspace(CHANGE, 10.0, 50)
    other = RockingBase(0.2, 0.1, 0.5).sample(times)
    assert_allclose(base.sample(times).gravity, other.gravity, atol=1e-9)
    assert_allclose(base.sample(times).motion, other.motion, atol=1e-9)


def test_wrong_rocking_is_refused() -> None:
    with pytest.raises(InputError, match="rocking: expected"):
        SteeredBase().toward(0.0, 0.0, 0.0, amplitude=-0.1)
    with pytest.raises(InputError):
        SteeredBase().toward(0.0, float("nan"), 0.0)


def test_plant_feels_the_base_that_it_stands_on_from_now_on() -> None:
    plant = CablePlant()
    assert_allclose(plant.measured_js().gravity, [0.0, 0.0, -9.81], atol=1e-3)
    plant.stand_on(FixedBase(np.deg2rad(30.0)))
    assert_allclose(plant.measured_js().gravity, FixedBase(np.deg2rad(30.0)).sample(np.zeros(1)).gravity[0])
