import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from catenary.control.controllers import make_controller
from catenary.errors import InputError, UnsupportedModelError
from catenary.robots.catalog import load_robot
from catenary.robots.model import Frame
from catenary.sensing.imu import SensedGravity
from catenary.simulation.base_motion import SwayingBase, Wave
from catenary.spatial import Pose
from catenary.trajectories.reference import Rest
from catenary.workflows.gravity_trials import base_sensor, rigid_arm, simulated_arm, track, with_gains

UR5E = "examples/ur5e.urdf"
DECK = SwayingBase(
    (Wave(math.radians(8.0), 0.1, (1.0, 0.0, 0.0)), Wave(math.radians(4.0), 0.14, (0.0, 1.0, 0.0), 0.7)),
    (Wave(2.0, 0.12, (0.0, 0.0, 1.0), 0.3),),
)
LEFT = np.array([0.02, 0.02, -0.01])  # 0.03 m/s2


def test_a_sensor_that_keeps_a_bias_of_its_calibration_is_off_by_that() -> None:
    sensor, told = base_sensor(DECK, bias=LEFT, noise=0.01, seed=1)
    source = SensedGravity(sensor.mailbox, told, mounted_on="ship", feed=sensor.advance)
    times = np.arange(400) / 100.0
    sensed = np.array([source.read(float(t)).gravity for t in times])
    samples = DECK.sample(times)
    off = (sensed - samples.gravity + samples.motion[:, 2])[100:]
    assert np.sqrt(np.mean(np.sum(off**2, axis=1))) < 0.1
    np.testing.assert_allclose(off.mean(axis=0), -LEFT, atol=5e-3)  # noise of a mean over 3 s


@pytest.mark.parametrize("wrong", [{"bias": (0.0, 0.0)}, {"noise": -1.0}, {"noise": math.nan}])
def test_sensors_that_there_are_not_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InputError, match="sensor"):
        base_sensor(DECK, **wrong)  # type: ignore[arg-type]


def test_an_arm_takes_other_gains_for_all_joints_or_for_each() -> None:
    arm = rigid_arm(load_robot("two_link"))
    stiff = with_gains(arm, 100.0, [1.0, 2.0])
    np.testing.assert_array_equal(stiff.gains.kp, [100.0, 100.0])
    np.testing.assert_array_equal(stiff.gains.kd, [1.0, 2.0])
    np.testing.assert_array_equal(with_gains(arm, None, 3.0).gains.kp, arm.gains.kp)
    for wrong in (-1.0, [1.0, 2.0, 3.0], math.nan):
        with pytest.raises(InputError, match="kp"):
            with_gains(arm, wrong, None)


def test_friction_holds_an_arm_that_nothing_else_holds_and_cables_bring_their_own() -> None:
    arm = simulated_arm("two_link", friction=1e3, kp=0.0, kd=0.0)
    result = track(arm, make_controller("pd", arm), Rest(arm.q_true(), 0.2), settle=0.0)
    np.testing.assert_allclose(result.error, 0.0, atol=1e-9)
    with pytest.raises(UnsupportedModelError, match="cables"):
        simulated_arm("raven2", friction=1.0)


@pytest.mark.slow
def test_an_arm_on_a_deck_is_held_ten_times_better_by_sensed_gravity_than_by_a_level_bases() -> None:
    pose = np.deg2rad([0.0, -60.0, 80.0, -110.0, -90.0, 0.0])
    largest = {}
    for name in ("pd", "sg", "dg"):
        arm = rigid_arm(load_robot(UR5E), base=DECK, start=pose)
        sensor, told = base_sensor(DECK, start=arm.plant.measured_js().time, bias=LEFT, seed=2)
        source = SensedGravity(sensor.mailbox, told, mounted_on="ship", feed=sensor.advance)
        result = track(arm, make_controller(name, arm), Rest(pose, 2.0), settle=1.0, gravity=source)
        assert result.gravity is not None
        assert set(result.gravity.ticks) == {"nominal", "live"}
        assert not result.gravity.faults
        largest[name] = float(result.rms_error[:3].max())
    assert largest["dg"] < 0.1 * largest["sg"] < 0.1 * largest["pd"]


def test_a_unit_at_a_turned_frame_of_the_robot_tells_gravity_and_rates_of_the_base_origin() -> None:
    arm, turned = load_robot("two_link"), Rotation.from_euler("xyz", [0.4, -0.9, 2.8]).as_matrix()
    frames = {**arm.frames, "imu_link": Frame(-1, Pose(turned, np.array([0.11, 0.03, 0.35])))}
    rocks = SwayingBase((Wave(0.35, 0.3, (1.0, 0.0, 0.0)), Wave(0.17, 0.5, (0.0, 1.0, 0.0))))
    sensor, told = base_sensor(rocks, noise=0.0, at=(replace(arm, frames=frames), "imu_link"))
    source, times = SensedGravity(sensor.mailbox, told, feed=sensor.advance), np.arange(3000) / 1000.0
    readings, true = [source.read(float(t)) for t in times][1000:], rocks.sample(times[1000:])
    assert {reading.status.value for reading in readings} == {"live"}
    np.testing.assert_allclose([reading.gravity for reading in readings], true.gravity, atol=0.1)
    np.testing.assert_allclose([reading.base_rates[0] for reading in readings], true.motion[:, 0], atol=5e-3)
