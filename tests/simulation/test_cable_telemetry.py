import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.arrays import Floats
from catenary.dynamics.kinematics import forward_kinematics
from catenary.raven2.topics import CHANNELS, raven_topics
from catenary.simulation.cable_plant import _AXIS_FIELDS, COLUMNS, CablePlant, of_both_arms, telemetry_of
from catenary.simulation.firmware import TickLog
from oracles.cable_arms import ROBOTS, homed_plant, smooth_motion

TICKS = 500


@pytest.fixture(scope="module", params=["left", "right"])
def run(request: pytest.FixtureRequest) -> tuple[CablePlant, TickLog, dict[str, Floats]]:
    plant = homed_plant(request.param)
    log = plant.run(smooth_motion(plant.setpoint_js().q, 1e-3 * TICKS))
    return plant, log, telemetry_of(plant, log)


def test_columns_are_those_that_are_declared_and_fit_the_topics(run) -> None:
    plant, _, telemetry = run
    assert set(telemetry) == set(COLUMNS)
    for topic in raven_topics("gold" if plant.side == "left" else "green"):
        for column in topic.columns:
            if column.name in telemetry:
                assert telemetry[column.name].shape == (TICKS, column.width), column.name


def test_an_arms_channels_are_its_own_and_the_parked_arms_are_zero(run) -> None:
    plant, log, telemetry = run
    arm, parked = ("gold", slice(8, 16)) if plant.side == "left" else ("green", slice(0, 8))
    for name, field in _AXIS_FIELDS.items():
        assert_array_equal(telemetry[name][:, list(CHANNELS[arm])], np.float32(getattr(log, field)))
        assert (telemetry[name][:, parked] == 0.0).all()


def test_the_last_row_of_true_joints_is_within_a_count_of_the_external_encoders(run) -> None:
    plant, log, telemetry = run
    assert (np.abs(telemetry["joint_enc"] - log.q * plant.encoders.rig.counts) <= 0.5).all()


def test_the_pose_is_that_of_the_reported_joints(run) -> None:
    plant, log, telemetry = run
    arm = 0 if plant.side == "left" else 1
    q = log.joint[-1]
    wrist = 0.5 * (q[6] - q[5])
    pose = forward_kinematics(plant.model, np.array([*q[:5], wrist]), plant.model.tip)
    base = plant.model.frames["frame0"].pose
    here = base.rotation.T @ (pose.position - base.position)
    assert_allclose(telemetry["pos"][-1, 3 * arm : 3 * arm + 3], here, atol=1e-12)  # metres, rounding
    rotation = telemetry["ori"][-1, 9 * arm : 9 * arm + 9].reshape(3, 3)
    assert_allclose(rotation, base.rotation.T @ pose.rotation, atol=1e-12)


def test_an_arm_that_runs_beside_another_fills_its_own_channels_and_pose() -> None:
    arms = [homed_plant(side) for side in ("left", "right")]
    logs = [plant.run(smooth_motion(plant.setpoint_js().q, 0.1)) for plant in arms]
    both = of_both_arms(arms[0], logs[0], arms[1], logs[1])
    alone = [telemetry_of(plant, log) for plant, log in zip(arms, logs, strict=True)]
    for name in _AXIS_FIELDS:
        assert_array_equal(both[name], np.where(np.arange(16) < 8, alone[0][name], alone[1][name]))
    assert_array_equal(both["pos"], np.hstack([alone[0]["pos"][:, :3], alone[1]["pos"][:, 3:]]))
    assert_array_equal(both["ext_jpos"], alone[0]["ext_jpos"])  # the rig is at the arm that moves


def test_positions_and_torques_have_the_digits_that_the_robot_reports() -> None:
    plant = homed_plant(robot=ROBOTS[1])
    told = telemetry_of(plant, plant.run(smooth_motion(plant.setpoint_js().q, 0.1)))
    for name in ("jpos", "tau"):
        assert_array_equal(told[name], np.float32(told[name]))
