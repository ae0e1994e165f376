import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.collision.bodies import box_at, floor_at
from catenary.collision.contacts import is_free, keep_apart, require_free_pose, touching, without_constant_contacts
from catenary.collision.scene import scene_of
from catenary.errors import InputError
from colliding_arm import PANDA, apart, box_arm, capsule_arm

Q = np.random.default_rng(0).uniform(PANDA.lower, PANDA.upper, (60, PANDA.n))


@pytest.mark.parametrize("arm", [capsule_arm, box_arm])
def test_configurations_are_free_where_no_pair_touches(arm):
    scene = apart(arm(), [floor_at(0.1)])
    close = touching(scene, Q, 0.01).any(axis=1)
    assert 0 < close.sum() < len(Q)
    assert_array_equal(is_free(scene, Q, 0.01), ~close)
    assert_array_equal([keep_apart(scene, q[None], 0.01) for q in Q], ~close)
    assert keep_apart(scene, Q[~close], 0.01)
    assert not keep_apart(scene, Q, 0.01)


def test_pairs_that_touch_everywhere_are_left_out_and_told():
    scene = scene_of(PANDA, capsule_arm(), [floor_at(2.0)])
    kept, names = without_constant_contacts(scene, Q, 0.01)
    assert ("q4", "q6") in names
    assert len(kept.pairs) < len(scene.pairs)
    assert not any("floor" in pair for pair in names)  # obstacles stay: a floor above the robot is no joint


@pytest.mark.parametrize(("obstacle", "name"), [(floor_at(0.5), "floor"), (box_at(1, [0, 0, 0.5, 2, 2, 2]), "box 1")])
def test_a_robot_that_stands_in_something_is_refused_by_its_name(obstacle, name):
    scene = apart(capsule_arm(), [obstacle])
    with pytest.raises(InputError, match=f"in none of 60 poses .* keep 10 mm apart; within it are .*{name} in 100 %"):
        require_free_pose(scene, Q, 0.01)
