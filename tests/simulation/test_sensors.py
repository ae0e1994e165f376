import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from catenary.errors import InputError
from catenary.sensing.gravity_vector import Kind, Mailbox, ReadingStatus
from catenary.sensing.imu import SensedGravity
from catenary.sensing.mounting import Mounting
from catenary.simulation import sensors
from catenary.simulation.base_motion import FixedBase, RockingBase, imu_reading
from oracles.sensor_faults import NAMED

TILTED = FixedBase(0.3, -0.2)
ROCKING = RockingBase(math.radians(15.0), math.radians(5.0), 1.0, (0.0, -1.0, 0.0), lever=(0.0, 0.1, 0.3))
TURNED = Rotation.from_euler("xyz", [1.0, -0.5, 2.0]).as_matrix()


def ideal(rate_hz, mounting=None, *, has_gyroscope=True):
    return sensors.SensorModel(rate_hz, 0.0, 0.0, 0.0, 0.0, 0.0, has_gyroscope, mounting or Mounting())


def samples(base, model, seconds, **options):
    """Everything that a sensor sends, as (stamp, vector, kind)."""
    mailbox = Mailbox(100_000)
    sensors.SimulatedSensor(base, mailbox, model, **options).advance(seconds)
    return [mailbox.take() for _ in range(len(mailbox))]


def vectors(taken, kind):
    return np.array([s.vector for s in taken if s.kind is kind])


def test_an_ideal_sensor_at_the_origin_reads_what_the_base_says():
    taken = samples(ROCKING, ideal(100.0), 1.0)
    stamps = np.array([s.stamp for s in taken if s.kind is Kind.ANGULAR_RATE])
    assert_allclose(stamps, np.arange(101) / 100.0)
    force, rate = imu_reading(ROCKING.sample(stamps))
    assert_allclose(vectors(taken, Kind.SPECIFIC_FORCE), force, atol=1e-12)
    assert_allclose(vectors(taken, Kind.ANGULAR_RATE), rate, atol=1e-12)


def test_a_sensor_away_from_the_origin_reads_the_acceleration_of_its_own_path():
    position, h = np.array([0.2, -0.1, 0.4]), 1e-4
    mounting = Mounting(rotation=TURNED, position=position)
    force = vectors(samples(ROCKING, ideal(100.0, mounting), 0.4), Kind.SPECIFIC_FORCE)[-1]

    def place(t):
        """R_world_base and the sensor's place, from the definition of rocking."""
        angle = ROCKING.mean + ROCKING.amplitude * np.sin(2.0 * np.pi * ROCKING.frequency * t)
        R = Rotation.from_rotvec(angle * np.array(ROCKING.axis)).as_matrix()
        return R, R @ (np.array(ROCKING.lever) + position)

    R, here = place(0.4)
    acceleration = (place(0.4 - h)[1] - 2.0 * here + place(0.4 + h)[1]) / h**2
    expected = TURNED.T @ R.T @ (acceleration - [0.0, 0.0, -9.81])
    assert_allclose(force, expected, atol=1e-5)  # roundings of 1e-16 / h^2 and h^2 of the fourth derivative


def test_noise_has_the_density_that_was_asked_for_and_follows_from_its_seed():
    model = sensors.SensorModel(200.0, resolution=0.0, rate_resolution=0.0)
    taken = samples(TILTED, model, 10.0, seed=3)
    again, other = (samples(TILTED, model, 0.5, seed=seed) for seed in (3, 8))
    spread = vectors(taken, Kind.SPECIFIC_FORCE).std(axis=0)
    assert_allclose(spread, model.noise * 10.0, rtol=0.05)  # sqrt(200 Hz / 2); 6,000 numbers tell it to 1 %
    assert_allclose(vectors(taken, Kind.ANGULAR_RATE).std(axis=0), model.rate_noise * 10.0, rtol=0.05)
    assert taken[: len(again)] == again
    assert again != other


def test_samples_arrive_late_by_the_latency():
    mailbox = Mailbox()
    sensor = sensors.SimulatedSensor(TILTED, mailbox, sensors.SensorModel(100.0, latency=0.015))
    sensor.advance(0.0149)
    assert len(mailbox) == 0
    sensor.advance(0.015)
    assert mailbox.take().stamp == 0.0


def test_readings_are_whole_counts_within_the_range():
    mounting = Mounting(bias=np.array([0.0, 15.0, 0.0]), acceleration_range=19.6)
    taken = samples(TILTED, sensors.SensorModel(200.0, resolution=0.5, mounting=mounting), 0.2)
    force = vectors(taken, Kind.SPECIFIC_FORCE)
    assert_allclose(force[:, [0, 2]] / 0.5, np.round(force[:, [0, 2]] / 0.5))
    assert np.abs(force).max() <= 19.6 + 0.25


def test_the_estimator_undoes_what_a_mounting_does():
    mounting = Mounting(
        rotation=TURNED,
        position=np.array([0.1, 0.2, -0.3]),
        bias=np.array([0.2, -0.1, 0.3]),
        scale=np.array([1.02, 0.97, 1.01]),
        rate_bias=np.array([0.01, 0.02, -0.03]),
        checked=True,  # below the axis that it rocks about gravity hardly moves: no check would be passed there
    )
    mailbox = Mailbox()
    sensor = sensors.SimulatedSensor(ROCKING, mailbox, sensors.SensorModel(200.0, 0.0, 0.0, mounting=mounting))
    source = SensedGravity(mailbox, mounting, feed=sensor.advance)
    times = np.arange(0.0, 1.2, 0.001)
    readings = [source.read(t) for t in times]
    base = ROCKING.sample(times)
    for k in range(600, 1200, 37):
        assert_allclose(readings[k].gravity, base.gravity[k] - base.motion[k, 2], atol=0.1)
        assert_allclose(readings[k].base_rates[0], base.motion[k, 0], atol=0.005)
        assert_allclose(readings[k].base_rates[1], base.motion[k, 1], atol=0.4)  # 10 % of 3.4, and counts


TICK = 0.005  # [s]
LIMIT = (100.0 + 10.0) * TICK + 1e-9  # [m/s2] in a tick


@pytest.mark.alike
@pytest.mark.parametrize(
    ("base", "kind"),
    [
        pytest.param(base, kind, id=f"{name}-{kind}")
        for name, base in (("rocking", ROCKING), ("still", TILTED))
        for kind in sensors.FAULT_KINDS
        if (name, kind) != ("still", "rates_in_deg")  # a base at rest turns by nothing in any unit
    ],
)
def test_a_fault_is_named_and_bounded_and_passes(base, kind):
    mailbox, model = Mailbox(), sensors.SensorModel()
    told = Mounting(acceleration_range=model.mounting.acceleration_range, rate_range=model.mounting.rate_range)
    sensor = sensors.SimulatedSensor(base, mailbox, model, faults=[sensors.InjectedFault(kind, 0.5, 0.4)], seed=1)
    source = SensedGravity(mailbox, told, feed=sensor.advance)
    times = np.arange(0.0, 2.1, TICK)
    readings = [source.read(t) for t in times]
    truth = base.sample(times)
    gravity = np.array([r.gravity for r in readings])
    off = np.linalg.norm(gravity - (truth.gravity - truth.motion[:, 2]), axis=1)
    assert not any(r.faults for r in readings[20:100])
    assert any({*r.faults.names} & NAMED[kind][1] for r in readings[100:180])
    assert np.linalg.norm(np.diff(gravity, axis=0), axis=1).max() <= LIMIT
    # rocking swings gravity by 0.85 m/s2 to either side, and its accelerations by 1.1; a parabola
    # through a sensor that got stuck overshoots
    assert off[100:].max() < (2.7 if base is ROCKING else 0.5)
    assert readings[-1].status is ReadingStatus.LIVE
    assert not readings[-1].faults
    assert off[-40:].max() < 0.2  # noise of 0.04 m/s2


def test_an_accelerometer_alone_sends_no_rates_and_begins_when_it_is_switched_on():
    taken = samples(TILTED, ideal(100.0, has_gyroscope=False), 30.02, start=29.995)
    assert {s.kind for s in taken} == {Kind.SPECIFIC_FORCE}
    assert_allclose([s.stamp for s in taken], [30.0, 30.01, 30.02])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sensors.SensorModel(rate_hz=0.0), "rate_hz"),
        (lambda: sensors.SensorModel(noise=-1.0), "noise"),
        (lambda: sensors.SensorModel(latency=math.nan), "latency"),
        (lambda: sensors.InjectedFault("broken", 0.0), '"broken": expected one of drop_out, not_finite'),
    ],
)
def test_impossible_sensors_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()
