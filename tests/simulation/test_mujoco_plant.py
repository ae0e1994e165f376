import copy
import sys
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

import own_base
from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics, mass_matrix
from catenary.errors import InputError, LimitError, MissingInertiaError, MissingPackageError, NotReadyError
from catenary.gravity.payload import Payload
from catenary.gravity.torque import gravity_torque
from catenary.robots.assembly import Coordinate, Link, assemble
from catenary.robots.catalog import load_robot
from catenary.robots.link_inertia import LinkInertia
from catenary.robots.urdf import parse_urdf
from catenary.simulation.base_motion import FixedBase, RockingBase
from catenary.simulation.joint_hardware import JointHardware
from catenary.simulation.mujoco_plant import MujocoDynamics, MujocoPlant, tree_mjcf
from catenary.simulation.simulated_plant import PERIOD
from catenary.spatial import identity_pose
from oracles.catalogue import robots_with_inertia

LEVEL = np.array([0.0, 0.0, -9.81])
TILTED = FixedBase(roll=np.deg2rad(30.0))
ROCKING = RockingBase(mean=0.2, amplitude=0.3, frequency=0.7, axis=(0.6, 0.0, 0.8), lever=(0.1, 0.2, 0.5), start=TILTED)
MASSLESS_WRIST = {"raven2_full", "raven2_full_right"}


def enabled(model, **options) -> MujocoPlant:
    plant = MujocoPlant(model, **options)
    plant.home()
    return plant


def ticks(plant, count, torque=None):
    """Wait, commanding a torque where one is given; returns joint positions after each tick (count, n)."""
    seen = []
    for _ in range(count):
        if torque is not None:
            plant.servo_jf(torque)
        plant.wait()
        seen.append(plant.measured_js().q)
    return np.array(seen)


def gravity_of(base, t=0.0):
    return base.sample(np.array([t])).gravity[0]


def small(robots, most=6):
    """Random trees of a few joints, coupled, prismatic and branching ones among them, one in four."""
    return [r.model for r in robots[:24:4] if r.model.n <= most]


def hardware_for(name):
    return JointHardware(armature=1e-4) if name in MASSLESS_WRIST else None


# exactness


@pytest.mark.alike
@pytest.mark.parametrize("name", robots_with_inertia())
def test_gravity_torque_holds_a_catalogue_robot_still_on_a_tilted_base(name):
    model = load_robot(name)
    plant = enabled(model, base=TILTED, hardware=hardware_for(name))
    start = plant.measured_js().q
    end = ticks(plant, 300, gravity_torque(model, start, gravity_of(TILTED)))[-1]
    # nothing corrects: rounding grows by e^(t sqrt(g / l)), l = 4 cm for the dual arm's wrists; on the Gen3's bracelet,
    # 7e-4 kg m2, 1e-16 of 23 Nm is 3e-12 rad/s2, times e^9 a second
    assert_allclose(end, start, atol=1e-6)


@pytest.mark.parametrize("base", [TILTED, ROCKING])
def test_free_motion_is_that_of_the_recursions(random_robots, base):
    rng = np.random.default_rng(4)
    for model in small(random_robots):
        n = model.n
        q, tau = rng.normal(scale=0.5, size=n), rng.normal(size=n)

        def motion(t, y, model=model, n=n, tau=tau):
            gravity, moves = (rows[0] for rows in base.sample(np.array([t])))
            h = inverse_dynamics(model, y[:n], y[n:], np.zeros(n), gravity, BaseMotion(*moves))
            return np.concatenate([y[n:], np.linalg.solve(mass_matrix(model, y[:n]), tau - h)])

        expected = solve_ivp(motion, (0.0, 0.2), [*q, *np.zeros(n)], method="DOP853", rtol=1e-11, atol=1e-12)
        plant = enabled(model, start=q, base=base)
        ticks(plant, 200, tau)
        state = plant.measured_js()
        size = 1.0 + np.abs(expected.y[:, -1]).max()
        assert_allclose([*state.q, *state.qd], expected.y[:, -1], atol=1e-6 * size)


def test_inverse_dynamics_holds_an_arm_on_a_rocking_base():
    model = load_robot("raven2")
    q, zero = np.array([0.5, 1.5, 0.4]), np.zeros(3)

    def holding(gravity, motion):
        return inverse_dynamics(model, q, zero, zero, gravity, BaseMotion(*motion))

    plant = enabled(model, start=q, base=ROCKING)
    for _ in range(1000):
        # torques are held over a tick: their mean over it, by Simpson's rule
        samples = ROCKING.sample(plant.time + PERIOD * np.array([0.0, 0.5, 1.0]))
        torques = [holding(*sample) for sample in zip(*samples, strict=True)]
        state = plant.measured_js()  # its gravity and rates tell as much
        assert_allclose(holding(state.gravity, state.base_rates), torques[0], atol=1e-3)  # the arm has moved
        plant.servo_jf(np.array([1.0, 4.0, 1.0]) @ torques / 6.0)
        plant.wait()
    # held torques lead at first and lag then: each tick moves the arm by h^3 (dtau/dt) / 12 M, in a second by
    # h^2 (5 Nm) / 12 (0.02 kg m2) = 2e-5 rad, and the pose is unstable
    assert_allclose(plant.measured_js().q, q, atol=1e-4)


# drives


def test_friction_holds_without_creep_up_to_its_coulomb_torque():
    model, q = load_robot("two_link"), np.array([0.3, 0.4])
    hold = gravity_torque(model, q, LEVEL)
    plant = enabled(model, start=q, hardware=JointHardware(friction=1.0))
    assert_array_equal(ticks(plant, 300, hold + np.array([0.999, -0.999])), np.tile(q, (300, 1)))
    assert ticks(plant, 200, hold + np.array([1.5, 0.0]))[-1, 0] - q[0] > 1e-3


def wheel(**hardware):
    """One joint with a vertical axis, 2 kg m2: gravity does nothing."""
    body = LinkInertia(3.0, np.array([0.4, 0.0, 0.0]), np.diag([0.8, 1.0, 2.0 - 3.0 * 0.4**2]))
    model = assemble(
        "wheel",
        [Link("disc", "base", "revolute", identity_pose(), variable={"turn": 1.0}, inertia=body)],
        [Coordinate("turn", "rad")],
    )
    return enabled(model, hardware=JointHardware(**hardware))


def test_a_wheel_moves_as_the_closed_forms_of_damping_and_friction_say():
    damped = wheel(damping=3.0, armature=0.7)
    ticks(damped, 200, [6.0])
    assert_allclose(damped.measured_js().qd, [2.0 * (1.0 - np.exp(-3.0 * 0.2 / 2.7))], rtol=1e-9)
    plant = wheel(friction=2.0)
    ticks(plant, 100, [12.0])
    state, speed = plant.measured_js(), (12.0 - 2.0) * 0.1 / 2.0
    assert_allclose(state.qd, [speed], rtol=1e-9)
    seen = ticks(plant, 800, np.zeros(1))[:, 0]
    stop = speed / (2.0 / 2.0)  # [s]
    # it stops within a tick, at 1 mrad/s, and stays
    assert_allclose(seen[-1], state.q[0] + 0.5 * speed * stop, atol=1e-6)
    assert (seen[round(stop / PERIOD) + 1 :] == seen[-1]).all()


def test_an_arm_falls_onto_its_limit_and_lies_there():
    model = load_robot("raven2")
    plant = enabled(model, start=[0.5, 1.5, 0.4])
    seen = ticks(plant, 3000, np.zeros(3))
    assert ((seen >= model.lower) & (seen <= model.upper)).all()
    assert_array_equal(seen[-1], seen[-500])
    on = np.isclose(seen[-1], model.lower) | np.isclose(seen[-1], model.upper)
    assert on.any()


def test_elastic_joints_move_as_two_masses_on_a_spring():
    model = load_robot("planar_3r")
    n, q = 3, np.array([0.3, -0.4, 0.5])
    stiffness, rotor, damping = np.array([400.0, 200.0, 80.0]), np.array([0.5, 0.2, 0.1]), 0.3
    tau = gravity_torque(model, q, LEVEL) + np.array([1.0, -0.5, 0.2])

    def motion(_, y):
        q, theta, qd, thetad = y.reshape(4, n)
        pull = stiffness * (theta - q) + damping * (thetad - qd)
        h = inverse_dynamics(model, q, qd, np.zeros(n), LEVEL)
        return np.concatenate([qd, thetad, np.linalg.solve(mass_matrix(model, q), pull - h), (tau - pull) / rotor])

    expected = solve_ivp(motion, (0.0, 0.3), [*q, *q, *np.zeros(6)], method="DOP853", rtol=1e-11, atol=1e-12)
    hardware = JointHardware(armature=rotor, stiffness=stiffness, spring_damping=damping)
    plant = enabled(model, start=q, hardware=hardware)
    ticks(plant, 300, tau)
    state, links, rotors = plant.measured_js(), expected.y[:3, -1], expected.y[3:6, -1]
    assert_allclose(plant.telemetry()["q_true"], links, atol=1e-6)
    assert_allclose(state.q, rotors, atol=1e-6)
    assert_array_equal(state.q_motor, state.q)


def test_torque_beyond_the_effort_limit_does_not_act():
    model = replace(load_robot("two_link"), effort_limit=np.array([5.0, 5.0]))
    plants = [enabled(model, base=FixedBase(roll=np.pi / 2)) for _ in range(2)]
    one, other = (ticks(p, 100, [tau, 0.0])[-1] for p, tau in zip(plants, (5.0, 50.0), strict=True))
    assert_array_equal(one, other)
    assert plants[1].measured_js().tau[0] == 50.0
    assert plants[1].telemetry()["effort"][0] == 5.0


# payload


def test_payload_taken_up_and_put_down_again_needs_its_own_torque():
    model, payload = load_robot("planar_3r"), Payload(1.5, None, (0.05, 0.0, 0.0))
    q = np.array([0.3, -0.5, 0.8])
    plant = enabled(model, start=q)
    for carried in (model, payload.on(model), model):
        if carried is not model:
            plant.attach(payload)
        elif plant.payload is not None:
            plant.detach()
        assert_allclose(ticks(plant, 100, gravity_torque(carried, q, LEVEL))[-1], q, atol=1e-12)
    assert plant.payload is None


# the servo in place of firmware


def test_servo_reaches_its_setpoint_on_any_tree_and_base(random_robots):
    for model in small(random_robots):
        plant = enabled(model, start=np.full(model.n, 0.1), base=ROCKING, payload=Payload(1.0))
        for k in range(400):
            plant.servo_jp(np.full(model.n, 0.1 + 0.1 * min(k / 200, 1.0)))
            plant.wait()
        # torques are held over a tick while the base rocks
        assert_allclose(plant.measured_js().q, 0.2, atol=1e-4)


@pytest.mark.parametrize("spring", [{}, {"armature": 0.2, "stiffness": [np.inf, 500.0, 500.0]}])
def test_servo_overcomes_friction_to_a_tenth_of_a_milliradian(spring):
    model = load_robot("planar_3r")
    plant = enabled(model, start=[0.3, 0.2, 0.1], hardware=JointHardware(friction=[5.0, 2.0, 1.0], **spring))
    for k in range(600):
        plant.servo_jp(np.array([0.3, 0.2, 0.1]) + 0.1 * min(k / 200, 1.0))
        plant.wait()
    assert_allclose(plant.measured_js().q, [0.4, 0.3, 0.2], atol=2e-4)


def test_setpoint_follows_torques_and_moves_no_faster_than_the_velocity_limits():
    plant = enabled(replace(load_robot("two_link"), velocity_limit=np.array([1.0, np.inf])))
    left = ticks(plant, 200, np.zeros(2))[-1]
    plant.servo_jp(left)
    plant.wait()
    assert_allclose(plant.setpoint_js().q, left, atol=1e-12)
    plant.servo_jp(left + 0.5)
    plant.wait()
    assert_allclose(plant.setpoint_js().q, left + np.array([1e-3, 0.5]))


# life


def test_brakes_hold_while_the_robot_is_not_enabled():
    plant = MujocoPlant(load_robot("planar_3r"), base=ROCKING, start=[0.3, 0.2, 0.1])
    assert_array_equal(ticks(plant, 300)[-1], [0.3, 0.2, 0.1])
    plant.home()
    ticks(plant, 100, np.zeros(3))
    plant.state_command("pause")
    where = plant.measured_js()
    assert_array_equal(ticks(plant, 100)[-1], where.q)
    assert (where.qd == 0.0).all()


def test_equal_commands_give_equal_motions_bit_for_bit_and_a_copy_goes_on_alike():
    hardware = JointHardware(friction=0.2, damping=0.1)
    a, b = (enabled(load_robot("raven2"), base=ROCKING, hardware=hardware) for _ in range(2))
    assert_array_equal(ticks(a, 50, np.ones(3)), ticks(b, 50, np.ones(3)))
    twin = copy.deepcopy(a)
    expected = ticks(twin, 50, np.ones(3))
    assert_array_equal(ticks(a, 50, np.ones(3)), expected)


def test_a_motion_beyond_all_numbers_stops_the_robot_in_fault():
    plant = enabled(load_robot("two_link"))
    plant.servo_jf(np.array([1e300, -1e300]))
    assert np.isfinite(ticks(plant, 20)).all()
    assert plant.operating_state().state == "FAULT"
    with pytest.raises(NotReadyError, match=r"diverged in tick \d+, at 0\.0"):
        plant.servo_jf(np.zeros(2))
    plant.state_command("enable")
    plant.servo_jf(np.zeros(2))


def test_unhomed_robot_is_homed_by_its_command_once_enabled():
    plant = enabled(load_robot("two_link"))
    plant.state_command("unhome")
    assert not plant.operating_state().is_homed
    plant.state_command("home")
    assert plant.operating_state().is_homed
    plant.state_command("disable")
    with pytest.raises(NotReadyError, match="enable it first"):
        plant.state_command("home")


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [({"start": [0.5, 1.5, 0.1]}, LimitError, "insertion"), ({"substeps": 0}, InputError, "substeps")],
)
def test_impossible_options_are_refused(options, error, message):
    with pytest.raises(error, match=message):
        MujocoPlant(load_robot("raven2"), **options)


def test_bodies_and_joints_have_the_links_names(random_robots):
    for robot in random_robots[:10]:
        model = mujoco.MjModel.from_xml_string(tree_mjcf(robot.model))
        for name, mass in zip(robot.model.link_names, robot.model.tree.mass, strict=True):
            assert model.body(name).mass[0] == mass
            assert model.body(model.joint(name).bodyid[0]).name == name


def test_names_may_hold_what_xml_does_not_like():
    names = ('a<"&', "b'>")
    model = mujoco.MjModel.from_xml_string(tree_mjcf(replace(load_robot("two_link"), link_names=names, name="<&>")))
    assert [model.joint(k + 1).name for k in range(2)] == list(names)


def test_inertia_that_no_body_has_is_refused_by_name():
    model = load_robot("two_link")
    inertia = np.array(model.tree.inertia)
    inertia[1] = np.diag([0.1, 0.1, 0.3])
    with pytest.raises(InputError, match=model.link_names[1]):
        tree_mjcf(replace(model, tree=model.tree._replace(inertia=inertia)))


def test_links_without_inertia_are_refused():
    with pytest.raises(MissingInertiaError):
        tree_mjcf(replace(load_robot("two_link"), missing_inertia=("upper",)))


def test_a_moving_link_may_be_named_base():
    model = mujoco.MjModel.from_xml_string(tree_mjcf(parse_urdf(own_base.MOVING)))
    assert model.body(1).name == "base_link"
    assert model.body(model.joint("base").bodyid[0]).name == "base"


def terms(model, q, qd, gravity=(0.0, 0.0, 0.0), motion=((0.0,) * 3,) * 3):
    """Mass matrix (n, n) and velocity, gravity and base torques (n,) along the robot's coordinates."""
    dynamics = MujocoDynamics(model)
    dynamics.tree.q[dynamics.at] = model.coupling @ q + model.offset
    dynamics.tree.qd[dynamics.dof] = model.coupling @ qd
    dynamics.move_base(np.asarray(gravity), np.asarray(motion))
    dynamics.update()
    pick = dynamics.dof
    A = model.coupling
    return A.T @ dynamics.tree.mass[np.ix_(pick, pick)] @ A, A.T @ dynamics.tree.bias[pick]


def test_terms_on_an_accelerating_base_are_the_recursions(random_robots):
    rng = np.random.default_rng(1)
    for robot in random_robots[:12]:
        n = robot.model.n
        q, qd, qdd, gravity, motion = (rng.normal(size=s) for s in (n, n, n, 3, (3, 3)))
        M, h = terms(robot.model, q, qd, 9.81 * gravity, motion)
        inertia = mass_matrix(robot.model, q)
        assert_allclose(M, inertia, atol=1e-11 * np.abs(inertia).max())
        expected = inverse_dynamics(robot.model, q, qd, qdd, 9.81 * gravity, BaseMotion(*motion))
        assert_allclose(M @ qdd + h, expected, atol=1e-11 * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("name", robots_with_inertia())
def test_terms_of_a_catalogue_robot_are_the_recursions(name):  # rods and massless links among them
    model, rng = load_robot(name), np.random.default_rng(5)
    q = rng.uniform(np.maximum(model.lower, -3.0), np.minimum(model.upper, 3.0))
    qd, gravity = rng.normal(size=model.n), rng.normal(scale=6.0, size=3)
    M, h = terms(model, q, qd, gravity)
    # 1e-12 kg and 1e-14 kg m2 stand for massless links
    assert_allclose(M, mass_matrix(model, q), atol=1e-10)
    assert_allclose(h, inverse_dynamics(model, q, qd, np.zeros(model.n), gravity), atol=1e-9)


def test_a_copy_is_another_one():
    dynamics = MujocoDynamics(load_robot("two_link"))
    twin = copy.deepcopy(dynamics)
    twin.tree.q[twin.at] = 1.0
    assert (dynamics.tree.q[dynamics.at] == 0.0).all()
    dynamics.update()
    before = dynamics.tree.mass.copy()
    twin.update()
    assert (dynamics.tree.mass == before).all()


def test_without_mujoco_one_is_told_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingPackageError, match=r"pip install 'mujoco>="):
        MujocoDynamics(load_robot("two_link"))
