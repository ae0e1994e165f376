import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.collision.obstacles import floor_at
from catenary.collision.reach import reach_of_body
from catenary.collision.scene import scene_of
from catenary.robots.catalog import load_robot
from catenary.robots.shapes import load_geometry
from colliding_arm import PANDA, capsule_arm


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
