"""What every source of gravity promises to a loop."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest

from catenary.control.loop import GravitySource
from catenary.sensing.fallback_kinds import FALLBACKS
from catenary.sensing.gravity_vector import FixedGravity, Mailbox, ReadingStatus, tilted_gravity
from catenary.sensing.imu import SensedGravity
from catenary.simulation.base_motion import FixedBase, RockingBase
from catenary.simulation.sensors import InjectedFault, SensorModel, SimulatedSensor


def sensed(
    base: FixedBase | RockingBase, *faults: InjectedFault, gyroscope: bool = True, fallback: str = "fade"
) -> SensedGravity:
    mailbox = Mailbox()
    sensor = SimulatedSensor(base, mailbox, SensorModel(has_gyroscope=gyroscope), faults=faults)
    return SensedGravity(mailbox, angular=gyroscope, feed=sensor.advance, fallback=fallback)


SOURCES: dict[str, Callable[[], GravitySource]] = {
    "fixed": lambda: FixedGravity(tilted_gravity(0.1, 0.2)),
    "silent": lambda: SensedGravity(Mailbox()),
    "accelerometer": lambda: sensed(FixedBase(0.2, 0.1), gyroscope=False),
    "inertial unit": lambda: sensed(RockingBase(0.2, 0.1, 1.0)),
    **{
        f"silenced, {name}": partial(sensed, RockingBase(0.2, 0.1, 1.0), InjectedFault("drop_out", 0.3), fallback=name)
        for name in FALLBACKS
    },
    "broken": lambda: sensed(RockingBase(0.2, 0.1, 1.0), InjectedFault("not_finite", 0.3)),
}


@pytest.fixture(params=sorted(SOURCES))
def source(request: pytest.FixtureRequest) -> GravitySource:
    return SOURCES[request.param]()


def test_every_reading_is_finite_and_of_gravitys_length(source):
    for tick in range(1000):
        reading = source.read(0.001 * tick)
        assert reading.gravity.shape == (3,)
        assert reading.base_rates.shape == (2, 3)
        assert np.isfinite(reading.base_rates).all()
        assert 8.0 < np.linalg.norm(reading.gravity) < 12.0
        assert reading.age >= 0.0
        assert isinstance(reading.status, ReadingStatus)


def test_a_reading_stays_as_it_was_when_the_next_is_taken(source):
    for tick in range(500):
        source.read(0.001 * tick)
    reading = source.read(0.5)
    before = reading.gravity.copy(), reading.base_rates.copy()
    for tick in range(500, 900):
        source.read(0.001 * tick)
    np.testing.assert_array_equal(reading.gravity, before[0])
    np.testing.assert_array_equal(reading.base_rates, before[1])


def test_nominal_gravity_has_no_age_and_measured_gravity_has_one(source):
    for tick in range(200):
        reading = source.read(0.001 * tick)
        assert (reading.status is ReadingStatus.NOMINAL) == (reading.age == math.inf)


@pytest.mark.parametrize("times", [[1.0, 1.0], [1.0, 0.5], [0.0, 1.5], [math.nan, 0.0], [-1.0, 0.0]])
def test_no_time_makes_it_raise(source, times):
    for time in times:
        assert np.isfinite(source.read(time).gravity).all()
