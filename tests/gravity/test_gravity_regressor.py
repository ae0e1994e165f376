from dataclasses import replace

import numpy as np
import pinocchio
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import MissingInertiaError
from catenary.gravity.compact_regressor import compact_regressor
from catenary.gravity.gravity_regressor import (
    gravity_parameters,
    gravity_regressor,
    standard_gravity_parameters,
    standard_gravity_regressor,
)
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot, robot_names
from oracles.pinocchio_trees import pinocchio_model, pinocchio_vector
from oracles.random_trees import RandomRobot, random_bodies_on, random_robot

UPRIGHT = np.array([0.0, 0.0, -9.81])


@pytest.fixture(scope="module")
def robots(random_robots: list[RandomRobot]) -> list[RandomRobot]:
    """Thirty random trees, and every robot of the catalogue with random bodies."""
    rng = np.random.default_rng(0)
    return random_robots[:30] + [random_bodies_on(load_robot(name), rng) for name in robot_names()]


def test_full_form_has_the_papers_size_and_a_column_per_prismatic_joint(robots: list[RandomRobot]) -> None:
    for robot in robots:
        m = robot.model
        n, prismatic = len(m.link_names), int(m.tree.prismatic.sum())
        s = gravity_parameters(m)
        assert gravity_regressor(m, np.zeros(m.n), UPRIGHT).shape == (m.n, 3 * n * (n + 1) + prismatic)
        assert len(s.values) == len(s.labels) == len(s.units) == 3 * n * (n + 1) + prismatic
        assert len(set(s.labels)) == len(s.labels)
        assert s.units.count("kg") == prismatic


def test_planar_arm_has_the_parameters_that_the_paper_prints() -> None:
    l1, l2, lg1, lg2, lg3, m1, m2, m3 = 0.4, 0.3, 0.2, 0.15, 0.1, 2.0, 1.5, 1.0
    third = [lg3 * m3, 0, 0]
    second = [l2 * m3 + lg2 * m2, 0, 0, *third]
    first = [0, 0, 0, l1 * (m2 + m3) + lg1 * m1, 0, 0, *second]
    expected = [*first, *([0] * 6), *second, *([0] * 9), *third]
    assert_allclose(gravity_parameters(load_robot("planar_3r")).values, expected, atol=1e-15)


def test_level_gravity_has_the_papers_form(robots: list[RandomRobot], rng: np.random.Generator) -> None:
    # g_c e_z^T [z_k]x R, from Pinocchio's frames, for the revolute joints of uncoupled robots
    for robot in robots:
        m = robot.model
        n = len(m.link_names)
        if m.n != n or not (m.coupling == np.eye(n)).all():
            continue
        q = rng.normal(size=n)
        pin = pinocchio_model(robot)
        data = pin.createData()
        pinocchio.forwardKinematics(pin, data, pinocchio_vector(robot, pin, q + m.offset))
        turned = [data.oMi[pin.getJointId(name)].rotation for name in m.link_names]
        R = np.hstack([np.eye(3), *turned])
        Z = gravity_regressor(m, q, UPRIGHT)
        for k in range(n):
            block = Z[:, 3 * (n + 1) * k : 3 * (n + 1) * (k + 1)]
            x, y, z = turned[k] @ m.tree.axis[k]
            skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            expected = 0.0 * R[2] if m.tree.prismatic[k] else 9.81 * (skew @ R)[2]
            assert_allclose(block[k], expected, atol=1e-12)
            assert_array_equal(np.delete(block, k, axis=0), 0.0)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 200), st.integers(0, 2**32 - 1))
def test_regressors_do_not_depend_on_masses(tree: int, seed: int) -> None:
    m = random_robot(tree).model
    rng = np.random.default_rng(seed)
    q, gravity = rng.normal(size=m.n), rng.normal(size=3)
    n = len(m.link_names)
    other = replace(m, tree=m.tree._replace(mass=rng.uniform(0.1, 9.0, n), com=rng.normal(size=(n, 3))))
    held, compact = gravity_torque(other, q, gravity), compact_regressor(m)
    assert_allclose(compact.Z(q, gravity) @ compact.parameters(other), held, atol=1e-9)
    for regressor, parameters in (
        (gravity_regressor, gravity_parameters),
        (standard_gravity_regressor, standard_gravity_parameters),
    ):
        assert_array_equal(regressor(m, q, gravity), regressor(other, q, gravity))
        assert_allclose(regressor(m, q, gravity) @ parameters(other).values, held, atol=1e-10)


def test_parameters_need_inertia() -> None:
    m = replace(load_robot("raven2"), missing_inertia=("elbow",))
    for parameters in (gravity_parameters, standard_gravity_parameters):
        with pytest.raises(MissingInertiaError, match='"elbow"'):
            parameters(m)


def test_standard_parameters_are_named_by_link() -> None:
    s = standard_gravity_parameters(load_robot("raven2"))
    assert s.labels[:5] == ("m(shoulder)", "mx(shoulder)", "my(shoulder)", "mz(shoulder)", "m(elbow)")
    assert s.units[:2] == ("kg", "kg m")
