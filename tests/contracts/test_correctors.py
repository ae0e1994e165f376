"""What every deployed model must do, whatever its kind: give what the fitted model gives."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.calibration.corrector import Corrector
from catenary.calibration.model import CalibrationModel
from oracles.calibration_models import MIXED, PREDICTORS, log_of, random_model

TORQUES = 2


def drawn(kind: str, seed: int, **options: object) -> tuple[CalibrationModel, Floats]:
    """A random model, and signals on random walks that leave its valid range now and then."""
    rng = np.random.default_rng(seed)
    joints = int(rng.integers(TORQUES, 5))
    signals = np.cumsum(0.2 * rng.normal(size=(120, joints + TORQUES)), axis=0)
    model = random_model(kind, signals, rng, joints=joints, torques=TORQUES, rate_hz=30.0, **options)  # type: ignore[arg-type]
    return model, 1.1 * signals


def fitted(model: CalibrationModel, signals: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """What the model gives for a recording, and its flags."""
    log = log_of(model.joint_names, model.joint_units, signals, TORQUES)
    return model.calibrate(log), model.inside(model.features.matrix(log))


@pytest.mark.parametrize("kind", [*PREDICTORS, MIXED])
@settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(
    seed=st.integers(0, 10_000),
    history=st.sampled_from([0, 0, 1, 4]),
    plays=st.sampled_from([0, 0, 1, 3]),
    target=st.sampled_from(["error", "position"]),
    per_joint=st.booleans(),
)
def test_run_gives_the_bits_of_the_fitted_model(kind, seed, history, plays, target, per_joint) -> None:
    model, signals = drawn(kind, seed, history=history, plays=plays, target=target, per_joint=per_joint)
    calibrated, flags = fitted(model, signals)
    out, inside = Corrector(model, rate_hz=30.0).run(signals[:, : len(model.joint_names)], signals)
    assert_array_equal(inside, flags)
    assert_array_equal(out, calibrated)


@pytest.mark.parametrize("kind", [*PREDICTORS, MIXED])
def test_ticks_give_the_bits_of_a_run(kind: str) -> None:
    model, signals = drawn(kind, 1, history=3, plays=2)
    n = len(model.joint_names)
    corrector = Corrector(model, rate_hz=30.0)
    calibrated, flags = corrector.run(signals[:, :n], signals)
    corrector.reset()
    out, inside = np.empty(n), np.empty(n, dtype=bool)
    for k in range(len(signals)):
        corrector.correct(signals[k, :n].copy(), signals[k], out, inside)
        assert_array_equal(out, calibrated[k])
        assert_array_equal(inside, flags[k])


@pytest.mark.parametrize("kind", PREDICTORS)
def test_nan_gives_the_fixed_offset_and_no_flag(kind: str) -> None:
    model, signals = drawn(kind, 2, plays=1)
    n = len(model.joint_names)
    corrector = Corrector(model)
    whole, inside = corrector.run(signals[:, :n], signals)
    broken = signals.copy()
    broken[50, n] = np.nan  # a torque
    broken[60, 1] = np.inf  # a position among the inputs; the reported one is fine
    out, flags = corrector.run(signals[:, :n], broken)
    for row in (50, 60):
        assert not flags[row].any()
        assert_array_equal(out[row], signals[row, :n] + model.offset)
    sound = (np.arange(len(signals)) != 50) & (np.arange(len(signals)) < 60)  # later, a play state missed a push
    assert_array_equal(out[sound], whole[sound])
    assert_array_equal(flags[sound], inside[sound])


@pytest.mark.parametrize("kind", [*PREDICTORS, MIXED])
def test_until_history_is_there_the_fixed_offset_is_used(kind: str) -> None:
    model, signals = drawn(kind, 3, history=3)
    n = len(model.joint_names)
    still = np.tile(np.median(signals, axis=0), (60, 1))
    out, inside = Corrector(model, rate_hz=300.0).run(still[:, :n], still)
    assert not inside[:30].any()  # three positions, ten ticks apart
    assert_array_equal(out[:30], still[:30, :n] + model.offset)
    assert inside[30:].all()
