"""Candidates of memory held against closed forms, and that they look at nothing that is not trained on."""

from dataclasses import replace
from itertools import pairwise
from math import gcd

import numpy as np

from catenary import MotionLog
from papers.beyond import memories
from papers.beyond.memories import PITCH_AND_YAW, Candidate, bounded, features, forgetting, relaxing

ALL = Candidate(combined=PITCH_AND_YAW, relaxing=True, forgetting=True, history=1)


def log_of(q: np.ndarray, time: np.ndarray | None = None) -> MotionLog:
    n = q.shape[1]
    names = tuple(f"J{j + 1}" for j in range(n))
    return MotionLog("made", names, ("rad",) * n, q, np.ones(len(q), dtype=bool), time=time)


def random_log(rows: int = 300, seed: int = 0) -> MotionLog:
    rng = np.random.default_rng(seed)
    return log_of(rng.uniform(-1.0, 1.0, (rows, 6)), np.cumsum(rng.uniform(0.2, 2.0, rows)))


def test_sums_are_of_two_joints_or_more_and_no_two_point_the_same_way() -> None:
    found = np.array(memories.sums(2, (3, 4, 5)))
    assert ((found != 0.0).sum(axis=1) > 1).all()
    assert all(gcd(*(int(weight) for weight in row)) == 1 for row in found)
    unit = found / np.linalg.norm(found, axis=1, keepdims=True)
    cosines = np.abs(unit @ unit.T) - np.eye(len(unit))
    assert cosines.max() < 1.0 - 1e-9
    assert len(memories.sums(1, (4, 5))) == 2  # J5 + J6 and J5 - J6


def test_what_is_left_of_a_step_relaxes_exponentially_and_by_time() -> None:
    time = np.array([0.0, 1.0, 1.5, 4.0, 9.0])
    q = np.zeros((5, 6))
    q[1:, 2] = 0.3
    left = relaxing(log_of(q, time), np.array([2.0, 7.0])).reshape(5, 6, 2)
    wanted = -0.3 * np.exp(-(time[1:, None] - 1.0) / np.array([2.0, 7.0]))
    np.testing.assert_allclose(left[1:, 2], wanted, atol=1e-12)
    assert not left[:, [0, 1, 3, 4, 5]].any()


def test_a_recording_that_begins_anew_forgets() -> None:
    log = random_log(40)
    assert log.time is not None
    twice = log_of(np.vstack([log.q_nominal] * 2), np.concatenate([log.time] * 2))
    for made in (relaxing(twice, np.array([3.0])), forgetting(twice, np.array([0.1]), 1.0)):
        np.testing.assert_array_equal(made[:40], made[40:])


def test_friction_that_forgets_by_travel_does_not_care_how_a_move_is_cut() -> None:
    corners = np.random.default_rng(1).uniform(-1.0, 1.0, (6, 6))
    fine = np.concatenate([a + (b - a) * np.linspace(0.1, 1.0, 10)[:, None] for a, b in pairwise(corners)])
    coarse = forgetting(log_of(corners), np.array([0.05, 0.4]), 1.0)
    cut = forgetting(log_of(np.vstack([corners[:1], fine])), np.array([0.05, 0.4]), 1.0)
    np.testing.assert_allclose(cut[::10], coarse, atol=1e-12)


def test_play_of_a_sum_is_that_of_a_joint_that_moves_so() -> None:
    log = random_log()
    seen = features(log, Candidate(combined=((0.0, 1.0, 1.0),)), 1.0)
    alone = log.q_nominal.copy()
    alone[:, 4] += alone[:, 5]  # what the sum is, as J5
    own = features(replace(log, q_nominal=alone), Candidate(), 1.0)
    played_by_joint = own[:, 6:].reshape(len(log), 6, -1)
    np.testing.assert_allclose(seen[:, -played_by_joint.shape[2] :], played_by_joint[:, 4], atol=1e-12)


def test_features_of_what_is_trained_on_do_not_depend_on_what_follows() -> None:
    log = random_log()
    later = log.q_nominal.copy()
    later[200:] *= 3.0
    before, after = (features(each, ALL, 200 / 300) for each in (log, replace(log, q_nominal=later)))
    np.testing.assert_array_equal(before[:200], after[:200])


def test_bounded_errors_keep_what_is_usual_and_bring_in_what_is_not() -> None:
    rng = np.random.default_rng(2)
    X = rng.normal(size=(500, 3))
    Y = X @ rng.normal(size=(3, 2)) + 0.01 * rng.normal(size=(500, 2))
    spoilt = Y.copy()
    spoilt[7] += 5.0
    told = bounded(X, spoilt, 1e-3)
    assert np.abs(told[7] - Y[7]).max() < 0.1  # three spreads of 0.01, and its own noise
    inside = np.abs(told - spoilt).max(axis=1) < 1e-12
    assert inside.mean() > 0.98  # a normal error exceeds three spreads once in 370
    assert not inside[7]
