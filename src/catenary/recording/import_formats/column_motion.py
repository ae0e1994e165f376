"""Which columns of a table without names are which, told by how they move: velocities are derivatives of positions."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.recording.import_formats.columns import ends

MOST_ROWS = 100_000  # that are looked at
LEAST_ROWS = 30
_WINDOWS = (3, 10, 30, 100, 300)  # rows over which positions change, and velocities add up to that
_LIKE = 0.95  # correlation of the two, over one of these windows; noise and delay cost the short ones theirs
_SAME = 1.25  # factor within which they are the same in size


@dataclass(frozen=True)
class MovingColumns:
    """Columns of the joints, in the order of the table."""

    q: tuple[str, ...]
    qd: tuple[str, ...]
    again: tuple[str, ...] = ()  # positions that have the same velocities: a command, or a measurement
    tau: tuple[str, ...] = ()  # what is left, where it is as many
    left: tuple[str, ...] = ()  # what is left, where it is not

    def said(self) -> str:
        """Return in words how they were told."""
        told = f"{ends(self.qd)} are the derivatives of {ends(self.q)}, and were taken for qd"
        told += f"; {ends(self.again)} have the same" if self.again else ""
        told += f"; {ends(self.tau)} are what is left, and were taken for tau" if self.tau else ""
        return told + (f"; {ends(self.left)} are left, and were not taken" if self.left else "")


def by_motion(columns: Mapping[str, NDArray[np.generic]], seconds: Floats | None) -> MovingColumns | None:
    """Return which columns are positions, velocities and torques; None where no column is another's derivative.

    Columns stand in blocks, so that each velocity is as far behind its position: the distance that most pairs have.

    Args:
        columns: All but the time.
        seconds: Of the rows; without, a derivative may be of any size, the same for all.
    """
    names, rows = list(columns), slice(0, MOST_ROWS)
    if len(names) < 2:
        return None
    values = np.column_stack([np.asarray(columns[name][rows], dtype=np.float64) for name in names])
    time = np.arange(len(values), dtype=np.float64) if seconds is None else seconds[rows]
    whole = np.isfinite(values).all(axis=1) & np.isfinite(time)
    values, time = values[whole], time[whole]
    if len(values) < LEAST_ROWS or not (np.diff(time) > 0.0).all():
        return None
    is_derivative = _derivatives(values, time, any_size=seconds is None)
    m = len(names)
    pairs = {d: [i for i in range(m - d) if is_derivative[i, i + d]] for d in range(1, m)}
    d = max(pairs, key=lambda each: (len(pairs[each]), -each))
    q = [i for i in pairs[d] if i - d not in pairs[d]]  # what has an integral itself is a velocity
    if not q:
        return None
    if m % d == 0 and max(q) < d:  # joints that stood still are of the block, too
        q = list(range(d))
    qd = [i + d for i in q]
    accelerations = [i + 2 * d for i in q if i + 2 * d < m and any(is_derivative[j, j + d] for j in qd if j + d < m)]
    used = {*q, *qd, *accelerations}
    again = [i for i in range(m) if i not in used and any(is_derivative[i, j] for j in qd)]
    again = again if len(again) == len(q) else []
    left = [i for i in range(m) if i not in {*used, *again}]
    moving = [i for i in left if np.ptp(values[:, i]) > 0.0]
    tau = next((some for some in (left, moving) if len(some) == len(q)), [])
    rest = [i for i in moving if i not in tau]
    return MovingColumns(*(tuple(names[i] for i in some) for some in (q, qd, again, tau, rest)))


def _derivatives(values: Floats, time: Floats, *, any_size: bool) -> NDArray[np.bool_]:
    """Return whether column j is the derivative of column i, (m, m)."""
    middle = 0.5 * (values[1:] + values[:-1]) * np.diff(time)[:, np.newaxis]
    sums = np.vstack([np.zeros(values.shape[1]), np.cumsum(middle - middle.mean(axis=0), axis=0)])
    best, size = np.zeros((2, values.shape[1], values.shape[1]))
    for window in _WINDOWS:
        if window > len(values) // 5:
            break
        moved, added = (each[window:] - each[:-window] for each in (values, sums))
        moved, added = moved - moved.mean(axis=0), added - added.mean(axis=0)
        with np.errstate(invalid="ignore", divide="ignore"):
            both, own, its = moved.T @ added, (moved**2).sum(axis=0), (added**2).sum(axis=0)
            like = np.nan_to_num(both / np.sqrt(np.outer(own, its)))
            larger = like > best
            best, size = np.where(larger, like, best), np.where(larger, np.sqrt(np.divide.outer(own, its)), size)
    found = best > _LIKE
    np.fill_diagonal(found, False)
    if any_size and found.any():
        size = size / float(np.median(size[found]))
    return np.asarray(found & (size > 1.0 / _SAME) & (size < _SAME))
