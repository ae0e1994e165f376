import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.dynamics.torque_regressor import link_parameters
from catenary.errors import InputError
from catenary.gravity.compact_regressor import compact_regressor
from catenary.gravity.gravity_regressor import standard_gravity_parameters, standard_gravity_regressor, standard_labels
from catenary.gravity.torque import gravity_torque
from catenary.identification.base_parameters import (
    TILTED,
    base_parameters,
    gravity_base_parameters,
    random_configurations,
)
from catenary.identification.parameters import Parameters
from catenary.robots.assembly import Coordinate, Link, assemble
from catenary.robots.catalog import load_robot, robot_names
from catenary.spatial import identity_pose
from moving_arm import LEVEL, sinusoids
from oracles.random_trees import random_inertia, random_pose, random_robot

RAVEN = load_robot("raven2")


def base_of(model, terms="full", gravity=LEVEL):
    recorded = sinusoids(np.random.default_rng(5), model, np.linspace(0.0, 3.0, 200))
    if terms == "static":
        recorded = (recorded[0], np.zeros_like(recorded[0]), np.zeros_like(recorded[0]))
    return base_parameters(
        Parameters(model, terms), np.asarray(gravity, dtype=float), recorded, np.random.default_rng(6)
    )


@pytest.mark.parametrize(
    ("name", "count"),
    [
        # published by Wang et al. 2019, and Gaz et al. 2019 (43 inertial, 21 friction)
        ("dvrk_psm_motors", 49),
        ("dvrk_mtm_motors", 73),
        ("panda", 64),
        # a planar 3R: I, mcx, mcy per link less what is the same about parallel axes (Khalil, Dombre 2002), 9 friction
        ("planar_3r", 9 + 9),
    ],
)
def test_as_many_base_parameters_as_are_published(name, count):
    assert base_of(load_robot(name)).count == count


def test_base_parameters_give_the_torques_of_all_parameters(rng):
    base = base_of(RAVEN)
    phi = np.concatenate([link_parameters(RAVEN.tree), rng.normal(size=9)])
    q, qd, qdd = sinusoids(rng, RAVEN, np.linspace(0.0, 2.0, 50))
    whole = base.parameters.regressor(q, qd, qdd, LEVEL) @ phi
    assert_allclose(base.regressor(q, qd, qdd, LEVEL) @ (base.combination @ phi), whole, atol=1e-9)


def test_a_base_parameter_is_written_as_the_sum_it_is():
    base = base_of(load_robot("two_link"))
    texts = [base.describe(i) for i in range(base.count)]
    # under gravity the second link's mass acts at the first's end, 1 m along x: only their sum shows
    assert any("mcx link0" in text and "m link1" in text for text in texts)
    assert len(set(base.names)) == base.count == len(base.units)


def test_massless_links_have_no_parameters():
    parameters = Parameters(load_robot("raven2_full"), "full")
    assert all("tool" not in name and "wrist" not in name for name in parameters.names[:30])
    assert len(parameters.links) == 3


# poses at rest, gravity alone


def general_arm(n):
    """n revolute joints in no special arrangement, but that the first axis is vertical."""
    rng = np.random.default_rng(0)
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
def test_tilting_an_arm_with_a_vertical_first_axis_adds_two_parameters(n, level):
    arm = general_arm(n)
    still = gravity_base_parameters(arm)
    assert still.count == level
    for gravity in (TILTED, None):
        tilted = gravity_base_parameters(arm, gravity)
        assert tilted.count == level + 2
        names = [tilted.names[k] for k, column in enumerate(tilted.columns) if column not in still.columns]
        assert len(names) == 2
        assert all(name.endswith(" link0") for name in names)


def test_parameters_are_as_many_as_singular_values_and_identifiable_as_the_null_space_says(random_robots):
    rng = np.random.default_rng(1)
    for robot in random_robots[:30]:
        m = robot.model
        W = standard_gravity_regressor(m, rng.normal(size=(60, m.n)), LEVEL).reshape(-1, 4 * len(m.link_names))
        _, values, V = np.linalg.svd(W)
        rank = int((values > 1e-9 * values[0]).sum())
        base = gravity_base_parameters(m)
        assert base.count == rank, m.name
        unnoticed = np.abs(V[rank:]).max(axis=0, initial=0.0) > 1e-7
        effect = np.abs(W).max(axis=0) > 1e-9
        expected = np.where(effect, np.where(unnoticed, "combined", "alone"), "none")
        assert list(base.identifiable) == list(expected), m.name


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 200), st.integers(0, 2**32 - 1), st.booleans())
def test_gravity_base_parameters_hold_the_arm(tree, seed, turning):
    m = random_robot(tree).model
    rng = np.random.default_rng(seed)
    gravity = rng.normal(size=3) if turning else np.array(LEVEL)
    base = gravity_base_parameters(m, None if turning else LEVEL)
    q, rest = rng.normal(size=(1, m.n)), np.zeros((1, m.n))
    torque = base.regressor(q, rest, rest, gravity)[0] @ (base.combination @ standard_gravity_parameters(m).values)
    assert_allclose(torque, gravity_torque(m, q[0], gravity), atol=1e-6)


def test_planar_arm_leaves_the_papers_three_and_their_counterparts_across():
    arm = load_robot("planar_3r")
    base = gravity_base_parameters(arm)
    assert [base.describe(k, standard_labels(arm)) for k in range(base.count)] == [
        "mx(link1) + 0.4 m(link2) + 0.4 m(link3)",
        "my(link1)",
        "mx(link2) + 0.3 m(link3)",
        "my(link2)",
        "mx(link3)",
        "my(link3)",
    ]
    values = base.combination @ standard_gravity_parameters(arm).values
    assert_allclose(values[[0, 2, 4]], compact_regressor(arm).parameters(), atol=1e-12)


def test_condition_is_that_of_columns_of_one_length():
    base = gravity_base_parameters(RAVEN)
    q = random_configurations(RAVEN, 40, np.random.default_rng(0))  # the draw that it was found on
    W = base.regressor(q, 0.0 * q, 0.0 * q, np.array(LEVEL)).reshape(-1, base.count)
    assert_allclose(base.condition, np.linalg.cond(W / np.linalg.norm(W, axis=0)), rtol=1e-9)


def test_configurations_are_within_the_limits():
    for name in robot_names():
        m = load_robot(name)
        q = random_configurations(m, 100, np.random.default_rng(4))
        assert ((q >= m.lower) & (q <= m.upper)).all()


def test_gravity_must_be_an_acceleration():
    with pytest.raises(InputError, match="gravity is zero"):
        gravity_base_parameters(RAVEN, np.zeros(3))
    with pytest.raises(InputError, match=r"gravity: expected shape \(3,\)"):
        gravity_base_parameters(RAVEN, np.zeros(2))
