"""Vibration averages out, and no lever condemns a right gyroscope: an inertial unit by numbers of its own."""

import numpy as np
import pytest

from benchmarks.shaken_base import ROWS, sensed


@pytest.mark.parametrize(
    ("name", "within"),
    [
        ("shake .5", 0.12), ("shake 1", 0.12), ("shake 2", 0.15), ("shake 1, table 1 Hz", 0.15),
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


def test_an_accelerometer_that_creeps_beside_a_gyroscope_at_rest_is_told_with_its_size():
    _, true, readings, _, _ = sensed(*ROWS["creeps by 15 deg in 10 s"], seconds=20.0, seed=1)
    off = np.linalg.norm(np.array([r.gravity for r in readings]) - true, axis=1)
    live = np.array([r.status.value == "live" for r in readings])
    assert np.sum(live & (off > 0.3)) * 0.005 < 2.0  # it begins slowly
    assert {(r.status.value, r.faults.names) for r in readings[-1000:]} == {("degraded", ("disagreement",))}
    assert 2.0 * np.sqrt(3.0) * readings[-1].deviation == pytest.approx(off[-1], rel=0.25)
