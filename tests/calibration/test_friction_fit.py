"""Friction that is found in recordings of simulated arms, whose law is known."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.calibration.cable_search import find_friction
from catenary.calibration.dataset import calibration_data
from catenary.calibration.evaluate import evaluate
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.recordings import Recordings
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.transmission.cable_friction import coupled_friction
from recordings import COMPLIANCE, THRESHOLDS, coupled_arm, fitted

OPTIONS = FitOptions()


@pytest.fixture(scope="module")
def log() -> MotionLog:
    return coupled_arm()


@pytest.fixture(scope="module")
def found(log):
    return find_friction(Recordings.of([log]), OPTIONS)


def test_the_coupled_pair_and_its_law_are_found(found) -> None:
    assert found.states.positions == ("q:J5", "q:J6")
    compliance = np.array(found.states.lever) @ np.linalg.inv(np.array(found.states.directions)).T
    # the readout has every scale; what is found is the springs' ratio and what the middle threshold is near
    assert_allclose(compliance / compliance[0, 0], COMPLIANCE / COMPLIANCE[0, 0], atol=0.12)
    lag_at_threshold = (
        compliance[0, 0] * np.array(found.states.directions)[0, 0] * np.array(found.states.thresholds)[3, 0]
    )
    assert 0.3 < lag_at_threshold / (COMPLIANCE[0, 0] * THRESHOLDS[0]) < 3.0
    assert found.gain > 0.3


def test_another_recording_of_the_arm_is_predicted_where_play_states_cannot(log, found) -> None:
    later, errors = coupled_arm(seed=1), {}
    for name, friction in (("play", None), ("friction", found)):
        model = fitted(log, kind="learned", friction=friction)
        errors[name] = [joint.rmse for joint in evaluate(model, calibration_data([later], model.features)).joints][2:]
    assert max(errors["friction"]) < 0.35  # [deg]; noise is 0.11
    assert min(errors["play"]) > 2.0 * max(errors["friction"])


def test_without_coupling_nothing_is_found() -> None:
    log = coupled_arm()
    alone = coupled_friction(np.eye(2), np.eye(2), [THRESHOLDS], [0.02, 0.02])
    q_encoder = np.array(log.q_encoder)
    q_encoder[:, 2:] = log.q_nominal[:, 2:] + alone.lag(log.q_nominal[:, 2:])[:, 0]
    q_encoder[:, 2:] += 2e-3 * np.random.default_rng(0).normal(size=(len(log), 2))
    assert find_friction(Recordings.of([replace(log, q_encoder=q_encoder)]), OPTIONS) is None


def test_joints_that_never_move_at_once_are_not_coupled() -> None:
    """Whatever one of them leaves behind, friction states of both would learn it, and mislead where both move."""
    log = coupled_arm()
    q = log.q_nominal.copy()
    part = np.arange(len(q)) // 100 % 2
    for k, j in enumerate((2, 3)):  # each stands while the other moves
        q[:, j] = q[0, j] + np.cumsum(np.where(part == k, np.diff(q[:, j], prepend=q[0, j]), 0.0))
    error = coupled_friction(COMPLIANCE, np.eye(2), [THRESHOLDS], [0.02, 0.02]).lag(q[:, 2:])[:, 0]
    q_encoder = np.array(log.q_encoder) - log.q_nominal + q
    q_encoder[:, 2:] = q[:, 2:] + error + 2e-3 * np.random.default_rng(0).normal(size=error.shape)
    found = find_friction(Recordings.of([replace(log, q_nominal=q, q_encoder=q_encoder)]), OPTIONS)
    assert found is None or found.states.positions != ("q:J5", "q:J6")


@pytest.mark.parametrize(
    ("coupled", "message"),
    [(("J5", "J9"), '"J9": no such joint'), (("J5",), "two or more"), (("J5", "J5"), "two or more")],
)
def test_joints_that_cannot_be_coupled_are_refused(log, coupled, message) -> None:
    with pytest.raises(InputError, match=message):
        find_friction(Recordings.of([log]), replace(OPTIONS, coupled=coupled))


def test_what_is_held_out_does_not_matter(log) -> None:
    broken = np.array(log.q_encoder)
    broken[1200:] += 1.0
    short = FitOptions(coupled=("J5", "J6"))
    first, second = (
        find_friction(Recordings.of([each]), short, held_out=0.2) for each in (log, replace(log, q_encoder=broken))
    )
    assert first == second
