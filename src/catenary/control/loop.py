"""The control loop: the only clock, and the only place that cleans up behind a controller."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from itertools import count
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_array
from catenary.control.limits import TorqueLimits
from catenary.control.loop_report import GravityTally, LoopReport, RunningRms
from catenary.control.motion_guard import LEAP, MotionGuard
from catenary.control.pd import Controller
from catenary.control.realtime import Durations, RealTime
from catenary.control.shutdown import GIVE_UP_AFTER, FiniteTicks, hold, leave_safe
from catenary.errors import InputError, LimitError, SensorError
from catenary.kernels.compiled import in_motion
from catenary.plant import JointState, Plant, require_ready
from catenary.sensing.vector import GravityReading, ReadingStatus
from catenary.trajectories.reference import Reference, Trajectory

FADE = 1.5  # [s] from a leap until all of it has come on
SETTLES = 0.2  # [s] time constant of the torques that a correction takes: slower than an arm under PD
Flags = NDArray[np.bool_]
# [rad], [m] to a first reference from where it is measured, with a controller: an arm may have sagged under another
SAG = {"rad": 0.1, "m": 0.01}


class Fade:
    """What is left out of a correction that leaps: all of the leap at first, then in equal steps ever less."""

    def __init__(self, correction: Floats, period: float) -> None:
        """Begin at a correction (n,) [rad|m] that is already acting, in ticks of `period` [s]."""
        self._last, self._share = correction, period / FADE
        self._left = self._step = np.zeros(len(correction))

    def left_out(self, correction: Floats, leaps: ArrayLike) -> Floats:
        """Return what is left out of a tick's correction (n,) [rad|m], which `leaps` from the last one where told."""
        leap = np.where(leaps, np.nan_to_num(correction - self._last), 0.0)
        self._last = correction
        if leap.any():
            self._left = self._left + leap
            self._step = self._share * np.abs(self._left)
        left = self._left
        self._left = left - np.clip(left, -self._step, self._step)
        return left


class SlowTorque:
    """The torques that a correction takes where control takes the corrected positions: a first-order low-pass.

    A correction of -tau / k undoes the stretch of a cable of stiffness k. PD of gain kp at such positions commands
    tau = -kp (q - tau / k): at once, where kp is above k, it pushes the arm the way that it is off. Behind a low-pass
    slower than the arm that loop's gain is kp / (kp + k), always below one.
    """

    def __init__(self, period: float) -> None:
        """Begin at the first torques, in ticks of `period` [s]."""
        self._tau: Floats | None = None
        self._share = -math.expm1(-period / SETTLES)

    def of(self, tau: Floats) -> Floats:
        """Return a tick's torques (n,) [Nm|N], slow; one that is not finite is passed on, and forgotten."""
        last = np.where(np.isfinite(tau), tau, 0.0) if self._tau is None else self._tau
        step = self._share * (tau - last)
        known = np.isfinite(step)
        if known.all():
            self._tau = last + step
            return self._tau
        self._tau = last + np.where(known, step, 0.0)
        return np.where(known, self._tau, tau)


class StateCorrector(Protocol):
    """A source of true joint positions for the loop, such as a deployed calibration model."""

    def prepare(self, joint_names: Sequence[str], joint_units: Sequence[str], rate_hz: float) -> None:
        """Get ready for a robot, or raise; forget all previous ticks."""

    def correct_state(self, state: JointState, out: Floats, inside: Flags, interval: Floats) -> None:
        """Write calibrated positions (n,) [rad|m], whether each is inside the valid range, and half-widths [rad|m]."""


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
    give_up_after: int = GIVE_UP_AFTER,
    max_speed: ArrayLike | None = None,
) -> LoopReport:
    """Run a controller on a robot along a trajectory, and return a report of timing, trust and tracking.

    A tick: measure, correct, sense gravity, control, limit, send, observe, wait. Without a controller the reference's
    positions are sent, and the robot's own firmware controls. A late tick delays the motion, it never makes it leap.
    The clock starts when the first command has gone out.

    The robot is where the trajectory begins: by its setpoint without a controller, else as it is measured, or by its
    calibrated positions. A correction comes on within FADE seconds where the trajectory begins at the
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
    """
    waits = _require_ready(plant, controller, rate_hz)
    n, dt = len(plant.joint_names), 1.0 / rate_hz
    length = trajectory.duration if duration is None else duration
    if not length >= 0.0:
        raise InputError(f"duration: expected zero or more seconds, got {length}")
    # the last tick sends the reference at the end; 1e-9 forgives rounding
    numbers = range(math.ceil(length * rate_hz - 1e-9) + 1) if math.isfinite(length) else count()
    first = as_array("reference q", trajectory(0.0).q, (n,))
    state, correction, inside = plant.measured_js(), np.zeros(n), np.ones(n, dtype=bool)
    if corrector is not None:
        corrector.prepare(plant.joint_names, plant.joint_units, rate_hz)
        corrector.correct_state(state, correction, inside, np.empty(n))
        correction -= state.q
        corrector.prepare(plant.joint_names, plant.joint_units, rate_hz)  # the loop's ticks are the first
    if controller is None:
        _require_near(plant, first, "the setpoint", plant.setpoint_js().q, np.zeros(n), LEAP)
    else:
        correction[~_require_near(plant, first, "the robot", state.q, correction, SAG)] = 0.0
    fade, slow, guard = Fade(correction, dt), SlowTorque(dt), MotionGuard(plant, first, dt, max_speed)
    if limits is None:
        limits = TorqueLimits(np.full(n, np.inf))
    limits.reset(state.tau)
    clock = RealTime(dt) if real_time or not plant.simulated else None
    compute, correcting, outside = Durations(), Durations(), np.zeros(n)
    nominal, calibrated = RunningRms(n), RunningRms(n)  # of the reference less each
    sensed = None if gravity is None else GravityTally()
    finite = FiniteTicks(plant.joint_names, state.q, give_up_after)
    ticks, finished = 0, False

    def report() -> LoopReport:
        return LoopReport(
            joint_names=plant.joint_names,
            joint_units=plant.joint_units,
            rate_hz=rate_hz,
            ticks=ticks,
            finished=finished,
            compute=compute.timing(),
            jitter=None if clock is None else clock.jitter.timing(),
            overruns=None if clock is None else clock.overruns,
            longest_gap=None if clock is None else clock.longest_gap,
            has_priority=clock is not None and clock.has_priority,
            outside_valid_range=None if corrector is None else tuple((outside / max(1, ticks)).tolist()),
            tracking_nominal=nominal.value(),
            tracking_calibrated=None if corrector is None else calibrated.value(),
            limited_ticks=limits.limited,
            not_finite_ticks=limits.not_finite,
            gravity=None if sensed is None else sensed.report(),
            correction=correcting.timing(),
        )

    moving = in_motion.set(True)
    try:
        if clock is not None:
            clock.begin()
        for number in numbers:
            begin = time.perf_counter()
            state = plant.measured_js()
            q_nominal = as_array("measured q", state.q, (n,), finite=False)
            if corrector is not None:
                q, was_inside, interval = np.empty(n), inside, np.empty(n)
                inside = np.empty(n, dtype=bool)
                asked = time.perf_counter()
                known = state if controller is None else state._replace(tau=slow.of(state.tau))
                corrector.correct_state(known, q, inside, interval)
                if number > 0:
                    correcting.add(time.perf_counter() - asked)
                if controller is not None:
                    left = fade.left_out(q - q_nominal, (inside != was_inside) | (number == 0))
                    q -= left
                    interval += np.abs(left)
                state = JointState(state.time, q, *state[2:8], interval)
            if gravity is not None and sensed is not None:
                reading = gravity.read(state.time)
                sensed.add(reading)
                if reading.status is ReadingStatus.STOP:
                    raise SensorError(f"gravity is not known: {reading.faults.message or 'the sensor is lost'}")
                state = JointState(*state[:5], reading.gravity, reading.age, reading.base_rates, state.q_interval)
            reference = trajectory(number * dt)
            q_wanted = as_array("reference q", reference.q, (n,), finite=False)
            guard.update(state.time, q_nominal, q_wanted)
            tau = None
            if controller is None:
                finite.update(q_nominal)
                plant.servo_jp(q_wanted)
            else:
                wanted = as_array("torque", controller.torque(state, reference), (n,), finite=False)
                tau = limits.apply(wanted, q_nominal, dt)
                finite.update(q_nominal, wanted)
                plant.servo_jf(tau)
            if clock is not None:
                clock.sent()
            nominal.add(q_wanted, q_nominal)
            calibrated.add(q_wanted, state.q)
            outside += ~inside
            ticks += 1
            for observe in observers:
                observe(Tick(number, number * dt, state, q_nominal, inside, reference, tau))
            if number > 0:
                compute.add(time.perf_counter() - begin)
            for _ in range(waits):
                plant.wait()
            if clock is not None:
                if number > 0:
                    clock.wait()
                else:
                    clock.start()
        finished = True
        if controller is not None:
            q = plant.measured_js().q  # where the robot holds, without the controller
            if not hold(plant, np.where(np.isfinite(q), q, finite.held)):
                plant.state_command("pause")
        return report()
    except BaseException as error:  # Ctrl-C too: whatever ends the loop must not leave the robot under way
        finished = False
        error.loop_report = report()  # type: ignore[attr-defined]
        error.add_note(f"the control loop ended after {ticks} ticks ({ticks * dt:.3f} s)")
        leave_safe(plant, finite.held, error)
        raise
    finally:
        in_motion.reset(moving)
        if clock is not None:
            clock.end()


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
