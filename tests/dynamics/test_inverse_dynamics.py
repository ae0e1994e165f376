from dataclasses import replace

import mujoco
import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.actuation_loads import ActuationLoads, known_loads
from catenary.dynamics.inverse_dynamics import (
    BaseMotion,
    coriolis_matrix,
    forward_dynamics,
    inverse_dynamics,
    mass_matrix,
    torque_derivatives,
)
from catenary.errors import InputError, MissingInertiaError
from catenary.gravity.torque import gravity_torque
from catenary.robots.actuation import Actuation, Friction, MotorInertia, Spring, actuation_terms
from catenary.robots.catalog import load_robot
from catenary.robots.mjcf import load_mjcf
from oracles.floating_base import STILL, Free, by_mujoco, by_pinocchio
from oracles.mujoco_trees import mujoco_data, mujoco_mass_matrix, mujoco_model
from oracles.pinocchio_trees import pinocchio_model, pinocchio_order, pinocchio_vector
from oracles.random_robots import random_mjcf
from oracles.random_trees import Floats, RandomRobot, random_rotation


def random_motion(robot: RandomRobot, rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    return rng.normal(size=robot.model.n), rng.normal(size=robot.model.n), rng.normal(size=robot.model.n)


@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("peer", [by_mujoco, by_pinocchio])
def test_torques_are_what_peers_compute(peer, moving, random_robots, rng):
    for robot in random_robots:
        arm, gravity = random_motion(robot, rng), 5.0 * rng.normal(size=3)
        base = Free(random_rotation(rng), rng.normal(size=3), BaseMotion(*rng.normal(size=(3, 3))))
        tau = inverse_dynamics(robot.model, *arm, gravity, base.motion if moving else None)
        expected = peer(robot, *arm, gravity, base if moving else STILL)
        assert_allclose(tau, expected, atol=1e-10, err_msg=robot.model.name)


def test_coriolis_matrix_agrees_with_pinocchio_and_is_the_term_of_the_equation_of_motion(random_robots, rng):
    for robot in random_robots:
        m, gravity = robot.model, 5.0 * rng.normal(size=3)
        q, qd, qdd = random_motion(robot, rng)
        pin = pinocchio_model(robot)
        x, xd = (pinocchio_vector(robot, pin, v) for v in (m.coupling @ q + m.offset, m.coupling @ qd))
        order = pinocchio_order(robot, pin)
        C = pinocchio.computeCoriolisMatrix(pin, pin.createData(), x, xd)[np.ix_(order, order)]
        assert_allclose(coriolis_matrix(m, q, qd), m.coupling.T @ C @ m.coupling, atol=1e-10, err_msg=m.name)
        there, back = coriolis_matrix(m, q, qd) @ qdd, coriolis_matrix(m, q, qdd) @ qd
        assert_allclose(there, back, atol=1e-10, err_msg=m.name)  # as Christoffel's symbols have it
        terms = mass_matrix(m, q) @ qdd + coriolis_matrix(m, q, qd) @ qd + gravity_torque(m, q, gravity)
        assert_allclose(inverse_dynamics(m, q, qd, qdd, gravity), terms, atol=1e-10, err_msg=m.name)


def test_each_row_has_the_base_motion_of_its_own(random_robots, rng):
    for robot in random_robots[:3]:
        rows, gravity = [random_motion(robot, rng) for _ in range(4)], 5.0 * rng.normal(size=3)
        motion = BaseMotion(*rng.normal(size=(2, 4, 3)), rng.normal(size=3))  # the last one for all
        bases = [Free(np.eye(3), np.zeros(3), BaseMotion(w, a, motion[2])) for w, a in zip(*motion[:2], strict=True)]
        tau = inverse_dynamics(robot.model, *(np.array(part) for part in zip(*rows, strict=True)), gravity, motion)
        expected = [by_mujoco(robot, *row, gravity, base) for row, base in zip(rows, bases, strict=True)]
        assert_allclose(tau, expected, atol=1e-10, err_msg=robot.model.name)


def test_base_motions_of_another_number_of_rows_are_refused(random_robots):
    model = random_robots[0].model
    q = np.zeros((4, model.n))
    with pytest.raises(InputError, match=r"base angular acceleration: expected shape \(3,\) or \(4, 3\).*got \(2, 3\)"):
        inverse_dynamics(model, q, q, q, [0, 0, 0], BaseMotion(angular_acceleration=np.zeros((2, 3))))


HOME = [np.pi / 6, np.pi / 2, 0.40]


def test_mass_matrix_agrees_with_mujoco_and_pinocchio(random_robots, rng):
    for robot in random_robots:
        m = robot.model
        q = rng.normal(size=m.n)
        M = mass_matrix(m, q)
        mj = mujoco_model(robot)
        in_mujoco = mujoco_mass_matrix(robot, mj, mujoco_data(robot, mj, q))
        assert_allclose(M, m.coupling.T @ in_mujoco @ m.coupling, atol=1e-10, err_msg=m.name)
        pin = pinocchio_model(robot)
        upper = np.triu(pinocchio.crba(pin, pin.createData(), pinocchio_vector(robot, pin, m.coupling @ q + m.offset)))
        order = pinocchio_order(robot, pin)
        in_pinocchio = (upper + np.triu(upper, 1).T)[np.ix_(order, order)]
        assert_allclose(M, m.coupling.T @ in_pinocchio @ m.coupling, atol=1e-10, err_msg=m.name)


@pytest.mark.parametrize("name", ["raven2", "raven2_right"])
def test_raven_point_masses_at_home_have_the_inertia_of_the_mechanism_page(name: str) -> None:
    model = load_robot(name)
    points = replace(model, tree=model.tree._replace(inertia=np.zeros((3, 3, 3))))
    # printed with four decimals, three for the mass
    assert_allclose(np.diag(mass_matrix(points, HOME)), [0.1032, 0.0480, 0.231], atol=0.6e-4)


def test_derivatives_are_those_of_pinocchio(random_robots, rng: np.random.Generator) -> None:
    for robot in random_robots:
        m, gravity = robot.model, 5.0 * rng.normal(size=3)
        q, qd, qdd = rng.normal(size=(3, m.n))
        pin = pinocchio_model(robot)
        pin.gravity.linear = gravity
        motion = (m.coupling @ q + m.offset, m.coupling @ qd, m.coupling @ qdd)
        data, order = pin.createData(), pinocchio_order(robot, pin)
        theirs = pinocchio.computeRNEADerivatives(pin, data, *(pinocchio_vector(robot, pin, v) for v in motion))
        found = torque_derivatives(m, q, qd, qdd, gravity)
        for ours, of_tree in zip(found, theirs, strict=True):
            expected = m.coupling.T @ np.asarray(of_tree)[np.ix_(order, order)] @ m.coupling
            assert_allclose(ours, expected, atol=1e-9, err_msg=m.name)


DOWN = np.array([0.3, -0.2, -9.7])


@pytest.mark.parametrize("seed", range(4))
def test_accelerations_with_rotors_dampers_and_springs_are_mujocos(seed, tmp_path):
    rng = np.random.default_rng(seed)
    text = random_mjcf(rng).replace('type="', 'armature="0.4" damping="0.7" stiffness="2" springref="0.1" type="')
    (tmp_path / "r.xml").write_text(text)
    ours, model = load_mjcf(tmp_path / "r.xml"), mujoco.MjModel.from_xml_string(text)
    model.opt.gravity = DOWN
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    q, qd, tau = rng.normal(size=(3, ours.n))
    at = [model.joint(name).dofadr[0] for name in ours.joint_names]
    data.qpos[at], data.qvel[at], data.qfrc_applied[at] = q, qd, tau
    mujoco.mj_forward(model, data)
    found = forward_dynamics(ours, q, qd, tau, DOWN, loads=known_loads(ours))
    assert_allclose(found, data.qacc[at], atol=1e-8 * np.abs(data.qacc).max())


def test_with_friction_it_is_the_inverse_of_inverse_dynamics(rng):
    model = load_robot("ur10e")
    rows = np.eye(6)
    actuation = Actuation(
        friction=tuple(Friction(f"f{k}", row, load=True, stribeck=0.1) for k, row in enumerate(rows)),
        motor_inertia=tuple(MotorInertia(f"m{k}", row) for k, row in enumerate(rows)),
        springs=(Spring("s", rows[1]),),
    )
    terms = actuation_terms(actuation)
    loads = ActuationLoads(6, actuation, terms, rng.uniform(0.05, 0.2, len(terms)))
    q, qd, qdd = rng.normal(size=(3, 20, 6))
    links = inverse_dynamics(model, q, qd, qdd, DOWN)
    tau = inverse_dynamics(model, q, qd, qdd, DOWN, loads=loads)
    assert_allclose(tau, links + loads.torque(q, qd, qdd, links))
    assert_allclose(forward_dynamics(model, q, qd, links, DOWN), qdd, atol=1e-7)
    assert_allclose(forward_dynamics(model, q, qd, tau, DOWN, loads=loads), qdd, atol=1e-7)
    heavy = loads._replace(
        values=np.array([3.0 if t.kind == "load" else v for t, v in zip(terms, loads.values, strict=True)])
    )
    with pytest.raises(InputError, match="friction takes more than the load"):
        forward_dynamics(model, q, qd, tau, DOWN, loads=heavy)


def test_what_has_no_accelerations_is_refused():
    with pytest.raises(MissingInertiaError):
        forward_dynamics(load_robot("tiago"), *np.zeros((3, load_robot("tiago").n)), DOWN)
    arm = load_robot("two_link")
    light = replace(arm, tree=arm.tree._replace(mass=arm.tree.mass * [1, 0], inertia=arm.tree.inertia * [[[1]], [[0]]]))
    with pytest.raises(InputError, match='robot "two_link": its joints can move so that no mass moves'):
        forward_dynamics(light, *np.zeros((3, 2)), DOWN)
