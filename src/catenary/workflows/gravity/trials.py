"""What gravity compensation is tried by on a simulated arm: motions by name, followed or held.

[Holding: Lewis, Hannaford 2014, section V: with the sensed vector "the robot passively held any new position manually
imposed", upside down too; with the static one it drifts once "tipped more than a few degrees"]
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Flags, Floats, as_array
from catenary.control.gravity_pd import GravityPD
from catenary.control.loop import GravitySource, Observer, Tick, run_loop
from catenary.control.loop_report import Holding, Tracking
from catenary.control.pd import Controller, SplitController
from catenary.errors import InputError
from catenary.plant import Bounded, JointState
from catenary.robots.model import RobotModel
from catenary.trajectories.cartesian import AMPLITUDE_M, CartesianSinusoids
from catenary.trajectories.reference import InTurn, Rest, Trajectory
from catenary.workflows.gravity.simulated_arm import SimulatedArm
from catenary.workflows.robot.motion import check_motion, gentle_way, random_within, range_of

MOTIONS = ("cartesian", "random", "poses")
# where the published sinusoids of 3.1 inch find room to every side [rad, rad, m]
RAVEN_START = (0.8, 1.6, 0.3)
# away from the stops, with some way to fall to either side, and where gravity at the angles that are tried is not by
# chance what joint 1 carries on a level base [rad, rad, m]
HOLD_START = (1.0, 1.6, 0.4)
POSES = 6
REST = 1.5  # [s] at a pose
WATCHED = 0.7  # [s] of it, at its end: the arm has come to rest


class Motion(NamedTuple):
    """A motion, and the times in it at which an arm's errors count."""

    trajectory: Trajectory
    windows: Sequence[tuple[float, float]] | None  # [s] from, to; all of it when None


def make_motion(
    name: str,
    model: RobotModel,
    limits: Bounded,
    rng: np.random.Generator,
    *,
    q_start: ArrayLike | None = None,
    amplitude: float = AMPLITUDE_M,
    axes: Sequence[str] = ("x", "y", "z"),
    seconds: float = 20.0,
) -> Motion:
    """Return a motion of all joints by name, within limits.
    "cartesian" are the paper's sinusoids of the tip along `axes` of the base, from `q_start` (n,) [rad|m] on, by an
    amplitude [m]; "random" moves each joint by itself over half of its range for some seconds; "poses" rests at POSES
    positions along the first joint's range, the others at `q_start`: RAVEN_START, or the middle of the range, when
    None.
    """
    if name not in MOTIONS:
        raise InputError(f'motion "{name}": expected one of {", ".join(MOTIONS)}')
    if name == "random":
        return Motion(random_within(limits, seconds, rng), None)
    start = start_pose(model, limits) if q_start is None else as_array("q_start", q_start, (model.n,))
    if name == "cartesian":
        return Motion(CartesianSinusoids(model, start, amplitude=amplitude, axes=axes), None)
    lower, upper = range_of(limits)
    edge = 0.05 * (upper[0] - lower[0])
    return poses_along(limits, 0, np.linspace(lower[0] + edge, upper[0] - edge, POSES), start)


def poses_along(limits: Bounded, joint: int, positions: ArrayLike, q: ArrayLike) -> Motion:
    """Return a motion that rests at K positions of a joint, one after the other, the other joints at q (n,) [rad|m].

    The last WATCHED seconds of each rest count.
    """
    n = len(limits.joint_names)
    rows = np.tile(as_array("q", q, (n,)), (len(as_array("positions", positions, (None,))), 1))
    rows[:, joint] = positions
    parts: list[Trajectory] = [Rest(rows[0], REST)]
    windows = [(REST - WATCHED, REST)]
    end = REST
    for before, row in pairwise(rows):
        way = gentle_way(before, row, limits.joint_units)
        parts += [way, Rest(row, REST)]
        end += way.duration + REST
        windows.append((end - WATCHED, end))
    return Motion(InTurn(parts), windows)


def start_pose(model: RobotModel, limits: Bounded, raven: tuple[float, ...] = RAVEN_START) -> Floats:
    """Return where an arm starts, (n,) [rad|m]: a RAVEN-II at `raven`, others in the middle of their ranges."""
    if model.closed_form == "raven2" and model.n == len(raven):
        return np.array(raven)
    lower, upper = range_of(limits, "; give --q")
    return 0.5 * (lower + upper)


SETTLE = 1.0  # [s] at the start of a motion, before it begins


def track(
    arm: SimulatedArm,
    controller: SplitController,
    trajectory: Trajectory,
    *,
    settle: float = SETTLE,
    windows: Sequence[tuple[float, float]] | None = None,
    gravity: GravitySource | None = None,
    observers: Sequence[Observer] = (),
) -> Tracking:
    """Bring an arm to a motion's start, let it settle there [s], and follow the motion, all with the same controller.

    All is measured at the motors, as the paper did. Windows are the times of the motion that count in the measures,
    from and to [s]. `gravity` says what gravity is; what the plant says when None. Observers get the motion's ticks.

    Raises:
        LimitError: The motion leaves the joint limits; nothing has moved.
        InputError: The motion is of other joints, or a window lies outside it.
    """
    plant = arm.plant
    check_motion(plant, trajectory)
    spans = [(0.0, trajectory.duration)] if windows is None else list(windows)
    for first, last in spans:
        if not 0.0 <= first < last <= trajectory.duration + 1e-9:
            raise InputError(f"windows: expected within 0 to {trajectory.duration} s, got {first} to {last}")
    whole, begin = with_approach(arm, trajectory, settle)
    times: list[float] = []
    rows: list[tuple[Floats, Floats, Floats]] = []

    def observe(tick: Tick) -> None:
        if tick.time >= begin - 1e-9 and tick.tau is not None:
            times.append(tick.time - begin)
            rows.append((tick.reference.q - tick.state.q, controller.feedback.copy(), tick.tau))
            for observer in observers:
                observer(tick)

    report = run_loop(
        plant, controller, whole, limits=arm.limits(), rate_hz=1.0 / plant.period,
        gravity=gravity, observers=[observe],
    )  # fmt: skip
    time = np.array(times)
    counted = np.zeros(len(time))
    for first, last in spans:
        counted[(time >= first - 1e-9) & (time <= last + 1e-9)] = 1.0
    error, feedback, torque = (np.array(column) for column in zip(*rows, strict=True))
    return Tracking(plant.joint_names, plant.joint_units, time, error, feedback, torque, counted, report)


def with_approach(arm: SimulatedArm, trajectory: Trajectory, settle: float) -> tuple[InTurn, float]:
    """Return a motion with the way to its start before it, and when it then begins [s].

    The way begins where the arm is measured to be, so that no controller starts with a leap.
    """
    plant = arm.plant
    start, goal = as_array("measured q", plant.measured_js().q, (None,)), trajectory(0.0).q
    way = gentle_way(start, as_array("trajectory", goal, start.shape), plant.joint_units)
    # the motion begins on a tick
    begin = math.ceil((way.duration + settle) / plant.period - 1e-6) * plant.period
    return InTurn([way, Rest(goal, max(0.0, begin - way.duration)), trajectory]), begin


class TruePositions:
    """Positions of a simulated arm's joints as they truly are, as from a perfect calibration; a StateCorrector."""

    def __init__(self, arm: SimulatedArm) -> None:
        self._arm = arm

    def prepare(self, joint_names: Sequence[str], joint_units: Sequence[str], rate_hz: float) -> None:
        """Do nothing: there is nothing to forget."""

    def correct_state(self, state: JointState, out: Floats, inside: Flags, interval: Floats) -> None:
        """Write the true positions (n,) [rad|m]."""
        out[:], inside[:], interval[:] = self._arm.q_true(), True, 0.0


def hold(
    arm: SimulatedArm,
    controller: Controller,
    q: ArrayLike,
    seconds: float,
    *,
    gravity: GravitySource | None = None,
    calibrated: bool = False,
) -> Holding:
    """Place an arm at q (n,) [rad|m] by PD and sensed gravity, then let the controller alone hold it for a time.

    `gravity` says what gravity is; what the plant says when None. The controller sees joints as the robot reports them,
    or, calibrated, as they truly are.

    Raises:
        LimitError: q lies outside the joint limits; nothing has moved.
    """
    plant = arm.plant
    pose = as_array("q", q, (arm.model.n,))
    if not 0.0 < seconds < np.inf:
        raise InputError(f"seconds: expected more than 0, got {seconds}")
    check_motion(plant, Rest(pose, 0.0))
    placing = GravityPD(arm.model, arm.gains.kp, arm.gains.kd)
    whole, _ = with_approach(arm, Rest(pose, 0.0), SETTLE)
    limits, rate = arm.limits(), 1.0 / plant.period
    # by reported positions always: a stiff PD law on the far side of a soft cable swings
    run_loop(plant, placing, whole, limits=limits, rate_hz=rate, gravity=gravity)
    corrector = TruePositions(arm) if calibrated else None
    rows: list[tuple[float, Floats, Floats]] = []

    def observe(tick: Tick) -> None:
        rows.append((tick.time, tick.q_nominal, arm.q_true()))

    held = Rest(arm.q_true() if calibrated else plant.measured_js().q, seconds)
    report = run_loop(
        plant, controller, held, limits=limits, rate_hz=rate, gravity=gravity, corrector=corrector, observers=[observe],
        max_speed=np.inf,  # a simulated arm that falls is what is looked for
    )  # fmt: skip
    time, reported, true = (np.array(column) for column in zip(*rows, strict=True))
    return Holding(plant.joint_names, plant.joint_units, time, reported, true, gravity=report.gravity)
