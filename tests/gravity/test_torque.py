import warnings
from dataclasses import replace
from functools import partial

import mujoco
import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import catenary
from catenary.dynamics.robot_kernels import _FEW_CALLS
from catenary.errors import ImplausibleWarning, InputError
from catenary.gravity.torque import (
    center_of_mass,
    center_of_mass_jacobian,
    gravity_delta,
    gravity_torque,
    potential_energy,
)
from catenary.robots.catalog import load_robot
from catenary.sensing.gravity_vector import tilted_gravity
from catenary.spatial import LEVEL
from oracles.floating_base import by_mujoco, by_pinocchio, held
from oracles.mujoco_trees import mujoco_data, mujoco_model, mujoco_order
from oracles.paper_gravity import paper_gravity_torque
from oracles.pinocchio_trees import pinocchio_model, pinocchio_order, pinocchio_vector
from oracles.random_trees import Floats, RandomRobot

RAVEN = load_robot("raven2")

UPRIGHT = np.array([0.0, 0.0, -9.81])
ARMS = ["raven2", "raven2_right", "raven2_full", "raven2_full_right"]


def by_the_papers_sum(robot: RandomRobot, q: Floats, gravity: Floats) -> Floats:
    m, pin = robot.model, pinocchio_model(robot)
    data = pin.createData()
    pinocchio.framesForwardKinematics(pin, data, pinocchio_vector(robot, pin, m.coupling @ q + m.offset))
    placed = [data.oMi[pin.getJointId(name)] for name in m.link_names]
    rotations, positions = np.array([p.rotation for p in placed]), np.array([p.translation for p in placed])
    return m.coupling.T @ paper_gravity_torque(m.tree, rotations, positions, gravity)


def by_slope_of_energy(robot: RandomRobot, q: Floats, gravity: Floats) -> Floats:
    h = 1e-5
    steps = h * np.eye(len(q))
    ahead, behind = (potential_energy(robot.model, q + s * steps, gravity) for s in (1.0, -1.0))
    return (ahead - behind) / (2 * h)


@pytest.mark.parametrize(
    ("peer", "atol"),
    [
        (partial(held, peer=by_mujoco), 1e-10),
        (partial(held, peer=by_pinocchio), 1e-10),
        (by_the_papers_sum, 1e-10),
        (by_slope_of_energy, 1e-7),  # central difference, h = 1e-5, of energies up to 300 J
    ],
)
def test_gravity_torque_is_what_peers_compute(peer, atol, random_robots, rng):
    for robot in random_robots:
        q, gravity = rng.normal(size=robot.model.n), 5.0 * rng.normal(size=3)
        torque = gravity_torque(robot.model, q, gravity)
        assert_allclose(torque, peer(robot, q, gravity), atol=atol, err_msg=robot.model.name)


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize(
    ("j1_deg", "j2_deg", "j3", "expected"),
    [
        (0, 90, 0.32, (1.5120, -0.1962, 2.1879)),
        (45, 90, 0.32, (-0.8996, -0.4609, 1.8771)),
        (90, 90, 0.32, (-2.7843, -0.4556, 0.4667)),
        (0, 45, 0.40, (2.1491, 1.1707, 1.8520)),
        (30, 90, 0.40, (-0.1379, -0.4280, 2.1282)),
        (90, 135, 0.40, (-2.2626, 0.2669, 0.3915)),
    ],
)
def test_raven_holds_what_the_mechanism_page_says(name, j1_deg, j2_deg, j3, expected) -> None:
    model = load_robot(name)
    q = np.zeros(model.n)
    q[:3] = np.deg2rad(j1_deg), np.deg2rad(j2_deg), j3
    tau = gravity_torque(model, q, UPRIGHT)
    assert_allclose(tau[:3], expected, atol=0.6e-4)  # printed with four decimals
    assert_allclose(tau[3:], 0.0, atol=0.0)  # the tool has no mass


@pytest.mark.parametrize(("name", "j2"), [("raven2", 0.306), ("raven2_right", -0.438)])
def test_lateral_gravity_differs_between_the_raven_arms(name: str, j2: float) -> None:
    # grav_dir (1.3, -2.1, 9.4) in the robot's software is the base frame turned by 180 deg about y
    gravity = np.array([-1.3, -2.1, -9.4])
    model = load_robot(name)
    assert_allclose(gravity_torque(model, [0.5, 1.2, 0.33], gravity)[1], j2, atol=0.6e-3)


def test_one_configuration_takes_one_gravity_as_a_row_too() -> None:
    q = np.array([0.5, 1.5, 0.4])
    assert gravity_torque(RAVEN, q, [UPRIGHT]).shape == (3,)
    assert gravity_torque(RAVEN, [q], UPRIGHT).shape == (1, 3)


@pytest.mark.parametrize("name", ["raven2", "planar_3r"])
def test_from_some_calls_on_the_kernel_gives_the_same_and_checks_as_much(name, rng):
    model, gravity = load_robot(name), np.array([0.3, -0.2, -9.81])
    fixed = gravity.copy()
    fixed.setflags(write=False)
    for k in range(_FEW_CALLS + 5):
        q = rng.normal(size=model.n)
        (expected,) = gravity_torque(model, q[None], gravity)
        for given in (gravity, fixed, list(gravity)):
            assert_allclose(gravity_torque(model, q, given), expected, rtol=0.0, atol=1e-12, err_msg=str(k))
    with pytest.raises(InputError, match=r"q\[1\] is nan"):
        gravity_torque(model, np.array([0.1, np.nan, 0.2]), gravity)
    with pytest.raises(InputError, match=r"gravity\[0\] is inf"):
        gravity_torque(model, np.zeros(3), np.array([np.inf, 0.0, 0.0]))
    with pytest.raises(InputError, match=r"q: expected shape \(3,\) or \(N, 3\), got \(2,\)"):
        gravity_torque(model, np.zeros(2), gravity)


@pytest.mark.parametrize(
    ("q", "gravity", "said"),
    [
        ([0.5, 1.5, 0.4], [0.0, 0.0, 9.81], "points up in base axes"),
        ([0.5, 1.5, 0.4], [0.0, 0.0, -981.0], "has a magnitude of 981 m/s2"),
        ([0.5, 1.5, 400.0], UPRIGHT, "insertion is 399.4 m beyond its limits; positions are in rad and m"),
        ([30.0, 1.5, 0.4], UPRIGHT, "shoulder is 28.43 rad beyond its limits"),
    ],
)
def test_what_is_hardly_meant_is_warned_of_where_the_caller_stands(q, gravity, said) -> None:
    arm, many = load_robot("raven2"), np.tile([0.5, 1.5, 0.4], (9, 1))
    many[4] = q
    still = np.zeros(3)
    for call in (
        lambda: catenary.gravity_torque(arm, q, gravity),
        lambda: catenary.gravity_torque(arm, many, gravity),
        lambda: catenary.inverse_dynamics(arm, q, still, still, gravity),
    ):
        with pytest.warns(ImplausibleWarning, match=said) as caught:
            call()
        assert caught[0].filename == __file__


def test_gravity_on_a_wall_a_moving_base_or_none_is_not_warned_of(rng) -> None:
    arm, q = load_robot("raven2"), [0.5, 1.5, 0.4]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for gravity in ([9.81, 0.0, 0.1], [3.0, -4.0, -14.0], [0.0, 0.0, 0.0], tilted_gravity(1.0, 0.5)):
            gravity_torque(arm, q, gravity)
            gravity_delta(arm, q, gravity)
        center_of_mass_jacobian(arm, q)


def test_firmware_for_a_level_base_plus_the_delta_is_the_whole_gravity_torque(random_robots, rng):
    for robot in random_robots[:20]:
        q, gravity = rng.normal(size=robot.model.n), tilted_gravity(*rng.uniform(-3.0, 3.0, 2))
        whole = gravity_torque(robot.model, q, LEVEL) + gravity_delta(robot.model, q, gravity)
        assert_allclose(whole, gravity_torque(robot.model, q, gravity), atol=1e-11)
        assert_array_equal(gravity_delta(robot.model, q, LEVEL), np.zeros(robot.model.n))  # nothing to add


def test_it_is_where_mujoco_and_pinocchio_have_it(random_robots, rng) -> None:
    for robot in random_robots[::2]:
        m = robot.model
        q = rng.normal(size=m.n)
        mj, pin = mujoco_model(robot), pinocchio_model(robot)
        data, pin_data = mujoco_data(robot, mj, q), pin.createData()
        x = pinocchio_vector(robot, pin, m.coupling @ q + m.offset)
        # Pinocchio counts the moving links alone, MuJoCo also those fixed to the base
        assert_allclose(center_of_mass(m, q), pinocchio.centerOfMass(pin, pin_data, x), atol=1e-10)
        if np.isclose(mj.body_subtreemass[0], m.tree.mass.sum()):
            assert_allclose(center_of_mass(m, q), data.subtree_com[0], atol=1e-10)
        linear = np.zeros((3, mj.nv))
        mujoco.mj_jacSubtreeCom(mj, data, linear, 0)
        share = mj.body_subtreemass[0] / m.tree.mass.sum()
        expected = share * linear[:, mujoco_order(robot, mj)] @ m.coupling
        assert_allclose(center_of_mass_jacobian(m, q), expected, atol=1e-10, err_msg=m.name)
        J = np.asarray(pinocchio.jacobianCenterOfMass(pin, pin_data, x)).reshape(3, -1)
        expected = J[:, pinocchio_order(robot, pin)] @ m.coupling
        assert_allclose(center_of_mass_jacobian(m, q), expected, atol=1e-10, err_msg=m.name)


def test_what_has_no_mass_is_refused() -> None:
    arm = load_robot("raven2")
    empty = replace(arm, tree=arm.tree._replace(mass=np.zeros(3)))
    with pytest.raises(InputError, match="no moving link has a mass"):
        center_of_mass(empty, np.zeros(3))
