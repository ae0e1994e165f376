import copy
import sys
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

import own_base
from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics, mass_matrix
from catenary.errors import InputError, MissingInertiaError, MissingPackageError
from catenary.robots.catalog import load_robot
from catenary.robots.urdf import parse_urdf
from catenary.simulation.mujoco_plant import MujocoDynamics, tree_mjcf
from oracles.catalogue import robots_with_inertia


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
