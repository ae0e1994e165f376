import numpy as np
import pytest

from catenary.dynamics.kinematics import forward_kinematics, link_poses
from catenary.robots.catalog import load_robot, robot_names
from catenary.view.shapes import arm_length, arm_shapes


@pytest.mark.parametrize("name", robot_names())
def test_drawn_arm_hangs_together_from_base_to_tip(name: str) -> None:
    model = load_robot(name)
    shapes = arm_shapes(model)
    assert len(shapes.links) == len(model.link_names)
    q = np.clip(0.3 * np.ones(model.n), model.lower, model.upper)
    rotations, positions = link_poses(model, q)
    drawn = [mesh.vertices @ r.T + p for mesh, r, p in zip(shapes.links, rotations, positions, strict=True)]
    tip = forward_kinematics(model, q).position
    reach = 0.06 * shapes.length
    assert min(np.linalg.norm(v - tip, axis=1).min() for v in drawn) < reach
    link = model.frame().link
    while (parent := int(model.tree.parent[link])) >= 0:  # every link touches the one that carries it
        apart = np.linalg.norm(drawn[link][:, None] - drawn[parent][None], axis=2).min()
        assert apart < reach, model.link_names[link]
        link = parent


def test_spherical_linkage_is_drawn_about_the_point_in_which_its_axes_meet() -> None:
    model = load_robot("raven2")
    shapes = arm_shapes(model)
    # the links of the spherical mechanism stay away from the port; the tool alone goes through it
    assert np.linalg.norm(shapes.links[0].vertices, axis=1).min() > 0.15
    assert np.linalg.norm(shapes.links[1].vertices, axis=1).min() > 0.15
    assert shapes.base is not None


def test_arm_length_of_a_planar_arm_is_the_sum_of_its_links() -> None:
    model = load_robot("planar_3r")
    straight = forward_kinematics(model, np.zeros(model.n)).position
    assert arm_length(model) == pytest.approx(np.linalg.norm(straight))
