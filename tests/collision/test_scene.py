from dataclasses import replace
from itertools import product

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.collision import scene
from catenary.collision.scene import _LOOK_COUNT, body_of, box_at, floor_at, mesh_at, scene_of
from catenary.dynamics.kinematics import Configuration, forward_kinematics
from catenary.errors import FileFormatError, InputError, MissingPackageError
from catenary.robots.catalog import load_robot
from catenary.robots.geometry import Ball, Box, Capsule, Cylinder, Ellipsoid, HalfSpace, Shape, TriangleMesh
from catenary.robots.shapes import load_geometry
from catenary.spatial import Pose, rotation_from_vector
from colliding_arm import PANDA, apart, box_arm, capsule_arm, motion, write_arm
from tests.descriptions.collisions import colliding, of_capsules, read_geometry, with_pairs

Q = np.random.default_rng(0).uniform(PANDA.lower, PANDA.upper, (60, PANDA.n))


@pytest.mark.parametrize("name", ["panda", "raven2", "ur10e", "dual_arm_19", "dvrk_mtm_motors"])
def test_no_distance_changes_faster_than_the_reach_allows(name):
    model = load_robot(name)
    scene = scene_of(model, load_geometry(name, model, link_radius=0.02), [floor_at(0.0)])
    rng = np.random.default_rng(0)
    low = np.where(np.isfinite(model.lower), model.lower, -1.0)
    high = np.where(np.isfinite(model.upper), model.upper, 1.0)
    q, h = rng.uniform(low, high, (400, model.n)), 1e-5
    step = rng.normal(size=q.shape)
    inside = np.clip(q, low + 2 * h, high - 2 * h)
    before, after = (scene.lower_bounds(Configuration(model, inside + sign * h * step)) for sign in (-0.5, 0.5))
    rate = np.abs(after - before) / h
    with np.errstate(invalid="ignore"):
        bound = np.abs(step) @ np.nan_to_num(scene.reach, posinf=1e9).T
    assert (rate <= bound + 1e-6).all()
    # and Coal's own distances, over a step that its tolerance does not hide; how deep shapes overlap is no distance
    h = 1e-2
    ends = [Configuration(model, inside[:30] + sign * h * step[:30]) for sign in (-0.5, 0.5)]
    for row, pair in product(range(30), range(len(scene.pairs))):
        before, after = (max(scene.distance(placed, row, pair, np.inf), 0.0) for placed in ends)
        assert abs(after - before) <= h * bound[row, pair] + 1e-5


def test_joints_that_carry_both_bodies_move_neither_against_the_other():
    scene = scene_of(PANDA, capsule_arm())
    for k in range(len(scene.pairs)):
        links = sorted(scene.bodies[b].link for b in scene.pairs[k])
        moved = np.flatnonzero(scene.reach[k])
        assert_array_equal(moved, np.arange(links[0] + 1, links[1] + 1))


def test_a_sliding_joint_moves_what_it_carries_at_its_own_speed():
    model = load_robot("raven2")
    scene = scene_of(model, load_geometry("raven2", model))
    k = next(k for k in range(len(scene.pairs)) if set(scene.names(k)) == {"insertion", "base"})
    assert scene.reach[k, 2] == 1.0


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    path = write_arm(tmp_path_factory.mktemp("arm"))
    model = load_robot(path)
    return path, model, scene_of(model, load_geometry(path, model), [floor_at(-0.35)])


def test_boxes_cylinders_balls_and_meshes_of_a_urdf_are_as_far_apart_as_pinocchio_has_them(arm):
    path, model, scene = arm
    theirs, geometry = read_geometry(path)
    geometry = with_pairs(theirs, geometry, -0.35)
    assert len(geometry.collisionPairs) == len(scene.pairs)
    data, shapes = theirs.createData(), geometry.createData()
    objects = geometry.geometryObjects
    order = {frozenset(objects[i].name for i in (p.first, p.second)): k for k, p in enumerate(geometry.collisionPairs)}
    q = np.random.default_rng(0).uniform(-3.0, 3.0, (60, model.n))
    placed = Configuration(model, q)
    bounds = scene.lower_bounds(placed)
    for row in range(len(q)):
        pin.updateGeometryPlacements(theirs, data, geometry, shapes, q[row])
        pin.computeDistances(geometry, shapes)
        for pair in range(len(scene.pairs)):
            a, b = (name if name == "floor" else f"{name}_0" for name in scene.names(pair))
            expected = shapes.distanceResults[order[frozenset((a, b))]].min_distance
            found = scene.distance(placed, row, pair, np.inf)
            assert bounds[row, pair] <= found + 1e-9
            if expected > 1e-3:  # what overlaps has many depths
                assert_allclose(found, expected, atol=1e-6)
            else:
                assert found < 2e-3


def test_hulls_are_taken_where_they_are_enough_and_are_no_farther_than_the_shapes(arm):
    _, model, scene = arm
    q = np.random.default_rng(1).uniform(-3.0, 3.0, (20, model.n))
    placed = Configuration(model, q)
    for row in range(len(q)):
        for pair in range(len(scene.pairs)):
            assert scene.distance(placed, row, pair, -1.0) <= scene.distance(placed, row, pair, np.inf) + 1e-6


@pytest.mark.parametrize("name", ["raven2", "raven2_right", "raven2_full"])
def test_capsules_of_the_ravens_are_as_far_apart_as_pinocchio_has_them(name, tmp_path):
    robot = load_robot(name)
    shapes = load_geometry(name, robot)
    scene = scene_of(robot, shapes, [floor_at(-0.15)])
    model, geometry = of_capsules(robot, shapes, tmp_path)
    q = np.random.default_rng(0).uniform(robot.lower, robot.upper, (40, robot.n))
    geometry = with_pairs(model, geometry, -0.15)
    for row in (0, 20):
        _, least, _ = colliding(model, geometry, q[row : row + 1])
        ours = [scene.distance(Configuration(robot, q), row, pair, np.inf) for pair in range(len(scene.pairs))]
        assert least == pytest.approx(min(ours), abs=1e-6)


def test_neighbours_are_not_compared_nor_the_base_with_the_floor():
    scene = scene_of(PANDA, capsule_arm(), [floor_at(0.0)])
    names = {frozenset(scene.names(k)) for k in range(len(scene.pairs))}
    assert frozenset(("q1", "q2")) not in names
    assert frozenset(("base", "floor")) not in names
    assert frozenset(("q1", "q3")) in names
    assert frozenset(("q1", "floor")) in names


def test_pairs_that_may_touch_are_left_out_and_unknown_names_refused():
    scene = scene_of(PANDA, capsule_arm(), [floor_at(0.0)], ignored=[("floor", "q1")])
    assert all(set(scene.names(k)) != {"q1", "floor"} for k in range(len(scene.pairs)))
    with pytest.raises(InputError, match='"ceiling": no link with a shape and no obstacle; there are base'):
        scene_of(PANDA, capsule_arm(), ignored=[("ceiling", "q1")])


def test_a_robot_with_nothing_to_hit_is_refused():
    model = load_robot("two_link")
    with pytest.raises(InputError, match="no two bodies that could collide"):
        scene_of(model, capsule_arm(model), ignored=[("base", "link1")])


def test_the_base_may_touch_by_its_links_name_or_as_base(arm):
    path, model, _ = arm
    for name in ("base", "base_link"):
        scene = scene_of(model, load_geometry(path, model), ignored=[(name, "elbow")])
        assert {"base_link", "elbow"} not in [set(scene.names(k)) for k in range(len(scene.pairs))]


@pytest.mark.parametrize("arm", [capsule_arm, box_arm])
def test_configurations_are_free_where_no_pair_touches(arm):
    scene = apart(arm(), [floor_at(0.1)])
    close = scene.touching(Q, 0.01).any(axis=1)
    assert 0 < close.sum() < len(Q)
    assert_array_equal([scene.keeps_apart(q[None], 0.01) for q in Q], ~close)
    assert scene.keeps_apart(Q[~close], 0.01)
    assert not scene.keeps_apart(Q, 0.01)


def test_pairs_that_touch_everywhere_are_left_out_and_told():
    scene = scene_of(PANDA, capsule_arm(), [floor_at(2.0)])
    kept, names = scene.without_constant_contacts(Q, 0.01)
    assert ("q4", "q6") in names
    assert len(kept.pairs) < len(scene.pairs)
    assert not any("floor" in pair for pair in names)  # obstacles stay: a floor above the robot is no joint


POSE = Pose(rotation_from_vector([0.3, -0.5, 0.2]), np.array([0.1, 0.2, -0.3]))
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
TETRAHEDRON = TriangleMesh(np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))


def body(form):
    return body_of(Shape("link", 0, POSE, form))


def test_balls_about_forms_hold_them():
    rng = np.random.default_rng(0)
    sphere = rng.normal(size=(500, 3))
    sphere /= np.linalg.norm(sphere, axis=1)[:, None]
    angle = rng.uniform(0, 6.28, 500)
    rim = np.column_stack([0.2 * np.cos(angle), 0.2 * np.sin(angle), rng.choice([-0.5, 0.5], 500)])
    for form, points in (
        (Ball(0.4), 0.4 * sphere),
        (Capsule(0.2, 1.0), [[0, 0, 0.7], [0, 0, -0.7], [0.2, 0, 0.5]]),
        (Box(0.2, 0.6, 0.3), CORNERS * [0.2, 0.6, 0.3]),
        (Cylinder(0.2, 1.0), rim),
        (Ellipsoid(0.2, 0.6, 0.3), sphere * [0.2, 0.6, 0.3]),
        (TETRAHEDRON, TETRAHEDRON.vertices),
    ):
        one, there = body(form), points @ POSE.rotation.T + POSE.position
        assert np.linalg.norm(there - one.centre, axis=1).max() < one.radius + 1e-6, form
    assert body(HalfSpace()).is_plane


def test_what_is_missing_is_said(monkeypatch):
    scene._coal.cache_clear()
    monkeypatch.setitem(__import__("sys").modules, "coal", None)
    with pytest.raises(MissingPackageError, match=r"pip install .*coal"):
        body(Box(1, 1, 1))


def test_obstacles_stand_where_they_were_put(tmp_path):
    assert floor_at(-0.2).pose.position[2] == -0.2
    box = box_at(3, [1, 2, 3, 0.1, 0.2, 0.3])
    assert box.name == "box 3"
    assert tuple(box.form) == (0.1, 0.2, 0.3)
    (tmp_path / "table.stl").write_text("solid")
    assert_array_equal(mesh_at(tmp_path / "table.stl", [1, 2, 3]).pose.position, [1, 2, 3])


def test_what_cannot_stand_anywhere_is_refused(tmp_path):
    with pytest.raises(InputError, match="floor: height nan"):
        floor_at(np.nan)
    with pytest.raises(InputError, match="box 1: expected six numbers"):
        box_at(1, [1, 2, 3])
    with pytest.raises(InputError, match="box 1: size 0, expected above zero"):
        box_at(1, [1, 2, 3, 1, 0, 1])
    with pytest.raises(FileFormatError, match="no such mesh"):
        mesh_at(tmp_path / "none.stl", [0, 0, 0])


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
