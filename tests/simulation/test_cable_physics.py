import copy

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.arrays import Floats
from catenary.dynamics.inverse_dynamics import mass_matrix
from catenary.gravity.torque import gravity_torque
from catenary.kernels.compiled import compiled
from catenary.robots.catalog import load_robot
from catenary.simulation.base_motion import RockingBase
from catenary.simulation.cable_parameters import Cable, load_cable_arm
from catenary.simulation.cable_physics import ArmState, Work, pull_at_joint, pull_cable
from catenary.simulation.cable_plant import CablePlant
from catenary.simulation.compiled_records import OFF
from catenary.simulation.firmware import control_motors, read_encoders
from catenary.simulation.simulated_plant import PERIOD
from catenary.transmission.cable_elasticity import beyond_backlash, tensions_for, winding_of
from oracles import cable_arms
from oracles.mujoco_cable_arm import MujocoCableArm
from oracles.tree_poses import potential_energy

GRAVITY = np.array([0.0, 0.0, -9.81])
MODEL = load_robot("raven2")
TREE = MODEL.tree._make(np.array(part) for part in MODEL.tree)  # writable, as a plant's own
ARM = load_cable_arm()
CABLE = ARM.cable


def motor_torques(cable, seconds, step):
    """Pushes and pulls about what holds the arm, which swing it without reaching its stops."""
    t = (np.arange(round(seconds / step)) + 0.5) * step
    hold = tensions_for(cable.coupling, gravity_torque(MODEL, cable_arms.HOME, GRAVITY))
    torque = np.zeros((len(t), 7))
    torque[:, :3] = hold / (cable.ratio * (1.0 + cable.ratio_error))
    torque[:, 0] += 0.02 * np.cos(6.0 * t)
    torque[:, 1] += 0.015 * np.cos(7.0 * t)
    torque[:, 2] += 0.010 * np.cos(9.0 * t)
    return torque


def energy_balance(cable, step, seconds=0.5):
    """Work of the motors, to and fro, and what of it is found nowhere: [J]."""
    state = cable_arms.resting_state(cable, cable_arms.HOME)
    torque = motor_torques(cable, seconds, step)
    steps = ArmState.rows(len(torque))
    cable_arms.take_steps(TREE, cable, state, torque, GRAVITY, np.zeros((3, 3)), step, Work(), steps)
    rotor, rotor_velocity = steps.rotor[:, :3], steps.rotor_velocity[:, :3]
    assert (cable.stop_side * (steps.q - cable.stop_position) < 0.0).all()  # no stop was met

    ratio = cable.ratio * (1.0 + cable.ratio_error)
    torque = torque[:, :3]
    work = np.sum(torque * rotor_velocity) * step
    kinetic = 0.5 * steps.qd[-1] @ mass_matrix(MODEL, steps.q[-1]) @ steps.qd[-1]
    kinetic += 0.5 * np.sum(cable.rotor_inertia * rotor_velocity[-1] ** 2)
    potential = potential_energy(MODEL, steps.q[-1]) - potential_energy(MODEL, cable_arms.HOME)

    before = {
        "rotor": np.vstack([cable_arms.resting_state(cable, cable_arms.HOME).rotor[:3], rotor[:-1]]),
        "q": np.vstack([cable_arms.HOME, steps.q[:-1]]),
        "velocity": np.vstack([np.zeros(3), rotor_velocity[:-1]]),
        "qd": np.vstack([np.zeros(3), steps.qd[:-1]]),
    }
    pulled = before["rotor"] / ratio - np.array([winding_of(cable.coupling, q) for q in before["q"]])
    stretch = np.array([[beyond_backlash(s, b) for s, b in zip(row, cable.backlash, strict=True)] for row in pulled])
    rate = before["velocity"] / ratio - np.array([winding_of(cable.coupling, v) for v in before["qd"]])
    K, a, w, k = cable.stiffness, cable.elastic_share, cable.hysteresis_width, cable.slow_share
    elastic = 0.5 * K * (a * stretch[-1] ** 2 + k * (stretch[-1] - steps.slow_stretch[-1]) ** 2)
    share = cable.node_share
    winding_rate = np.array([winding_of(cable.coupling, v) for v in before["qd"]])
    way = (1.0 - share) * before["velocity"] / ratio + share * winding_rate  # of the node, were it free

    held = (1.0 - a) * K * w * steps.hysteresis  # hysteretic part of the tension
    creeping = k * K * (stretch - steps.slow_stretch)
    lost = step * (
        np.sum(cable.damping * np.where(stretch != 0.0, rate, 0.0) ** 2)
        + np.sum(held * rate)
        + np.sum(steps.node * way)  # stored in the cable beside the node, or rubbed away
        # inside the backlash the Maxwell branch pulls along the travel, outside it only flows
        + np.sum(np.where(stretch != 0.0, 0.0, creeping * rate))
        + np.sum(creeping**2 / (k * K * cable.slow_time) if np.all(k > 0.0) else 0.0)
        + np.sum(cable.rotor_damping * before["velocity"] * rotor_velocity)
    )
    inertial = cable.rotor_inertia * (rotor_velocity - before["velocity"]) / step
    load = (steps.tension + (1.0 - share) * steps.node) / ratio
    rotor_friction = torque - load - cable.rotor_damping * before["velocity"] - inertial
    lost += step * np.sum(rotor_friction * rotor_velocity)
    lost += np.sum(steps.friction * steps.qd)
    turned_over = np.sum(np.abs(torque * rotor_velocity)) * step
    return turned_over, work - kinetic - potential - np.sum(elastic) - lost


NO_RUNOUT, FRICTION = (
    cable_arms.without_wear(cable_arms.without_runout(load_cable_arm(robot).cable)) for robot in cable_arms.ROBOTS
)
BALANCED = {
    "springs": cable_arms.with_linear_cables(CABLE).replace(damping=np.zeros(3), rotor_damping=np.zeros(3)),
    "linear cables": cable_arms.with_linear_cables(CABLE),
    "idlers": cable_arms.with_linear_cables(CABLE).replace(node_friction=[0.3, 0.3, 3.0]),
    "hysteresis, creep, backlash": cable_arms.without_friction(NO_RUNOUT),
    "everything": NO_RUNOUT,
    "everything, more friction": FRICTION,
}


@pytest.mark.slow
@pytest.mark.parametrize("effects", BALANCED)
def test_energy_is_kept_to_the_first_order_of_the_step(effects):
    (work, coarse), (_, fine) = (energy_balance(BALANCED[effects], step) for step in (2e-4, 1e-4))
    assert abs(coarse) < 0.02 * work
    assert abs(2.0 * fine - coarse) < 2e-4 * work  # what a first-order error leaves when it is extrapolated


@pytest.mark.parametrize("base", [None, RockingBase(0.2, 0.15, 0.5, lever=(0.1, -0.2, 0.3))], ids=["still", "rocking"])
def test_linear_cables_move_as_in_mujoco(base):
    plant = CablePlant(cable_arms.linear_arm(), base=base, substeps=1)
    plant.home()
    plant.substeps = 2
    mujoco_arm = MujocoCableArm(TREE, plant.cable, base)
    mujoco_arm.place(plant.state.q, plant.state.qd, plant.state.rotor[:3], plant.state.rotor_velocity[:3], plant.time)
    control, state = copy.deepcopy((plant.control, plant.state))
    rows = cable_arms.smooth_motion(plant.control.setpoint, 4.0)
    log = plant.run(rows)

    # the same firmware on the rotors of the other simulation, which has no tool
    control.mode[3:] = OFF
    q, shaft_torque = np.empty((len(rows), 3)), np.zeros(7)
    for k, row in enumerate(rows):
        q[k] = mujoco_arm.q
        control.setpoint[:] = row
        control_motors(plant.firmware, control, shaft_torque)
        mujoco_arm.step(shaft_torque[:3], PERIOD)
        state.rotor[:3] = mujoco_arm.rotor
        read_encoders(plant.firmware, state, control)

    assert np.ptp(q, axis=0)[2] > 0.03  # it did move
    assert np.rad2deg(np.abs(log.q - q)[:, :2].max()) < 0.005
    assert np.abs(log.q - q)[:, 2].max() < 5e-6


def creep_deg_per_s(plant, seconds):
    """Fastest true joint's mean speed over a span [deg/s; mm/s for the insertion, much the same at a hand's length]."""
    before = plant.state.q.copy()
    for _ in range(round(seconds / PERIOD)):
        plant.wait()
    return (np.abs(plant.state.q - before) * [np.rad2deg(1.0), np.rad2deg(1.0), 1e3]).max() / seconds


@pytest.mark.parametrize("robot", cable_arms.ROBOTS)
def test_arm_that_holds_still_does_not_creep(robot):
    plant = cable_arms.homed_plant(robot=robot)
    row = np.full((1, 7), np.nan)
    plant.run(np.repeat(row, 300_000, axis=0))  # five slow times: only what never ends is left
    assert creep_deg_per_s(plant, 2.0) < 1e-4


@pytest.mark.parametrize("robot", cable_arms.ROBOTS)
def test_arm_on_its_brakes_does_not_creep(robot):
    plant = cable_arms.homed_plant(robot=robot)
    plant.state_command("disable")
    creep_deg_per_s(plant, 2.0)
    assert creep_deg_per_s(plant, 2.0) < 2e-4


def test_sticking_joint_stands_exactly_still():
    # a cable that relaxes takes a joint along that stands just at what friction holds
    plant = CablePlant(ARM._replace(cable=CABLE.replace(slow_share=np.zeros(3))), start=cable_arms.HOME)
    for _ in range(2000):  # on its brakes
        plant.wait()
    assert_allclose(plant.state.qd, 0.0, atol=1e-12)


@compiled
def wind_up(cable: Cable, state: ArmState, way: float, winding: float, ends: Floats) -> None:
    """Turn the first motor by a way [rad of the joint], whose joint is held; write what both ends of its cable feel."""
    steps = len(ends)
    cable, state = cable[()], state[()]
    ratio = cable.ratio[0] * (1.0 + cable.ratio_error[0])
    for k in range(steps):
        state.rotor_velocity[0] = ratio * way / steps / PERIOD
        state.rotor[0] += ratio * way / steps
        pull_cable(cable, state, 0, winding, 0.0, PERIOD)
        ends[k, 0] = state.tension[0] + (1.0 - cable.node_share[0]) * state.node[0]
        ends[k, 1] = pull_at_joint(cable, state, 0)


@pytest.mark.parametrize("share", [0.2, 0.5, 0.7])
def test_a_held_joint_feels_nothing_until_its_cable_slides_over_the_idlers(share):
    friction, stiffness = 0.4, CABLE.stiffness[0]
    linear = cable_arms.with_linear_cables(CABLE).replace(damping=np.zeros(3))
    cable = linear.replace(node_friction=[friction, 0.0, 0.0], node_share=[share, 0.5, 0.5])
    slides = friction * share / stiffness  # the motor's part of the cable alone is stretched until here
    state, ends = ArmState(), np.empty((100, 2))
    wind_up(cable, state, slides, 0.0, ends)
    assert_allclose(ends[-1], [friction, 0.0], atol=1e-9)
    wind_up(cable, state, 2.0 * slides, 0.0, ends)  # it slides: both ends feel the whole cable's stiffness
    assert_allclose(ends[-1], [friction + 2.0 * stiffness * slides, 2.0 * stiffness * slides], rtol=1e-9)
    wind_up(cable, state, -2.0 * slides, 0.0, ends)  # and back: friction has to turn round before the joint feels it
    assert_allclose(ends[-1], [2.0 * stiffness * slides - friction, 2.0 * stiffness * slides], atol=1e-9)


def test_idlers_rub_the_same_however_slowly_their_cable_slides():
    cable = cable_arms.with_linear_cables(CABLE).replace(damping=np.zeros(3), node_friction=[0.4, 0.0, 0.0])
    slides, felt = 0.4 * 0.5 / cable.stiffness[0], []
    for steps in (7, 500):
        state, ends = ArmState(), np.empty((steps, 2))
        for way in (3.0, -1.5, 0.5, -4.0):
            wind_up(cable, state, way * slides, 0.0, ends)
            felt.append(ends[-1].copy())
    assert_allclose(felt[:4], felt[4:], atol=1e-9)


def test_idlers_out_of_round_move_the_joint_as_their_cable_winds():
    idlers = {"idler_runout": [1e-3, 0.0, 0.0], "idler_turns": [8.0, 1.0, 1.0], "idler_phase": np.zeros(3)}
    cable = cable_arms.with_linear_cables(CABLE).replace(**idlers)
    ratio, ends = cable.ratio[0] * (1.0 + cable.ratio_error[0]), np.empty((1, 2))
    for q in np.linspace(-1.0, 1.0, 9):
        state = cable_arms.resting_state(cable, np.array([q, *cable_arms.HOME[1:]]))
        assert_allclose(state.rotor[0] / ratio, q - 1e-3 * np.sin(8.0 * q), atol=1e-12)
        wind_up(cable, state, 0.0, q, ends)
        assert_allclose(ends, 0.0, atol=1e-9)  # no cable is stretched


def turned_tool(cable, torque, steps=200, velocity=0.0):
    """Speed of the first tool's motor after some milliseconds under a torque [Nm]."""
    state = cable_arms.resting_state(cable, cable_arms.HOME)
    state.rotor_velocity[3] = velocity
    shaft = np.zeros((steps, 7))
    shaft[:, 3] = torque
    log = ArmState.rows(steps)
    cable_arms.take_steps(TREE, cable, state, shaft, GRAVITY, np.zeros((3, 3)), PERIOD, Work(), log)
    return log.rotor_velocity[:, 3], log.rotor[:, 3]


def test_a_tool_sticks_harder_than_it_slides_and_unevenly():
    friction = 0.004
    even = CABLE.replace(tool_friction=np.full(4, friction), tool_damping=np.zeros(4), tool_ripple=np.zeros(4))
    sticky = even.replace(tool_stiction=np.full(4, 0.5))
    assert not turned_tool(sticky, 1.49 * friction)[0].any()
    assert turned_tool(sticky, 1.51 * friction)[0][-1] > 0.0
    assert (np.diff(turned_tool(sticky, 1.2 * friction, velocity=5.0)[0]) > 0.0).all()  # it keeps what moves going
    uneven = sticky.replace(tool_stiction=np.zeros(4), tool_ripple=np.full(4, 0.4), tool_wave=np.full(4, 3.0))
    speed, rotor = turned_tool(uneven, 0.0, steps=30, velocity=50.0)
    joint = (
        rotor - uneven.tool_carried[0] * cable_arms.resting_state(uneven, cable_arms.HOME).rotor[2]
    ) / uneven.tool_ratio[0]
    slowing = -np.diff(speed) / PERIOD * uneven.tool_inertia[0]
    expected = friction * (1.0 + 0.4 * np.sin(3.0 * joint[:-1]))
    assert_allclose(slowing, expected, rtol=0.02)  # the insertion's motor turns a little meanwhile
