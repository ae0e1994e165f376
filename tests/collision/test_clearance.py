from dataclasses import replace

import numpy as np
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from catenary.collision.scene import _LOOK_COUNT, box_at, floor_at, scene_of
from catenary.dynamics.kinematics import Configuration, forward_kinematics
from colliding_arm import PANDA, apart, box_arm, capsule_arm, motion

CAPSULES = apart(capsule_arm(), [floor_at(0.25)])
BOXES = apart(box_arm(), [floor_at(-0.2), box_at(1, [0.5, 0.0, 0.6, 0.2, 0.2, 0.2])])


def smallest(scene, path, rows):
    placed = Configuration(scene.model, path.sample(np.linspace(0.0, path.duration, rows))[0])
    known = scene.lower_bounds(placed)
    least = np.inf
    for place in np.argsort(known, axis=None):
        row, pair = (int(k) for k in np.unravel_index(place, known.shape))
        if known[row, pair] >= least:
            break
        least = min(least, scene.distance(placed, row, pair))
    return least


@given(st.integers(0, 10**6), st.floats(0.001, 0.05), st.floats(0.05, 1.2))
@settings(max_examples=12)
def test_a_motion_is_kept_clear_where_a_fine_look_finds_nothing_nearer(seed, margin, amplitude):
    path = motion(PANDA, seed, amplitude)
    found = CAPSULES.clearance(path, margin)
    least = smallest(CAPSULES, path, 1500)
    if found.is_kept:
        assert least >= margin
        event("kept")
    else:
        assert found.distance < margin + 1e-4
        assert least < margin + 0.005  # a fine look comes as near, but for what lies between its rows


@given(st.integers(0, 10**6), st.floats(0.05, 1.0))
@settings(max_examples=10)
def test_the_same_of_boxes_by_coal(seed, amplitude):
    path = motion(PANDA, seed, amplitude)
    found = BOXES.clearance(path, 0.01)
    least = smallest(BOXES, path, 600)
    assert least >= 0.01 if found.is_kept else least < 0.015
    if found.is_kept:
        assert found.distance >= 0.01


def test_a_small_thing_that_is_passed_between_two_looks_is_found():
    path = motion(PANDA, 3, 1.5, centre=np.array([0.0, 0.9, 0.0, -1.2, 0.0, 2.0, 0.0]))
    times = np.linspace(0.0, path.duration, _LOOK_COUNT + 1)
    tip = forward_kinematics(PANDA, path.sample(times)[0])[1]
    k = int(np.argmax(np.linalg.norm(np.diff(tip, axis=0), axis=1)))
    passed = forward_kinematics(PANDA, path.sample(times[k : k + 2].mean(keepdims=True))[0])[1][0]
    scene = scene_of(PANDA, capsule_arm(radius=0.001), [box_at(1, [*passed, 1e-3, 1e-3, 1e-3])])
    # the hand's own capsule alone: the links before it would be in the way as well
    is_hand = [set(scene.names(p)) == {PANDA.link_names[-1], "box 1"} for p in range(len(scene.pairs))]
    scene = replace(scene, pairs=scene.pairs[is_hand])
    assert smallest(scene, path, _LOOK_COUNT + 1) > 0.01
    found = scene.clearance(path, 1e-3)
    assert not found.is_kept
    assert times[k] < found.time < times[k + 1]


def test_a_motion_that_stands_still_is_looked_at_little():
    path = motion(PANDA, 0, 1e-6, centre=np.array([0.0, 0.0, 0.0, -1.5, 0.0, 1.5, 0.0]))
    found = CAPSULES.clearance(path, 0.005)
    assert found.is_kept
    assert found.instants < 300
    assert found.distance == pytest.approx(smallest(CAPSULES, path, 3), abs=1e-5)
