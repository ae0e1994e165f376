from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.errors import InputError
from catenary.gravity.base_parameters import TILTED, base_parameters, random_configurations
from catenary.gravity.compact import compact_regressor
from catenary.gravity.regressor import (
    standard_gravity_parameters,
    standard_gravity_regressor,
    standard_labels,
)
from catenary.gravity.torque import gravity_torque
from catenary.robots.assembly import Coordinate, Link, assemble
from catenary.robots.catalog import load_robot, robot_names
from catenary.robots.model import RobotModel
from catenary.sensing.vector import LEVEL
from catenary.spatial import identity_pose
from oracles.random_trees import RandomRobot, random_inertia, random_pose, random_robot


def general_arm(n: int, seed: int = 0) -> RobotModel:
    """n revolute joints in no special arrangement, but that the first axis is vertical."""
    rng = np.random.default_rng(seed)
    links = [
        Link(
            f"link{i}",
            f"link{i - 1}" if i else "base",
            "revolute",
            random_pose(rng) if i else identity_pose(),
            rng.normal(size=3) if i else np.array([0.0, 0.0, 1.0]),
            {f"q{i}": 1.0},
            inertia=random_inertia(rng),
        )
        for i in range(n)
    ]
    return assemble("general", links, [Coordinate(f"q{i}", "rad") for i in range(n)])


@pytest.mark.parametrize(("n", "level"), [(3, 4), (7, 12)])
def test_tilting_an_arm_with_a_vertical_first_axis_adds_two_parameters(n: int, level: int) -> None:
    arm = general_arm(n)
    assert standard_gravity_regressor(arm, np.zeros(n), LEVEL).shape == (n, 4 * n)
    still = base_parameters(arm)
    assert still.rank == level
    for gravity in (TILTED, None):
        tilted = base_parameters(arm, gravity)
        assert tilted.rank == level + 2
        names = [standard_labels(arm)[column] for column in tilted.columns if column not in still.columns]
        assert len(names) == 2
        assert all(name.endswith("(link0)") for name in names)


def test_rank_is_the_number_of_singular_values_that_are_not_zero(random_robots: list[RandomRobot]) -> None:
    rng = np.random.default_rng(0)
    for robot in random_robots:
        m = robot.model
        W = standard_gravity_regressor(m, rng.normal(size=(60, m.n)), LEVEL).reshape(
            -1, 4 * len(m.link_names)
        )
        values = np.linalg.svd(W, compute_uv=False)
        rank = int((values > 1e-9 * values[0]).sum()) if len(values) else 0
        assert base_parameters(m).rank == rank, m.name


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 200), st.integers(0, 2**32 - 1), st.booleans())
def test_base_parameters_hold_the_arm(tree: int, seed: int, turning: bool) -> None:
    m = random_robot(tree).model
    rng = np.random.default_rng(seed)
    gravity = rng.normal(size=3) if turning else np.array(LEVEL)
    base = base_parameters(m, None if turning else LEVEL)
    q = rng.normal(size=m.n)
    assert_allclose(base.regressor(q, gravity) @ base.values(), gravity_torque(m, q, gravity), atol=1e-6)


def test_no_smaller_set_than_the_compact_forms_for_any_gravity(random_robots: list[RandomRobot]) -> None:
    for robot in random_robots:
        assert base_parameters(robot.model, None).rank <= len(compact_regressor(robot.model).labels)


def test_planar_arm_leaves_the_papers_three_and_their_counterparts_across() -> None:
    base = base_parameters(load_robot("planar_3r"))
    assert base.labels == (
        "mx(link1) + 0.4 m(link2) + 0.4 m(link3)",
        "my(link1)",
        "mx(link2) + 0.3 m(link3)",
        "my(link2)",
        "mx(link3)",
        "my(link3)",
    )
    assert_allclose(
        base.values()[[0, 2, 4]], compact_regressor(load_robot("planar_3r")).parameters(), atol=1e-12
    )


def test_parameters_are_identifiable_alone_in_combination_or_not(random_robots: list[RandomRobot]) -> None:
    # the null space of the stacked regressor says which parameters may change unnoticed
    rng = np.random.default_rng(1)
    for robot in random_robots[:30]:
        m = robot.model
        W = standard_gravity_regressor(m, rng.normal(size=(60, m.n)), LEVEL).reshape(
            -1, 4 * len(m.link_names)
        )
        _, values, V = np.linalg.svd(W)
        rank = int((values > 1e-9 * values[0]).sum())
        unnoticed = np.abs(V[rank:]).max(axis=0, initial=0.0) > 1e-7
        base = base_parameters(m)
        for name, can_change, column, kind in zip(
            standard_labels(m), unnoticed, np.abs(W).max(axis=0), base.identifiable, strict=True
        ):
            expected = "none" if column < 1e-9 else "combined" if can_change else "alone"
            assert kind == expected, (m.name, name)


def test_massless_links_have_nothing_to_identify() -> None:
    base = base_parameters(load_robot("raven2_full"))
    assert base.identifiable[12:] == ("known",) * 12
    assert base.rank == base_parameters(load_robot("raven2")).rank == 5
    assert base.identifiable[8] == "alone"  # the force along the insertion is its weight


def test_condition_is_that_of_columns_of_one_length() -> None:
    arm = load_robot("raven2")
    base = base_parameters(arm, rng=np.random.default_rng(3))
    q = random_configurations(arm, 40, np.random.default_rng(3))
    W = base.regressor(q, LEVEL).reshape(-1, base.rank)
    assert_allclose(base.condition, np.linalg.cond(W / np.linalg.norm(W, axis=0)), rtol=1e-9)


def test_configurations_are_within_the_limits() -> None:
    for name in robot_names():
        m = load_robot(name)
        q = random_configurations(m, 100, np.random.default_rng(4))
        assert (q >= m.lower).all()
        assert (q <= m.upper).all()


def test_values_need_no_more_than_another_robots_masses() -> None:
    arm = load_robot("raven2")
    heavy = replace(arm, tree=arm.tree._replace(mass=2.0 * arm.tree.mass))
    base = base_parameters(arm)
    assert_allclose(base.values(heavy), 2.0 * base.values(), rtol=1e-12)
    assert len(standard_gravity_parameters(heavy).values) == 12


def test_gravity_must_be_an_acceleration() -> None:
    arm = load_robot("raven2")
    with pytest.raises(InputError, match="gravity is zero"):
        base_parameters(arm, np.zeros(3))
    with pytest.raises(InputError, match=r"gravity: expected shape \(3,\)"):
        base_parameters(arm, np.zeros(2))
