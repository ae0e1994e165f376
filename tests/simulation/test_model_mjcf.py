from dataclasses import replace

import mujoco
import numpy as np
import pytest

import own_base
from catenary.errors import InputError, MissingInertiaError
from catenary.robots.catalog import load_robot
from catenary.robots.urdf import parse_urdf
from catenary.simulation.model_mjcf import tree_mjcf


def test_bodies_and_joints_have_the_links_names(random_robots):
    for robot in random_robots[:10]:
        model = mujoco.MjModel.from_xml_string(tree_mjcf(robot.model))
        for name, mass in zip(robot.model.link_names, robot.model.tree.mass, strict=True):
            assert model.body(name).mass[0] == mass
            assert model.body(model.joint(name).bodyid[0]).name == name


def test_names_may_hold_what_xml_does_not_like():
    names = ('a<"&', "b'>")
    model = mujoco.MjModel.from_xml_string(
        tree_mjcf(replace(load_robot("two_link"), link_names=names, name="<&>"))
    )
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
