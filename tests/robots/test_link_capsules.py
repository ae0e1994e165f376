import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.robots.catalog import load_robot
from catenary.robots.link_capsules import DENSITY, capsules_along_links


@pytest.mark.parametrize("name", ["panda", "ur10e", "dual_arm_19", "iiwa14"])
def test_capsules_hold_their_links_masses_as_water(name):
    model = load_robot(name)
    found = capsules_along_links(model)
    for link, mass in enumerate(model.tree.mass):
        own = [shape.form for shape in found.shapes if shape.link == link]
        if mass > 0.0:
            length, radius = sum(form.length for form in own), own[0].radius
            volume = np.pi * radius**2 * length + 4 / 3 * np.pi * radius**3
            assert_allclose(DENSITY * volume, mass, rtol=1e-6)


def test_capsules_reach_from_joint_to_joint():
    model = load_robot("ur10e")
    arm = [s for s in capsules_along_links(model, 0.05).shapes if s.name == "upper_arm_link"]
    ends = [s.pose.position + k * s.form.length / 2 * s.pose.rotation[:, 2] for s in arm for k in (-1, 1)]
    for place in (np.zeros(3), [-0.6127, 0, 0]):
        assert min(np.linalg.norm(end - place) for end in ends) < 1e-9


def test_a_centre_of_mass_beside_the_line_lies_in_the_capsules():
    model = load_robot("ur10e")  # the upper arm stands beside the line between its joints
    arm = [s for s in capsules_along_links(model).shapes if s.name == "upper_arm_link"]
    com = model.tree.com[1]
    apart = []
    for s in arm:
        along = s.pose.rotation[:, 2]
        share = np.clip((com - s.pose.position) @ along, -s.form.length / 2, s.form.length / 2)
        apart.append(np.linalg.norm(com - s.pose.position - share * along) - s.form.radius)
    assert min(apart) < 0.0


def test_without_masses_a_radius_must_be_given():
    model = load_robot("dvrk_psm_motors")
    assert capsules_along_links(model) is None
    found = capsules_along_links(model, 0.02)
    assert {shape.form.radius for shape in found.shapes} == {0.02}
    assert {shape.link for shape in found.shapes} >= set(range(len(model.link_names)))
