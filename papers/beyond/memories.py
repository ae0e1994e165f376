"""Candidates for a longer memory of a wrist's cables: further features, and how what is trained on is weighed."""

from dataclasses import dataclass, replace
from itertools import product
from math import gcd

import numpy as np

from catenary import MotionLog
from catenary.arrays import Floats
from catenary.calibration.fit_options import PLAY_SHARES, FitOptions
from catenary.calibration.fit_rows import choose_inputs
from catenary.calibration.predictors import fit_linear

WRIST = (3, 4, 5)
# of J5 and J6, by which the cables of the two jaws move; that of the pitch moves with J5 alone
# [coupling matrix of the da Vinci Research Kit's PSM; Wang et al. 2019]
COUPLING = ((0.0, -0.8306, 1.2178), (0.0, 0.8306, 1.2178))
RELAXATION_TIMES = (1.0, 3.0, 10.0, 30.0, 100.0)  # [s]
BOUND = 3.0  # standard deviations, by the median
ROUNDS = 3  # of bounding errors and fitting again


def sums(largest: int, joints: tuple[int, ...]) -> tuple[tuple[float, ...], ...]:
    """Return whole-number weights (k, 3) on J4 to J6, of two joints or more, without common divisor or twin."""
    found = []
    for weights in product(range(-largest, largest + 1), repeat=len(joints)):
        moved = [weight for weight in weights if weight]
        if len(moved) > 1 and moved[0] > 0 and gcd(*weights) == 1:
            row = dict(zip(joints, map(float, weights), strict=True))
            found.append(tuple(row.get(joint, 0.0) for joint in WRIST))
    return tuple(found)


PITCH_AND_YAW = sums(2, (4, 5))
PAST_THE_ROLL = sums(1, WRIST)


@dataclass(frozen=True)
class Candidate:
    """What a model takes beside the inputs of the preset `best`, and how it is trained."""

    combined: tuple[tuple[float, ...], ...] = ()  # (k, 3) sums of J4 to J6 that play states follow as well
    relaxing: bool = False  # q less its low-passed self, by time
    forgetting: bool = False  # friction that forgets by the wrist's travel
    history: int = 0  # previous commands
    ridge: float = 10.0  # of the linear part
    bounded: bool = False  # errors beyond BOUND of a linear model's spread are brought to it
    late_twice: bool = False  # rows of the later half count twice


def features(log: MotionLog, candidate: Candidate, seen: float) -> Floats:
    """Return the features of every row (N, F), their widths chosen on the first share `seen` of the rows."""
    inputs = choose_inputs(
        [log], FitOptions(kind="neural", preset="best", history=candidate.history), held_out=1.0 - seen
    )
    parts = [inputs.features.matrix(log)]
    if candidate.combined:
        parts.append(_played(log, np.array(candidate.combined), seen))
    if candidate.relaxing:
        parts.append(relaxing(log, np.array(RELAXATION_TIMES)))
    if candidate.forgetting:
        parts.append(forgetting(log, np.array(PLAY_SHARES), seen))
    return np.hstack(parts)


def _played(log: MotionLog, weights: Floats, seen: float) -> Floats:
    """Return play states of sums of J4 to J6, as of a robot whose joints these sums are."""
    count = len(weights)
    robot = replace(
        log,
        joint_names=tuple(f"sum {k + 1}" for k in range(count)),
        joint_units=("rad",) * count,
        q_nominal=log.q_nominal[:, WRIST] @ weights.T,
        q_encoder=None,
        qd=None,
        tau=None,
    )
    taken = choose_inputs([robot], FitOptions(kind="linear", play=PLAY_SHARES), held_out=1.0 - seen).features
    return taken.matrix(robot)[:, taken.bounded]


def relaxing(log: MotionLog, times: Floats) -> Floats:
    """Return low-passed commands less the commands, (N, n x times): what is left of a move after some time.

    s <- s + (1 - exp(-dt / T)) (q' - s), with q' the command until now. Rows without time stamps count as 1 s.
    """
    q, starts = log.q_nominal, set(log.starts)
    steps = np.ones(len(q)) if log.time is None else np.r_[0.0, np.maximum(np.diff(log.time), 0.0)]
    left = np.zeros((len(q), q.shape[1], len(times)))
    state = np.zeros(left.shape[1:])
    for row in range(len(q)):
        if row in starts:
            state[:] = q[row, :, None]
        else:
            state += (1.0 - np.exp(-steps[row] / times)) * (q[row - 1, :, None] - state)
        left[row] = state - q[row, :, None]
    return left.reshape(len(q), -1)


def forgetting(log: MotionLog, shares: Floats, seen: float) -> Floats:
    """Return states of friction that forget by travel in place of turning points, (N, n x shares).

    z <- z exp(-a) + dq (1 - exp(-a)) / a, with a the travel of J4 to J6, each by its range, over a share of it.
    [Dahl 1968]
    """
    q, starts = log.q_nominal, set(log.starts)
    ranges = np.ptp(q[: max(1, round(seen * len(q)))], axis=0)
    moves = np.diff(q, axis=0, prepend=q[:1])
    travel = (np.abs(moves) / np.where(ranges > 0.0, ranges, np.inf))[:, WRIST].sum(axis=1)
    found = np.zeros((len(q), q.shape[1], len(shares)))
    for row in range(len(q)):
        if row in starts:
            continue  # nothing is known of what came before
        a = travel[row] / shares
        kept = np.where(a > 1e-9, -np.expm1(-a) / np.maximum(a, 1e-9), 1.0)
        found[row] = found[row - 1] * np.exp(-a) + moves[row, :, None] * kept
    return found.reshape(len(q), -1)


def bounded(X: Floats, Y: Floats, ridge: float) -> Floats:
    """Return Y with what lies beyond BOUND spreads of a linear model brought to that bound (Huber's loss)."""
    told = Y
    for _ in range(ROUNDS):
        middle = fit_linear(X, told, ridge=ridge).predict(X)
        rest = Y - middle
        spread = 1.4826 * np.median(np.abs(rest - np.median(rest, axis=0)), axis=0)
        told = middle + np.clip(rest, -BOUND * spread, BOUND * spread)
    return np.asarray(told)
