"""Learn from training recordings what a watch without encoders compares a robot with.

Torques: a polynomial of second order of the joints' positions and of one play state each, which tells on which side of
its friction a joint is; rate-independent, so that a law learnt at 30 Hz holds at 1 kHz. The recordings are cut into
windows of time; a window's mean of torque less prediction, by a polynomial fitted to other windows, spreads from window
to window, and a new window's mean lies within a prediction interval for one further value of a normal distribution
(Hahn and Meeker, Statistical Intervals, 1991, 4.7). Shares of rows outside the valid range are bounded likewise, by the
models of a cross-validation, and by no less than 3 / K, which K windows without any such row leave open.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.calibration.dataset import CalibrationData
from catenary.calibration.features import FeatureSet
from catenary.calibration.fit import EXTRAPOLATION, MEMORY_RIDGE
from catenary.calibration.kernels import Flags, run
from catenary.calibration.model import CalibrationModel
from catenary.calibration.predictors import Quadratic
from catenary.calibration.regression import fit_polynomial
from catenary.calibration.trained_day.day import TrainedDay, TrainedTorque, UsualBounds
from catenary.calibration.valid_range import fit_valid_range
from catenary.plant import MotionLog
from catenary.recording.raven_transmission import registrations

CHANCE = 1e-4  # that a quantity of one joint leaves its bounds in a window without drift
WINDOWS = 20  # that recordings are cut into
LONGEST_WINDOW, SHORTEST_WINDOW = 60.0, 2.0  # [s]
FEWEST_WINDOWS = 8
FOLDS = 5
MOST_ROWS = 20_000  # of a fit of torques: more of the same motion tell nothing new
PLAY = 0.02  # half-width of play states, as a share of a joint's range of motion
ANY = 1e300  # bound of a torque that a robot does not report


def learn_day(
    model: CalibrationModel,
    logs: Sequence[MotionLog],
    data: CalibrationData,
    inside: Flags | None,
) -> TrainedDay | None:
    """Return what the watch compares with; None of recordings without time, or shorter than it can tell apart.

    Args:
        model: Fitted to these recordings.
        logs: The recordings.
        data: Their rows that the model was fitted to.
        inside: (N, n) whether these rows are in the valid range of models of a cross-validation which did not see
            them; None without.
    """
    window = window_of(logs)
    if window is None:
        return None
    why: list[str] = []
    torque = _learn_torque(logs, window, why)
    outside = None
    if inside is None or len(inside) != len(data):
        why.append("valid range: no cross-validation said how often blocks of time leave each other's")
    else:
        block = _windows_of_rows(data.time, data.recording, window)
        outside = share_bounds(np.array([np.mean(~inside[block == k], axis=0) for k in np.unique(block)]))
        if (outside >= 1.0).all():
            outside = None
            why.append("valid range: blocks of the training recordings leave each other's too often to tell")
    homing = _learn_homing(model, logs, why)
    low, high = (
        f([f(log.q_nominal, axis=0) for log in logs], axis=0) for f in (np.minimum.reduce, np.maximum.reduce)
    )
    return TrainedDay(window, high - low, torque, outside, homing, tuple(why))


def on_new_day(model: CalibrationModel, logs: Sequence[MotionLog]) -> CalibrationModel:
    """Return a refreshed model whose watch compares with registrations and mean torques of the new day's recordings."""
    day = model.trained_day
    if day is None:
        return model
    why: list[str] = []
    homing = _learn_homing(model, logs, why)
    kept = [each for each in day.not_watched if not each.startswith("homing: ")]
    torque = day.torque
    if torque is not None and all(log.tau is not None for log in logs):
        n, moved = len(day.reach), []
        for log in logs:
            X = torque.features.matrix(log)
            known = np.ones(len(X), dtype=bool)
            run(torque.valid_range.steps(np.ascontiguousarray(X[:, :n]), known))
            moved.append((np.asarray(log.tau) - torque.predictor.predict(X))[known])
        left = np.concatenate(moved)
        if len(left):
            predictor = replace(torque.predictor, bias=torque.predictor.bias + left.mean(axis=0))
            torque = replace(torque, predictor=predictor)
    return replace(model, trained_day=replace(day, torque=torque, homing=homing, not_watched=(*kept, *why)))


def window_of(logs: Sequence[MotionLog]) -> float | None:
    """Return how long [s] the windows of recordings are; None where they have no time, or are too short."""
    if any(log.time is None for log in logs):
        return None
    length = sum(
        float(np.asarray(log.time)[last - 1] - np.asarray(log.time)[first])
        for log in logs
        for first, last in pairwise([*log.starts, len(log)])
    )
    window = min(length / WINDOWS, LONGEST_WINDOW)
    return window if window >= SHORTEST_WINDOW else None


def prediction_bounds(values: Floats) -> UsualBounds:
    """Return between which one further row of values (K, n) lies but for CHANCE, were they normal."""
    from scipy.stats import t

    K = len(values)
    spread = values.std(axis=0, ddof=1) * np.sqrt(1.0 + 1.0 / K) * t.ppf(1.0 - CHANCE / 2.0, K - 1)
    middle = values.mean(axis=0)
    return UsualBounds(middle - spread, middle + spread)


def share_bounds(shares: Floats) -> Floats:
    """Return the largest usual share (n,) of a further window, of those of K windows (K, n)."""
    if len(shares) < 2:
        return np.ones(shares.shape[1])
    upper: Floats = np.clip(prediction_bounds(shares).upper, 3.0 / len(shares), 1.0)
    return upper


def _windows_of_rows(time: Floats, recording: NDArray[np.int64], window: float) -> NDArray[np.int64]:
    """Return the window that each row lies in, (N,), numbered on from recording to recording, none empty."""
    block, next_one = np.zeros(len(time), dtype=np.int64), 0
    for part in np.split(np.arange(len(time)), np.flatnonzero(np.diff(recording)) + 1):
        block[part] = next_one + ((time[part] - time[part].min()) / window).astype(np.int64)
        next_one = int(block[part].max()) + 1
    return np.unique(block, return_inverse=True)[1]  # stamps far apart leave windows without rows


def _learn_torque(logs: Sequence[MotionLog], window: float, why: list[str]) -> TrainedTorque | None:
    if any(log.tau is None for log in logs) or all(
        not np.ptp(np.asarray(log.tau), axis=0).any() for log in logs
    ):
        why.append("torque: the training recordings hold none")
        return None
    first = logs[0]
    q, tau = (
        np.concatenate([log.q_nominal for log in logs]),
        np.concatenate([np.asarray(log.tau) for log in logs]),
    )
    time = np.concatenate([np.asarray(log.time) for log in logs])
    motion = np.cumsum(
        np.concatenate([np.isin(np.arange(len(log)), log.starts).astype(np.int64) for log in logs])
    )
    names = tuple(f"q:{name}" for name in first.joint_names)
    reach = np.ptp(q, axis=0)
    widths = tuple((name, PLAY * float(each)) for name, each in zip(names, reach, strict=True) if each > 0.0)
    features = FeatureSet(names, first.joint_units, play=widths)
    X = np.concatenate([features.matrix(log) for log in logs])
    block = _windows_of_rows(time, motion, window)
    counts = np.bincount(block)
    whole = np.flatnonzero(counts >= 0.5 * np.median(counts[counts > 0]))
    if len(whole) < FEWEST_WINDOWS:
        why.append(f"torque: {len(whole)} windows of {window:g} s are too few to tell how much it varies")
        return None
    thin = np.zeros(len(X), dtype=bool)
    thin[:: max(1, len(X) // MOST_ROWS)] = True
    fold = np.searchsorted(whole, block) * FOLDS // len(whole)
    left = []
    for k in range(FOLDS):
        seen, new = thin & (fold != k), whole[(np.arange(len(whole)) * FOLDS // len(whole)) == k]
        predictor = fit_polynomial(X[seen], tau[seen], ridge=MEMORY_RIDGE)
        for number in new:
            rows = block == number
            left.append(np.mean(tau[rows] - predictor.predict(X[rows]), axis=0))
    usual = prediction_bounds(np.array(left))
    silent = np.ptp(tau, axis=0) == 0.0
    for name in np.array(first.joint_names)[silent]:
        why.append(f"torque of {name}: the training recordings hold none")
    usual = UsualBounds(np.where(silent, -ANY, usual.lower), np.where(silent, ANY, usual.upper))
    final: Quadratic = fit_polynomial(X[thin], tau[thin], ridge=MEMORY_RIDGE)
    return TrainedTorque(features, final, fit_valid_range(q[thin], EXTRAPOLATION), usual)


def _learn_homing(model: CalibrationModel, logs: Sequence[MotionLog], why: list[str]) -> UsualBounds | None:
    found = [registrations(log) for log in logs]
    known = [shift for shift in found if shift is not None]
    if len(known) < len(found):
        why.append(
            "homing: the recordings hold no encoder offsets (catenary extract PROJECT --columns encoffsets keeps them)"
        )
        return None
    if model.intervals is None:
        why.append("homing: the model has no intervals to compare a shift with")
        return None
    shifts = np.concatenate(known)
    return UsualBounds(
        shifts.min(axis=0) - model.intervals.inside, shifts.max(axis=0) + model.intervals.inside
    )
