import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.plant import JointState
from catenary.trajectories.smoothed_path import go_to
from catenary.view.simulated_arm import SteeredTrajectory, SwitchedCorrector

DT = 1e-3
FADE = 1.5  # [s]


def way(goal: np.ndarray):
    return lambda q: go_to(q, goal, max_velocity=[0.5, 0.5], max_acceleration=[1.0, 1.0])


@settings(max_examples=3, deadline=None)
@given(st.lists(st.tuples(st.floats(0.05, 2.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=1, max_size=5))
def test_motion_is_continuous_however_often_another_is_wanted(wishes) -> None:
    trajectory = SteeredTrajectory(np.zeros(2))
    rows, t = [], 0.0
    for wait, a, b in wishes:
        trajectory.follow(way(np.array([a, b])))
        for _ in range(round(wait / DT)):
            t += DT
            rows.append(trajectory(t))
    for _ in range(5500):
        t += DT
        rows.append(trajectory(t))
    q, qd = np.array([row.q for row in rows]), np.array([row.qd for row in rows])
    assert np.abs(np.diff(q, axis=0)).max() <= 0.51 * DT
    # stopping in 0.4 s from 0.5 rad/s beside the motion's own 1 rad/s2, as a go-to may ask for
    assert np.abs(np.diff(qd, axis=0)).max() <= 4.0 * DT
    assert_allclose(np.diff(q, axis=0) / DT, 0.5 * (qd[1:] + qd[:-1]), atol=5e-3)  # qd is q's derivative
    assert_allclose(q[-1], wishes[-1][1:], atol=1e-9)
    assert_allclose(qd[-1], 0.0, atol=1e-9)


def test_motion_that_is_over_is_made_again_from_where_it_ended() -> None:
    starts = []

    def recipe(q):
        starts.append(q)
        return go_to(q, q + 0.1, max_velocity=[0.5, 0.5], max_acceleration=[1.0, 1.0])

    trajectory = SteeredTrajectory(np.zeros(2))
    trajectory.follow(recipe)
    for k in range(3000):
        trajectory(k * DT)
    assert len(starts) > 2
    assert_allclose(np.diff(starts, axis=0), 0.1)
    trajectory.follow(None)
    for k in range(3000, 6000):
        last = trajectory(k * DT)
    assert_allclose(last.qd, 0.0)
    assert len(starts) < 8


class Shifted:
    """Says that every joint is 0.1 further."""

    def correct_state(self, state, out, inside, interval=None) -> None:
        out[:], inside[:] = state.q + 0.1, True
        interval[:] = 0.01

    def prepare(self, joint_names, joint_units, rate_hz) -> None: ...


def test_model_is_faded_in_and_out_and_always_says_its_own() -> None:
    corrector = SwitchedCorrector(Shifted(), lambda state: state, 2, DT)
    state = JointState(0.0, np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(0), np.zeros(3), 0.0)
    out, inside, interval = np.empty(2), np.empty(2, dtype=bool), np.empty(2)
    seen = []
    for k in range(5000):
        corrector.is_on = 100 <= k < 2500
        corrector.correct_state(state, out, inside, interval)
        assert_allclose(corrector.calibrated, 0.1)
        seen.append(out[0])
    assert seen[99] == 0.0
    assert seen[2499] == pytest.approx(0.1)
    assert seen[-1] == 0.0
    assert np.abs(np.diff(seen)).max() <= 0.1 * DT / FADE + 1e-12
