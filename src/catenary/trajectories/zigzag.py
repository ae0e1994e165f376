"""Zig-zag calibration trajectories: even coverage of three joints' ranges in one direction.

Joint-calibration paper, section II-B, equations 1 to 5; the generator is the one whose output was published
(uw-biorobotics/raven2_CRTK_Python_controller @ c83e669, generated_trajs/*.csv), which `zigzag_rows` equals row
for row. In the unit cube the path sweeps x from side to side, moves on by the sparsity in y after each sweep,
and, when y is through, by the sparsity in z; y then goes back the other way. A rotation turns x into the
direction wanted, a scale per joint brings the cube into the joints' ranges.

Where the sources are silent or disagree:
- Only the directions J1, J1-J2 and J1-J2-J3 were published. The others permute the joints cyclically, so that
  the sweep of J2-J3 runs along the diagonal of joints 2 and 3.
- The equal volume of equations 4 and 5 holds for single and double directions. The published J1-J2-J3 files
  stretch their first axis over the joint's whole range, by 1.22, and so do we; and they differ from the
  rotations of equation 3 (Ry45 Rx45): theirs is Rx45 Rz45.
- The path ends on the way to one more layer, 5 % beyond the cube: it is kept, as published.
"""

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_array, as_positive, frozen
from catenary.errors import InputError
from catenary.spatial import rotation_about_x, rotation_about_z
from catenary.trajectories.smoothed_path import SmoothedPath

Direction = Literal["J1", "J2", "J3", "J1-J2", "J2-J3", "J1-J3", "J1-J2-J3"]
DIRECTIONS: tuple[Direction, ...] = get_args(Direction)

# the RAVEN-II's calibration box: limits of joints 1 to 3 in the published trajectories [rad, rad, m]
CALIBRATION_LOWER = frozen(np.array([np.deg2rad(20.0), np.deg2rad(55.0), 0.33]))
CALIBRATION_UPPER = frozen(np.array([np.deg2rad(60.0), np.deg2rad(110.0), 0.42]))

ROWS_PER_SECOND = 64.3  # 65,164 rows of J2-J3 at 1/2 + 1/3 + 1/4 take the paper's 1013 s
BLEND = 0.5  # [s], ours: the paper asks for smooth velocity and states no number
LEAST_SPARSITY = 0.01  # eleven million rows

_STEP = 0.001  # of the unit cube, from row to row
_END = 1.05  # of z: beyond it the path stops, wherever it is
# how far the published J1-J2-J3 path reaches along its first axis before it is stretched
_REACH = (0.09093521295520893, 0.9082482904638634)


def unit_zigzag(sparsity: float) -> Floats:
    """Return the path in the unit cube, sweeping along its first axis.

    Args:
        sparsity: Distance between sweeps, 0.01 to 1; they lie a multiple of 0.001 apart, the next larger one.

    Returns:
        (rows, 3), 0.001 apart; the largest coordinates exceed 1 by what the sparsity does not divide.

    Raises:
        InputError: The sparsity is outside its range.
    """
    moves = _unit_moves(sparsity)
    rows = np.zeros((_corner_rows(moves)[-1] + 1, 3))
    ways = np.repeat(np.sign(moves).astype(np.int8), np.abs(moves).sum(axis=1), axis=0)
    np.multiply(_STEP, ways, out=rows[1:])
    return np.cumsum(rows, axis=0, out=rows)


def zigzag_rows(
    direction: Direction,
    sparsity: float,
    *,
    lower: ArrayLike = CALIBRATION_LOWER,
    upper: ArrayLike = CALIBRATION_UPPER,
) -> Floats:
    """Return the rows of a zig-zag path as published: joint positions, equal distances apart, corners sharp.

    Args:
        direction: Of the sweeps.
        sparsity: Distance between sweeps in the unit cube, 0.01 to 1.
        lower: (3,) lower end of the joints' ranges [rad or m]; the RAVEN-II's calibration box by default.
        upper: (3,) upper end [rad or m].

    Returns:
        (rows, 3) [rad or m].

    Raises:
        InputError: An unknown direction, a sparsity out of range, a range that is empty.
    """
    matrix, shift = _placement(direction, lower, upper)
    joints: Floats = unit_zigzag(sparsity) @ matrix.T + shift
    return joints


def zigzag(
    direction: Direction,
    sparsities: Sequence[float],
    *,
    lower: ArrayLike = CALIBRATION_LOWER,
    upper: ArrayLike = CALIBRATION_UPPER,
    rows_per_second: float = ROWS_PER_SECOND,
    blend: float = BLEND,
) -> SmoothedPath:
    """Return zig-zag paths one after the other, with continuous position, velocity and acceleration.

    The corners are rounded over `blend` seconds: at the defaults the motion stays within 0.14 deg or 0.23 mm of
    the published path (`corner_distance` says how far), and passes its rows half a blend later. Between two
    paths it comes to rest at the end of the first, goes straight to the start of the next, no joint faster
    than in the sweeps, and comes to rest there: each path is as it would be alone.

    Args:
        direction: Of the sweeps.
        sparsities: Distance between sweeps in the unit cube, of each path, 0.01 to 1.
        lower: (3,) lower end of the joints' ranges [rad or m]; the RAVEN-II's calibration box by default.
        upper: (3,) upper end [rad or m].
        rows_per_second: Speed: how many rows of `zigzag_rows` are played in a second, positive.
        blend: Time over which the velocity changes at a corner [s], positive.

    Raises:
        InputError: An argument outside its range, an unknown direction.
    """
    matrix, shift = _placement(direction, lower, upper)
    rate = float(as_positive("rows_per_second", rows_per_second))
    if len(sparsities) == 0:
        raise InputError("sparsities: expected at least one, got none")
    rest = rate * float(as_positive("blend", blend))  # rows: a stop of one blend reaches its point exactly
    fastest = _STEP * np.abs(matrix).max(axis=1)  # of each joint, per row
    times: list[Floats] = []  # in rows
    points: list[Floats] = []
    for sparsity in sparsities:
        corners = _corner_rows(_unit_moves(sparsity))
        joints: Floats = unit_zigzag(sparsity)[corners] @ matrix.T + shift
        begin = 0.0
        if points:
            leaves = times[-1][-1] + rest
            arrives = leaves + float((np.abs(joints[0] - points[-1][-1]) / fastest).max())
            begin = arrives + rest
            times.append(np.array([leaves, arrives]))
            points.append(np.array([points[-1][-1], joints[0]]))
        times.append(corners.astype(np.float64) + begin)
        points.append(joints)
    return SmoothedPath.through(np.concatenate(times) / rate, np.concatenate(points), blend)


def _placement(direction: str, lower: ArrayLike, upper: ArrayLike) -> tuple[Floats, Floats]:
    """Return the matrix (3, 3) and shift (3,) that take the unit cube's path to joint positions."""
    if direction not in DIRECTIONS:
        raise InputError(f"direction: expected one of {', '.join(DIRECTIONS)}, got {direction!r}")
    low, high = as_array("lower", lower, (3,)), as_array("upper", upper, (3,))
    if not (low < high).all():
        raise InputError(f"lower, upper: expected lower below upper for each joint, got {low} and {high}")
    # u = matrix @ (path - 1/2) + 1/2 + lean, in the order of the axes; equal volume: equations 4 and 5
    lean = np.zeros(3)
    named = direction.split("-")
    if len(named) == 1:
        matrix = np.eye(3) / np.sqrt(3.0)
    elif len(named) == 2:
        half = np.array([np.sqrt(2.0 / 3.0), np.sqrt(2.0 / 3.0), 1.0 / np.sqrt(3.0)])
        back = np.array([1.0 / np.sqrt(2.0), 1.0 / np.sqrt(2.0), 1.0])  # equation 2
        matrix = np.diag(half * back) @ rotation_about_z(np.pi / 4.0)
    else:
        matrix = rotation_about_x(np.pi / 4.0) @ rotation_about_z(np.pi / 4.0) / np.sqrt(3.0)
        first, last = _REACH
        matrix[0] /= last - first
        lean[0] = (0.5 - first) / (last - first) - 0.5
    # the direction's first joint takes the first axis, the joints after it the others, round and round
    leading = {"J1-J3": 2}.get(direction, int(named[0][1]) - 1)
    axis_of_joint = (np.arange(3) - leading) % 3
    matrix, lean = matrix[axis_of_joint], lean[axis_of_joint]
    joint_range = high - low
    shift = 0.5 * (low + high) + joint_range * (lean - 0.5 * matrix.sum(axis=1))
    return joint_range[:, np.newaxis] * matrix, shift


def _unit_moves(sparsity: float) -> NDArray[np.int64]:
    """Return the straight moves of the unit path, (moves, 3) steps along each axis: all but one are 0.

    All sums add 0.001 in floating point, as the published generator does: it decides the number of rows.

    Raises:
        InputError: The sparsity is outside its range.
    """
    s = float(as_array("sparsity", sparsity, ()))
    if not LEAST_SPARSITY <= s <= 1.0:
        raise InputError(f"sparsity: expected {LEAST_SPARSITY} to 1, got {s}")
    sums = np.cumsum(np.append(0.0, np.full(3000, _STEP)))
    sweep, aside = (int(np.argmax(sums >= way)) for way in (1.0, s))
    rows_of_sweeps = int(np.argmax(sums[::aside] >= 1.0))
    height = int(np.argmax(sums > _END))
    moves, toward_x, toward_y = [], 1, 1
    for climbed in range(0, height, aside):
        for k in range(rows_of_sweeps + 1):
            if k > 0:
                moves.append((0, toward_y * aside, 0))
            moves.append((toward_x * sweep, 0, 0))
            toward_x = -toward_x
        toward_y = -toward_y
        moves.append((0, 0, min(aside, height - climbed)))
    return np.array(moves)


def _corner_rows(moves: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the indices of the rows where the path turns, first and last row included."""
    return np.append(0, np.cumsum(np.abs(moves).sum(axis=1)))
