"""Motions an operator asks for: to a place, at random, along the rows of a file, whose units it states; each watched.

However a motion ends, the robot holds and is paused. One that is refused moves nothing, and changes no state.
"""

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from catenary.archives import read_arrays
from catenary.arrays import Floats, as_array
from catenary.bounded_parsers import cut, no_file
from catenary.dynamics.inverse_kinematics import inverse_kinematics
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import FileFormatError, InputError, LimitError
from catenary.file_formats import format_of
from catenary.parallel import Progress, silent
from catenary.plant import Joints, JointState, MotionLog, OperatingState, joint_indices, nameless, require_ready
from catenary.recording.import_formats.columns import joined
from catenary.recording.import_formats.csv_files import TextTable
from catenary.recording.logs import read_parquet
from catenary.robots.catalog import RAVEN_SIDES
from catenary.spatial import Pose
from catenary.trajectories.reference import Reference, Trajectory
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.trajectories.smoothed_path import SmoothedPath
from catenary.trajectories.zigzag import CORNER_BLEND_S, ROWS_PER_SECOND
from catenary.units import TO_SI, in_words
from catenary.workflows.robot.motion import (
    GENTLE_VELOCITY,
    arrive,
    at_rest_afterwards,
    check_motion,
    move_to,
    random_within,
    run_trajectory,
)
from catenary.workflows.robot.operated_robot import OperatedRobot

SCALE = {unit: TO_SI[unit] for unit in ("rad", "m", "deg", "mm")}
SECONDS = {"s": 1.0, "ms": 1e-3}
_PUBLISHED_UNITS = ("rad", "rad", "m")  # of the zig-zags that RAVEN-II's group published
_HEAD = re.compile(r"^(?P<name>[^\[\]]+?)\s*\[(?P<unit>[^\[\]]+)\]$")


def along_rows(motion: MotionLog, blend: float = CORNER_BLEND_S) -> SmoothedPath:
    """Return the motion along a file's rows, at rest at both ends.

    Args:
        motion, blend: The file's rows, with times; time over which velocities are averaged [s].
    """
    if not 0.0 < blend < np.inf:
        raise InputError(f"blend: expected more than 0 s, got {blend}")
    return SmoothedPath.through(cast(Floats, motion.time), motion.q_nominal, blend)


def _is_named(motion: MotionLog) -> bool:
    """Return True if a file names its joints; otherwise they are the first ones."""
    return not (motion.units_assumed and motion.joint_names == nameless(len(motion.joint_names)))


def read_followed_file(path: Path, *, rows_per_second: float | None = None) -> MotionLog:
    """Read a motion to follow; its times are shifted to begin at 0.

    A table of text with units in its heading (`time [s],shoulder [deg]`), or that of `catenary excitation`; numbers
    alone in the layout of the published zig-zags (rad, rad, m); a motion log, `.parquet`; an `.npz` with `q` or `q_des`
    (N, k), `t` (N,) [s], `units` and `joint_names` (k,).

    Args:
        rows_per_second: Rate of a file without times [Hz]; that of the published zig-zags when None.
    """
    if not path.is_file():
        raise FileFormatError(no_file(path))
    if rows_per_second is not None and not 0.0 < rows_per_second < np.inf:
        raise InputError(f"--rows-per-second: expected more than 0, got {rows_per_second}")
    form = format_of(path)
    if form.reader_in_parts:
        motion = _read_text(path, rows_per_second)
    elif form.ending == ".parquet":
        motion = replace(read_parquet(path), notes=())
        if motion.time is None or len(motion.starts) > 1:
            what = "holds no times" if motion.time is None else f"holds {len(motion.starts)} recordings"
            raise FileFormatError(f"{path}: {what}; expected one motion with times, to be followed")
    elif form.ending == ".npz":
        motion = _read_npz(path)
    else:
        raise FileFormatError(f'{path}: ending "{path.suffix}": expected a table of text (.csv), .parquet or .npz')
    if rows_per_second is not None and _is_named(motion):
        raise InputError(f"{path}: states its times; --rows-per-second is for files without")
    time = cast(Floats, motion.time)
    if not (rises := np.diff(time) > 0.0).all():
        raise InputError(f"{path}: row {int(np.argmin(rises)) + 2}: time does not rise")
    return replace(motion, time=time - time[0])


def _read_text(path: Path, rows_per_second: float | None) -> MotionLog:
    table = TextTable(path)
    parts = list(table.streams())
    if not parts:
        raise FileFormatError(f"{path}: has no row of numbers")
    columns = joined(parts).columns
    odd = next((column for column in table.head.columns if column.kind == "text"), None)
    if odd is not None:
        where = f", {odd.odd}" if odd.odd else ""
        raise FileFormatError(f'{path}: column "{cut(odd.name)}": expected numbers, got text{where}')
    values = np.column_stack([np.asarray(numbers, dtype=float) for numbers in columns.values()])
    if not table.head.is_named:
        if values.shape[1] != len(_PUBLISHED_UNITS):
            raise FileFormatError(
                f"{path}: numbers without a heading, {values.shape[1]} columns: expected a heading such as "
                f"time [s],shoulder [deg],..., or the published zig-zags' {len(_PUBLISHED_UNITS)} in rad, rad, m"
            )
        rate = ROWS_PER_SECOND if rows_per_second is None else rows_per_second
        note = f"{path.name}: no heading: taken as rad, rad, m, {rate:g} rows a second, as the published zig-zags"
        return MotionLog(
            path.name, nameless(len(_PUBLISHED_UNITS)), _PUBLISHED_UNITS, values, np.ones(len(values), dtype=bool),
            time=np.arange(len(values)) / rate, units_assumed=True, notes=(note,),
        )  # fmt: skip
    heads = [_HEAD.match(name) for name in columns]
    plain = [name for name, head in zip(columns, heads, strict=True) if head is None]
    if plain:
        raise FileFormatError(f'{path}: column "{plain[0]}" has no unit: expected NAME [UNIT], as in time [s]')
    names = [head["name"] for head in heads if head]
    units = [head["unit"] for head in heads if head]
    if names[0] not in ("time", "t") or units[0] not in SECONDS:
        raise FileFormatError(f'{path}: first column "{names[0]} [{units[0]}]": expected time [s] or time [ms]')
    positions = [k for k, name in enumerate(names) if name.startswith("q:")]
    if positions:  # velocities and accelerations stand beside them
        names = [names[0], *(names[k].removeprefix("q:") for k in positions)]
        units = [units[0], *(units[k] for k in positions)]
        values = values[:, [0, *positions]]
    motion = _in_si(path, names[1:], units[1:], values[:, 0] * SECONDS[units[0]], values[:, 1:])
    return replace(motion, notes=tuple(f"{path.name}: {note}" for note in table.notes[len(table.head.notes) :]))


def _read_npz(path: Path) -> MotionLog:
    content = read_arrays(path)
    key = next((key for key in ("q", "q_des") if key in content), None)
    missing = [name for name in ("t", "units", "joint_names") if name not in content]
    if key is None or missing:
        raise FileFormatError(f"{path}: lacks {', '.join([*missing, *([] if key else ['q or q_des'])])}")
    time, q = (np.asarray(content[name], dtype=float) for name in ("t", key))
    return _in_si(path, content["joint_names"].tolist(), content["units"].tolist(), time, q)


def _in_si(path: Path, names: list[str], units: list[str], time: Floats, q: Floats) -> MotionLog:
    """Return a motion of joints (N, k) that are in k units of SCALE."""
    if not units or not set(units) <= set(SCALE) or q.ndim != 2 or q.shape[1] != len(units):
        raise FileFormatError(
            f"{path}: expected joint positions (N, k) in k units among {', '.join(SCALE)}; "
            f"got {q.shape} in {', '.join(units) or 'none'}"
        )
    si, scale = zip(*(SCALE[unit] for unit in units), strict=True)
    return MotionLog(path.name, tuple(names), si, q * np.array(scale), np.ones(len(q), dtype=bool), time=time)


# a fifth of what a RAVEN-II's firmware lets pass, 2.5 rad/s and 0.05 m/s: a faster file was likely not meant for it
MAX_VELOCITY = {"rad": 0.5, "m": 0.01}  # [rad/s], [m/s]
# way to the start of a file that is gone without being asked twice
NEAR_DISTANCE = {"rad": np.deg2rad(60.0), "m": 0.15}  # [rad], [m]


@dataclass(frozen=True)
class MotionSummary:
    """Errors and final state of a motion."""

    robot: str
    simulated: bool
    duration: float  # [s] of the robot's time
    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    max_error: Floats  # (n,) [rad|m] largest |reported - commanded|
    rms_error: Floats  # (n,) [rad|m]
    q: Floats  # (n,) [rad|m] reported at the end
    state: OperatingState  # at the end
    late_ticks: int
    ended_by: str | None  # Ctrl-C or a signal's name, before the motion's end: the robot holds where it is
    tip_name: str
    tip: Floats  # (3,) [m] of the tool in the base frame at the end, by reported joints
    true_error: Floats | None = None  # (k,) [rad|m] reported less true, of the first k joints; None but in a simulation
    true_frame: str = ""  # what those k joints place: the model's tip
    tip_error: float | None = None  # [m] between it by reported joints and where it really is

    def as_data(self) -> dict[str, Any]:
        """Return plain data, SI."""
        arrays = self.q.tolist(), self.max_error.tolist(), self.rms_error.tolist()
        columns = self.joint_names, self.joint_units, *arrays
        true_error = [] if self.true_error is None else self.true_error.tolist()
        unknown = [None] * (len(self.q) - len(true_error))
        return {
            "robot": self.robot,
            "simulated": self.simulated,
            "duration_s": self.duration,
            "interrupted": self.ended_by is not None,
            "ended_by": self.ended_by,
            "late_ticks": self.late_ticks,
            "state": self.state._asdict(),
            "tip": {"frame": self.tip_name, "position": self.tip.tolist()},
            "true_error": {"frame": self.true_frame, "distance": self.tip_error},
            "joints": [
                {"name": name, "unit": unit, "q": q, "max_error": largest, "rms_error": rms, "true_error": error}
                for name, unit, q, largest, rms, error in zip(*columns, [*true_error, *unknown], strict=True)
            ],
        }


def go_to_joints(
    robot: OperatedRobot,
    q: ArrayLike,
    *,
    joints: Sequence[str] | None = None,
    speed: float = 1.0,
    progress: Progress = silent,
) -> MotionSummary:
    """Move joints to given positions together, gently; errors as of `move_to`.

    Args:
        q: Positions (k,) [rad|m].
        joints: Names of the joints; the first k when None.
        speed: Factor on the gentle velocity.
    """
    goal = as_array("q", q, (None,))
    names = robot.plant.joint_names[: len(goal)] if joints is None else tuple(joints)
    if not 0.0 < speed <= 5.0:
        raise InputError(f"--speed: expected more than 0 and at most 5, got {speed}")
    units = dict(zip(robot.plant.joint_names, robot.plant.joint_units, strict=True))
    # move_to refuses unknown names
    velocity = [speed * GENTLE_VELOCITY[units.get(name, "rad")] for name in names]
    return _watched(robot, move_to, goal, joints=names, max_velocity=velocity, progress=progress)


def joints_at(robot: OperatedRobot, position: ArrayLike, *, rng: np.random.Generator) -> Floats:
    """Return joint positions (n,) [rad|m] near the present ones that bring the tool to a point, or refuse it.

    Args:
        position: Point in the base frame (3,) [m].
        rng: Draws starts of the search.
    """
    q = robot.plant.setpoint_js().q
    model = robot.with_tool_at(q)
    start = np.clip(q[: model.n], model.lower, model.upper)
    goal = Pose(forward_kinematics(model, start).rotation, as_array("position", position, (3,)))
    if robot.tool is not None:
        robot.tool.require_reach(goal)
    return inverse_kinematics(model, goal, start, rng=rng)


def random_motion(robot: OperatedRobot, seconds: float, *, rng: np.random.Generator) -> Trajectory:
    """Return a random motion of the model's joints: in RAVEN-II's calibration box, else in the middle of the ranges."""
    if robot.model.name in RAVEN_SIDES or robot.name in RAVEN_SIDES:
        return random_sinusoids(rng, seconds)
    return random_within(robot.model, seconds, rng)


def run_random(
    robot: OperatedRobot, seconds: float, *, rng: np.random.Generator, progress: Progress = silent
) -> MotionSummary:
    """Move the model's joints at random, after a gentle motion to the start.

    Args:
        seconds: Duration [s].
    """
    motion = random_motion(robot, seconds, rng=rng)
    return _watched(robot, run_trajectory, motion, joints=robot.joints, progress=progress)


def follow_motion(
    robot: OperatedRobot,
    file: MotionLog,
    *,
    blend: float = CORNER_BLEND_S,
    largest_velocity: dict[str, float] | None = None,
    from_afar: bool = False,
    progress: Progress = silent,
) -> MotionSummary:
    """Check a file's motion as a whole, go to its start gently, and follow it; a LimitError comes before it moves.

    Args:
        blend: Time over which velocities are averaged [s].
        largest_velocity: Largest velocity by unit [rad/s, m/s]; `MAX_VELOCITY` when None.
        from_afar: Whether the robot may be farther from the start than `NEAR_DISTANCE`.
    """
    plant, motion = robot.plant, along_rows(file, blend)
    names = file.joint_names if _is_named(file) else plant.joint_names[: len(file.joint_units)]
    moved = joint_indices(Joints(names, file.joint_units), plant, whose="the robot", of=f"{file.name} moves")
    fastest = MAX_VELOCITY if largest_velocity is None else largest_velocity
    try:
        check_motion(plant, motion, joints=names, max_velocity=[fastest[unit] for unit in file.joint_units])
    except LimitError as error:
        raise LimitError(f"{file.name}: {error}; nothing has moved") from error
    way = np.abs(motion(0.0).q - plant.setpoint_js().q[moved])
    for name, unit, far in zip(names, file.joint_units, way, strict=True):
        if far > NEAR_DISTANCE[unit] and not from_afar:
            raise LimitError(
                f'{file.name}: joint "{name}" is {in_words(far, unit, 1)} from the start, '
                f"more than {in_words(NEAR_DISTANCE[unit], unit, 1)}; nothing has moved. "
                "Go there first (catenary goto), or say --from-afar"
            )
    return _watched(robot, run_trajectory, motion, joints=names, progress=progress)


def _watched(
    robot: OperatedRobot, move: Callable[..., None], to: ArrayLike | Trajectory, **options: Any
) -> MotionSummary:
    """Move a robot by `move_to` or `run_trajectory`; it holds where that ends, and is paused."""
    plant = robot.plant
    require_ready(plant, "servo_jp")
    n = len(plant.joint_names)
    largest, squares, count = np.zeros(n), np.zeros(n), 0
    begin, late = plant.measured_js().time, robot.late()
    sent: Floats | None = None

    def observe(state: JointState, reference: Reference, _: float) -> None:
        nonlocal count, sent
        error = np.abs(state.q - reference.q)
        np.maximum(largest, error, out=largest)
        squares[:] += error**2
        count, sent = count + 1, reference.q

    ended_by = None
    try:
        with at_rest_afterwards(plant, began=lambda: count > 0):
            move(plant, to, observe=observe, **options)
            if sent is not None:
                arrive(plant, sent)
    except KeyboardInterrupt as stop:  # SIGTERM and SIGHUP, too, whose names are its text
        if getattr(stop, "__notes__", ()):
            raise  # the robot does not hold, or is not paused
        ended_by = str(stop) or "Ctrl-C"
    end, truth = plant.measured_js(), robot.truth()
    tool = robot.model.tip if robot.tool is None else robot.tool.model.tip
    return MotionSummary(
        robot.name, plant.simulated, end.time - begin, plant.joint_names, plant.joint_units,
        largest, np.sqrt(squares / max(count, 1)), end.q, plant.operating_state(), robot.late() - late, ended_by,
        tool, robot.tool_position(end.q),
        None if truth is None else end.q[: len(truth.q)] - truth.q,
        robot.model.tip, None if truth is None else math.dist(robot.tip(end.q), robot.tip(truth.q)),
    )  # fmt: skip
