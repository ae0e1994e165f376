import multiprocessing
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.dynamics.kinematics import forward_kinematics, link_poses
from catenary.sensing.gravity_vector import tilted_gravity
from catenary.spatial import LEVEL, rotation_from_quaternion
from catenary.view.page_content import _PATH_POINTS, TipPaths, base_orientation, scene_of_robot
from catenary.view.page_process import _SHOWN_NOTES, PageProcess, newest, truncated_state
from view.arms import RAVEN, Q, state


@pytest.mark.parametrize("word", ["warning " * 100, "\u00fc" * 5000, "\U0001f916" * 900, "\x00" * 900, "\ud800" * 900])
def test_words_that_take_much_room_are_cut_and_never_lost_with_the_numbers(word: str) -> None:
    told = truncated_state(state(2.5, notes=(word,) * 20, doing=word, fault=word, silent=word))
    assert told.time == 2.5
    assert len(told.notes) == _SHOWN_NOTES
    assert len("".join([told.state, *told.warnings()]).encode()) < 8000


def test_the_newest_state_is_taken_once_and_the_end_is_noticed() -> None:
    ours, theirs = multiprocessing.Pipe()
    assert newest(theirs) is None
    ours.send((state(1.0), {}))
    ours.send((state(2.0, doing=", still"), {"plays": True}))
    seen = newest(theirs)
    assert seen is not None
    assert (seen[0].time, seen[0].doing, seen[1]) == (2.0, ", still", {"plays": True})
    assert_array_equal(seen[0].q, Q)
    assert newest(theirs) is None
    ours.send(None)
    with pytest.raises(EOFError):
        newest(theirs)


def test_who_puts_states_is_not_held_up_by_a_page_that_never_takes_them_or_is_gone() -> None:
    page = PageProcess()
    page._is_open = True
    durations = []
    for k in range(300):
        begin = time.thread_time()
        page.put(state(float(k), notes=("x" * 1000,) * 20))
        durations.append(time.thread_time() - begin)
    assert np.median(durations) < 5e-4  # of a millisecond's tick
    page._theirs.close()
    page.put(state())


def test_arms_stand_where_the_kinematics_say() -> None:
    moved = Q + 0.1
    scene = scene_of_robot(RAVEN, state(calibrated=moved))
    assert set(scene.arms) == {"reported", "calibrated"}  # nobody knows the true one
    for name, q in (("reported", Q), ("calibrated", moved)):
        rotations, positions = link_poses(RAVEN, q)
        arm = scene.arms[name]
        assert_allclose([rotation_from_quaternion(w) for w in arm.wxyz], rotations, atol=1e-12)
        assert_allclose(arm.positions, positions)
        assert_allclose(arm.tip, forward_kinematics(RAVEN, q).position, atol=1e-12)


@given(st.floats(-3.0, 3.0), st.floats(-1.5, 1.5))
def test_base_is_turned_so_that_the_gravity_it_feels_points_down(roll: float, pitch: float) -> None:
    felt = tilted_gravity(roll, pitch)
    assert_allclose(rotation_from_quaternion(base_orientation(felt)) @ felt, LEVEL, atol=1e-9)


@pytest.mark.parametrize(("felt", "expected"), [
    ((0.0, 0.0, -9.81), (1.0, 0.0, 0.0, 0.0)),
    ((0.0, 0.0, 9.81), (0.0, 0.0, 1.0, 0.0)),  # upside down
    ((np.nan, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),  # unknown: level
    ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
])  # fmt: skip
def test_base_whose_tilt_cannot_be_told_stands_still(felt, expected) -> None:
    assert_allclose(base_orientation(np.array(felt)), expected, atol=1e-15)


def test_base_is_turned_no_further_than_it_has_to_be() -> None:
    w = base_orientation(tilted_gravity(0.4, 0.0))[0]
    assert 2.0 * np.arccos(w) == pytest.approx(0.4)


def test_gravity_is_an_arrow_as_long_as_one_on_earth() -> None:
    scene = scene_of_robot(RAVEN, state(gravity=np.array([0.0, 0.0, -9.81]), actual=np.array([0.0, 9.81, 0.0])))
    assert scene.measured is not None
    assert np.linalg.norm(scene.measured) == pytest.approx(1.0)
    assert scene.assumed is None
    # the base stands as gravity is, not as a broken sensor says
    assert_allclose(rotation_from_quaternion(scene.base_wxyz) @ [0.0, 1.0, 0.0], [0.0, 0.0, -1.0], atol=1e-12)


def test_paths_keep_the_newest_points_and_leave_out_standing_still() -> None:
    paths = TipPaths(1.0)
    for k in range(3 * _PATH_POINTS):
        scene = scene_of_robot(RAVEN, state()._replace(q=Q + np.array([0.0, 0.0, 1e-3 * (k % 90)])))
        paths.add(scene)
        paths.add(scene)
    assert len(paths.segments("reported")) <= _PATH_POINTS
    assert len(paths.segments("true")) == 0
    ways = np.linalg.norm(np.diff(paths.segments("reported"), axis=1), axis=2)
    assert ways.min() >= 0.002 - 1e-12
    paths.clear()
    assert len(paths.segments("reported")) == 0
