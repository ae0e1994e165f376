"""How far torques are from what a model says, per axis, and what that says about the model.

A joint that hardly moves, or moves where it was not identified, tells nothing of whether the arm has changed. What has
changed of one that does is found by explanations/, which weigh the recording against the arm as it was identified.
"""

from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np

from catenary.arrays import Floats, Listed
from catenary.config import IN_FILES
from catenary.identification.samples import Samples
from catenary.robots.model import RobotModel

Axes = Annotated[Floats, Listed(null=np.nan)]
Verdict = Literal["holds", "unclear", "drifted", "fails"]
_HOLDS_RATIO = 2.0  # times the training residual
_FAILS_SHARE = 0.9  # of the torque itself: hardly better than predicting nothing
_SMALL_RESIDUAL = 0.1  # relative residuals below this are never called drift


@dataclass(frozen=True)
class LogResidual:
    """Residual of one recording: RMS(measured - predicted), and relative to RMS(measured)."""

    __pydantic_config__ = IN_FILES

    log: str
    rows: int
    relative_rms: Axes  # (n,) NaN on an axis without torque
    rms: Axes  # (n,) [Nm or N]
    verdict: Verdict | None = None  # none is given on the recordings that were fitted
    reasons: tuple[str, ...] = ()  # why it is not "holds", for each axis that is not predicted


def residual(samples: Samples, predicted: Floats) -> LogResidual:
    """Compare a recording with predictions (N, n) of its torque, less what is known beforehand."""
    left, size = rms(samples.tau - predicted), rms(samples.tau)
    with np.errstate(invalid="ignore", divide="ignore"):
        return LogResidual(samples.name, len(samples), np.where(size > 0.0, left / size, np.nan), left)


def residual_verdict(
    model: RobotModel, samples: Samples, predicted: Floats, training: Floats, seen: "MovedRange | None"
) -> LogResidual:
    """Return the residual of a recording that was not fitted, with a verdict on the model and its reasons.

    An axis is not predicted if its relative RMS is more than twice the largest of the training, and more than a
    tenth of its torque. "holds": all are predicted. "unclear": those that are not moved too little, or where nothing
    was fitted; or a joint moves that stood still in training. "fails": one is hardly better than predicting no torque.
    "drifted": otherwise.

    Args:
        predicted: Predicted torques (N, n) [Nm or N].
        training: Largest relative RMS of each axis in training (n,).
        seen: Range that each joint moved over in training; unknown when None.
    """
    of_log, left = residual(samples, predicted), samples.tau - predicted
    with np.errstate(invalid="ignore"):
        axes = np.flatnonzero(of_log.relative_rms > np.maximum(_HOLDS_RATIO * training, _SMALL_RESIDUAL)).tolist()
    unseen = [] if seen is None else _unseen(model, samples, seen)
    moved = {i: "" if seen is None else _motion_reason(model, i, samples, left[:, i], seen) for i in axes}
    telling = [i for i in axes if not moved[i]]  # where it moved enough, and where it was fitted
    texts = [
        why or f"{of_log.relative_rms[i]:.2g} of the torque of {model.joint_names[i]} is left"
        for i, why in moved.items()
    ]
    verdict: Verdict = "unclear" if unseen or texts else "holds"
    if telling and not unseen:
        verdict = "fails" if any(of_log.relative_rms[i] > _FAILS_SHARE for i in telling) else "drifted"
    return replace(of_log, verdict=verdict, reasons=(*unseen, *texts))


def rms(values: Floats) -> Floats:
    """Return the RMS of each column."""
    return np.sqrt(np.mean(values**2, axis=0))


_LITTLE_MOTION_SHARE = 0.1  # of the speed, or of the travel, that it was identified with
_STILL_TRAVEL = {"rad": 0.05, "m": 0.005}  # [rad, m] that a joint which moves does at least
_STILL_SHARE = 0.1  # of a usual range, that this is
_BEYOND_TRAVEL_SHARE = 0.1  # of that travel, outside of which a joint was not identified
_OUTSIDE_SHARE = 0.5  # of the squared residual on rows outside it


@dataclass(frozen=True, eq=False)
class MovedRange:
    """Range of positions and RMS speed of recordings, per joint (n,)."""

    __pydantic_config__ = IN_FILES

    low: Annotated[Floats, Listed()]
    high: Annotated[Floats, Listed()]
    speed: Annotated[Floats, Listed()]


def _unseen(model: RobotModel, samples: Samples, seen: MovedRange) -> list[str]:
    """Return the joints of a recording that move, and were still where the arm was identified, as reasons."""
    travel, was = np.ptp(samples.q, axis=0), seen.high - seen.low
    least = np.array([_STILL_TRAVEL[unit] for unit in model.joint_units])
    moves = np.flatnonzero((travel > least) & (was < _LITTLE_MOTION_SHARE * np.minimum(travel, least / _STILL_SHARE)))
    return [f"joint {model.joint_names[i]} was still in training, and moves here: unseen" for i in moves]


def _motion_reason(model: RobotModel, axis: int, samples: Samples, left: Floats, seen: MovedRange) -> str:
    """Return why an axis's motion tells nothing: too little, or elsewhere than fitted; empty if it tells."""
    q, name, unit = samples.q[:, axis], model.joint_names[axis], model.joint_units[axis]
    travel = float(seen.high[axis] - seen.low[axis])
    speed = float(np.sqrt(np.mean(samples.qd[:, axis] ** 2)))
    if seen.speed[axis] > 0.0 and (
        speed < _LITTLE_MOTION_SHARE * seen.speed[axis] or np.ptp(q) < _LITTLE_MOTION_SHARE * travel
    ):
        return (
            f"too little motion in joint {name}: {np.ptp(q):.2g} {unit} at {speed:.2g} {unit}/s, identified over "
            f"{travel:.2g} at {seen.speed[axis]:.2g}"
        )
    outside = (q < seen.low[axis] - _BEYOND_TRAVEL_SHARE * travel) | (
        q > seen.high[axis] + _BEYOND_TRAVEL_SHARE * travel
    )
    if left[outside] @ left[outside] > _OUTSIDE_SHARE * (left @ left):
        return (
            f"joint {name} moves from {q.min():.3g} to {q.max():.3g} {unit}, and was identified from "
            f"{seen.low[axis]:.3g} to {seen.high[axis]:.3g}"
        )
    return ""
