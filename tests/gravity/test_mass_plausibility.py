from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catenary.gravity.mass_plausibility import mass_doubts
from catenary.robots.catalog import load_robot, robot_names
from command_line import catenary

LINK = """<link name="{name}"><inertial><origin xyz="{x} 0 0"/><mass value="{mass}"/>
<inertia ixx="{ixx}" ixy="0" ixz="0" iyy="{i}" iyz="0" izz="{i}"/></inertial></link>
<joint name="{name}_joint" type="revolute"><parent link="{parent}"/><child link="{name}"/><origin xyz="{at} 0 0"/>
<axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="{effort}" velocity="1"/></joint>"""


def two_link(*, mass=4.0, x=0.25, i=0.1, ixx=0.005, effort=60.0):
    """Two links of 0.5 m; the last one's numbers are given."""
    first = LINK.format(name="upper", parent="root", at=0, mass=4.0, x=0.25, i=0.1, ixx=0.005, effort=60.0)
    last = LINK.format(name="lower", parent="upper", at=0.5, mass=mass, x=x, i=i, ixx=ixx, effort=effort)
    return f'<robot name="arm"><link name="root"/>{first}{last}</robot>'


DENSE = 'link "lower": 2400 kg with the inertia of 7.72e+06 t/m3; the densest metal has 22.6 t/m3'
CASES = [
    ({}, []),
    ({"mass": 2400}, [DENSE, "gravity asks more than motors give: upper_joint up to 1.7"]),
    ({"mass": 2.0, "i": 0.0, "ixx": 0.0}, ['link "lower": 2 kg with the inertia of a point']),
    ({"mass": 2.0, "ixx": 0.0}, []),  # a rod without thickness is meant as one
    ({"i": 8.0, "ixx": 0.005}, ['link "lower": 4 kg with the inertia of a body of 3.16 m to either side']),
    ({"x": 0.55}, ['link "lower": its centre of mass lies 0.55 m off the line of its joints and frames, 0 m long']),
    ({"effort": 9.0}, ["gravity asks more than motors give: lower_joint up to 9.8"]),
    ({"effort": 0.0}, []),  # a placeholder
]


@pytest.mark.parametrize(("numbers", "expected"), CASES)
def test_masses_that_cannot_be_are_told(numbers, expected):
    doubts = mass_doubts(load_robot(two_link(**numbers)))
    assert len(doubts) == len(expected), doubts
    for doubt, begins in zip(doubts, expected, strict=True):
        assert doubt.startswith(begins)


@pytest.mark.parametrize("name", robot_names())
def test_no_robot_of_the_catalogue_is_doubted(name):
    assert mass_doubts(load_robot(name)) == ()


@given(
    axes=st.tuples(*[st.floats(0.05, 0.4)] * 3),
    density=st.floats(100.0, 100_000.0).filter(lambda rho: abs(rho - 30_000.0) > 1.0),
)
def test_an_ellipsoid_is_doubted_exactly_where_it_is_denser_than_thirty_tonnes(axes, density):
    mass = 4.0 / 3.0 * np.pi * np.prod(axes) * density
    squares = np.square(axes)
    model = load_robot(two_link(effort=1e9))
    tensors = model.tree.inertia.copy()
    tensors[1] = np.diag(0.2 * mass * (squares.sum() - squares))
    masses = model.tree.mass.copy()
    masses[1] = mass
    model = replace(model, tree=model.tree._replace(mass=masses, inertia=tensors), effort_limit=np.full(2, np.inf))
    doubts = mass_doubts(model)
    assert any("t/m3" in doubt for doubt in doubts) == (density > 30_000.0)


@pytest.mark.parametrize(("factor", "told"), [(0.4, "0.4 times"), (0.8, ""), (1.3, ""), (2.4, "2.4 times")])
def test_the_sum_of_identified_masses_is_held_against_the_files(factor, told):
    model = load_robot("ur10e")
    tree = model.tree._replace(mass=model.tree.mass * factor, inertia=model.tree.inertia * factor)
    found = [each for each in mass_doubts(replace(model, tree=tree), described=model) if "moving mass" in each]
    assert bool(found) == bool(told)
    assert all(told in each for each in found)


def test_a_payload_is_a_point_mass_but_loads_the_motors():
    model = load_robot(two_link())
    assert mass_doubts(model.with_payload("lower", 2.0, [0.4, 0.0, 0.0])) == ()
    (doubt,) = mass_doubts(model.with_payload("lower", 20.0, [0.4, 0.0, 0.0]))
    assert doubt.startswith("gravity asks more than motors give")


def test_the_commands_print_the_doubts(tmp_path):
    path = tmp_path / "heavy.urdf"
    path.write_text(two_link(mass=2400))
    checked = catenary("check", path)
    assert checked.code == 1
    assert DENSE in checked.out
    assert DENSE in catenary("gravity", path, "--q", "0,0").err
