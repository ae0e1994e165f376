"""The dVRK's control of a simulated PSM, tick by tick."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.simulation.compiled_records import POSITION, TORQUE
from catenary.simulation.psm_controller import (
    _FULL_TURN,
    PsmControlState,
    PsmState,
    control_joints,
    load_psm,
    read_psm_encoders,
    register_psm,
    take_psm_setpoint,
)

ARM = load_psm()
CONTROLLER = ARM.controller
JOINTS = np.eye(7)
JOINTS[3:, 3:] = CONTROLLER.joints  # of actuators


def held(q):
    """A controller that is at q and holds it."""
    control = PsmControlState(guarded=True, joint=q, setpoint=q)
    control.mode[:] = POSITION
    return control


def test_joints_are_read_through_gears_and_coupling(rng):
    rotor, control = rng.uniform(-5.0, 5.0, 7), PsmControlState()
    read_psm_encoders(CONTROLLER, PsmState(rotor=rotor), control)
    count = _FULL_TURN / CONTROLLER.counts
    assert_allclose(control.joint, JOINTS @ (rotor / CONTROLLER.ratio), atol=(np.abs(JOINTS) @ count).max())
    assert (np.abs(control.motor - rotor) <= count).all()


def test_currents_do_the_work_that_the_joints_are_asked_for(rng):
    control, shaft = held(np.zeros(7)), np.empty(7)
    control.setpoint = rng.uniform(-0.001, 0.001, 7)  # within the currents' limits
    control_joints(CONTROLLER, control, shaft)
    wanted = CONTROLLER.kp * control.setpoint
    joint_velocity = rng.normal(size=7)
    rotor_velocity = CONTROLLER.ratio * np.linalg.solve(JOINTS, joint_velocity)
    one_step = CONTROLLER.torque_constant / CONTROLLER.dac_per_ampere
    assert_allclose(shaft @ rotor_velocity, wanted @ joint_velocity, atol=one_step @ np.abs(rotor_velocity))
    assert_allclose(control.torque @ joint_velocity, shaft @ rotor_velocity, rtol=1e-5)  # digits of the file


def test_no_motor_gets_more_than_its_current():
    control, shaft = held(np.zeros(7)), np.empty(7)
    control.setpoint = 0.9 * CONTROLLER.tolerance
    control_joints(CONTROLLER, control, shaft)
    assert not control.stopped
    assert (np.abs(control.current) <= CONTROLLER.current_limit + 1.0 / CONTROLLER.dac_per_ampere).all()
    assert np.abs(control.current[0]) == pytest.approx(CONTROLLER.current_limit[0], rel=1e-3)


def test_it_stops_where_a_joint_is_farther_off_than_it_tolerates():
    control, shaft = held(np.zeros(7)), np.empty(7)
    control.setpoint[2] = 1.01 * CONTROLLER.tolerance[2]
    control_joints(CONTROLLER, control, shaft)
    assert control.stopped


def test_torques_that_are_commanded_are_the_joints():
    control, shaft = held(CONTROLLER.home_value), np.empty(7)
    control.mode[:] = TORQUE
    control.torque_command = np.array([0.5, -0.4, 2.0, 0.01, -0.01, 0.008, 0.002])
    control_joints(CONTROLLER, control, shaft)
    assert_allclose(control.torque, control.torque_command, atol=2e-3)  # steps of the current, 2e-4 A


@pytest.mark.parametrize("side", ["lower", "upper"])
def test_no_torque_pushes_a_joint_beyond_its_limit(side):
    limit, out = CONTROLLER[side], -1.0 if side == "lower" else 1.0
    control, shaft = held(limit.copy()), np.empty(7)
    control.mode[:] = TORQUE
    control.torque_command = out * np.ones(7)
    control_joints(CONTROLLER, control, shaft)
    assert (out * control.wanted <= 1e-12).all()


def test_setpoints_move_by_clamped_steps_within_the_limits():
    control = held(CONTROLLER.upper - 1e-4)
    take_psm_setpoint(CONTROLLER, control, CONTROLLER.upper + 1.0)
    assert_allclose(control.setpoint, np.minimum(CONTROLLER.upper, CONTROLLER.upper - 1e-4 + CONTROLLER.step_limit))
    control = held(CONTROLLER.home_value)
    take_psm_setpoint(CONTROLLER, control, CONTROLLER.home_value + 0.1)
    assert_allclose(control.setpoint - CONTROLLER.home_value, CONTROLLER.step_limit, atol=1e-12)


def test_registration_is_true_but_for_the_potentiometers(rng):
    rotor, control = rng.uniform(-2.0, 2.0, 7), PsmControlState(offset=rng.integers(-9999, 9999, 7))
    read_psm_encoders(CONTROLLER, PsmState(rotor=rotor), control)
    register_psm(CONTROLLER, control, ARM.drive, rotor)
    actuator = rotor / (ARM.drive.ratio * (1.0 + ARM.drive.ratio_error))
    expected = JOINTS @ (actuator + CONTROLLER.registration)
    assert_allclose(
        control.joint, expected, atol=2.0 * (np.abs(JOINTS) @ (_FULL_TURN / CONTROLLER.counts / CONTROLLER.ratio)).max()
    )
    assert_allclose(control.setpoint, control.joint)
