import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from catenary.plant import fault_of
from catenary.robots.catalog import load_robot
from catenary.simulation.cable_plant import PositioningArm
from oracles.cable_arms import homed_plant


def test_joints_and_limits_are_those_of_the_model_of_the_name() -> None:
    arm, model = PositioningArm(homed_plant("left")), load_robot("raven2")
    assert arm.joint_names == model.joint_names
    assert arm.joint_units == model.joint_units
    assert_allclose(arm.lower, model.lower, atol=1e-9)
    assert_allclose(arm.upper, model.upper, atol=1e-9)


def test_the_tool_is_held_while_torques_move_the_arm() -> None:
    whole = homed_plant("left")
    arm = PositioningArm(whole)
    before = whole.measured_js().q
    for _ in range(300):
        arm.servo_jf(np.array([3.0, 0.0, 2.0]))
        arm.wait()
    after = whole.measured_js().q
    assert abs(after[0] - before[0]) > 0.01
    # the tool hunts by some degrees about its setpoint, as on the robot
    assert_allclose(after[3:], before[3:], atol=np.deg2rad(6.0))


def test_positions_move_the_same_joints_as_the_whole_arms_do() -> None:
    whole, other = homed_plant("left"), homed_plant("left")
    arm = PositioningArm(whole)
    for _ in range(50):
        wanted = arm.setpoint_js().q + np.array([1e-3, -1e-3, 1e-5])
        arm.servo_jp(wanted)
        other.servo_jp(np.concatenate([wanted, other.setpoint_js().q[3:]]))
        arm.wait()
        other.wait()
    assert_array_equal(whole.measured_js().q, other.measured_js().q)
    assert_array_equal(arm.q_true, whole.state.q)


def test_arm_says_why_it_is_in_fault_as_the_whole_one_does() -> None:
    whole = homed_plant("left")
    arm = PositioningArm(whole)
    whole.firmware = whole.firmware.replace(kp=100.0 * whole.firmware.kp)
    arm.servo_jp(arm.lower)
    arm.wait()
    assert arm.operating_state().state == "FAULT"
    assert "a motor's command was too large" in fault_of(arm)
