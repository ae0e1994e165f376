"""The control loop: ticks at a fixed rate, and a safe stop however the loop ends."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Flags, Floats, as_array
from catenary.control.correction import Correction, StateCorrector
from catenary.control.limits import TorqueLimits
from catenary.control.loop_report import LoopReport, LoopTally
from catenary.control.pd import Controller
from catenary.control.realtime import RealTime
from catenary.control.shutdown import GIVE_UP_AFTER_TICKS, MAX_STEP, FiniteTicks, MotionGuard, hold_position, leave_safe
from catenary.errors import InputError, LimitError, SensorError
from catenary.kernels.compiled import in_motion
from catenary.operating_system import require_linux
from catenary.plant import JointState, Plant, require_ready
from catenary.sensing.gravity_vector import GravityReading, ReadingStatus
from catenary.trajectories.reference import Reference, Trajectory

# [rad], [m] largest distance from the measured position to the first reference, with a controller: the arm may have
# sagged under another one
_MAX_SAG = {"rad": 0.1, "m": 0.01}


class GravitySource(Protocol):
    """A source of gravity in the base frame and of the base's rates, such as a sensor on the base."""

    def read(self, time: float) -> GravityReading:
        """Return the reading at the time of a joint state [s], without blocking and without raising."""


class Tick(NamedTuple):
    """State and command of one tick; observers may keep the arrays but must not change them."""

    number: int
    time: float  # [s] since the start, in ticks
    state: JointState  # q is q_calibrated if the loop has a corrector
    q_nominal: Floats  # (n,) [rad|m] as the robot reported it
    inside: Flags  # (n,) inside the corrector's valid range; true without a corrector
    reference: Reference
    tau: Floats | None  # (n,) [Nm|N] sent torque; None if `reference.q` was sent as a position


Observer = Callable[[Tick], None]


def run_loop(
    plant: Plant,
    controller: Controller | None,
    trajectory: Trajectory,
    *,
    limits: TorqueLimits | None = None,
    rate_hz: float = 1000.0,
    corrector: StateCorrector | None = None,
    gravity: GravitySource | None = None,
    observers: Sequence[Observer] = (),
    duration: float | None = None,
    real_time: bool = False,
    give_up_after: int = GIVE_UP_AFTER_TICKS,
    max_speed: ArrayLike | None = None,
) -> LoopReport:
    """Run a controller on a robot along a trajectory, and return a report of timing, valid range and tracking.

    A tick: measure, correct, sense gravity, control, limit, send, observe, wait. Without a controller, the loop sends
    the reference positions and the robot's firmware controls. A late tick delays the motion and causes no jump.
    The clock starts when the first command has been sent.

    The trajectory must begin at the robot's position: at the setpoint without a controller, else at the measured or
    the calibrated position. If it begins at the measured position, the correction fades in within 1.5 s; so does a
    change between model and fixed offset. Until then the intervals are wider by the part that is not yet applied.
    If the controller uses calibrated positions, the model's torque inputs are low-pass filtered (`SlowTorque`).

    At the end the robot holds its position: by firmware if it has servo_jp, otherwise paused at zero torque. After an
    error or Ctrl-C it holds its last finite position or gets zero torque, and is paused; the error is raised with the
    report so far in its attribute `loop_report`.

    Args:
        limits: Torque limits; with None, only NaN and infinity are replaced, by zero torque.
        rate_hz: Rate of ticks; the plant's own rate divided by a whole number.
        corrector: Turns reported positions into calibrated ones for the controller; limits use reported ones.
        gravity: Replaces the robot's gravity vector, its age and the base's rates in every state.
        observers: Called with every tick, after its command was sent.
        duration: [s]; the trajectory's if None; infinity runs until Ctrl-C.
        real_time: Run a simulated plant in real time, instead of as fast as possible.
        give_up_after: Consecutive ticks with a torque or measured position that is NaN or infinite, after which the
            loop ends; it also ends once such ticks exceed a quarter of the others by this number.
        max_speed: Speed of a measured joint or of the reference that ends the loop, one for all or (n,) [rad/s|m/s];
            if None, 1.2 times the plant's `velocity_limit`, or 2 rad/s and .5 m/s if it has none.

    Raises:
        NotReadyError: The plant is not enabled, not homed or busy; nothing was sent.
        UnsupportedCommandError: The plant takes no torques, or without a controller no positions.
        LimitError: The trajectory begins away from the robot's position, and nothing was sent; or a joint was too fast
            or the reference jumped, and the loop ended (`MotionGuard`).
        InputError: Rate, duration, trajectory, limits or a torque do not fit the plant.
        NotFiniteError: Torques or measured positions were not finite in too many ticks.
        SensorError: The source of gravity asks for a stop.
        UnsupportedSystemError: The robot is real, and this is not Linux.

    Examples:
        >>> arm = catenary.load_robot("two_link")
        >>> plant = catenary.MujocoPlant(arm, start=[0.3, 0.5])
        >>> plant.home()
        >>> path = catenary.go_to([0.3, 0.5], [0.6, 0.2], max_velocity=[1.0, 1.0], max_acceleration=[2.0, 2.0])
        >>> controller = catenary.GravityPD(arm, kp=[2000.0, 500.0], kd=[120.0, 13.0])
        >>> report = catenary.run_loop(plant, controller, path)
        >>> report.finished, bool(np.abs(plant.measured_js().q - [0.6, 0.2]).max() < 0.01)
        (True, True)
    """
    if not plant.simulated:
        require_linux("a robot's control loop")
    limits = TorqueLimits(np.full(len(plant.joint_names), np.inf)) if limits is None else limits
    in_time = real_time or not plant.simulated
    run = _Run(
        plant, controller, trajectory, limits, rate_hz, corrector, gravity, observers, in_time, give_up_after, max_speed
    )
    length = trajectory.duration if duration is None else duration
    if not length >= 0.0:
        raise InputError(f"duration: expected zero or more seconds, got {length}")
    # the last tick sends the reference at the end; 1e-9 forgives rounding
    numbers = range(math.ceil(length * rate_hz - 1e-9) + 1) if math.isfinite(length) else count()
    moving = in_motion.set(True)
    try:
        if run.clock is not None:
            run.clock.begin()
        for number in numbers:
            run.tick(number)
        if controller is not None:
            run.hold()
        return run.report(finished=True)
    except BaseException as error:  # Ctrl-C too: the robot must stop whatever ends the loop
        ticks = run.tally.ticks
        error.loop_report = run.report(finished=False)  # type: ignore[attr-defined]
        error.add_note(f"the control loop ended after {ticks} ticks ({ticks * run.period:.3f} s)")
        leave_safe(plant, run.finite.held, error)
        raise
    finally:
        in_motion.reset(moving)
        if run.clock is not None:
            run.clock.end()


@dataclass
class _Run:
    """Settings and state of one run of the loop."""

    plant: Plant
    controller: Controller | None
    trajectory: Trajectory
    limits: TorqueLimits
    rate_hz: float
    corrector: StateCorrector | None
    gravity: GravitySource | None
    observers: Sequence[Observer]
    in_time: bool
    give_up_after: int
    max_speed: ArrayLike | None

    def __post_init__(self) -> None:
        """Check that the robot is ready and where the trajectory begins, and prepare; nothing is sent."""
        plant, n = self.plant, len(self.plant.joint_names)
        self.waits = _require_ready(plant, self.controller, self.rate_hz)  # the plant's ticks per tick of the loop
        self.period = 1.0 / self.rate_hz  # [s] between ticks
        first = as_array("reference q", self.trajectory(0.0).q, (n,))
        state = plant.measured_js()
        self.correction = None
        if self.corrector is not None:
            self.correction = Correction(self.corrector, plant, state, self.rate_hz)
        if self.controller is None:
            _refuse_jump(plant, first, "the setpoint", plant.setpoint_js().q, np.zeros(n), MAX_STEP)
        else:
            added = np.zeros(n) if self.correction is None else self.correction.at_start
            is_corrected = _refuse_jump(plant, first, "the robot", state.q, added, _MAX_SAG)
            if self.correction is not None:
                self.correction.smooth(np.where(is_corrected, added, 0.0))
        self.guard = MotionGuard(plant, first, self.period, self.max_speed)
        self.limits.reset(state.tau)
        self.finite = FiniteTicks(plant.joint_names, state.q, self.give_up_after)
        self.clock = RealTime(self.period) if self.in_time else None
        self.tally = LoopTally(n, sensed=self.gravity is not None)
        self.all_inside = np.ones(n, dtype=bool)  # reported without a corrector

    def tick(self, number: int) -> None:
        """Measure, correct, sense gravity, control, limit, send, observe, wait."""
        begin = time.perf_counter()
        plant, period, tally = self.plant, self.period, self.tally
        state = plant.measured_js()
        n = len(plant.joint_names)
        q_nominal = as_array("measured q", state.q, (n,), finite=False)
        if self.correction is not None:
            state = self.correction.corrected(state)
        if self.gravity is not None:
            state = self._with_gravity(state, self.gravity.read(state.time))
        reference = self.trajectory(number * period)
        q_reference = as_array("reference q", reference.q, (n,), finite=False)
        self.guard.update(state.time, q_nominal, q_reference)
        tau = None
        if self.controller is None:
            self.finite.update(q_nominal)
            plant.servo_jp(q_reference)
        else:
            torque = as_array("torque", self.controller.torque(state, reference), (n,), finite=False)
            tau = self.limits.apply(torque, q_nominal, period)
            self.finite.update(q_nominal, torque)
            plant.servo_jf(tau)
        if self.clock is not None:
            self.clock.sent()
        inside = self.all_inside if self.correction is None else self.correction.inside
        tally.add(q_reference, q_nominal, state.q, inside)
        for observe in self.observers:
            observe(Tick(number, number * period, state, q_nominal, inside, reference, tau))
        if number > 0:
            tally.compute.add(time.perf_counter() - begin)
        for _ in range(self.waits):
            plant.wait()
        if self.clock is not None:
            if number > 0:
                self.clock.wait()
            else:
                self.clock.start()

    def _with_gravity(self, state: JointState, reading: GravityReading) -> JointState:
        if self.tally.gravity is not None:
            self.tally.gravity.add(reading)
        if reading.status is ReadingStatus.STOP:
            raise SensorError(f"gravity is not known: {reading.faults.message or 'the sensor is lost'}")
        return JointState(*state[:5], reading.gravity, reading.age, reading.base_rates, state.q_interval)

    def hold(self) -> None:
        """Make the robot hold its position without the controller."""
        q = self.plant.measured_js().q
        if not hold_position(self.plant, np.where(np.isfinite(q), q, self.finite.held)):
            self.plant.state_command("pause")

    def report(self, *, finished: bool) -> LoopReport:
        """Return the report of the ticks so far."""
        tally, clock, corrected = self.tally, self.clock, self.correction is not None
        reported, calibrated = tally.tracking()
        return LoopReport(
            joint_names=self.plant.joint_names,
            joint_units=self.plant.joint_units,
            rate_hz=self.rate_hz,
            ticks=tally.ticks,
            finished=finished,
            compute=tally.compute.timing(),
            jitter=None if clock is None else clock.jitter.timing(),
            overruns=None if clock is None else clock.overruns,
            longest_gap=None if clock is None else clock.longest_gap,
            has_priority=clock is not None and clock.has_priority,
            outside_valid_range=tuple((tally.outside / max(1, tally.ticks)).tolist()) if corrected else None,
            tracking_nominal=reported,
            tracking_calibrated=calibrated if corrected else None,
            limited_ticks=self.limits.limited,
            not_finite_ticks=self.limits.not_finite,
            gravity=None if tally.gravity is None else tally.gravity.report(),
            correction=None if self.correction is None else self.correction.durations.timing(),
        )


def _require_ready(plant: Plant, controller: Controller | None, rate_hz: float) -> int:
    """Check plant and rate, and return the number of the plant's ticks per tick of the loop."""
    require_ready(plant, "servo_jp" if controller is None else "servo_jf")
    if not 0.0 < rate_hz < math.inf:
        raise InputError(f"rate_hz: expected a positive rate, got {rate_hz}")
    ratio = 1.0 / (rate_hz * plant.period)
    waits = max(1, round(ratio))
    if abs(ratio / waits - 1.0) > 0.01:
        raise InputError(
            f"rate_hz {rate_hz:g}: expected the robot's rate, {1.0 / plant.period:g} Hz, divided by a whole number"
        )
    return waits


def _refuse_jump(
    plant: Plant, first: Floats, what: str, q: Floats, correction: Floats, max_jump: Mapping[str, float]
) -> Flags:
    """Refuse a jump to the first reference; return flags of joints that begin at q + correction, calibrated (n,)."""
    calibrated = q + correction
    reported, corrected = np.abs(first - q), np.abs(first - calibrated)
    for j, (name, unit) in enumerate(zip(plant.joint_names, plant.joint_units, strict=True)):
        if not min(reported[j], corrected[j]) <= max_jump[unit]:
            also = f" ({calibrated[j]:.6g} {unit} calibrated)" if correction[j] else ""
            raise LimitError(
                f'joint "{name}": the trajectory begins at {first[j]:.6g} {unit}, {what} is at '
                f"{q[j]:.6g} {unit}{also}; go there first"
            )
    return corrected <= reported
