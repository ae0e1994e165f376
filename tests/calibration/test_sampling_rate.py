from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from catenary.calibration.dataset import calibration_data, sampling_rate
from catenary.calibration.files import load_model, save_model
from catenary.calibration.fit import FitOptions, choose_inputs, fit
from catenary.calibration.model import CalibrationModel
from catenary.plant import MotionLog


def moving(rate: float | None, rows: int = 60) -> MotionLog:
    """One joint on a sinusoid, with noise for an error."""
    rng = np.random.default_rng(0)
    q = np.sin(0.2 * np.arange(rows))[:, None]
    return MotionLog(
        name="run",
        joint_names=("J1",),
        joint_units=("rad",),
        q_nominal=q,
        ok=np.ones(rows, dtype=bool),
        q_encoder=q + 0.01 * rng.normal(size=q.shape),
        time=None if rate is None else np.arange(rows) / rate,
    )


def fitted(*logs: MotionLog) -> CalibrationModel:
    options = FitOptions(history=2)
    inputs = choose_inputs(logs, options)
    return fit(calibration_data(logs, inputs.features), inputs, options)


def test_rate_is_that_of_most_steps() -> None:
    log = moving(30.0)
    assert log.time is not None
    time = log.time.copy()
    time[20:] += 7.0  # a pause
    time[40:] -= 9.0  # another recording begins
    assert sampling_rate(replace(log, time=time)) == pytest.approx(30.0)


def test_recordings_without_time_have_no_rate() -> None:
    assert fitted(moving(None)).rate_hz is None
    assert fitted(moving(30.0), moving(None)).rate_hz is None


def test_recordings_of_two_rates_have_no_common_one() -> None:
    assert fitted(moving(30.0), moving(30.3)).rate_hz == pytest.approx(30.15)
    assert fitted(moving(30.0), moving(50.0)).rate_hz is None


@pytest.mark.parametrize("rate", [None, 30.0])
def test_rate_is_kept_in_the_model_file(rate: float | None, tmp_path: Path) -> None:
    model = fitted(moving(rate))
    save_model(model, {}, tmp_path / "arm.npz")
    assert load_model(tmp_path / "arm.npz")[0].rate_hz == model.rate_hz
