from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from catenary.robots.catalog import load_robot
from catenary.robots.model import RobotModel
from catenary.robots.quarter_turns import quarter_turn_notes, with_quarter_turns

QUARTERS = st.integers(-4, 4)
SMALL = st.floats(-4e-7, 4e-7)


def turned(rotation: np.ndarray) -> RobotModel:
    """A robot whose second link stands so in the first's frame."""
    arm = load_robot("two_link")
    return replace(arm, tree=arm.tree._replace(rotation=np.array([np.eye(3), rotation])))


@given(st.tuples(QUARTERS, QUARTERS, QUARTERS), st.tuples(SMALL, SMALL, SMALL))
def test_turns_of_few_digits_become_quarter_turns(quarters, off) -> None:
    angles = 0.5 * np.pi * np.array(quarters) + off
    found = with_quarter_turns(turned(Rotation.from_euler("xyz", angles).as_matrix())).tree.rotation[1]
    exact = np.round(Rotation.from_euler("xyz", 0.5 * np.pi * np.array(quarters)).as_matrix())
    assert_allclose(found, exact, atol=1e-12)


@given(st.floats(0.1, 1.4), QUARTERS, SMALL)
def test_a_turn_about_an_axis_keeps_it_exactly_and_its_angle(angle, quarters, off) -> None:
    R = Rotation.from_euler("zx", [angle, 0.5 * np.pi * quarters + off]).as_matrix()
    found = with_quarter_turns(turned(R)).tree.rotation[1]
    assert_allclose(found, R, atol=1e-6)
    assert_allclose(found @ found.T, np.eye(3), atol=1e-12)
    assert (np.abs(np.abs(found) - 1.0) == 0.0).sum() == 1 or np.array_equal(found, R)


@pytest.mark.parametrize(("off", "recognised"), [(9e-7, True), (1.1e-6, False)])
def test_beyond_a_millionth_of_a_radian_a_turn_is_what_it_says(off: float, recognised: bool) -> None:
    arm = turned(Rotation.from_euler("x", 0.5 * np.pi + off).as_matrix())
    assert (with_quarter_turns(arm) is not arm) == recognised
    notes = quarter_turn_notes(arm.link_names, arm.tree, arm.offset)
    assert [note.startswith("quarter turns, to within") and "link1" in note for note in notes] == [True] * recognised


def test_axes_and_constants_are_recognised_too_and_exact_robots_stay_themselves() -> None:
    arm = load_robot("two_link")
    assert with_quarter_turns(arm) is arm
    askew = replace(
        arm,
        tree=arm.tree._replace(axis=np.array([[3e-7, 0.0, 1.0], [0.0, 0.0, -1.0]])),
        offset=np.array([1.570796, 0.3]),
    )
    found = with_quarter_turns(askew)
    assert_allclose(found.tree.axis, [[0, 0, 1], [0, 0, -1]], atol=0)
    assert_allclose(found.offset, [0.5 * np.pi, 0.3], atol=0)
