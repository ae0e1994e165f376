"""How far apart a joint stands at one command when it comes from either side, and how much of that is slack."""

from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.plant import MotionLog
from catenary.verdict.delay import FEWEST_ROWS, MOST_ROWS, TRIM, Explanation
from catenary.verdict.pairs import MOVED, reversals_of, scales

RADII = (0.001, 0.002, 0.004, 0.007, 0.012, 0.02, 0.03, 0.045, 0.07, 0.1, 0.15, 0.2)  # of plays, as shares of a range
FOLLOWS = 0.5  # share of a joint's full motion from which on it counts as following its command


class Hysteresis(NamedTuple):
    """What one joint shows, in deg or mm; NaN where it moves too little, or was not measured."""

    loop: float  # width between both ways
    slack: float  # travel of the command after a reversal until the joint follows it
    reversals: int  # of the command


def hysteresis_of(log: MotionLog) -> list[Hysteresis]:
    """Return what each joint shows of slack and hysteresis.

    A smooth function of all commands and plays of its own explain it [Prandtl-Ishlinskii]: one of radius r and weight w
    makes a loop 2 r w wide, and lets the joint follow from 2 r behind a reversal.
    """
    q = scales(log) * log.q_nominal
    moved = [k for k in range(q.shape[1]) if np.ptp(q[:, k]) > MOVED]
    turns = [reversals_of(q[:, k]) if k in moved else 0 for k in range(q.shape[1])]
    if log.q_encoder is None or log.ok.sum() < FEWEST_ROWS:
        return [Hysteresis(np.nan, np.nan, count) for count in turns]
    rows = np.flatnonzero(log.ok)
    rows = rows[:: len(rows) // MOST_ROWS + 1]
    seen = scales(log) * log.q_encoder[rows]
    return [
        Hysteresis(*(_loop(q, k, moved, rows, seen[:, k]) if k in moved else (np.nan, np.nan)), turns[k])
        for k in range(q.shape[1])
    ]


def _loop(q: Floats, own: int, moved: list[int], rows: np.ndarray, seen: Floats) -> tuple[float, float]:
    from scipy.optimize import nnls

    columns = Explanation(q, own, moved, len(rows), RADII).at(rows)
    columns, y = columns - columns.mean(axis=0), seen - seen.mean()
    keep = np.ones(len(rows), dtype=bool)
    size = float(np.ptp(q[:, own]))
    weights = np.zeros(len(RADII))
    for _ in range(3):
        free, plays = columns[keep, : -len(RADII)], columns[keep, -len(RADII) :]
        onto = np.linalg.qr(free)[0]
        weights = nnls(plays - onto @ (onto.T @ plays), y[keep] - onto @ (onto.T @ y[keep]))[0]
        rest = y - columns[:, -len(RADII) :] @ weights
        left = np.abs(rest - columns[:, : -len(RADII)] @ np.linalg.lstsq(free, rest[keep], rcond=None)[0])
        keep = left <= TRIM * 1.4826 * np.median(left) + 1e-9
    command = columns[keep, moved.index(own)]
    alone = float(command @ rest[keep] / (command @ command))  # what follows at once
    follows = alone + np.cumsum(weights)
    if follows[-1] <= 0.0:  # it follows another command, or the wrong way round
        return np.nan, np.nan
    late = int(np.argmax(follows >= FOLLOWS * follows[-1]))
    slack = 0.0 if alone >= FOLLOWS * follows[-1] else 2.0 * RADII[late] * size
    return float(2.0 * np.array(RADII) @ weights), slack
