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
from catenary.identification.base_parameters import Parameters, base_parameters, gravity_base_parameters
from catenary.robots.catalog import load_robot
from moving_arm import LEVEL, sinusoids
from oracles.random_trees import random_robot

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


# poses at rest, gravity alone


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
    q, still = rng.normal(size=(1, m.n)), np.zeros((1, m.n))
    torque = base.regressor(q, still, still, gravity)[0] @ (base.combination @ standard_gravity_parameters(m).values)
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


def test_gravity_must_be_an_acceleration():
    with pytest.raises(InputError, match="gravity is zero"):
        gravity_base_parameters(RAVEN, np.zeros(3))
    with pytest.raises(InputError, match=r"gravity: expected shape \(3,\)"):
        gravity_base_parameters(RAVEN, np.zeros(2))
