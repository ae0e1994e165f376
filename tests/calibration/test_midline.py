"""The midline of a torque, against a cable whose load and friction are known."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.calibration.dataset import calibration_data
from catenary.calibration.evaluate import evaluate
from catenary.calibration.features import FeatureSet
from catenary.plant import MotionLog
from hysteretic_arm import play
from recordings import fitted

FEATURES = FeatureSet(("q:J1", "tau:J1"), ("rad", "Nm"), midlines=(("tau:J1", "q:J1", 0.05, 0.7),))


def tool(load: float, seed: int = 0, rows: int = 1500, hz: float = 100.0, friction: float = 0.2) -> MotionLog:
    """A driven joint: its cable stretches by the load, lags by play, and friction adds to what the motor needs."""
    rng, t = np.random.default_rng(seed), np.arange(rows) / hz
    q = 0.5 * np.sin(2 * np.pi * 0.3 * t) + 0.02 * np.sin(2 * np.pi * 0.071 * t)
    tau = load + friction * np.sign(np.gradient(q)) + 0.01 * rng.normal(size=rows)
    error = -0.3 * load + play(q, 0.02) - q + 1e-3 * rng.normal(size=rows)
    return MotionLog(
        "tool", ("J1",), ("rad",), q[:, None], np.ones(rows, dtype=bool), (q + error)[:, None], t, tau=tau[:, None]
    )


def midline(log: MotionLog) -> np.ndarray:
    return FEATURES.matrix(log)[:, -1]


@pytest.mark.parametrize("load", [0.0, 0.3, -1.2])
def test_the_midline_is_the_load_whatever_the_friction(load: float) -> None:
    found = midline(tool(load))
    known = np.isfinite(found)
    assert known.mean() > 0.7
    assert not known[:100].any()  # both directions must have been seen
    assert_allclose(found[known], load, atol=0.01)  # noise of the torque


def test_a_constant_torque_is_its_midline_exactly_and_time_does_not_count() -> None:
    log = replace(tool(0.0), tau=np.full((1500, 1), 0.7))
    assert_array_equal(midline(log)[600:], 0.7)
    waiting = np.repeat(np.arange(1500), 3)
    arrays: dict[str, Any] = {
        name: getattr(tool(0.4), name)[waiting] for name in ("q_nominal", "q_encoder", "ok", "tau")
    }
    slow = replace(tool(0.4), **arrays, time=np.arange(4500.0))
    assert_allclose(midline(slow)[::3], midline(tool(0.4)), atol=1e-12)


def test_what_is_not_finite_or_leaps_changes_nothing() -> None:
    log, features = tool(0.3), replace(FEATURES, steps=(("q:J1", 0.1),))
    leapt, q = features.rows(log).X[:, -1], np.array(log.q_nominal)
    q[700] += 3.0
    found = features.rows(replace(log, q_nominal=q)).X[:, -1]
    assert_allclose(found[702:], leapt[702:], atol=2e-3)  # one row did not count


def test_a_load_that_changes_is_told_from_friction_by_the_model() -> None:
    loads, seen = (0.1, 0.4, 0.8, 1.2), {}
    logs = [tool(load, seed) for seed, load in enumerate(loads)]
    for kind in ("linear", "hysteretic"):
        model = fitted(*logs, kind=kind)
        later = calibration_data([tool(0.6, 9)], model.features)
        seen[kind] = evaluate(model, later.rows(later.complete)).joints[0].rmse
    assert seen["hysteretic"] < 0.2  # [deg]; noise is 0.06
    assert seen["linear"] > 3.0 * seen["hysteretic"]
