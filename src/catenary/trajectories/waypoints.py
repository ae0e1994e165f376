"""Follow given joint positions, row by row, with smooth velocity.

Joint-calibration paper, section IV-A, "trajectory generation and follow": a sequence of joint positions is
followed at a desired speed with smooth velocity, after a go-to to its first row.
"""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from catenary.archives import read_array
from catenary.arrays import Floats, as_array, as_positive
from catenary.documents import cut
from catenary.errors import FileFormatError, InputError
from catenary.trajectories.smoothed_path import SmoothedPath


def follow_waypoints(
    points: ArrayLike, *, speed: ArrayLike, blend: float = 0.5, q_start: ArrayLike | None = None
) -> SmoothedPath:
    """Return a motion along rows of joint positions, the joint that has farthest to go moving at its speed.

    It passes near the rows, not through them: its velocity is that of the straight way from row to row,
    averaged over `blend` seconds (smoothed_path.py); `corner_distance` says how near. No joint moves faster
    than `speed`, nor accelerates by more than 3 speed / blend.

    Args:
        points: (N, n) [rad or m], N at least 1; rows equal to the one before are left out.
        speed: (n,) of each joint, positive [rad/s or m/s].
        blend: Time over which velocities are averaged [s], positive.
        q_start: (n,) where the robot is [rad or m]: from there it first goes to the first row, at the same
            speed, and comes to rest for an instant. The motion begins at the first row when None.

    Raises:
        InputError: An argument has another shape, is not finite or not positive.
    """
    rows = as_array("points", points, (None, None))
    if len(rows) == 0 or rows.shape[1] == 0:
        raise InputError(f"points: expected at least one row of one joint, got shape {rows.shape}")
    fastest = as_positive("speed", speed, (rows.shape[1],))
    pause = float(as_positive("blend", blend))
    rows = rows[np.append(True, (np.diff(rows, axis=0) != 0.0).any(axis=1))]
    steps = (np.abs(np.diff(rows, axis=0)) / fastest).max(axis=1, initial=0.0)
    times = np.append(0.0, np.cumsum(steps))  # [s] when each row is reached
    if q_start is not None:
        start = as_array("q_start", q_start, (rows.shape[1],))
        way = float((np.abs(rows[0] - start) / fastest).max())
        if way > 0.0:
            # a stop of one blend at the first row brings the motion to it exactly
            times = np.concatenate([[0.0, way, way + pause], way + pause + times[1:]])
            rows = np.concatenate([[start], rows[:1], rows])
    return SmoothedPath.through(times, rows, pause)


def play_rows(points: ArrayLike, *, rows_per_second: float, blend: float = 0.5) -> SmoothedPath:
    """Return a motion along rows of joint positions, so many a second; equal rows are a pause.

    Args:
        points: (N, n) [rad or m], N at least 1.
        rows_per_second: Positive.
        blend: Time over which velocities are averaged [s], positive.

    Raises:
        InputError: An argument has another shape, is not finite or not positive.
    """
    rows = as_array("points", points, (None, None))
    rate = float(as_positive("rows_per_second", rows_per_second))
    return SmoothedPath.through(np.arange(len(rows)) / rate, rows, blend)


def read_waypoints(path: Path, joints: int) -> Floats:
    """Read joint positions (N, n) [rad or m] from a `.csv` file of numbers without a heading, or an `.npy` file.

    Raises:
        FileFormatError: No such file, another ending, not numbers, or another number of columns.
    """
    if path.suffix not in (".csv", ".npy"):
        raise FileFormatError(f'{path}: ending "{path.suffix}": expected .csv or .npy')
    try:
        if path.suffix == ".csv":
            rows = np.loadtxt(path, delimiter=",", ndmin=2)
        else:
            rows = read_array(path)
        return as_array(str(path), rows, (None, joints))
    except FileNotFoundError as error:
        raise FileFormatError(f"{path}: no such file") from error
    except (OSError, ValueError, MemoryError) as error:
        why = cut(str(error).removeprefix(f"{path}: "))
        raise FileFormatError(f"{path}: expected rows of {joints} numbers: {why}") from error
