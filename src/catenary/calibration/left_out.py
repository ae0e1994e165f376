"""Rows that a fit left out though they were measured, and a model's error with them: who cleans data must say so."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.dataset import CalibrationData, calibration_data
from catenary.calibration.model import CalibrationModel
from catenary.plant import MotionLog
from catenary.recording.mend import left_out_rows
from catenary.units import DISPLAY
from catenary.verdict.finding import Finding

MORE = 2.0  # times their share of the rows, from which on rows left out carry more than their share of the error
WORSE = 1.05  # times the RMSE without them, that is worth a word


@dataclass(frozen=True)
class LeftOut:
    """What one joint's error is with the rows left out, which the model did not learn from; deg or mm."""

    joint: str
    unit: str
    rows: int  # left out for any joint: beyond the error limit, or as asked (--leave-out)
    beyond: int  # of them beyond the error limit on this joint
    share_of_rows: float
    share_of_error: float  # that they carry, of the squared error of all rows
    rmse_without: float
    rmse_with: float


def errors_with_left_out(
    model: CalibrationModel, logs: Sequence[MotionLog], data: CalibrationData, after: Floats | None = None
) -> tuple[LeftOut, ...]:
    """Return a model's error with and without measured rows left out; `after` (N, n) is of models that saw none."""
    asked = [left_out_rows(log) for log in logs]
    if not any(source.dropped for source in data.sources) and not any(each.any() for each in asked):
        return ()
    logs = [replace(log, ok=log.ok | each) for log, each in zip(logs, asked, strict=True)]
    everything = calibration_data(logs, model.features, every=data.every)
    kept = np.isin(everything.recording + everything.position, data.recording + data.position)
    gone = everything.rows(~kept)
    if not len(gone):
        return ()
    after = data.error - model.correction(data.X, data.q_nominal) if after is None else after
    squares = [np.square(each).sum(axis=0) for each in (after, gone.error - model.correction(gone.X, gone.q_nominal))]
    beyond = [sum(source.beyond.get(name, 0) for source in data.sources) for name in data.joint_names]
    total, (own, its) = len(after) + len(gone), squares
    scale = np.array([DISPLAY[unit][1] for unit in data.joint_units])
    rmse = [scale * np.sqrt(own / len(after)), scale * np.sqrt((own + its) / total)]
    numbers = np.array([its / np.maximum(own + its, 1e-300), *rmse]).T.tolist()
    return tuple(
        LeftOut(name, DISPLAY[unit][0], len(gone), beyond[j], len(gone) / total, *numbers[j])
        for j, (name, unit) in enumerate(zip(data.joint_names, data.joint_units, strict=True))
    )


def left_out_findings(found: Sequence[LeftOut]) -> list[Finding]:
    """Note joints on which the rows left out carry more than their share of the error."""
    return [
        Finding(
            "dropped",
            (each.joint,),
            f"the {each.rows} rows left out, {each.share_of_rows:.2%} of all, carry {each.share_of_error:.0%} of the "
            f"squared error: RMSE {each.rmse_with:.3g} {each.unit} with them, {each.rmse_without:.3g} without, which "
            "is what is printed",
            "measurement failures; or a true error that was cut away",
            refuses=False,
        )
        for each in found
        if each.share_of_error > MORE * each.share_of_rows and each.rmse_with > WORSE * each.rmse_without
    ]
