import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import lsq_linear

from catenary.collision.bodies import floor_at
from catenary.collision.scene import reach_of_body, scene_of, segment_distance
from catenary.errors import InputError
from catenary.robots.catalog import load_robot
from catenary.robots.geometry import capsule_between
from catenary.robots.shapes import load_geometry
from colliding_arm import PANDA, capsule_arm, write_arm
from tests.descriptions.collisions import colliding, of_capsules, read_geometry, with_pairs


def ends(seed, scale=1.0):
    return scale * np.random.default_rng(seed).normal(size=(4, 3))


@given(st.integers(0, 10**6))
def test_no_points_of_two_segments_are_closer_and_some_are_as_close(seed):
    p0, p1, q0, q1 = ends(seed)
    found = segment_distance(p0, p1, q0, q1)
    sides = np.column_stack([p1 - p0, q0 - q1])
    best = lsq_linear(sides, q0 - p0, bounds=(0.0, 1.0), tol=1e-14)  # shares of both segments
    assert_allclose(found, np.sqrt(2.0 * best.cost), atol=1e-6)


@given(st.integers(0, 10**6), st.floats(0.01, 0.3), st.floats(0.01, 0.3))
def test_capsules_are_as_far_apart_as_coal_says(seed, one, other):
    p0, p1, q0, q1 = ends(seed, 2.0)
    forms = [capsule_between(p0, p1, one), capsule_between(q0, q1, other)]
    bodies = [(coal.Capsule(*form), coal.Transform3s(*pose)) for pose, form in forms]
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    theirs = coal.distance(*bodies[0], *bodies[1], request, result)
    ours = float(segment_distance(p0, p1, q0, q1)) - one - other
    if ours > 1e-3:  # what overlaps has many depths
        assert_allclose(ours, theirs, atol=1e-5)  # Coal's tolerance


def test_degenerate_segments_are_points():
    zero, x, y = np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    assert_allclose(segment_distance(zero, zero, x, x), 1.0)
    assert_allclose(segment_distance(zero, zero, x, x + y), 1.0)
    assert_allclose(segment_distance(x - y, x + y, zero, zero), 1.0)
    assert_allclose(segment_distance(zero, x, y, x + y), 1.0)  # parallel
    assert_allclose(segment_distance(zero, x, 3 * x, 4 * x), 2.0)  # on one line
    assert_allclose(segment_distance(-x, x, y * -1, y), 0.0, atol=1e-12)  # crossing


def test_many_pairs_at_once_are_the_same_as_one_by_one():
    many = np.random.default_rng(0).normal(size=(4, 5, 7, 3))
    found = segment_distance(*many)
    assert found.shape == (5, 7)
    assert_allclose(found[2, 3], segment_distance(*many[:, 2, 3]))


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
    before, after = (scene.lower_bounds(scene.place(inside + sign * h * step)) for sign in (-0.5, 0.5))
    rate = np.abs(after - before) / h
    with np.errstate(invalid="ignore"):
        bound = np.abs(step) @ np.nan_to_num(scene.reach, posinf=1e9).T
    assert (rate <= bound + 1e-6).all()


def test_joints_that_carry_both_bodies_move_neither_against_the_other():
    scene = scene_of(PANDA, capsule_arm())
    for k in range(len(scene.pairs)):
        links = sorted(scene.bodies[b].link for b in scene.pairs[k])
        moved = np.flatnonzero(scene.reach[k])
        assert_array_equal(moved, np.arange(links[0] + 1, links[1] + 1))


def test_a_sliding_joint_moves_what_it_carries_at_its_own_speed():
    model = load_robot("raven2")
    scene = scene_of(model, load_geometry("raven2", model))
    tip = next(body for body in scene.bodies if body.name == "insertion")
    assert reach_of_body(model, tip)[2] == 1.0


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
    placed = scene.place(q)
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
    placed = scene.place(q)
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
    bounds = scene.lower_bounds(scene.place(q))
    for row in (0, 20):
        _, least, _ = colliding(model, geometry, q[row : row + 1])
        assert least == pytest.approx(bounds[row].min(), abs=1e-6)


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
