"""A PSM's physics against closed forms, the dynamics of its parallelogram, and what energy does."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics, mass_matrix
from catenary.simulation.base_motion import RockingBase
from catenary.simulation.psm_controller import PsmState, PsmWork, apply_coupling, load_psm, unstretched_motors
from oracles import psm_arms
from oracles.tree_poses import potential_energy

GRAVITY = np.array([0.0, 0.0, -9.81])
ARM = load_psm()
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
