"""The control loop: the only clock, and the only place that cleans up behind a controller."""

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
from catenary.sensing.vector import GravityReading, ReadingStatus
from catenary.trajectories.reference import Reference, Trajectory

# [rad], [m] to a first reference from where it is measured, with a controller: an arm may have sagged under another
_MAX_SAG = {"rad": 0.1, "m": 0.01}


class GravitySource(Protocol):
    """A source of gravity in the base frame and of the base's rates, such as a sensor on the base."""

    def read(self, time: float) -> GravityReading:
        """Return its reading at the time of a joint state [s]; it raises nothing, and waits for nothing."""


class Tick(NamedTuple):
    """State and command of one tick; observers may keep the arrays, and must not change them."""

    number: int
    time: float  # [s] since the start, in ticks
    state: JointState  # q is q_calibrated where a corrector is there
    q_nominal: Floats  # (n,) [rad|m] as the robot reported it
    inside: Flags  # (n,) inside the corrector's valid range; true without corrector
    reference: Reference
    tau: Floats | None  # (n,) [Nm|N] that was sent; None when `reference.q` was, as a position


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
    """Run a controller on a robot along a trajectory, and return a report of timing, trust and tracking.

    A tick: measure, correct, sense gravity, control, limit, send, observe, wait. Without a controller the reference's
    positions are sent, and the robot's own firmware controls. A late tick delays the motion, it never makes it leap.
    The clock starts when the first command has gone out.

    The robot is where the trajectory begins: by its setpoint without a controller, else as it is measured, or by its
    calibrated positions. A correction comes on within 1.5 s where the trajectory begins at the
    position that the robot reports, and where it changes between model and fixed offset: the controller sees no leap.
    Until then the state's half-widths are wider by what is left out. The torques that it takes are slow where a
    controller takes its positions (`SlowTorque`), else as measured.

    At the end the robot holds its position, by its firmware where it has servo_jp, otherwise at zero torque and
    paused. Whatever else ends the loop, an error or Ctrl-C, it holds its last finite position or gets zero torque,
    and is paused; the error is raised, with the report so far as its attribute `loop_report`.

    Args:
        limits: On torque; None stops only NaN and infinity, which become zero torque.
        rate_hz: Of ticks; the plant's own rate divided by a whole number.
        corrector: Turns reported positions into calibrated ones for the controller; limits look at reported ones.
        gravity: Takes the place of the gravity vector, its age and the base's rates in every state, the robot's report.
        observers: Called with every tick, after its command was sent.
        duration: [s]; the trajectory's when None; infinity runs until Ctrl-C.
        real_time: Keep time with a simulated plant too, which otherwise runs as fast as it can.
        give_up_after: Ticks in a row with a torque or a measured position that is NaN or infinite, after which the
            loop ends, or as many more than a quarter of the others. In fewer such a torque is zero.
        max_speed: Of measured joints and of the reference, one for all or (n,) [rad/s|m/s], infinity for any, beyond
            which the loop ends; when None 1.2 times the plant's own `velocity_limit`, without one 2 rad/s, .5 m/s.

    Raises:
        NotReadyError: The plant is not enabled, not homed or busy; nothing was sent.
        UnsupportedCommandError: It takes no torques, or without controller no positions.
        LimitError: The trajectory begins elsewhere than the robot is, and nothing was sent; a joint was too fast, or
            the reference leapt, and the loop ended (`MotionGuard`).
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
    waits = _require_ready(plant, controller, rate_hz)
    n, period = len(plant.joint_names), 1.0 / rate_hz
    length = trajectory.duration if duration is None else duration
    if not length >= 0.0:
        raise InputError(f"duration: expected zero or more seconds, got {length}")
    # the last tick sends the reference at the end; 1e-9 forgives rounding
    numbers = range(math.ceil(length * rate_hz - 1e-9) + 1) if math.isfinite(length) else count()
    first = as_array("reference q", trajectory(0.0).q, (n,))
    state = plant.measured_js()
    correction = None if corrector is None else Correction(corrector, plant, state, rate_hz)
    if controller is None:
        _require_near(plant, first, "the setpoint", plant.setpoint_js().q, np.zeros(n), MAX_STEP)
    else:
        added = np.zeros(n) if correction is None else correction.at_start
        is_corrected = _require_near(plant, first, "the robot", state.q, added, _MAX_SAG)
        if correction is not None:
            correction.smooth(np.where(is_corrected, added, 0.0))
    guard = MotionGuard(plant, first, period, max_speed)
    if limits is None:
        limits = TorqueLimits(np.full(n, np.inf))
    limits.reset(state.tau)
    run = _Run(
        plant=plant,
        controller=controller,
        trajectory=trajectory,
        rate_hz=rate_hz,
        period=period,
        waits=waits,
        limits=limits,
        guard=guard,
        finite=FiniteTicks(plant.joint_names, state.q, give_up_after),
        correction=correction,
        gravity=gravity,
        observers=observers,
        clock=RealTime(period) if real_time or not plant.simulated else None,
        tally=LoopTally(n, sensed=gravity is not None),
        all_inside=np.ones(n, dtype=bool),
    )
    moving = in_motion.set(True)
    try:
        if run.clock is not None:
            run.clock.begin()
        for number in numbers:
            run.tick(number)
        if controller is not None:
            run.hold()
        return run.report(finished=True)
    except BaseException as error:  # Ctrl-C too: whatever ends the loop must not leave the robot under way
        ticks = run.tally.ticks
        error.loop_report = run.report(finished=False)  # type: ignore[attr-defined]
        error.add_note(f"the control loop ended after {ticks} ticks ({ticks * period:.3f} s)")
        leave_safe(plant, run.finite.held, error)
        raise
    finally:
        in_motion.reset(moving)
        if run.clock is not None:
            run.clock.end()


@dataclass(frozen=True)
class _Run:
    """One run of the loop: what a tick needs."""

    plant: Plant
    controller: Controller | None
    trajectory: Trajectory
    rate_hz: float
    period: float  # [s] of a tick
    waits: int  # ticks of the plant in one of the loop
    limits: TorqueLimits
    guard: MotionGuard
    finite: FiniteTicks
    correction: Correction | None
    gravity: GravitySource | None
    observers: Sequence[Observer]
    clock: RealTime | None
    tally: LoopTally
    all_inside: Flags  # (n,) true, reported without a corrector

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
        q_wanted = as_array("reference q", reference.q, (n,), finite=False)
        self.guard.update(state.time, q_nominal, q_wanted)
        tau = None
        if self.controller is None:
            self.finite.update(q_nominal)
            plant.servo_jp(q_wanted)
        else:
            wanted = as_array("torque", self.controller.torque(state, reference), (n,), finite=False)
            tau = self.limits.apply(wanted, q_nominal, period)
            self.finite.update(q_nominal, wanted)
            plant.servo_jf(tau)
        if self.clock is not None:
            self.clock.sent()
        inside = self.all_inside if self.correction is None else self.correction.inside
        tally.add(q_wanted, q_nominal, state.q, inside)
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
        """Have the robot hold where it is, without the controller."""
        q = self.plant.measured_js().q
        if not hold_position(self.plant, np.where(np.isfinite(q), q, self.finite.held)):
            self.plant.state_command("pause")

    def report(self, *, finished: bool) -> LoopReport:
        """Return the report of the ticks so far."""
        tally, clock, corrected = self.tally, self.clock, self.correction is not None
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
            tracking_nominal=tally.nominal.value(),
            tracking_calibrated=tally.calibrated.value() if corrected else None,
            limited_ticks=self.limits.limited,
            not_finite_ticks=self.limits.not_finite,
            gravity=None if tally.gravity is None else tally.gravity.report(),
            correction=None if self.correction is None else self.correction.durations.timing(),
        )


def _require_ready(plant: Plant, controller: Controller | None, rate_hz: float) -> int:
    """Refuse what cannot run, and return the number of the plant's ticks in one of the loop's."""
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


def _require_near(
    plant: Plant, first: Floats, what: str, q: Floats, correction: Floats, most: Mapping[str, float]
) -> Flags:
    """Refuse to make a robot leap; return which joints begin at their calibrated positions, q + correction (n,)."""
    calibrated = q + correction
    reported, corrected = np.abs(first - q), np.abs(first - calibrated)
    for j, (name, unit) in enumerate(zip(plant.joint_names, plant.joint_units, strict=True)):
        if not min(reported[j], corrected[j]) <= most[unit]:
            also = f" ({calibrated[j]:.6g} {unit} calibrated)" if correction[j] else ""
            raise LimitError(
                f'joint "{name}": the trajectory begins at {first[j]:.6g} {unit}, {what} is at '
                f"{q[j]:.6g} {unit}{also}; go there first"
            )
    return corrected <= reported
