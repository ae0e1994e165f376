"""Slack and hysteresis of joints, and the columns that explain them at any speed.

A smooth function of all commands and play states of the joint's own explain a measurement [Prandtl-Ishlinskii]: one of
radius r and weight w makes a loop 2 r w wide, and lets the joint follow from 2 r behind a reversal.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats, Integers
from catenary.plant import MotionLog
from catenary.verdict.pairs import MOVED_DEG_MM, in_stretches, play, reversals_of, scales

# radii of plays, as shares of a joint's range: few where they are tried again and again, as for each delay
PLAY_RADII = (0.003, 0.01, 0.03, 0.08, 0.11, 0.14, 0.17, 0.2)
FINE_RADII = (0.001, 0.002, 0.004, 0.007, 0.012, 0.02, 0.03, 0.045, 0.07, 0.1, 0.15, 0.2)
_FOLLOWS_SHARE = 0.5  # share of a joint's full motion from which on it counts as following its command
TRIM_SIGMAS = 6.0  # robust deviations of what is unexplained, beyond which rows are left out
MAX_EXPLAINED_ROWS, MIN_EXPLAINED_ROWS = 1000, 80


class Explanation:
    """Columns that explain one joint's measurement, at rows as they are asked for: few of a long recording are."""

    def __init__(
        self, q: Floats, own: int, moved: Sequence[int], rows: int, radii: Sequence[float] = PLAY_RADII
    ) -> None:
        """Take commands (N, n), those `moved` in units of their ranges, and plays of `radii` in that of its own."""
        self._q, self._moved, self._own, self._most = q, list(moved), own, rows // 15 - 10
        self._mean, self._range = q.mean(axis=0), np.ptp(q, axis=0)
        z = self._scaled(own, slice(None))
        self._plays = np.empty((len(z), len(radii)), dtype=np.float32)
        for k, radius in enumerate(radii):
            self._plays[:, k] = play(z, radius)

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
        return np.column_stack([*free, *more[: max(0, self._most - len(free))], self._plays[rows]])


class Hysteresis(NamedTuple):
    """What one joint shows, in deg or mm; NaN where it moves too little, or was not measured."""

    loop: float  # width between both ways
    slack: float  # travel of the command after a reversal until the joint follows it
    reversals: int  # of the command


def hysteresis_of(log: MotionLog) -> list[Hysteresis]:
    """Return what each joint shows of slack and hysteresis."""
    q = scales(log) * log.q_nominal
    moved = [k for k in range(q.shape[1]) if np.ptp(q[:, k]) > MOVED_DEG_MM]
    turns = [reversals_of(q[:, k]) if k in moved else 0 for k in range(q.shape[1])]
    if log.q_encoder is None or log.ok.sum() < MIN_EXPLAINED_ROWS:
        return [Hysteresis(np.nan, np.nan, count) for count in turns]
    found = []
    for k, scale in enumerate(scales(log)):
        rows = in_stretches(np.flatnonzero(log.ok), MAX_EXPLAINED_ROWS, q[:, k], log.time)
        seen = scale * log.q_encoder[rows, k]
        found.append(Hysteresis(*(_loop(q, k, moved, rows, seen) if k in moved else (np.nan, np.nan)), turns[k]))
    return found


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
        rest = y - columns[:, -len(FINE_RADII) :] @ weights
        left = np.abs(rest - columns[:, : -len(FINE_RADII)] @ np.linalg.lstsq(free, rest[keep], rcond=None)[0])
        keep = left <= TRIM_SIGMAS * 1.4826 * np.median(left) + 1e-9
    command = columns[keep, moved.index(own)]
    alone = float(command @ rest[keep] / (command @ command))  # what follows at once
    follows = alone + np.cumsum(weights)
    if follows[-1] <= 0.0:  # it follows another command, or the wrong way round
        return np.nan, np.nan
    late = int(np.argmax(follows >= _FOLLOWS_SHARE * follows[-1]))
    slack = 0.0 if alone >= _FOLLOWS_SHARE * follows[-1] else 2.0 * FINE_RADII[late] * size
    return float(2.0 * np.array(FINE_RADII) @ weights), slack
