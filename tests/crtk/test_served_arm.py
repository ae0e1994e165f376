import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.crtk.serving.served_arm import BACKLOG, Goal, Increments

MOST = np.array([0.0025, 5e-5])
PERIOD = 1e-3
within = st.tuples(st.floats(-0.0025, 0.0025), st.floats(-5e-5, 5e-5)).map(np.array)


def drained(queue: Increments, tick: int, ticks: int) -> list[np.ndarray]:
    return [dq for k in range(ticks) if (dq := queue.next(tick + k)) is not None]


@given(st.lists(st.lists(within, max_size=8), max_size=12))
def test_nothing_is_lost_or_repeated_however_increments_arrive(ticks):
    queue = Increments(MOST, PERIOD)
    moved = np.zeros(2)
    for tick, arriving in enumerate(ticks):
        for dq in arriving:
            queue.add(dq, tick)
        done = queue.next(tick)
        moved += 0.0 if done is None else done
    for done in drained(queue, len(ticks), 120):
        moved += done
    total = np.sum([dq for arriving in ticks for dq in arriving] or [np.zeros(2)], axis=0)
    assert_allclose(moved, total, atol=1e-12)
    assert len(queue) == 0


def test_what_waited_too_long_is_left_out_and_counted():
    queue = Increments(MOST, PERIOD)
    queue.add(MOST, 0)
    assert queue.next(round(BACKLOG / PERIOD) + 1) is None
    assert len(queue) == 0


@given(within, st.integers(1, 50))
def test_a_goal_is_approached_by_clamped_steps_and_never_passed(way, steps):
    goal, setpoint = Goal(MOST, PERIOD), np.zeros(2)
    goal.set(20 * way, steps)
    taken = 0
    while goal:
        moved = goal.next(setpoint)
        assert (np.abs(moved - setpoint) <= MOST * (1 + 1e-12)).all()
        assert (np.abs(moved) <= np.abs(20 * way) + 1e-15).all()
        setpoint, taken = moved, taken + 1
    assert taken <= steps
