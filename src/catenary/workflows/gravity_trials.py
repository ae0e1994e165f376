"""Gravity compensation tried on a simulated arm: the arm with all that a controller needs, and motions, also held.

[Holding: Lewis, Hannaford 2014, section V: with the sensed vector "the robot passively held any new position manually
imposed", upside down too; with the static one it drifts once "tipped more than a few degrees"]
"""

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Flags, Floats, as_array
from catenary.control.gains import (
    JointGains,
    default_limits,
    gains_at_joints,
    gains_from_mass,
    reflected_inertia,
    torque_at_joints,
)
from catenary.control.limits import TorqueLimits
from catenary.control.loop import GravitySource, Observer, Tick, run_loop
from catenary.control.loop_report import Holding, Tracking
from catenary.control.pd import Controller, GravityPD, SplitController
from catenary.errors import InputError
from catenary.open_robot import Simulated, open_robot, refuse_unsupported
from catenary.plant import Bounded, JointState, Plant
from catenary.robots.actuation import joint_drives
from catenary.robots.catalog import RAVEN_SIDES, load_robot
from catenary.robots.model import Massless, RobotModel
from catenary.sensing.gravity_vector import Mailbox
from catenary.sensing.mounting import Mounting
from catenary.simulation.base_motion import MovingBase
from catenary.simulation.cable_parameters import CableArm, Firmware
from catenary.simulation.cable_plant import CablePlant, PositioningArm
from catenary.simulation.compiled_records import POSITIONING
from catenary.simulation.joint_hardware import JointHardware
from catenary.simulation.sensors import InjectedFault, SensorModel, SimulatedSensor
from catenary.trajectories.cartesian import AMPLITUDE_M, CartesianSinusoids
from catenary.trajectories.reference import InTurn, Rest, Trajectory
from catenary.workflows.robot.motion import check_motion, gentle_way, random_within, range_of

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class SimulatedArm:
    """A homed arm; the model's joints are the plant's, in the same order."""

    plant: Plant
    model: RobotModel
    gains: JointGains
    largest_torque: Floats  # (n,) [Nm|N], infinity for none
    q_true: Callable[[], Floats]  # where the joints really are, (n,) [rad|m]
    motor_inertia: Floats | None = None  # (n, n) what motors add to the mass matrix
    stiffness: Floats | None = None  # (n,) of elastic joints [Nm/rad|N/m]

    def limits(self) -> TorqueLimits:
        """Return the arm's torque limits, in their initial state."""
        return default_limits(self.largest_torque, self.plant.joint_units, self.plant.lower, self.plant.upper)


def simulated_arm(
    robot: str,
    *,
    base: MovingBase | None = None,
    payload: float = 0.0,
    seed: int | None = None,
    massless: Massless = (),
    strict: bool = False,
    kp: ArrayLike | None = None,
    kd: ArrayLike | None = None,
    friction: ArrayLike | None = None,
    viscous: ArrayLike | None = None,
) -> SimulatedArm:
    """Put an arm on a base, a level one when None, switch it on and home it.

    RAVEN-II's positioning joints, behind their cables, with the gains of the robot's own control: what it believes of
    itself, also where the simulated robot is another (`seed`). Of any other robot the rigid bodies of its model, and
    gains by rule; with the friction and rotors of its joints where it was identified, and ideal drives otherwise.

    Args:
        robot: raven2 or raven2_right, or any other robot with inertia: a name or a file.
        payload: Mass at the tool's wrist, or at the tip [kg], unknown to the model.
        kp: Stiffness of PD, one number or (n,) [Nm/rad|N/m]; kd: its damping [Nms/rad|Ns/m]; the arm's own when None.
        friction: Coulomb friction of a robot without cables, one number or (n,) [Nm|N]; viscous: likewise
            [Nms/rad|Ns/m]; what was identified, if anything, when None.
    """
    drives = None if friction is None and viscous is None else JointHardware()  # which only some robots have
    where = Simulated(seed, base, payload, hardware=drives)
    refuse_unsupported(robot, where)
    if robot not in RAVEN_SIDES:
        model = load_robot(robot, massless=massless, strict=strict)
        own = None if model.actuation is None else joint_drives(model.actuation, model.n)
        if own is not None and own.left_out:
            _log.warning(
                'robot "%s": simulated with its Coulomb and viscous friction and rotors, joint by joint; without %s',
                model.name,
                ", ".join(own.left_out),
            )
        overrides = {"friction": friction, "damping": viscous}
        hardware = replace(
            JointHardware() if own is None else JointHardware(own.friction, own.damping),
            **{key: value for key, value in overrides.items() if value is not None},
        )
        rotors = None if own is None else own.armature
        arm = rigid_arm(model, base=base, payload=payload, hardware=hardware, motor_inertia=rotors)
        return with_gains(arm, kp, kd)
    return with_gains(raven_arm(cast(CablePlant, open_robot(robot, where))), kp, kd)


def with_gains(arm: SimulatedArm, kp: ArrayLike | None, kd: ArrayLike | None) -> SimulatedArm:
    """Return an arm with other gains at its joints: one number for all, or (n,); its own where None."""
    chosen = []
    for name, own, value in zip(("kp", "kd"), arm.gains, (kp, kd), strict=True):
        values = own if value is None else as_array(name, value, () if np.ndim(value) == 0 else own.shape)
        if not (values >= 0.0).all():
            raise InputError(f"{name}: expected zero or more, got {values.tolist()}")
        chosen.append(np.broadcast_to(values, own.shape).copy())
    return replace(arm, gains=JointGains(*chosen))


def rigid_arm(
    model: RobotModel,
    *,
    base: MovingBase | None = None,
    payload: float = 0.0,
    start: ArrayLike | None = None,
    motor_inertia: ArrayLike | None = None,
    hardware: JointHardware | None = None,
) -> SimulatedArm:
    """Simulate any robot as rigid bodies, enabled, with gains by rule.

    It stands at `start` (n,) [rad|m] on a base, as `open_robot` has them when None, with a payload [kg] at its tip
    of which the model knows nothing. `hardware` is its friction, `motor_inertia` (n,) rotors at its joints [kg m2|kg].
    """
    model.require_inertia()
    n = model.n
    rotors = as_array("motor_inertia", np.zeros(n) if motor_inertia is None else motor_inertia, (n,))
    added = np.diag(rotors) if rotors.any() else None
    drives = replace(hardware or JointHardware(), armature=rotors)
    plant = open_robot(model, Simulated(base=base, payload=payload, start=start, hardware=drives))
    return SimulatedArm(
        plant=plant,
        model=model,
        gains=gains_from_mass(model, motor_inertia=added),
        largest_torque=np.array(model.effort_limit),
        q_true=lambda: plant.telemetry()["q_true"],
        motor_inertia=added,
    )


def raven_arm(plant: CablePlant) -> SimulatedArm:
    """Return a homed RAVEN-II as an arm of three joints, with its firmware's gains and its nominal springs."""
    part, firmware, n = PositioningArm(plant), plant.arm.firmware, POSITIONING
    return SimulatedArm(
        plant=part,
        model=load_robot("raven2" if plant.side == "left" else "raven2_right"),
        gains=raven_gains(firmware),
        # at level "moderate": 7.5, 6.7 Nm, 95 N, from its DAC limits
        largest_torque=torque_at_joints(
            firmware.dac_limit[:n], firmware.dac_per_ampere[:n], firmware.torque_constant[:n], firmware.ratio[:n]
        ),
        q_true=lambda: part.q_true,
        motor_inertia=raven_motor_inertia(plant.arm),
        stiffness=np.array(plant.arm.file.cable["stiffness"].value),
    )


def raven_gains(firmware: Firmware) -> JointGains:
    """Return gains of RAVEN-II's own control at its positioning joints: 454, 362 Nm/rad, 57.1 kN/m; 12.1, 9.6, 4564.

    [RAVEN-II source: Kp, Kd per motor, at the gearbox's output]
    """
    return gains_at_joints(*(getattr(firmware, name)[:POSITIONING] for name in ("kp", "kd", "ratio", "gearbox")))


def raven_motor_inertia(arm: CableArm) -> Floats:
    """Return the inertia that RAVEN-II's motors add to the mass matrix, by nominal ratios and coupling, (3, 3)."""
    ratio = np.abs(arm.firmware.ratio[:POSITIONING])
    return reflected_inertia(arm.cable.rotor_inertia, ratio, arm.firmware.coupling)


def base_sensor(
    base: MovingBase,
    *,
    start: float = 0.0,
    bias: ArrayLike = (0.0, 0.0, 0.0),
    noise: float | None = None,
    fault: InjectedFault | None = None,
    seed: int = 0,
    at: tuple[RobotModel, str] | None = None,
) -> tuple[SimulatedSensor, Mounting]:
    """Return a simulated inertial unit, 200 Hz, on a base, and its mounting.

    Args:
        start: Plant time at which it begins [s].
        bias: Accelerometer bias (3,) [m/s2] that calibration left and the mounting does not know.
        noise: Standard deviation of a reading's axis [m/s2]; an MPU-6050's when None.
        at: Robot and its frame that carries the sensor; the base's origin when None.
    """
    model = SensorModel()
    if noise is not None:
        if not 0.0 <= noise < np.inf:
            raise InputError(f"sensor noise: expected 0 or more m/s2, got {noise}")
        # white up to half the sampling rate
        model = replace(model, noise=noise / float(np.sqrt(0.5 * model.rate_hz)))
    mounting = model.mounting if at is None else model.mounting.at(*at)
    true = replace(mounting, bias=as_array("sensor bias", bias, (3,)))
    faults = () if fault is None else (fault,)
    sensor = SimulatedSensor(base, Mailbox(), replace(model, mounting=true), faults=faults, seed=seed, start=start)
    return sensor, mounting


MOTIONS = ("cartesian", "random", "poses")
# where the published sinusoids of 3.1 inch find room to every side [rad, rad, m]
RAVEN_START = (0.8, 1.6, 0.3)
# away from the stops, with some way to fall to either side, and where gravity at the angles that are tried is not by
# chance what joint 1 carries on a level base [rad, rad, m]
HOLD_START = (1.0, 1.6, 0.4)
POSES = 6
REST_S = 1.5  # [s] at a pose
WATCHED_S = 0.7  # [s] of it, at its end: the arm has come to rest


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

    Args:
        name: "cartesian": the paper's sinusoids of the tip; "random": each joint independently over half of its range;
            "poses": rests at `POSES` positions along the first joint's range, the others at `q_start`.
        q_start: Start (n,) [rad|m]; `RAVEN_START`, or the middle of the range, when None.
        amplitude, axes: Amplitude of the sinusoids [m], and axes of the base along which they move.
        seconds: Duration of a random motion [s].
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
    parts: list[Trajectory] = [Rest(rows[0], REST_S)]
    windows = [(REST_S - WATCHED_S, REST_S)]
    end = REST_S
    for before, row in pairwise(rows):
        way = gentle_way(before, row, limits.joint_units)
        parts += [way, Rest(row, REST_S)]
        end += way.duration + REST_S
        windows.append((end - WATCHED_S, end))
    return Motion(InTurn(parts), windows)


def start_pose(model: RobotModel, limits: Bounded, raven: tuple[float, ...] = RAVEN_START) -> Floats:
    """Return the start of an arm (n,) [rad|m]: a RAVEN-II's own, the middle of the ranges of others.

    Args:
        raven: Start of a RAVEN-II [rad, rad, m].
    """
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
    """Bring an arm to a motion's start, let it settle, and follow the motion, all with the same controller.

    All is measured at the motors, as in the paper. A motion beyond the limits, or of other joints, moves nothing.

    Args:
        settle: Time at the start [s].
        windows: Times of the motion that count in the measures, from and to [s]; all when None.
        gravity: Source of gravity; the plant's own when None.
        observers: Called with the motion's ticks.
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


def hold_arm(
    arm: SimulatedArm,
    controller: Controller,
    q: ArrayLike,
    seconds: float,
    *,
    gravity: GravitySource | None = None,
    calibrated: bool = False,
) -> Holding:
    """Place an arm by PD and sensed gravity, then let the controller alone hold it.

    Args:
        q: Positions (n,) [rad|m]; outside the joint limits LimitError, and nothing has moved.
        seconds: Time to hold [s].
        gravity: Source of gravity; the plant's own when None.
        calibrated: Whether the controller sees true joint positions; as the robot reports them otherwise.
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
