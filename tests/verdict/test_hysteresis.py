"""Slack and hysteresis are told as wide as they were made."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.plant import MotionLog
from catenary.verdict.command_response import hysteresis_of
from hysteretic_arm import play
from tests.verdict.test_delay import cable_arm


@pytest.mark.parametrize("slack", [(0.0, 0.0, 0.0), (1.5, 0.8, 2.0), (8.0, 8.0, 8.0)])
def test_the_loop_of_a_play_is_twice_its_radius(slack: tuple[float, ...]) -> None:
    found = hysteresis_of(cable_arm(slack=slack))
    assert_allclose([each.loop for each in found], 2.0 * np.array(slack), atol=0.15)  # noise of 0.03
    for each, radius in zip(found, slack, strict=True):
        assert 1.2 * radius <= each.slack <= 3.0 * radius  # radii that are tried lie 1.5 apart, twice the radius


def triangles(turns: int, rows: int = 1200) -> MotionLog:
    """One joint to and fro between -20 and 20 deg."""
    phase = np.linspace(0.0, turns / 2.0, rows)
    q = np.deg2rad(20.0) * (1.0 - 4.0 * np.abs(phase % 1.0 - 0.5))[:, None]
    return MotionLog("saw", ("J1",), ("rad",), q, np.ones(rows, dtype=bool), q_encoder=q, time=np.arange(rows) / 30.0)


@pytest.mark.parametrize("turns", [4, 9, 20])
def test_reversals_are_counted_and_not_those_of_noise(turns: int) -> None:
    log = triangles(turns)
    shaken = log.q_nominal + np.deg2rad(0.3) * np.random.default_rng(0).normal(size=log.q_nominal.shape)
    assert [hysteresis_of(replace(log, q_nominal=q))[0].reversals for q in (log.q_nominal, shaken)] == [turns - 1] * 2


def test_a_joint_that_follows_at_once_has_a_loop_and_no_slack() -> None:
    log = triangles(9)
    seen = 0.7 * log.q_nominal + 0.3 * play(log.q_nominal[:, 0], np.deg2rad(5.0))[:, None]
    (found,) = hysteresis_of(replace(log, q_encoder=seen))
    assert found.loop == pytest.approx(3.0, abs=0.15)
    assert found.slack == 0.0


def test_what_is_not_measured_or_the_wrong_way_round_is_not_told() -> None:
    log = triangles(9)
    assert np.isnan(hysteresis_of(replace(log, q_encoder=None))[0].loop)
    assert np.isnan(hysteresis_of(replace(log, q_encoder=-log.q_nominal))[0].loop)


def test_no_loop_is_wider_than_the_errors() -> None:
    """A potentiometer in the place of the joint: what it shows of smooth motion is its own curve."""
    log = triangles(2, rows=600)
    q = log.q_nominal[:, 0]
    for seen in (
        q + 0.02 * np.sin(9.0 * q),
        q + 0.01 * np.sign(np.sin(40.0 * q)),
        q + 0.02 * np.linspace(0.0, 1.0, len(q)),
    ):
        (found,) = hysteresis_of(replace(log, q_encoder=seen[:, None]))
        assert not found.loop > np.rad2deg(np.ptp(seen - q)) + 1e-6
