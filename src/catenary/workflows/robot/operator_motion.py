"""Motions an operator asks for: to a place, at random, along a file; each watched.

However a motion ends, the robot holds and is paused. One that is refused moves nothing, and changes no state.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.dynamics.inverse_kinematics import inverse_kinematics
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError, LimitError
from catenary.plant import JointState, OperatingState, Plant, require_ready
from catenary.robots.catalog import RAVEN_SIDES
from catenary.side_by_side import Progress, silent
from catenary.spatial import Pose
from catenary.trajectories.reference import Reference, Trajectory
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.trajectories.zigzag import BLEND
from catenary.units import in_words
from catenary.workflows.robot.followed_file import FollowedFile
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

# a fifth of what a RAVEN-II's firmware lets pass, 2.5 rad/s and 0.05 m/s: a faster file was likely not meant for it
LARGEST_VELOCITY = {"rad": 0.5, "m": 0.01}  # [rad/s], [m/s]
# way to the start of a file that is gone without being asked twice
NEAR = {"rad": np.deg2rad(60.0), "m": 0.15}  # [rad], [m]


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
    """Bring the named joints, or the first k, to q (k,) [rad|m] together, `speed` times gently; errors as `move_to`."""
    goal = as_array("q", q, (None,))
    names = robot.plant.joint_names[: len(goal)] if joints is None else tuple(joints)
    if not 0.0 < speed <= 5.0:
        raise InputError(f"--speed: expected more than 0 and at most 5, got {speed}")
    units = dict(zip(robot.plant.joint_names, robot.plant.joint_units, strict=True))
    # move_to refuses unknown names
    velocity = [speed * GENTLE_VELOCITY[units.get(name, "rad")] for name in names]
    return _watched(robot, move_to, goal, joints=names, max_velocity=velocity, progress=progress)


def joints_at(robot: OperatedRobot, position: ArrayLike, *, rng: np.random.Generator) -> Floats:
    """Return joints (n,) [rad|m], near where they are, that bring the tool to (3,) [m] in the base frame."""
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
    """Move the model's joints at random, after going to where that begins."""
    motion = random_motion(robot, seconds, rng=rng)
    return _watched(robot, run_trajectory, motion, joints=robot.joints, progress=progress)


def follow(
    robot: OperatedRobot,
    file: FollowedFile,
    *,
    blend: float = BLEND,
    largest_velocity: dict[str, float] | None = None,
    from_afar: bool = False,
    progress: Progress = silent,
) -> MotionSummary:
    """Check the whole motion of a file, go to its start gently, and follow it, velocities averaged over `blend` [s].

    Beyond limits or `largest_velocity` by unit (LARGEST_VELOCITY [rad/s, m/s] when None), or from farther away than
    NEAR, unless `from_afar`, it is refused before anything moves.
    """
    plant, motion = robot.plant, file.trajectory(blend)
    names = plant.joint_names[: len(file.joint_units)] if file.joint_names is None else file.joint_names
    moved = _joints_of(file, names, plant)
    fastest = LARGEST_VELOCITY if largest_velocity is None else largest_velocity
    try:
        check_motion(plant, motion, joints=names, max_velocity=[fastest[unit] for unit in file.joint_units])
    except LimitError as error:
        raise LimitError(f"{file.name}: {error}; nothing has moved") from error
    way = np.abs(motion(0.0).q - plant.setpoint_js().q[moved])
    for name, unit, far in zip(names, file.joint_units, way, strict=True):
        if far > NEAR[unit] and not from_afar:
            raise LimitError(
                f'{file.name}: joint "{name}" is {in_words(far, unit, 1)} from the start, '
                f"more than {in_words(NEAR[unit], unit, 1)}; nothing has moved. "
                "Go there first (catenary goto), or say --from-afar"
            )
    return _watched(robot, run_trajectory, motion, joints=names, progress=progress)


def _joints_of(file: FollowedFile, names: Sequence[str], plant: Plant) -> list[int]:
    """Return which joints a file moves; refuse those that the robot does not have, or has in another unit."""
    if len(names) != len(file.joint_units) or not set(names) <= set(plant.joint_names):
        raise InputError(f"{file.name}: moves {', '.join(names)}; the robot has {', '.join(plant.joint_names)}")
    moved = [plant.joint_names.index(name) for name in names]
    for j, name, unit in zip(moved, names, file.joint_units, strict=True):
        if plant.joint_units[j] != unit:
            raise InputError(f'{file.name}: joint "{name}" is in {unit}; the robot\'s is in {plant.joint_units[j]}')
    return moved


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
