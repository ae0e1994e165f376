import copy
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.errors import InputError
from catenary.gravity.torque import gravity_torque, potential_energy
from catenary.nodes.serve import Serving, make_server
from catenary.open_robot import Simulated
from catenary.robots.catalog import load_robot
from catenary.simulation.base_motion import FixedBase
from catenary.simulation.cable_parameters import RAVEN2_STIFF, load_cable_arm, right_arm
from catenary.simulation.cable_physics import ArmState
from catenary.simulation.cable_plant import CablePlant
from catenary.simulation.compiled_records import OFF, POSITION, TORQUE
from catenary.simulation.firmware import (
    NOMINAL_GRAV_DIR,
    ControlState,
    OwnGravity,
    control_motors,
    grav_dir_of,
    gravity_of,
    read_encoders,
    register_encoders,
    write_gravity_torque,
)
from catenary.transmission.cable_elasticity import joint_forces, tensions_for
from oracles.cable_arms import homed_plant, linear_arm, smooth_motion, with_linear_cables

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


@given(st.sampled_from([(GOLD, 0.012), (GREEN, 0.010)]), st.integers(0, 2), st.floats(-3, 3), st.floats(-9, 9))
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
    # an encoder step, the motor's own damping, cables that still swing
    assert_allclose(lag, 26.7e-3, rtol=0.03)


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
    register_encoders(firmware, control, np.array(joint))
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
    ("increment", "in_a_tick", "ticks"), [(5e-5, 1, 100), (5e-4, 4, 1), (1.0, 1, 1)], ids=["slow", "four", "leap"]
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
    plant = homed_plant(robot=RAVEN2_STIFF)  # all axes at once at their upper ends trip one with friction
    limit = getattr(plant, side)
    start, slow = plant.setpoint_js().q, 0.2 * plant.firmware.step_limit
    rows = start + np.sign(limit - start) * slow * np.arange(1, 34_000)[:, None]
    log = plant.run(rows)
    assert_array_equal(log.setpoint[-1], limit)


TILT = FixedBase(0.0, np.deg2rad(20.0))
# the robot's code: grav_dir (x, y, z) in cm/s2 to m/s2 in frame 0 of each arm
FRAME_0 = {
    "raven2": np.array([[0, 0, -1], [1, 0, 0], [0, -1, 0]]) / 100.0,
    "raven2_right": np.array([[0, 0, -1], [-1, 0, 0], [0, 1, 0]]) / 100.0,
}


def gravity_share(plant: CablePlant) -> np.ndarray:
    return plant.control.gravity_torque.copy()


def frictionless(*args: Any, **options: Any) -> CablePlant:
    """A homed arm whose cables have become springs without friction."""
    plant = homed_plant(*args, **options)
    plant.cable = with_linear_cables(plant.cable)
    return plant


def ran(plant: CablePlant, seconds: float) -> CablePlant:
    plant.run(np.full((round(1000 * seconds), 7), np.nan))
    return plant


def settled(plant: CablePlant) -> tuple[np.ndarray, np.ndarray]:
    """What the PD and what the compensation ask of the positioning joints' motors, at rest: means of a second [Nm]."""
    ran(plant, 2.0)
    torque = plant.run(np.full((1000, 7), np.nan)).torque[:, :3].mean(axis=0)
    return torque - gravity_share(plant), gravity_share(plant)


@pytest.mark.parametrize("name", FRAME_0)
def test_its_torques_are_the_gradient_of_potential_energy_through_each_joints_own_ratio(name: str) -> None:
    arm, model, rng = load_cable_arm(), load_robot(name), np.random.default_rng(0)
    frame_0 = load_robot(name.replace("raven2", "raven2_full")).frames["frame0"].pose.rotation
    firmware, own, control = arm.firmware, OwnGravity(), ControlState()
    for _ in range(20):
        q = rng.uniform([0.0, 0.8, 0.23], [1.57, 2.3, 0.56])
        grav_dir = rng.integers(-1500, 1500, 3).tolist()
        own.gravity, control.joint[:3] = gravity_of(grav_dir), q
        write_gravity_torque(firmware, model.tree, own, control)
        gravity = frame_0 @ FRAME_0[name] @ grav_dir
        h = 1e-5
        slope = [
            (potential_energy(model, q + h * e, gravity) - potential_energy(model, q - h * e, gravity)) / (2 * h)
            for e in np.eye(3)
        ]
        motors = np.array(slope) * firmware.gearbox[:3] / firmware.ratio[:3]
        assert_allclose(control.gravity_torque, motors, atol=1e-9)  # central difference, h = 1e-5


def test_integers_of_gravity_come_back() -> None:
    assert_array_equal(gravity_of(NOMINAL_GRAV_DIR), [0.0, 0.0, -9.8])
    assert grav_dir_of(gravity_of((31, -20, 900))) == (31, -20, 900)


def test_by_no_gravity_it_is_bit_for_bit_as_without() -> None:
    logs = []
    for plant in (homed_plant(seed=2), homed_plant(seed=2, grav_dir=(0, 0, 0))):
        logs.append(plant.run(smooth_motion(plant.setpoint_js().q, 2.0)))
    assert logs[0].tobytes() == logs[1].tobytes()


def test_it_acts_once_homed_with_the_pedal_up_or_down_and_in_no_other_state() -> None:
    plant = CablePlant(grav_dir=NOMINAL_GRAV_DIR)
    assert not gravity_share(plant).any()
    plant.state_command("enable")
    plant.state_command("home")
    while plant.operating_state().is_busy:
        assert not gravity_share(plant).any()
        plant.wait()
    assert gravity_share(ran(plant, 0.01)).all()
    plant.state_command("pause")
    plant.wait()
    assert_allclose(plant.telemetry()["tau"][:3], gravity_share(plant))  # the PD is off, the brakes hold
    assert plant.telemetry()["dac_val"][:3].all()
    plant.state_command("disable")
    plant.wait()
    assert not plant.telemetry()["tau"].any()
    plant.state_command("enable")
    plant.state_command("home")  # again
    plant.wait()
    assert not gravity_share(plant).any()


def test_the_reported_torque_is_the_sum_of_both() -> None:
    plant = ran(homed_plant(grav_dir=NOMINAL_GRAV_DIR), 0.5)
    log = plant.run(np.full((1, 7), np.nan))
    asked = plant.firmware.kp[:3] * (log.motor_setpoint[0] - log.motor[0])[:3]
    asked -= plant.firmware.kd[:3] * log.motor_velocity[0, :3]
    assert_allclose(log.torque[0, :3], asked + plant.control.gravity_torque, rtol=1e-12)


@pytest.mark.parametrize("side", ["left", "right"])
def test_an_arm_without_friction_sags_less_and_by_the_coupling_that_is_left_out(side: str) -> None:
    model = load_robot("raven2" if side == "left" else "raven2_right")
    sag = []
    for grav_dir in (None, NOMINAL_GRAV_DIR):
        plant = frictionless(side, grav_dir=grav_dir)
        feedback, share = settled(plant)
        needed = gravity_torque(model, plant.state.q, (0.0, 0.0, -9.81))
        ratio = plant.cable.ratio * (1.0 + plant.cable.ratio_error)
        motors = np.array(tensions_for(plant.cable.coupling, needed)) * plant.firmware.gearbox[:3] / ratio
        assert_allclose(feedback + share, motors, atol=2e-3)  # a step of an encoder is worth 5e-4 Nm
        sag.append(np.abs(feedback))
    assert sag[1][2] < 0.1 * sag[0][2]  # no other joint's motor pulls on the third
    assert np.linalg.norm(sag[1]) < 0.5 * np.linalg.norm(sag[0])


def test_on_a_tilted_base_it_goes_by_what_it_was_told_until_the_arm_is_disabled() -> None:
    told = frictionless(base=TILT, grav_dir=NOMINAL_GRAV_DIR)
    untold = copy.deepcopy(told)
    told.grav_dir = grav_dir_of(told.measured_js().gravity)
    assert untold.grav_dir == NOMINAL_GRAV_DIR
    model, reported = load_robot("raven2"), told.control.joint[:3].copy()
    errors = []
    for plant, gravity in ((untold, (0.0, 0.0, -9.8)), (told, told.measured_js().gravity)):
        feedback, share = settled(plant)
        holding = gravity_torque(model, reported, gravity)
        motors = holding * plant.firmware.gearbox[:3] / plant.firmware.ratio[:3]
        assert_allclose(share, motors, atol=1e-3)  # grav_dir is in whole cm/s2, and the arm sags a little
        errors.append(abs(feedback[0]))
    assert errors[1] < 0.5 * errors[0]
    told.state_command("disable")
    assert told.grav_dir == NOMINAL_GRAV_DIR


def test_torques_that_are_commanded_get_none_of_it() -> None:
    plant, plain = (homed_plant(grav_dir=by) for by in (NOMINAL_GRAV_DIR, None))
    plain.state, plain.control = copy.deepcopy(plant.state), copy.deepcopy(plant.control)
    for arm in (plant, plain):
        arm.servo_jf(np.array([0.1, -0.2, 2.0]))
        arm.wait()
    assert_array_equal(plant.telemetry()["tau"], plain.telemetry()["tau"])
    plant.servo_jp(plant.setpoint_js().q)
    assert set(plant.control.mode) == {POSITION}


@pytest.mark.parametrize("grav_dir", [(0, 0), (0.5, 0, 980), (0, 0, 40_000), (0, np.nan, 980)], ids=str)
def test_what_is_no_gravity_in_whole_numbers_is_refused(grav_dir: tuple) -> None:
    with pytest.raises(InputError, match="grav_dir"):
        CablePlant(grav_dir=grav_dir)


def test_a_robot_without_it_takes_no_gravity() -> None:
    plant = CablePlant()
    assert plant.grav_dir is None
    with pytest.raises(InputError, match="without gravity compensation"):
        plant.grav_dir = NOMINAL_GRAV_DIR


def test_a_served_robot_has_it_if_asked_for_and_says_so_in_its_torques() -> None:
    for grav_dir in (None, NOMINAL_GRAV_DIR):
        serving = Serving(simulated=Simulated(grav_dir=grav_dir))  # homed, and PAUSED
        network = LoopbackNetwork()
        client = Loopback("client", network)
        heard = client.subscribe("/ravenstate", "raven_2/raven_state")
        server = make_server(serving, Loopback("robot", network))
        for _ in range(3):
            server.tick()
        message = heard.take()[-1][0]
        assert message.runlevel == 2  # pedal up: only gravity's torques are asked for
        expected = gravity_share(server.arms["gold"].plant)
        assert_allclose(message.tau[:3], expected, rtol=1e-6)  # floats
        assert message.tau[:3].any() == (grav_dir is not None)
        assert not message.tau[3:].any()
