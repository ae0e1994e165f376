import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.kinematics import forward_kinematics
from catenary.robots.catalog import load_robot
from catenary.teleop.driver import JOINT_SPEED, RAMP, TIMEOUT, TeleopMotion

PERIOD = 0.001
RAVEN = load_robot("raven2")
START = np.array([0.8, 1.5, 0.4])


def raven_motion() -> TeleopMotion:
    return TeleopMotion(RAVEN, RAVEN)


def held(motion: TeleopMotion, key: str, seconds: float, q: np.ndarray, after: float = 0.0) -> np.ndarray:
    """Where the robot is, tick by tick, with a key that repeats every 30 ms for so long."""
    path = [np.array(q)]
    for tick in range(round((seconds + after) / PERIOD)):
        now = tick * PERIOD
        if now < seconds and tick % 30 == 0:
            motion.press(key, now)
        goal = motion.step(path[-1], now, PERIOD)[0]
        path.append(path[-1] if goal is None else goal)
    return np.array(path)


def test_motion_stops_a_quarter_of_a_second_after_the_last_repeat() -> None:
    path = held(raven_motion(), "q", 1.0, START, after=1.0)
    moving = np.flatnonzero(np.diff(path[:, 0]))
    assert moving[-1] * PERIOD <= 1.0 + TIMEOUT + RAMP + PERIOD


def test_a_held_key_reaches_its_speed_and_moves_its_joint_alone() -> None:
    motion = raven_motion()
    path = held(motion, "s", 1.0, START)
    assert_allclose(np.diff(path[-100:, 1]), -motion.speed * JOINT_SPEED["rad"] * PERIOD)
    assert_allclose(path[:, [0, 2]], np.tile(START[[0, 2]], (len(path), 1)))


def test_speed_never_leaps() -> None:
    path = held(raven_motion(), "q", 0.5, START, after=0.5)
    most = raven_motion().speed * JOINT_SPEED["rad"] * PERIOD / RAMP * PERIOD
    assert np.abs(np.diff(path[:, 0], n=2)).max() <= most * (1.0 + 1e-6)


@pytest.mark.parametrize(("key", "axis", "sign"), [("up", 0, 1), ("right", 1, -1), ("page up", 2, 1)])
def test_the_tip_moves_straight_along_its_axis(key: str, axis: int, sign: int) -> None:
    path = held(raven_motion(), key, 1.0, START)
    way = forward_kinematics(RAVEN, path[-1]).position - forward_kinematics(RAVEN, path[0]).position
    assert way[axis] * sign > 0.001
    off = np.delete(way, axis)
    assert np.abs(off).max() < 0.02 * abs(way[axis])  # what the damping of the inverse takes


def test_a_limit_is_reached_reported_and_never_passed() -> None:
    motion = raven_motion()
    q = np.array([RAVEN.upper[0] - 0.001, 1.5, 0.4])
    path = held(motion, "q", 1.0, q)
    assert_allclose(path[-1, 0], RAVEN.upper[0])
    motion.press("q", 1.0)
    assert motion.step(path[-1], 1.0, PERIOD)[1] == ("shoulder",)


def test_a_joint_beyond_its_limit_may_only_come_back() -> None:
    q = np.array([RAVEN.upper[0] + 0.1, 1.5, 0.4])
    assert_allclose(held(raven_motion(), "q", 0.5, q)[-1], q)
    assert held(raven_motion(), "a", 0.5, q)[-1, 0] < q[0]


def test_opposite_keys_cancel() -> None:
    motion = raven_motion()
    motion.press("q", 0.0)
    motion.press("a", 0.0)
    assert_allclose(motion.step(START, 0.0, PERIOD)[0], START)


def test_keys_of_joints_that_there_are_not_move_nothing() -> None:
    motion = raven_motion()
    assert not motion.press("r", 0.0)
    assert motion.step(START, 0.0, PERIOD)[0] is None
