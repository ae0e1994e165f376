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
from oracles.calibration_models import MIXED, PREDICTORS, log_of, random_model, ticked

TORQUES = 2


def drawn(kind: str, seed: int, **options: object) -> tuple[CalibrationModel, Floats]:
    """A random model, and signals on random walks that leave its valid range now and then."""
    rng = np.random.default_rng(seed)
    joints = int(rng.integers(TORQUES, 5))
    signals = np.cumsum(0.2 * rng.normal(size=(120, joints + TORQUES)), axis=0)
    model = random_model(kind, signals, rng, joints=joints, torques=TORQUES, **options)  # type: ignore[arg-type]
    return model, 1.1 * signals


def fitted(model: CalibrationModel, signals: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """What the model gives for a recording, and its flags."""
    log = log_of(model.joint_names, model.joint_units, signals, TORQUES)
    return model.calibrate(log), model.inside(model.features.matrix(log))


@pytest.mark.parametrize("kind", [*PREDICTORS, MIXED])
@settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(
    seed=st.integers(0, 10_000),
    plays=st.sampled_from([0, 0, 1, 3]),
    target=st.sampled_from(["error", "position"]),
    per_joint=st.booleans(),
)
def test_ticks_give_the_bits_of_the_fitted_model(kind, seed, plays, target, per_joint) -> None:
    model, signals = drawn(kind, seed, plays=plays, target=target, per_joint=per_joint)
    calibrated, flags = fitted(model, signals)
    out, inside = ticked(Corrector(model, rate_hz=30.0), signals[:, : len(model.joint_names)], signals)
    assert_array_equal(inside, flags)
    assert_array_equal(out, calibrated)


@pytest.mark.parametrize("kind", PREDICTORS)
def test_nan_gives_the_fixed_offset_and_no_flag(kind: str) -> None:
    model, signals = drawn(kind, 2, plays=1)
    n = len(model.joint_names)
    corrector = Corrector(model)
    whole, inside = ticked(corrector, signals[:, :n], signals)
    broken = signals.copy()
    broken[50, n] = np.nan  # a torque
    broken[60, 1] = np.inf  # a position among the inputs; the reported one is fine
    out, flags = ticked(corrector, signals[:, :n], broken)
    for row in (50, 60):
        assert not flags[row].any()
        assert_array_equal(out[row], signals[row, :n] + model.offset)
    sound = (np.arange(len(signals)) != 50) & (np.arange(len(signals)) < 60)  # later, a play state missed a push
    assert_array_equal(out[sound], whole[sound])
    assert_array_equal(flags[sound], inside[sound])
