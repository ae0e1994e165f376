import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.simulation.cable_parameters import load_cable_arm, right_arm
from catenary.simulation.cable_plant import CablePlant
from catenary.simulation.cabled.arm_state import ArmState
from catenary.simulation.firmware import (
    ControlState,
    control_motors,
    read_encoders,
    register,
)
from catenary.simulation.records import OFF, POSITION, TORQUE
from catenary.transmission.coupling import joint_forces
from oracles.cable_arms import homed_plant, linear_arm

GOLD = load_cable_arm().firmware
GREEN = right_arm(load_cable_arm()).firmware
STEP = 2.0 * np.pi / 4000.0  # of the encoders [rad]


def demanded(firmware, error=0.0, velocity=0.0, ticks=1, axis=0):
    """Control state and shaft torques after PD ticks with a constant error [rad] and speed of one motor."""
    control, shaft = ControlState(), np.zeros(7)
    control.mode[:] = POSITION
    control.motor_velocity[axis] = velocity
    control.motor[axis] = -error
    if axis == 2:  # the tools' motors follow the insertion's as measured: leave them out
        control.mode[3:] = OFF
    for _ in range(ticks):
        control_motors(firmware, control, shaft)
    return control, shaft


def moved(firmware, motor):
    """Control state that has read motors at the given positions [rad], with zero offsets."""
    state, control = ArmState(), ControlState()
    state.rotor[:] = motor
    read_encoders(firmware, state, control)
    return control


@given(
    st.sampled_from([(GOLD, 0.012), (GREEN, 0.010)]), st.integers(0, 2), st.floats(-3, 3), st.floats(-9, 9)
)
def test_torque_before_clipping_is_that_of_the_gains_at_the_motors(arm, axis, error, velocity):
    firmware, kd_of_insertion = arm
    control, _ = demanded(firmware, error, velocity, axis=axis)
    kp, kd = [0.3, 0.3, 0.15][axis], [0.008, 0.008, kd_of_insertion][axis]
    assert_allclose(control.torque[axis], kp * error - kd * velocity, rtol=1e-12, atol=1e-15)


def test_tool_axes_integrate_their_error_and_positioning_axes_do_not():
    control, _ = demanded(GOLD, error=0.1, ticks=1000, axis=4)
    assert_allclose(control.torque[4], 0.05 * 0.1 + 0.05 * 0.1 * 1.0, rtol=1e-9)  # Kp e + Ki e 1 s
    control, _ = demanded(GOLD, error=0.1, ticks=1000, axis=0)
    assert_allclose(control.torque[0], 0.3 * 0.1, rtol=1e-12)


def test_a_constant_speed_lags_by_damping_over_stiffness():
    # raven2: 26.7 ms on the shoulder; what gravity adds is alike on the way up and on the way down
    plant = CablePlant(linear_arm())
    plant.home()
    speed, span = np.deg2rad(5.0), 2000
    up = speed * 1e-3 * np.arange(span)
    rows = np.tile(plant.control.setpoint, (2 * span, 1))
    rows[:, 0] += np.concatenate([up, up[::-1]])
    log = plant.run(rows)
    behind = (log.setpoint - log.joint)[:, 0]
    lag = (behind[span // 2] - behind[2 * span - 1 - span // 2]) / (2.0 * speed)
    assert_allclose(
        lag, 26.7e-3, rtol=0.03
    )  # an encoder step, the motor's own damping, cables that still swing


@given(st.floats(-2.0, 2.0))
def test_dac_is_truncated_towards_zero(error):
    exact = -1.0 * 0.3 * error / (0.0603 * 12.25) * 2730.0
    assert demanded(GOLD, error=error)[0].dac[0] == math.trunc(np.clip(exact, -2500.0, 2500.0))


def test_dac_is_clipped_at_the_limits_of_the_source():
    control = ControlState(setpoint=[0.05, 0.05, 0.003, 0.3, 0.35, 0.35, 0.35])
    control.mode[:] = POSITION
    control_motors(GOLD, control, np.zeros(7))
    assert_array_equal(np.abs(control.dac[:6]), [2500.0, 2500.0, 2000.0, 3000.0, 3000.0, 3800.0])


@pytest.mark.parametrize(("axis", "ratio", "most"), [(0, 136.1963, 7.521), (2, 2158.59, 95.36)])  # Nm, N
def test_joint_limits_of_torque_are_those_of_the_mechanism(axis, ratio, most):
    _, shaft = demanded(GOLD, error=4.0, axis=axis)
    assert_allclose(shaft[axis] * ratio, most, rtol=1e-4)  # raven2 description, at the joint


@pytest.mark.parametrize(
    ("firmware", "signs"), [(GOLD, [-1, -1, -1, -1, -1, 1, -1]), (GREEN, [1, 1, 1, -1, -1, 1, -1])]
)
def test_positive_torque_is_positive_motion_whatever_the_boards_sign(firmware, signs):
    for axis in range(7):
        control, shaft = demanded(firmware, error=0.5, axis=axis)
        assert control.torque[axis] > 0.0
        assert shaft[axis] > 0.0
        assert np.sign(control.dac[axis]) == signs[axis]


@pytest.mark.parametrize(("dac", "stopped"), [(20_000.5, False), (20_002.0, True)])  # truncated to 20,000
def test_command_beyond_twenty_thousand_trips_the_software_stop(dac, stopped):
    control, shaft = demanded(GOLD, error=dac * 0.0603 * 12.25 / 2730.0 / 0.3)
    assert control.stopped == stopped
    assert (shaft[0] == 0.0) == stopped


def test_last_jaw_is_never_checked_but_its_board_has_sixteen_bits():
    control, _ = demanded(GOLD, error=100.0, axis=6)
    assert not control.stopped
    assert abs(control.dac[6]) == 32_768.0  # negative on this board


# 24 bits hold 26,000 rad: the board's wrap, which no joint reaches, is not modelled
@pytest.mark.parametrize("motor", [0.0, 0.999 * STEP, 1.0001 * STEP, 2.0 * np.pi + 0.5 * STEP, 30_000.0])
def test_encoders_count_four_thousand_steps_a_turn_without_end(motor):
    assert_array_equal(moved(GOLD, np.full(7, motor)).counts, np.floor(motor / STEP))


def test_encoder_steps_at_the_joints_are_those_of_the_mechanism():
    assert_allclose(np.rad2deg(STEP / GOLD.ratio[:2]), [6.608e-4, 7.406e-4], rtol=1e-3)
    assert_allclose(STEP / GOLD.ratio[2], 0.7277e-6, rtol=1e-4)
    assert_allclose(np.rad2deg(STEP / GOLD.ratio[3:5]), [0.01668, 0.01001], rtol=1e-3)


@given(st.tuples(*[st.floats(-1.0, 1.0)] * 7), st.sampled_from([GOLD, GREEN]))
def test_joints_read_what_they_were_registered_at_and_ask_for_the_motors_there(joint, firmware):
    control = moved(firmware, np.linspace(-50.0, 900.0, 7))
    register(firmware, control, np.array(joint))
    # to an encoder step at every motor that takes part: the insertion reads all three, the tools the insertion's
    atol = 2.0 * STEP * (1.0 / firmware.ratio + 0.35 / firmware.ratio)
    assert (np.abs(control.joint - joint) <= atol + 2e-6).all()
    control.setpoint[:] = control.joint
    control_motors(firmware, control, np.zeros(7))
    assert_allclose(control.motor_setpoint, control.motor, atol=1e-9)


@pytest.mark.parametrize(("firmware", "sign"), [(GOLD, 1.0), (GREEN, -1.0)])
def test_tool_joints_stand_still_while_their_motors_follow_the_insertion(firmware, sign):
    insertion = 29.087  # ten turns of the tool's cables
    follow = sign * 10.0 * np.array([1.0, 1.0, -1.0, 1.0])  # the first jaw's runs the other way
    control = moved(firmware, np.array([0.0, 0.0, insertion, *follow]))
    assert_allclose(control.joint[3:], 0.0, atol=2.0 * STEP / 5.0)


def test_velocity_is_the_difference_of_one_tick_and_ignores_the_coupling():
    state, control = ArmState(), ControlState()
    read_encoders(GOLD, state, control)
    state.rotor[0] = 10.5 * STEP
    read_encoders(GOLD, state, control)
    assert_allclose(control.motor_velocity[0], 10.0 * STEP / 1e-3)
    assert_allclose(control.joint_velocity[0], 10.0 * STEP / 1e-3 / 136.1963)
    assert_array_equal(control.joint_velocity[1:], 0.0)


def test_commanded_joint_torques_reach_the_motors_through_the_coupling():
    control, shaft = ControlState(joint=GOLD.home_value), np.zeros(7)
    control.mode[:] = TORQUE
    control.torque_command[:3] = [2.0, -1.0, 5.0]
    control_motors(GOLD, control, shaft)
    joint = joint_forces((0.14545, 0.0077973826, 0.008077387), shaft[:3] * GOLD.ratio[:3])
    # one DAC step: 0.003 Nm on the first two joints, 0.05 N on the third
    assert_allclose(joint, [2.0, -1.0, 5.0], atol=0.05)


def test_an_axis_that_is_off_gets_nothing():
    control, shaft = ControlState(), np.ones(7)
    control.mode[:] = OFF
    control.setpoint[:] = 1.0
    control_motors(GOLD, control, shaft)
    assert_array_equal(shaft, 0.0)


@pytest.mark.parametrize(
    ("increment", "in_a_tick", "ticks"),
    [(5e-5, 1, 100), (5e-4, 4, 1), (1.0, 1, 1)],
    ids=["slow", "four", "leap"],
)
def test_increments_of_a_tick_add_up_and_are_clamped(increment, in_a_tick, ticks):
    plant = homed_plant()
    start = plant.setpoint_js().q
    for _ in range(ticks):
        for _ in range(in_a_tick):
            plant.servo_jr(np.full(7, increment))
        plant.wait()
    most = np.array([0.0025, 0.0025, 5e-5, *[0.0025] * 4])  # 0.0025 rad or 0.05 mm a millisecond
    moved_by = ticks * np.minimum(in_a_tick * increment, most)
    assert_allclose(plant.setpoint_js().q - start, moved_by, rtol=1e-9)


@pytest.mark.parametrize("side", ["lower", "upper"])
def test_setpoints_saturate_at_the_software_limits(side):
    plant = homed_plant()
    limit = getattr(plant, side)
    start, slow = plant.setpoint_js().q, 0.2 * plant.firmware.step_limit
    rows = start + np.sign(limit - start) * slow * np.arange(1, 34_000)[:, None]
    log = plant.run(rows)
    assert_array_equal(log.setpoint[-1], limit)
