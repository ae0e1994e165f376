"""Cables that run over another joint's drum, and their slack, found where they are and not where they are not."""

from dataclasses import replace

import numpy as np
import pytest

from catenary.calibration.cable_search import find_cables, play_states
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.recordings import Recordings
from catenary.plant import MotionLog
from hysteretic_arm import play
from recordings import recording

FACTOR, SLACK = 0.6, 0.013


def arm(factor: float, seed: int = 0) -> MotionLog:
    """J2 hangs on a cable that J1 moves too; all have noise."""
    rng = np.random.default_rng(seed)
    log = recording(rng, rows=3000, units=("rad", "rad"), error=np.zeros_like)
    path = log.q_nominal[:, 1] + factor * log.q_nominal[:, 0]
    error = 2e-4 * rng.normal(size=log.q_nominal.shape)
    error[:, 1] += play(path, SLACK) - path
    return replace(log, q_encoder=log.q_nominal + error)


def test_a_cable_over_another_joints_drum_is_found_with_its_slack() -> None:
    found = find_cables(Recordings.of([arm(FACTOR)]), FitOptions())
    ((name, position, other, factor),) = found.paths
    assert (position, other) == ("q:J2", "q:J1")
    assert factor == pytest.approx(FACTOR, abs=0.03)
    along = [width for followed, width in found.slacks if followed == name]
    assert min(abs(width / SLACK - 1.0) for width in along) < 0.1


def test_no_path_is_found_where_a_joint_moves_alone() -> None:
    found = find_cables(Recordings.of([arm(0.0)]), FitOptions())
    assert found.paths == ()
    assert min(abs(width / SLACK - 1.0) for name, width in found.slacks if name == "q:J2") < 0.1


def test_what_is_held_out_does_not_matter() -> None:
    log = arm(FACTOR)
    broken = np.array(log.q_encoder)
    broken[2400:] += 1.0
    first, second = (
        find_cables(Recordings.of([each]), FitOptions(), held_out=0.2) for each in (log, replace(log, q_encoder=broken))
    )
    assert first == second


def test_play_states_are_those_of_a_pushed_joint() -> None:
    path = np.cumsum(np.random.default_rng(0).normal(size=500))
    states = play_states(path, np.array([0.5, 2.0]))
    for k, width in enumerate((0.5, 2.0)):
        np.testing.assert_allclose(states[:, k], play(path, width) - path, atol=1e-12)
