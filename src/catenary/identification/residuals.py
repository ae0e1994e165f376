"""How far torques are from what a model says, per axis, and what that says about the model."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.identification.samples import Samples

Verdict = Literal["holds", "unclear", "drifted", "fails"]
HOLDS = 2.0  # times the training residual
FAILS = 0.9  # of the torque itself: hardly better than predicting nothing
SMALL = 0.1  # relative residuals below this are never called drift


@dataclass(frozen=True)
class LogResidual:
    """Residual of one recording: RMS(measured - predicted), and relative to RMS(measured)."""

    log: str
    rows: int
    rms: Floats  # (n,) [Nm or N]
    relative_rms: Floats  # (n,) NaN on an axis without torque
    relative_rms_period: Floats | None  # (n,) over the first period after the cut
    verdict: Verdict | None = None  # none is given on the recordings that were fitted
    reasons: tuple[str, ...] = ()  # why it is not "holds", for each axis that is not predicted


def residual(samples: Samples, predicted: Floats, period: int | None) -> LogResidual:
    """Compare a recording with predictions (N, n) of its torque, less what is known beforehand."""
    error = samples.tau - predicted
    return LogResidual(
        samples.name,
        len(samples),
        rms(error),
        relative(error, samples.tau),
        None if period is None else relative(error[:period], samples.tau[:period]),
    )


def unpredicted(test: LogResidual, training: Floats) -> NDArray[np.int64]:
    """Return the axes of a recording that are predicted clearly worse than those that were fitted.

    They have more than twice the training residual, and more than a tenth of their torque.

    Args:
        test: Residual on the recording.
        training: (n,) largest relative RMS on the recordings that were fitted.
    """
    with np.errstate(invalid="ignore"):
        worse = test.relative_rms > np.maximum(HOLDS * training, SMALL)
    return np.flatnonzero(worse)


def judge(test: LogResidual, axes: Collection[int], telling: Collection[int]) -> Verdict:
    """Return whether a model holds on a recording it did not see.

    holds: every axis is predicted. unclear: the axes that are not were moved too little, or where nothing was fitted.
    fails: an axis is hardly better than predicting no torque. drifted: otherwise, as when the arm or its load changed.

    Args:
        test: Residual on the recording.
        axes: Those that are not predicted.
        telling: Those of them whose motion can tell.
    """
    if not axes:
        return "holds"
    if not telling:
        return "unclear"
    return "fails" if any(test.relative_rms[i] > FAILS for i in telling) else "drifted"


def rms(values: Floats) -> Floats:
    """Return the RMS of each column."""
    result: Floats = np.sqrt(np.mean(values**2, axis=0))
    return result


def relative(error: Floats, of: Floats) -> Floats:
    """Return the RMS of each column over that of another; NaN where that is zero."""
    size = rms(of)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(size > 0.0, rms(error) / size, np.nan)
