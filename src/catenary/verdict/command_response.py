"""Trusted rows of a recording, how each measured joint goes with each command; slack and hysteresis of joints.

A smooth function of all commands and play states of the joint's own explain a measurement [Prandtl-Ishlinskii]: one of
radius r and weight w makes a loop 2 r w wide, and lets the joint follow from 2 r behind a reversal.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from catenary.arrays import Flags, Floats, Integers, spread
from catenary.kernels.compiled import compiled
from catenary.plant import MotionLog
from catenary.units import DISPLAY

OUTLIER_SIGMAS = 10.0  # robust standard deviations beyond which a measurement is suspected
_REVERSAL_SHARE = 0.05  # share of a joint's range that it must go back by for a reversal to count
# of long recordings: how many, and rows and seconds of each at least
_STRETCHES, _STRETCH_ROWS, _STRETCH_S = 8, 2000, 60.0
MOVED_DEG_MM = 1.0  # [deg, mm] least range of a joint that counts as moved: below it, encoders and cameras see noise

# a wrist's cables couple its joints: on a real arm, moving one alone turns the other by 16 deg
MOVED_BY_OTHERS_DEG_MM = {"rad": 20.0, "m": 10.0}  # [deg, mm] largest motion of a joint by other joints' commands
# Of a joint that others pull: its command's range in such motions, the unexplained share of variance, the slope, where
# it follows no command by such a correlation and slope near one. Untouched windows of 75 poses: 1.5, .056, -.21.
_PULLED_RATIO, _MAX_PULLED_UNEXPLAINED, _MIN_PULLED_SLOPE = 2.0, 0.1, -0.25
_FOLLOWING, _WHOLE_WITHIN = 0.95, 0.15


def scales(log: MotionLog) -> Floats:
    """Return the factors of joint positions to deg and mm, (n,)."""
    return np.array([DISPLAY[unit][1] for unit in log.joint_units])


def outliers(errors: Floats) -> tuple[Integers, Floats]:
    """Return the number of N errors (N, n) beyond OUTLIER_SIGMAS robust standard deviations, and these, (n,)."""
    count, spread = np.zeros(errors.shape[1], dtype=np.int64), np.zeros(errors.shape[1])
    for j, column in enumerate(errors.T):  # one at a time: of a long recording each is large
        deviation = np.abs(column - np.median(column))
        spread[j] = 1.4826 * np.median(deviation)  # the standard deviation, if errors were normal
        count[j] = (deviation > OUTLIER_SIGMAS * max(spread[j], 1e-9)).sum()
    return count, spread


def slack_of(command: Floats, measured: Floats) -> float:
    """Return the spread of errors on rows where the measurement moves; of nearly all, as some are wild."""
    moving = np.diff(measured, prepend=measured[:1]) != 0.0
    return float(np.ptp(np.percentile((measured - command)[moving], [1.0, 99.0]))) if moving.any() else 0.0


@compiled
def play(command: Floats, radius: float) -> Floats:
    """Return the position (N,) of a joint whose motor moves freely within a play.

    Args:
        command, radius: Positions of the motor (N,), and half-width of the play.
    """
    joint = command.copy()
    for row in range(1, len(joint)):
        joint[row] = min(max(joint[row - 1], command[row] - radius), command[row] + radius)
    return joint


@dataclass(frozen=True)
class Pairs:
    """Commands and measurements of trusted rows, in deg and mm; correlations and slopes leave single outliers out."""

    log: MotionLog
    q: Floats  # (N, n) commands
    m: Floats  # (N, n) measurements
    likely: Flags  # (N, n) no outlier
    correlation: Floats  # (n, n) of measurement i with command j; zero where either stands still
    slope: Floats  # (n, n) of measurement i on command j; zero where either stands still
    moved: Flags  # (n,) joints whose command moved
    seen_moving: Flags  # (n,) joints whose measurement moved

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the joints."""
        return self.log.joint_names

    def unit(self, joint: int) -> str:
        """Return the unit that a joint is shown in."""
        return DISPLAY[self.log.joint_units[joint]][0]


_SLACK_SHARES = (0.0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4)  # radii of play, as shares of a joint's range
_OTHERS_SHARES, _ROWS_A_COLUMN = (0.1, 0.3), 5  # the same of other joints; rows that a column needs


class BehindSlack(NamedTuple):
    """How a joint moves for its command once slack is taken up and the other joints' pull is counted."""

    slope: float
    unexplained: float  # share of the measurement's variance that this leaves
    of_cables: float  # the same of the best slope that cables allow


def behind_slack(pairs: Pairs, i: int, own: int, allowed: tuple[float, float], *, shared: bool = True) -> BehindSlack:
    """Explain measurement i by play of its command, of any radius, other commands, and their plays if `shared`.

    Slopes `allowed` compete with all others: what these explain hardly better needs no wrong scale.
    """
    scale = scales(pairs.log)
    q = scale * pairs.log.q_nominal
    rows = np.flatnonzero(pairs.log.ok)[pairs.likely[:, i]]
    y = pairs.m[pairs.likely[:, i], i]
    y = y - y.mean()
    size = max(float(y @ y), 1e-12)
    command, moved = np.ascontiguousarray(q[:, own]), [k for k in np.flatnonzero(pairs.moved) if k != own]
    columns = [q[:, k] for k in moved]
    if shared and len(rows) >= _ROWS_A_COLUMN * len(moved) * (1 + len(_OTHERS_SHARES)):  # friction that joints share
        columns += [
            play(np.ascontiguousarray(x), share * float(np.ptp(x))) for x in columns for share in _OTHERS_SHARES
        ]
    others = np.array(columns).reshape(len(columns), len(q)).T[rows]
    onto = np.linalg.qr(others - others.mean(axis=0))[0]
    y = y - onto @ (onto.T @ y)
    best, best_left, of_cables = 0.0, float(y @ y) / size, np.inf
    for share in _SLACK_SHARES:
        x = play(command, share * float(np.ptp(command)))[rows]
        x = x - x.mean()
        x = x - onto @ (onto.T @ x)
        slope = float(x @ y) / max(float(x @ x), 1e-12)
        near = float(np.copysign(np.clip(abs(slope), *allowed), slope))  # the nearest that is allowed
        left, left_near = (float(np.square(y - ratio * x).sum()) / size for ratio in (slope, near))
        of_cables = min(of_cables, left_near)
        if left < best_left:
            best, best_left = slope, left
    return BehindSlack(best, best_left, of_cables)


def is_pulled(pairs: Pairs, i: int, own: int) -> bool:
    """Attribute a joint's motion to other joints' friction, where its command moves so little that they explain it.

    Args:
        i, own: The measurement's place and its command's.
    """
    little = _PULLED_RATIO * MOVED_BY_OTHERS_DEG_MM[pairs.log.joint_units[i]]
    follows = np.abs(pairs.correlation[i]) > _FOLLOWING
    whole = np.abs(np.abs(pairs.slope[i]) - 1.0) < _WHOLE_WITHIN  # as far as a command: another joint's column
    if np.ptp(pairs.q[:, own]) > little or follows[own] or np.any(follows & whole):
        return False
    moves = behind_slack(pairs, i, own, (0.0, np.inf), shared=False)
    return moves.unexplained < _MAX_PULLED_UNEXPLAINED and moves.slope > _MIN_PULLED_SLOPE


def pairs_of(log: MotionLog) -> Pairs | None:
    """Pair commands and measurements; None of a recording with fewer than three rows of both."""
    if log.q_encoder is None or log.ok.sum() < 3:
        return None
    scale = scales(log)
    q, m = scale * log.q_nominal[log.ok], scale * log.q_encoder[log.ok]
    likely, errors = np.empty(q.shape, dtype=bool), m - q
    for j, (column, deviation) in enumerate(zip(errors.T, outliers(errors)[1], strict=True)):
        likely[:, j] = np.abs(column - np.median(column)) <= OUTLIER_SIGMAS * max(deviation, MOVED_DEG_MM)
    del errors
    moved = np.ptp(q, axis=0) > MOVED_DEG_MM
    n = len(scale)
    correlation, slope, seen_moving = np.zeros((n, n)), np.zeros((n, n)), np.zeros(n, dtype=bool)
    for i in range(n):
        rows = likely[:, i]
        measured, size, product = m[rows, i] - m[rows, i].mean(), np.zeros(n), np.zeros(n)
        for j in range(n):
            command = q[rows, j] - q[rows, j].mean()
            size[j], product[j] = np.linalg.norm(command), command @ measured
        own = float(np.linalg.norm(measured))
        seen_moving[i] = np.ptp(m[rows, i]) > MOVED_DEG_MM * 1e-3 if rows.any() else False
        both = moved & (size > 0.0) & (own > 0.0)
        correlation[i, both] = product[both] / size[both] / own
        slope[i, both] = product[both] / size[both] ** 2
    return Pairs(log, q, m, likely, correlation, slope, moved, seen_moving)


def in_stretches(rows: Integers, count: int, command: Floats, time: Floats | None, parts: int = _STRETCHES) -> Integers:
    """Return `count` usable rows of N, rising: of each part of a long recording where its `command` (N,) moves most.

    A joint's zero wanders over hours, which looks like what a delay leaves; within minutes it stays. `time` (N,) [s].
    """
    step = 0.0 if time is None else float(np.median(np.diff(time)))
    long = max(_STRETCH_ROWS, round(_STRETCH_S / max(step, 1e-4)) if step > 0.0 else 0)
    if len(rows) > parts * long:
        moves = np.abs(np.diff(command[rows], prepend=command[rows[:1]]))
        way = np.r_[0.0, np.cumsum(np.minimum(moves, np.percentile(moves, 99.0)))]  # single leaps are no motion
        edges = pairwise(np.arange(parts + 1) * len(rows) // parts)
        begins = [a + int(np.argmax(way[a + long : b + 1] - way[a : b + 1 - long])) for a, b in edges]
        rows = np.concatenate([rows[first : first + long] for first in begins])
    return rows[spread(len(rows), count)]


def speeds_of(log: MotionLog) -> Floats:
    """Return speeds between neighbouring rows (M, n) [rad/s|m/s], or per row without stamps."""
    moved = np.abs(np.diff(log.q_nominal, axis=0))
    if log.time is None:
        return moved
    steps = np.diff(log.time)
    step = float(np.median(steps))
    near = np.abs(steps - step) < 0.5 * step
    return np.asarray(moved[near] / steps[near, None])


def evenness(speeds: Floats) -> tuple[float, bool]:
    """Return the share of a joint's mean square speed that goes with the direction, and whether it has one speed."""
    moving = speeds[speeds > STANDING_SHARE * np.sqrt(np.mean(speeds**2))]
    if not len(moving):
        return 0.0, False
    usual = np.median(moving)
    along = min(float(np.mean(moving)) ** 2 / float(np.mean(moving**2)), 1.0 - 1e-9)
    return along, bool(along > _EVEN or np.mean(np.abs(moving - usual) < _EVEN_WITHIN * usual) > _EVEN_SHARE)


def reversals_of(command: Floats) -> int:
    """Return the number of reversals of a command (N,), by _REVERSAL_SHARE of its range or more."""
    way = np.sign(np.diff(play(np.ascontiguousarray(command), _REVERSAL_SHARE / 2.0 * float(np.ptp(command)))))
    return int((np.diff(way[way != 0.0]) != 0.0).sum())


STANDING_SHARE = 0.1  # share of a joint's RMS speed below which it stands still
# speed is constant if its squared mean is nearly its mean square (.98 on zig-zags, .5 to .94 on random motion), or if
# it is within a tenth of its median on most rows (.75 of a zig-zag with 30 s of random motion, .1 of random motion)
_EVEN, _EVEN_WITHIN, _EVEN_SHARE = 0.95, 0.1, 0.5
# radii of plays, as shares of a joint's range: few where they are tried again and again, as for each delay
PLAY_RADII = (0.003, 0.01, 0.03, 0.08, 0.11, 0.14, 0.17, 0.2)
FINE_RADII = (0.001, 0.002, 0.004, 0.007, 0.012, 0.02, 0.03, 0.045, 0.07, 0.1, 0.15, 0.2)
_ROUNDING_DEG_MM, _WIDER_RATIO = 1e-6, 1.5
_FOLLOWS_SHARE = 0.5  # share of a joint's full motion from which it counts as following its command
TRIM_SIGMAS = 6.0  # robust deviations of what is unexplained, beyond which rows are left out
MAX_EXPLAINED_ROWS, MIN_EXPLAINED_ROWS = 1000, 80


class Explanation:
    """Columns that explain one joint's measurement, at rows as they are asked for: few of a long recording are."""

    def __init__(
        self, q: Floats, own: int, moved: Sequence[int], rows: int, radii: Sequence[float] = PLAY_RADII,
        stretches: Sequence[tuple[int, int]] | None = None,
    ) -> None:  # fmt: skip
        """Take commands (N, n), those `moved` in units of their ranges, and plays of `radii` in that of its own.

        Plays of rows that lie in none of the `stretches`, from first to last rows, are forgotten.
        """
        self._q, self._moved, self._own, self._most = q, list(moved), own, rows // 15 - 10
        self._mean, self._range = q.mean(axis=0), np.ptp(q, axis=0)
        z, kept = self._scaled(own, slice(None)), np.zeros(len(q), dtype=bool)
        for first, last in [(0, len(q) - 1)] if stretches is None else stretches:
            kept[first : last + 1] = True
        self._plays = np.empty((int(kept.sum()), len(radii)), dtype=np.float32)
        self._place = np.cumsum(kept, dtype=np.int32) - np.int32(1)  # of each row's plays
        for k, radius in enumerate(radii):
            self._plays[:, k] = play(z, radius)[kept]

    def _scaled(self, k: int, rows: Integers | slice) -> Floats:
        scaled: Floats = (self._q[rows, k] - self._mean[k]) / self._range[k]
        return scaled

    def at(self, rows: Integers) -> Floats:
        """Return columns of any weight, then play states, at some rows (len(rows), p)."""
        moved, own = self._moved, self._own
        z = {k: self._scaled(k, rows) for k in moved}
        free = [z[k] for k in moved] + [z[own] ** 2, z[own] ** 3]
        more = [z[a] * z[b] for a in moved for b in moved if a <= b and (a, b) != (own, own)]
        if len(moved) <= 4:
            cubes = ((a, b, c) for a in moved for b in moved for c in moved if a <= b <= c and (a, c) != (own, own))
            more += [z[a] * z[b] * z[c] for a, b, c in cubes]
        return np.column_stack([*free, *more[: max(0, self._most - len(free))], self._plays[self._place[rows]]])


class Hysteresis(NamedTuple):
    """What one joint shows, in deg or mm; NaN if it moves too little, or was not measured."""

    loop: float  # width between both ways
    slack: float  # travel of the command after a reversal until the joint follows it
    reversals: int  # of the command


def hysteresis_of(log: MotionLog) -> list[Hysteresis]:
    """Return each joint's slack and hysteresis."""
    q = scales(log) * log.q_nominal
    moved = [k for k in range(q.shape[1]) if np.ptp(q[:, k]) > MOVED_DEG_MM]
    turns = [reversals_of(q[:, k]) if k in moved else 0 for k in range(q.shape[1])]
    if log.q_encoder is None or log.ok.sum() < MIN_EXPLAINED_ROWS:
        return [Hysteresis(np.nan, np.nan, count) for count in turns]
    hysteresis = []
    for k, scale in enumerate(scales(log)):
        rows = in_stretches(np.flatnonzero(log.ok), MAX_EXPLAINED_ROWS, q[:, k], log.time)
        seen = scale * log.q_encoder[rows, k]
        hysteresis.append(Hysteresis(*(_loop(q, k, moved, rows, seen) if k in moved else (np.nan, np.nan)), turns[k]))
    return hysteresis


def _loop(q: Floats, own: int, moved: list[int], rows: np.ndarray, seen: Floats) -> tuple[float, float]:
    from scipy.optimize import nnls

    columns = Explanation(q, own, moved, len(rows), FINE_RADII).at(rows)
    columns, y = columns - columns.mean(axis=0), seen - seen.mean()
    keep = np.ones(len(rows), dtype=bool)
    size = float(np.ptp(q[:, own]))
    weights = np.zeros(len(FINE_RADII))
    for _ in range(3):
        free, plays = columns[keep, : -len(FINE_RADII)], columns[keep, -len(FINE_RADII) :]
        onto = np.linalg.qr(free)[0]
        weights = nnls(plays - onto @ (onto.T @ plays), y[keep] - onto @ (onto.T @ y[keep]))[0]
        without_plays = y - columns[:, -len(FINE_RADII) :] @ weights
        left = np.abs(
            without_plays - columns[:, : -len(FINE_RADII)] @ np.linalg.lstsq(free, without_plays[keep], rcond=None)[0]
        )
        keep = left <= TRIM_SIGMAS * 1.4826 * np.median(left) + 1e-9
    command = columns[keep, moved.index(own)]
    alone = float(command @ without_plays[keep] / (command @ command))  # what follows at once
    follows = alone + np.cumsum(weights)
    if follows[-1] <= 0.0:  # it follows another command, or the wrong way round
        return np.nan, np.nan
    late = int(np.argmax(follows >= _FOLLOWS_SHARE * follows[-1]))
    slack = 0.0 if alone >= _FOLLOWS_SHARE * follows[-1] else 2.0 * FINE_RADII[late] * size
    loop = float(2.0 * np.array(FINE_RADII) @ weights)
    spread = float(np.ptp((seen - q[rows, own])[keep]))
    # no loop is wider than all errors together: what looks far wider is no hysteresis
    return (min(loop, spread), slack) if loop <= _WIDER_RATIO * spread + _ROUNDING_DEG_MM else (np.nan, np.nan)
