"""Recordings made for tests, whose errors are known exactly, and models fitted to them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from catenary.calibration.dataset import CalibrationData, calibration_data
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.fit_rows import choose_inputs, fit_model
from catenary.calibration.model import CalibrationModel
from catenary.calibration.neural import PAPER
from catenary.calibration.recordings import Recordings
from catenary.plant import MotionLog
from catenary.transmission.cable_friction import coupled_friction

REACH = {"rad": 1.0, "m": 0.1}  # amplitude of the motion
STEP = 0.1  # [s] between rows
COMPLIANCE, THRESHOLDS = np.array([[1.4, -0.6], [-0.6, 0.95]]), np.array([0.07, 0.19])  # [rad] as on a da Vinci wrist


def recording(
    rng: np.random.Generator,
    rows: int = 300,
    units: Sequence[str] = ("rad", "rad", "m"),
    error: Callable[[np.ndarray], np.ndarray] | None = None,
    **changes: Any,
) -> MotionLog:
    """Joints J1, J2, ... on independent sinusoids; `error` of the commands (N, n), or small noise, is the truth."""
    time = STEP * np.arange(rows)
    reach = np.array([REACH[unit] for unit in units])
    rates, phases = rng.uniform(0.3, 2.0, size=len(units)), rng.uniform(0.0, 6.28, size=len(units))
    q = reach * np.sin(time[:, None] * rates + phases)
    e = 0.01 * reach * rng.normal(size=q.shape) if error is None else error(q)
    fields = {
        "name": "run",
        "joint_names": tuple(f"J{i + 1}" for i in range(len(units))),
        "joint_units": tuple(units),
        "q_nominal": q,
        "q_encoder": q + e,
        "ok": np.ones(rows, dtype=bool),
        "time": time,
    }
    return MotionLog(**(fields | changes))


def coupled_arm(seed: int = 0, rows: int = 1500, level: float = 1.0) -> MotionLog:
    """A stiff base, a roll with a little play and a wrist of which one joint drags the other."""
    rng = np.random.default_rng(seed)
    reach = np.array([0.3, 1.5, 1.2, 1.2])
    via = rng.uniform(-1.0, 1.0, (rows // 4 + 2, 4)) * reach
    q = np.column_stack([np.interp(np.arange(rows), 4 * np.arange(len(via)), column) for column in via.T])
    wrist = coupled_friction(COMPLIANCE, np.eye(2), [level * THRESHOLDS], [0.02, 0.02])
    error = 2e-3 * rng.normal(size=q.shape)
    error[:, 2:] += 0.9 * wrist.lag(q[:, 2:])[:, 0] + 0.01 * q[:, [1]]
    error += [0.01, 0.02, -0.1, 0.05]
    names = ("J1", "J4", "J5", "J6")
    return MotionLog("wrist", names, ("rad",) * 4, q, np.ones(rows, dtype=bool), q + error, np.arange(rows) * 0.4)


def data_of(*logs: MotionLog, **options: Any) -> CalibrationData:
    """Usable rows of recordings with the features that the options ask for, of a linear model where no kind is given."""
    return calibration_data(
        logs, choose_inputs(Recordings.of(logs), FitOptions(**{"kind": "linear"} | options)).features
    )


def fitted(*logs: MotionLog, **options: Any) -> CalibrationModel:
    """Model fitted to all usable rows of recordings, a linear one where no kind is given."""
    asked = FitOptions(**{"kind": "linear"} | options)
    inputs = choose_inputs(Recordings.of(logs), asked)
    return fit_model(calibration_data(logs, inputs.features), inputs, asked)


def short_training() -> Iterator[None]:
    """Train smaller networks, and not for long, where how well they learn is not asked: to be made a fixture."""
    paper = replace(PAPER, hidden=(20, 20), l2=1e-5, learning_rate=1e-2, epochs=60)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("catenary.calibration.neural.PAPER", paper)
        yield
