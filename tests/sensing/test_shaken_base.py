"""Vibration averages out, and no lever condemns a right gyroscope: an inertial unit by numbers of its own."""

import numpy as np
import pytest

from benchmarks.shaken_base import ROWS, sensed
from catenary.sensing.gravity_vector import Kind, Mailbox
from catenary.sensing.imu import SensedGravity
from catenary.sensing.mounting import Mounting
from oracles.shaken_imu import Shaken, X, Y, complementary, rock


@pytest.mark.parametrize(
    ("name", "within"),
    [
        ("shake .5", 0.12), ("shake 1", 0.12), ("shake 2", 0.15), ("shake 1, table 1 Hz", 0.15),
        ("shake 2 at 15 Hz", 0.12), ("shake 2 at 187 Hz, aliased", 0.15), ("shake 5, clipped at 12", 0.3),
        ("ship that heaves, default", 0.11), ("turntable 120 deg/s, .3 m, checked", 0.15),
    ],
)  # fmt: skip
def test_gravity_is_known_and_live_on_a_base_that_shakes_or_turns(name, within):
    t, true, readings, _, source = sensed(*ROWS[name], seconds=6.0, seed=1)
    off = np.linalg.norm(np.array([r.gravity for r in readings]) - true, axis=1)[t > 1.0]
    live = np.array([r.status.value == "live" for r in readings])[t > 1.0]
    assert np.sqrt(np.mean(off**2)) < within  # the bias of the sensor is 0.087
    assert live.mean() > 0.85  # in 5 s; strong vibration needs one of them
    assert source.remedy == ""


def test_a_scale_that_is_off_from_the_start_is_degraded_within_a_second():
    t, _, readings, _, _ = sensed(*ROWS["scale 3 % off"], seconds=2.0, seed=1)
    assert {(r.status.value, r.faults.names) for r, now in zip(readings, t, strict=True) if now > 1.0} == {
        ("degraded", ("magnitude",))
    }


def test_an_accelerometer_that_creeps_beside_a_gyroscope_at_rest_is_told_with_its_size():
    _, true, readings, _, _ = sensed(*ROWS["creeps by 15 deg in 10 s"], seconds=20.0, seed=1)
    off = np.linalg.norm(np.array([r.gravity for r in readings]) - true, axis=1)
    live = np.array([r.status.value == "live" for r in readings])
    assert np.sum(live & (off > 0.3)) * 0.005 < 1.5  # it begins slowly
    assert {(r.status.value, r.faults.names) for r in readings[-1000:]} == {("degraded", ("disagreement",))}
    assert 2.0 * np.sqrt(3.0) * readings[-1].deviation == pytest.approx(off[-1], rel=0.25)


ROCKING, TILTED = ((X, rock(10.0, 0.3)),), ((X, lambda t: 0.3 + 0.0 * t), (Y, lambda t: 0.2 + 0.0 * t))
FAR = (0.1, 0.0, 0.3)
SCALE, SWAP, FLIP = 1.1 * np.eye(3), np.eye(3)[[1, 0, 2]], np.diag([1.0, -1.0, 1.0])


@pytest.mark.parametrize(
    ("turns", "place", "accelerometer", "gyroscope", "within"),
    [
        (ROCKING, (0.0, 0.0, 0.0), SWAP, np.eye(3), 0.7), (ROCKING, FAR, SWAP, np.eye(3), 0.5),
        (ROCKING, (0.0, 0.0, 0.0), FLIP, np.eye(3), 0.35), (ROCKING, FAR, FLIP, np.eye(3), 0.5),
        ((), (0.0, 0.0, 0.0), SCALE, np.eye(3), 6.0), (ROCKING, (0.0, 0.0, 0.0), SCALE, np.eye(3), 6.0),
        (TILTED, (0.0, 0.0, 0.0), np.diag([0.0, 1.0, 1.0]), np.eye(3), 1.3),
        (ROCKING, FAR, np.eye(3), np.degrees(np.eye(3)), 0.1),
    ],
)  # fmt: skip
@pytest.mark.parametrize("seed", [1, pytest.param(3, marks=pytest.mark.alike)])
def test_a_sensor_that_changes_on_the_way_is_told_and_hardly_ever_live_and_wrong(
    turns, place, accelerometer, gyroscope, within, seed
):
    t, true, force, rates = Shaken(turns, place=place).samples(20.0, seed)
    force[t >= 8.0] = force[t >= 8.0] @ accelerometer.T
    rates[t >= 8.0] = rates[t >= 8.0] @ gyroscope.T
    mailbox, readings = Mailbox(), []
    source = SensedGravity(mailbox, Mounting(position=np.array(place)))
    for now, f, w in zip(t.tolist(), force, rates, strict=True):
        mailbox.put(now, w, Kind.ANGULAR_RATE)
        mailbox.put(now, f, Kind.SPECIFIC_FORCE)
        readings.append(source.read(now))
    off = np.linalg.norm(np.array([r.gravity for r in readings]) - true, axis=1)
    live = np.array([r.status.value == "live" for r in readings])
    named = t[np.array([bool(r.faults) for r in readings]) & (t >= 8.0)]
    assert named[0] < 8.1
    assert np.sum(live & (off > 0.3) & (t > 2.0)) * 0.005 < within
    assert off[t > 2.0].max() < 6.0


def test_the_complementary_filter_is_that_of_the_ahrs_package():
    filters = pytest.importorskip("ahrs.filters", reason="the package ahrs is not installed")
    t, _, force, rates = Shaken(ROCKING).samples(5.0)
    roll, pitch, _ = filters.Complementary(gyr=rates, acc=force, frequency=200.0, gain=0.98).W.T
    down = [np.sin(pitch), -np.cos(pitch) * np.sin(roll), -np.cos(pitch) * np.cos(roll)]
    np.testing.assert_allclose(complementary(t, force, rates), 9.81 * np.column_stack(down), atol=1e-12)
