"""The dVRK's control of a simulated PSM, tick by tick."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics, mass_matrix
from catenary.simulation.base_motion import RockingBase
from catenary.simulation.compiled_records import POSITION, TORQUE
from catenary.simulation.psm_controller import (
    _FULL_TURN,
    PsmControlState,
    PsmState,
    PsmWork,
    apply_coupling,
    control_joints,
    load_psm,
    read_psm_encoders,
    register_psm,
    take_psm_setpoint,
    unstretched_motors,
)
from oracles import psm_arms
from oracles.tree_poses import potential_energy

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


GRAVITY = np.array([0.0, 0.0, -9.81])
MODEL = ARM.loaded_model()
DRIVE = ARM.drive
STILL = np.zeros((3, 3))


def stepped(drive, state, torque, step, base=STILL):
    """States after each of the steps."""
    steps, work = PsmState.rows(len(torque)), PsmWork()
    psm_arms.take_psm_steps(ARM.links, ARM.coupling, drive, state, torque, GRAVITY, base, step, work, steps)
    return steps, work


def test_discs_are_wound_as_the_user_guide_has_it():
    # joints of its matrix at discs: pitch 1.0186 d2, yaw -.8306 d2 + .6089 (d3 + d4), jaw 1.2177 (d4 - d3)
    q, wound = np.array([0.2, -0.3, 0.1, 0.5, -0.4, 0.3, 0.6]), np.empty(7)
    apply_coupling(q, DRIVE.coupling, wound, False)
    second = q[4] / 1.0186
    both = (q[5] + 0.8306 * second) / 0.6089
    assert_allclose(wound[:3], q[:3])
    assert_allclose(wound[3], q[3] / -1.5632, rtol=1e-6)  # the file has seven digits
    assert_allclose(wound[4], second, rtol=1e-6)
    assert_allclose([wound[5] + wound[6], wound[6] - wound[5]], [both, q[6] / 1.2177], rtol=1e-6)


@pytest.mark.parametrize("base", [None, RockingBase(0.2, 0.15, 0.5, lever=(0.1, -0.2, 0.3))], ids=["still", "rocking"])
def test_links_have_the_dynamics_of_the_parallelogram(base, rng):
    motion, gravity = STILL, GRAVITY
    if base is not None:
        sampled = base.sample(np.array([0.7]))
        motion, gravity = sampled.motion[0], sampled.gravity[0]
    for _ in range(5):
        q, qd = rng.uniform(-0.3, 0.3, (2, 7))
        q[2] += 0.12
        state, work, steps = PsmState(q=q, qd=qd), PsmWork(), PsmState.rows(1)
        state.rotor = unstretched_motors(DRIVE, q)
        psm_arms.take_psm_steps(
            ARM.links, ARM.coupling, DRIVE, state, np.zeros((1, 7)), gravity, motion, 1e-9, work, steps
        )
        of_base = None if base is None else BaseMotion(*motion)
        still = inverse_dynamics(MODEL, q, qd, np.zeros(7), gravity, of_base)
        M = mass_matrix(MODEL, q)[:3, :3] - np.diag((DRIVE.ratio**2 * DRIVE.rotor_inertia)[:3])
        assert_allclose(work.load[:3], still[:3], atol=1e-10)
        assert_allclose(work.inverse[:3, :3] @ M, np.eye(3), atol=1e-9)


def test_no_tension_where_no_cable_is_stretched():
    state = psm_arms.resting_psm(DRIVE, psm_arms.HOME)
    steps, _ = stepped(DRIVE, state, np.zeros((1, 7)), 1e-9)
    assert_allclose(steps.tension[0] / DRIVE.stiffness, 0.0, atol=1e-9)


def energy(drive, state):
    """Of rotors, links, tool, cables and gravity [J]."""
    q, qd, rotor, rotor_velocity = (state[name] for name in ("q", "qd", "rotor", "rotor_velocity"))
    M = np.zeros((7, 7))
    M[:3, :3] = mass_matrix(MODEL, q)[:3, :3] - np.diag((drive.ratio**2 * drive.rotor_inertia)[:3])
    M[3:, 3:] = np.diag(drive.tool_inertia)
    wound = np.empty(7)
    apply_coupling(q, drive.coupling, wound, False)
    stretch = rotor / (drive.ratio * (1.0 + drive.ratio_error)) - wound
    kinetic = 0.5 * qd @ M @ qd + 0.5 * drive.rotor_inertia @ rotor_velocity**2
    return kinetic + 0.5 * drive.stiffness @ stretch**2 + potential_energy(MODEL, q)


def drift_of_energy(step):
    drive = psm_arms.with_plain_springs(DRIVE)
    state = psm_arms.resting_psm(drive, psm_arms.HOME)
    state.rotor[3:] += 0.5  # wound up: the wrist will swing
    before = energy(drive, state)
    steps, _ = stepped(drive, state, np.zeros((round(0.2 / step), 7)), step)
    swung = (0.5 * steps.qd[::10, 3:] ** 2 @ drive.tool_inertia).max()
    return energy(drive, steps[-1]) - before, swung


def test_energy_is_kept_without_friction_to_the_first_order_of_the_step():
    (coarse, swung), (fine, _) = (drift_of_energy(step) for step in (4e-5, 2e-5))
    assert swung > 1e-4
    assert abs(coarse) < 0.05 * swung
    assert abs(2.0 * fine - coarse) < 0.1 * abs(coarse) + 1e-4 * swung  # halves with the step


def test_a_wrist_joint_stays_where_it_is_within_its_play():
    state = psm_arms.resting_psm(DRIVE, psm_arms.HOME)
    braked = state.q.copy()
    state.rotor[4] += 0.4 * DRIVE.backlash[4] * DRIVE.ratio[4]
    steps, _ = stepped(DRIVE, state, np.zeros((500, 7)), 5e-4)
    assert_allclose(steps.q[-1, 3:], braked[3:], atol=1e-12)
