"""Zig-zag calibration trajectories: even coverage of three joints' ranges in one direction.

Joint-calibration paper, section II-B, equations 1 to 5, and the authors' generator (uw-biorobotics/
raven2_CRTK_Python_controller @ c83e669, traj_generator/run_snake_generator.py). In the unit cube the path sweeps x
from side to side, advances by the sparsity in y after each sweep, and, at the end of y, by the sparsity in z; y then
returns. A rotation about the cube's centre turns x into the desired direction, and a scale maps the cube to the joints'
ranges: along J2-J3 the sweeps follow the diagonal of joints 2 and 3, the moves between them move joint 1 backwards,
and back again in the next layer.

Where the sources are silent or disagree:
- J1, J1-J2 and J1-J2-J3 were published as files too, which `zigzag_rows` equals row for row; the others follow the
  generator's text, J2 also equation 1.
- J1-J2-J3 was published in three forms, see `Form`.
- Single and double directions cover the equal volume of equations 4 and 5, for which the generator's scales and
  the divisions by sqrt 2 after its rotations come to 1/sqrt 3 of each joint's range. The generator and the
  files stretch J1-J2-J3 beyond that, by 1.15 and 1.22.
- The path ends within one more layer, 5 % beyond the cube: it is kept, as published.
"""

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_array, as_positive, frozen
from catenary.errors import InputError
from catenary.spatial import rotation_about_x, rotation_about_y, rotation_about_z
from catenary.trajectories.smoothed_path import SmoothedPath

Direction = Literal["J1", "J2", "J3", "J1-J2", "J2-J3", "J1-J3", "J1-J2-J3"]
DIRECTIONS: tuple[Direction, ...] = get_args(Direction)
# of J1-J2-J3: generator, the newest, swept along all three joints, joint 3 least; files, the published CSVs, along all
# three; paper, its equation 3, along joints 1 and 3, while joint 2 moves between sweeps only
Form = Literal["generator", "files", "paper"]
_FORMS: tuple[Form, ...] = get_args(Form)

# the RAVEN-II's calibration box: limits of joints 1 to 3 in the published trajectories [rad, rad, m]
CALIBRATION_LOWER = frozen(np.array([np.deg2rad(20.0), np.deg2rad(55.0), 0.33]))
CALIBRATION_UPPER = frozen(np.array([np.deg2rad(60.0), np.deg2rad(110.0), 0.42]))

ROWS_PER_SECOND = 64.3  # 65,164 rows of J2-J3 at 1/2 + 1/3 + 1/4 take the paper's 1013 s
CORNER_BLEND_S = 0.5  # [s], ours: the paper requires smooth velocity and states no number
_WAY_BACK = 2.0  # times the sweeps' speed, ours: within those of the authors' random motion
MIN_SPARSITY = 0.01  # eleven million rows

_STEP = 0.001  # of the unit cube, from row to row
_END = 1.05  # of z, beyond which the path stops at any point
_X, _Y, _Z = (turn(np.pi / 4.0) for turn in (rotation_about_x, rotation_about_y, rotation_about_z))
_TURNS: dict[str, Floats] = {  # of the unit path about its middle
    "J1": np.eye(3),
    "J2": np.rint(rotation_about_z(np.pi / 2.0)),  # equation 1
    "J3": np.rint(rotation_about_y(np.pi / 2.0)),
    "J1-J2": _Z,  # equation 2
    "J2-J3": _X @ np.rint(rotation_about_z(np.pi / 2.0)),
    "J1-J3": _Y,
    "generator": _Y @ _X @ _Z,
    "files": _X @ _Z,
    "paper": _Y @ _X,  # equation 3
}
# range of the unit path along each axis before it is stretched to the whole cube, as measured by its authors
_REACH = {
    "generator": ((0.0668181961291, 0.933590052161), (0.0, 1.0), (0.0669872981078, 0.934575650721)),
    "files": ((0.09093521295520893, 0.9082482904638634), (0.0, 1.0), (0.0, 1.0)),
}
_NO_STRETCH = ((0.0, 1.0),) * 3


def unit_zigzag(sparsity: float) -> Floats:
    """Return the path in the unit cube, sweeping along its first axis, as rows (rows, 3) 0.001 apart.

    The sparsity, 0.01 to 1, is the distance between sweeps, rounded up to a multiple of 0.001; the largest coordinates
    exceed 1 if it does not divide 1.
    """
    moves = _unit_moves(sparsity)
    rows = np.zeros((_corner_rows(moves)[-1] + 1, 3))
    ways = np.repeat(np.sign(moves).astype(np.int8), np.abs(moves).sum(axis=1), axis=0)
    np.multiply(_STEP, ways, out=rows[1:])
    return np.cumsum(rows, axis=0, out=rows)


def zigzag_rows(direction: Direction, sparsity: float, *, form: Form = "generator") -> Floats:
    """Return the rows of a path as published: joint positions (rows, 3) [rad or m], equally far apart."""
    matrix, shift = _placement(direction, form, CALIBRATION_LOWER, CALIBRATION_UPPER)
    return np.asarray(unit_zigzag(sparsity) @ matrix.T + shift)


def zigzag(
    direction: Direction,
    sparsities: Sequence[float],
    *,
    form: Form = "generator",
    lower: ArrayLike = CALIBRATION_LOWER,
    upper: ArrayLike = CALIBRATION_UPPER,
    rows_per_second: float = ROWS_PER_SECOND,
    blend: float = CORNER_BLEND_S,
) -> SmoothedPath:
    """Return zig-zag paths in sequence, with continuous position, velocity and acceleration.

    The corners are blended: at the defaults the motion stays within 0.14 deg or 0.23 mm of the published path
    (`corner_distance`), and passes its rows half a blend later. Between two paths it comes to rest at the end of the
    first, moves straight to the start of the next, at most twice as fast as in the sweeps, and comes to rest there:
    each path is the same as alone.

    Args:
        direction: Joints along which the sweeps move: J1, J2, J3, J1-J2, J2-J3, J1-J3 or J1-J2-J3.
        sparsities: Distance between sweeps in the unit cube for each path, 0.01 to 1.
        form: Of J1-J2-J3: generator, files or paper; the other directions have only generator.
        lower, upper: (3,) ends of the ranges [rad|m]; the RAVEN-II's calibration box by default.
        rows_per_second: Speed in rows of `zigzag_rows`.
        blend: Duration of the velocity change at a corner [s].

    Raises:
        InputError: An unknown direction or form, or an argument outside its range.

    Examples:
        >>> motion = catenary.zigzag("J2-J3", [0.5])
        >>> round(motion.duration, 1)
        203.5
    """
    matrix, shift = _placement(direction, form, lower, upper)
    rate = float(as_positive("rows_per_second", rows_per_second))
    if len(sparsities) == 0:
        raise InputError("sparsities: expected at least one, got none")
    dwell = rate * float(as_positive("blend", blend))  # rows: a stop of one blend reaches its point exactly
    fastest = _STEP * np.abs(matrix).max(axis=1)  # of each joint, per row
    times: list[Floats] = []  # in rows
    points: list[Floats] = []
    for sparsity in sparsities:
        corners = _corner_rows(_unit_moves(sparsity))
        joints: Floats = unit_zigzag(sparsity)[corners] @ matrix.T + shift
        begin = 0.0
        if points:
            leaves = times[-1][-1] + dwell
            arrives = leaves + float((np.abs(joints[0] - points[-1][-1]) / fastest).max()) / _WAY_BACK
            begin = arrives + dwell
            times.append(np.array([leaves, arrives]))
            points.append(np.array([points[-1][-1], joints[0]]))
        times.append(corners.astype(np.float64) + begin)
        points.append(joints)
    return SmoothedPath.through(np.concatenate(times) / rate, np.concatenate(points), blend)


def check_direction(direction: str, form: str = "generator") -> None:
    """Refuse an unknown direction, or a form that it does not have.

    Args:
        direction: One of DIRECTIONS.
        form: "generator"; of J1-J2-J3 also "files" or "paper".
    """
    if direction not in DIRECTIONS:
        raise InputError(f"direction: expected one of {', '.join(DIRECTIONS)}, got {direction!r}")
    if form not in _FORMS:
        raise InputError(f"form of J1-J2-J3: expected one of {', '.join(_FORMS)}, got {form!r}")
    if form != "generator" and direction != "J1-J2-J3":
        raise InputError(f"direction {direction} has one form, generator; got {form!r}, a form of J1-J2-J3")


def _placement(direction: str, form: str, lower: ArrayLike, upper: ArrayLike) -> tuple[Floats, Floats]:
    """Return the matrix (3, 3) and shift (3,) that map the unit cube's path to joint positions."""
    check_direction(direction, form)
    low, high = as_array("lower", lower, (3,)), as_array("upper", upper, (3,))
    if not (low < high).all():
        raise InputError(f"lower, upper: expected lower below upper for each joint, got {low} and {high}")
    # u = (turned / sqrt 3 + 1/2 - first) / (last - first), of the joints' ranges; equal volume: equations 4 and 5
    path = form if direction == "J1-J2-J3" else direction
    first, last = np.array(_REACH.get(path, _NO_STRETCH)).T
    scale = (high - low) / (last - first)
    matrix = scale[:, np.newaxis] * _TURNS[path] / np.sqrt(3.0)
    shift: Floats = low + scale * (0.5 - first) - 0.5 * matrix.sum(axis=1)
    return matrix, shift


def _unit_moves(sparsity: float) -> NDArray[np.int64]:
    """Return the straight moves of the unit path, (moves, 3) steps along each axis: all but one are 0.

    Steps of 0.001 are summed in floating point, as in the published generator, which determines the number of rows.
    """
    s = float(as_array("sparsity", sparsity, ()))
    if not MIN_SPARSITY <= s <= 1.0:
        raise InputError(f"sparsity: expected {MIN_SPARSITY} to 1, got {s}")
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
    return np.append(0, np.cumsum(np.abs(moves).sum(axis=1)))
