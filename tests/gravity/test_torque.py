from dataclasses import replace

import numpy as np
import pinocchio
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.kernels import FEW
from catenary.errors import InputError, MissingInertiaError
from catenary.gravity.torque import gravity_torque, potential_energy
from catenary.robots.catalog import load_robot
from oracles.mujoco_trees import mujoco_data, mujoco_model, mujoco_order
from oracles.paper_gravity import paper_gravity_torque
from oracles.pinocchio_trees import pinocchio_model, pinocchio_order, pinocchio_vector
from oracles.random_trees import RandomRobot
from oracles.raven2 import dh_frames

UPRIGHT = np.array([0.0, 0.0, -9.81])
ARMS = [
    ("raven2", "left"),
    ("raven2_right", "right"),
    ("raven2_full", "left"),
    ("raven2_full_right", "right"),
]


def test_gravity_torque_agrees_with_mujoco(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(1)
    for robot in random_robots:
        m = robot.model
        q, gravity = rng.normal(size=m.n), 5.0 * rng.normal(size=3)
        mj = mujoco_model(robot, gravity=gravity)
        bias = mujoco_data(robot, mj, q).qfrc_bias[mujoco_order(robot, mj)]
        assert_allclose(gravity_torque(m, q, gravity), m.coupling.T @ bias, atol=1e-10, err_msg=m.name)


def test_gravity_torque_agrees_with_pinocchio(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(2)
    for robot in random_robots:
        m = robot.model
        q, gravity = rng.normal(size=m.n), 5.0 * rng.normal(size=3)
        pin = pinocchio_model(robot)
        pin.gravity.linear = gravity
        x = pinocchio_vector(robot, pin, m.coupling @ q + m.offset)
        expected = pinocchio.computeGeneralizedGravity(pin, pin.createData(), x)[pinocchio_order(robot, pin)]
        assert_allclose(gravity_torque(m, q, gravity), m.coupling.T @ expected, atol=1e-10, err_msg=m.name)


def test_gravity_torque_is_the_papers_sum_over_the_carried_links(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(3)
    for robot in random_robots:
        m = robot.model
        q, gravity = rng.normal(size=m.n), 5.0 * rng.normal(size=3)
        pin = pinocchio_model(robot)
        data = pin.createData()
        pinocchio.framesForwardKinematics(pin, data, pinocchio_vector(robot, pin, m.coupling @ q + m.offset))
        placed = [data.oMi[pin.getJointId(name)] for name in m.link_names]
        expected = paper_gravity_torque(
            m.tree, np.array([p.rotation for p in placed]), np.array([p.translation for p in placed]), gravity
        )
        assert_allclose(gravity_torque(m, q, gravity), m.coupling.T @ expected, atol=1e-10, err_msg=m.name)


def test_gravity_torque_is_gradient_of_potential_energy(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(4)
    h = 1e-5
    for robot in random_robots:
        m = robot.model
        q, gravity = rng.normal(size=m.n), 5.0 * rng.normal(size=3)
        steps = h * np.eye(m.n)
        slope = (potential_energy(m, q + steps, gravity) - potential_energy(m, q - steps, gravity)) / (2 * h)
        # central difference, h = 1e-5, of energies up to 300 J
        assert_allclose(gravity_torque(m, q, gravity), slope, atol=1e-7, err_msg=m.name)


def test_gravity_torque_is_linear_in_gravity(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(5)
    for robot in random_robots:
        m = robot.model
        q, (a, b) = rng.normal(size=m.n), rng.normal(size=(2, 3))
        assert_allclose(
            gravity_torque(m, q, 2.0 * a - 3.0 * b),
            2.0 * gravity_torque(m, q, a) - 3.0 * gravity_torque(m, q, b),
            atol=1e-11,
        )
        assert_allclose(gravity_torque(m, q, np.zeros(3)), np.zeros(m.n), atol=0.0)


@pytest.mark.parametrize(("name", "arm"), ARMS)
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
def test_raven_holds_what_the_mechanism_page_says(
    name: str, arm: str, j1_deg: float, j2_deg: float, j3: float, expected: tuple[float, ...]
) -> None:
    model = load_robot(name)
    q = np.zeros(model.n)
    q[:3] = np.deg2rad(j1_deg), np.deg2rad(j2_deg), j3
    tau = gravity_torque(model, q, UPRIGHT)
    assert_allclose(tau[:3], expected, atol=0.6e-4)  # printed with four decimals
    assert_allclose(tau[3:], 0.0, atol=0.0)  # the tool has no mass


@pytest.mark.parametrize(("name", "arm"), ARMS)
def test_raven_torques_are_the_papers_sum_over_its_table(name: str, arm: str) -> None:
    model = load_robot(name)
    R_base_0 = model.frames["frame0"].pose.rotation
    rng = np.random.default_rng(6)
    for _ in range(50):
        q, gravity = rng.uniform(model.lower, model.upper), 5.0 * rng.normal(size=3)
        frames = np.array(dh_frames(arm, q[:3]))[: model.n]
        expected = paper_gravity_torque(
            model.tree._replace(**{name: getattr(model.tree, name)[:3] for name in model.tree._fields}),
            frames[:3, :3, :3],
            frames[:3, :3, 3],
            R_base_0.T @ gravity,
        )
        assert_allclose(gravity_torque(model, q, gravity)[:3], expected, atol=1e-13)


@pytest.mark.parametrize(("name", "arm"), ARMS)
def test_level_gravity_points_against_x_of_the_ravens_frame_0(name: str, arm: str) -> None:
    R_base_0 = load_robot(name).frames["frame0"].pose.rotation
    assert_allclose(R_base_0 @ [-9.81, 0.0, 0.0], UPRIGHT, atol=0.0)


def test_raven_arms_mirror_each_other_under_mirrored_gravity() -> None:
    left, right = load_robot("raven2"), load_robot("raven2_right")
    rng = np.random.default_rng(7)
    q = rng.uniform(left.lower, left.upper, size=(100, 3))
    gravity = 5.0 * rng.normal(size=(100, 3))
    mirrored = gravity * [1.0, -1.0, 1.0]  # the arms mirror in the base's y
    assert_allclose(gravity_torque(left, q, gravity), gravity_torque(right, q, mirrored), atol=1e-13)


@pytest.mark.parametrize(("name", "j2"), [("raven2", 0.306), ("raven2_right", -0.438)])
def test_lateral_gravity_differs_between_the_raven_arms(name: str, j2: float) -> None:
    # grav_dir (1.3, -2.1, 9.4) in the robot's software is the base frame turned by 180 deg about y
    gravity = np.array([-1.3, -2.1, -9.4])
    model = load_robot(name)
    assert_allclose(gravity_torque(model, [0.5, 1.2, 0.33], gravity)[1], j2, atol=0.6e-3)


def test_batch_gives_what_single_configurations_give(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(8)
    for robot in random_robots[:9]:
        m = robot.model
        q, gravity = rng.normal(size=(4, m.n)), rng.normal(size=(4, 3))
        each = gravity_torque(m, q, gravity)
        one = gravity_torque(m, q, gravity[0])
        energy = potential_energy(m, q, gravity)
        assert energy.shape == (4,)
        for k in range(4):
            assert_allclose(each[k], gravity_torque(m, q[k], gravity[k]), atol=0.0)
            assert_allclose(one[k], gravity_torque(m, q[k], gravity[0]), atol=0.0)
            assert_allclose(energy[k], potential_energy(m, q[k], gravity[k]), atol=0.0)


def test_one_configuration_takes_one_gravity_as_a_row_too() -> None:
    model = load_robot("raven2")
    q = np.array([0.5, 1.5, 0.4])
    assert gravity_torque(model, q, [UPRIGHT]).shape == (3,)
    assert gravity_torque(model, [q], UPRIGHT).shape == (1, 3)
    assert gravity_torque(model, np.empty((0, 3)), UPRIGHT).shape == (0, 3)


def test_wrong_arguments_are_refused_with_a_reason() -> None:
    model = load_robot("raven2")
    with pytest.raises(InputError, match=r"q: expected shape \(3,\) or \(N, 3\), got \(2,\)"):
        gravity_torque(model, np.zeros(2), UPRIGHT)
    with pytest.raises(InputError, match=r"gravity: expected shape \(3,\)"):
        gravity_torque(model, np.zeros(3), [0.0, -9.81])
    with pytest.raises(
        InputError, match=r"gravity: expected shape \(3,\) or \(2, 3\), as q has it, got \(3, 3\)"
    ):
        gravity_torque(model, np.zeros((2, 3)), np.zeros((3, 3)))
    with pytest.raises(InputError, match=r"q\[2\] is inf"):
        gravity_torque(model, [0.0, 1.0, np.inf], UPRIGHT)
    with pytest.raises(InputError, match=r"gravity\[0\] is nan"):
        potential_energy(model, np.zeros(3), [np.nan, 0.0, 0.0])


def test_a_model_without_inertia_is_refused_by_the_links_names() -> None:
    model = replace(load_robot("raven2"), missing_inertia=("elbow", "insertion"))
    for refused in (gravity_torque, potential_energy):
        with pytest.raises(MissingInertiaError, match='"elbow", "insertion"') as caught:
            refused(model, np.zeros(3), UPRIGHT)
        assert caught.value.links == ("elbow", "insertion")


@pytest.mark.parametrize("name", ["raven2", "planar_3r"])
def test_from_some_calls_on_the_kernel_gives_the_same_and_checks_as_much(name: str) -> None:
    model, gravity = load_robot(name), np.array([0.3, -0.2, -9.81])
    rng = np.random.default_rng(12)
    fixed = gravity.copy()
    fixed.setflags(write=False)
    for k in range(FEW + 5):
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
