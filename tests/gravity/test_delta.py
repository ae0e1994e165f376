import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from catenary.gravity.delta import gravity_delta
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot
from catenary.sensing.vector import tilted_gravity
from catenary.spatial import LEVEL


def test_firmware_for_a_level_base_plus_the_delta_is_the_whole_gravity_torque(random_robots):
    rng = np.random.default_rng(0)
    for robot in random_robots[:20]:
        q, gravity = rng.normal(size=robot.model.n), tilted_gravity(*rng.uniform(-3.0, 3.0, 2))
        whole = gravity_torque(robot.model, q, LEVEL) + gravity_delta(robot.model, q, gravity)
        assert_allclose(whole, gravity_torque(robot.model, q, gravity), atol=1e-11)


def test_there_is_nothing_to_add_on_a_level_base():
    arm = load_robot("raven2")
    assert_array_equal(gravity_delta(arm, [0.5, 1.5, 0.4], LEVEL), np.zeros(3))


def test_rows_of_gravity_go_with_rows_of_positions():
    arm = load_robot("raven2")
    q = np.tile([0.5, 1.5, 0.4], (2, 1))
    gravities = np.array([LEVEL, tilted_gravity(0.3, 0.0)])
    rows = gravity_delta(arm, q, gravities)
    assert_array_equal(rows[0], np.zeros(3))
    assert_allclose(rows[1], gravity_delta(arm, q[1], gravities[1]))
