"""Move a robot along a trajectory, whatever it is, and bring it to rest however that ends: held, then paused."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_array
from catenary.control.shutdown import FiniteTicks, attempt, leave_safe
from catenary.errors import CatenaryError, InputError, LimitError, NotFiniteError, NotReadyError, TransportError
from catenary.parallel import Progress, silent
from catenary.plant import Bounded, JointState, Plant, require_ready, state_in_words
from catenary.trajectories.reference import Reference, Rest, Trajectory
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.trajectories.smoothed_path import go_to

_HOLD_TICKS = 20  # during which a robot is commanded to hold its position
_ARRIVAL_S = 0.5  # [s] that a robot's setpoint gets at a motion's end to come to where it was sent last
_ARRIVED_WITHIN = 1e-6  # [rad|m]


@contextmanager
def at_rest_afterwards(plant: Plant, began: Callable[[], bool] = lambda: True) -> Iterator[None]:
    """Pause a robot when what runs inside ends; where an error, Ctrl-C or a signal ends it, hold it first.

    One of our errors before anything `began` to move is a refusal, and changes no state.
    """
    try:
        yield
        pause(plant)
    except BaseException as error:
        if began() or not isinstance(error, CatenaryError):
            attempt(error, holding=lambda: hold_at_setpoint(plant), pausing=lambda: pause(plant))
        raise


@contextmanager
def paused_if_interrupted(plant: Plant) -> Iterator[None]:
    """Pause a robot when Ctrl-C or a signal ends what runs inside, as while a person is asked for something."""
    try:
        yield
    except KeyboardInterrupt as stop:
        attempt(stop, pausing=lambda: pause(plant))
        raise


def hold_at_setpoint(plant: Plant) -> None:
    """Hold a robot at its setpoint; one that is not enabled stands on its brakes and is left alone."""
    q = np.array(plant.setpoint_js().q)
    for _ in range(_HOLD_TICKS):
        if plant.operating_state().state != "ENABLED":
            return
        plant.servo_jp(q)
        plant.wait()


def pause(plant: Plant) -> None:
    """Pause a robot that is enabled, or silent: one that only stood still obeys when it goes on."""
    with suppress(TransportError):
        if plant.operating_state().state != "ENABLED":
            return
    plant.state_command("pause")


# after each tick: what is measured, what was commanded, and the motion's time [s], below 0 on the way there
Observer = Callable[[JointState, Reference, float], None]

# A go-to nobody asked to be fast: about ten times slower than RAVEN-II's servo limits, 2.5 rad/s and 0.05 m/s
GENTLE_VELOCITY = {"rad": 0.2, "m": 0.01}  # [rad/s], [m/s]
GENTLE_ACCELERATION = {"rad": 0.5, "m": 0.025}  # [rad/s2], [m/s2]

_BLOCK = 1000  # ticks whose setpoints are computed at once; progress is reported as often
_STEP = 0.01  # [s] between the places of a motion that are checked
_AT_LIMIT = 1e-9  # [rad|m] rounding, with a wide margin
_THERE = 1e-9  # [rad|m] nearer than any encoder tells


def check_motion(
    limits: Bounded,
    trajectory: Trajectory,
    *,
    joints: Sequence[str] | None = None,
    max_velocity: ArrayLike | None = None,
) -> None:
    """Refuse a trajectory beyond the joint limits or a velocity.

    Args:
        joints: Names of its joints; all when None.
        max_velocity: Largest velocity (k,) [rad/s|m/s]; any when None.
    """
    moved = _indices(limits, joints, trajectory)
    lower, upper = limits.lower[moved] - _AT_LIMIT, limits.upper[moved] + _AT_LIMIT
    fastest = np.full(len(moved), np.inf)
    if max_velocity is not None:
        fastest = as_array("max_velocity", max_velocity, (len(moved),))
        if not (fastest > 0.0).all():
            raise InputError(f"max_velocity: expected more than 0, got {fastest}")
        fastest = fastest * (1.0 + 1e-9)  # rounding
    ticks = int(np.ceil(trajectory.duration / _STEP))
    for first in range(0, ticks + 1, _BLOCK):
        times = np.minimum(np.arange(first, min(first + _BLOCK, ticks + 1)) * _STEP, trajectory.duration)
        q, qd, _ = trajectory.sample(times)
        # not "beyond": a NaN is a violation too
        bad = ~((q >= lower) & (q <= upper) & (np.abs(qd) <= fastest))
        if bad.any():
            k, j = (int(i) for i in np.argwhere(bad)[0])
            unit = limits.joint_units[moved[j]]
            how = f"velocity {qd[k, j]:.6g} {unit}/s beyond {fastest[j]:.6g} {unit}/s"
            if not lower[j] <= q[k, j] <= upper[j]:
                low, high = limits.lower[moved[j]], limits.upper[moved[j]]
                how = f"position {q[k, j]:.6g} {unit} outside [{low:.6g}, {high:.6g}]"
            raise LimitError(f'joint "{limits.joint_names[moved[j]]}" at {times[k]:.3f} s: {how}')


def gentle_way(
    start: ArrayLike,
    goal: ArrayLike,
    units: Sequence[str],
    *,
    speed: float = 1.0,
    max_velocity: ArrayLike | None = None,
) -> Trajectory:
    """Return a slow, smooth motion from rest to rest, with `GENTLE_ACCELERATION`.

    Args:
        start, goal: Positions (k,) [rad|m].
        units: "rad" or "m" of each joint.
        speed: Factor on `GENTLE_VELOCITY`.
        max_velocity: Largest velocity in its place (k,) [rad/s|m/s].
    """
    velocity = [speed * GENTLE_VELOCITY[unit] for unit in units] if max_velocity is None else max_velocity
    acceleration = [speed * GENTLE_ACCELERATION[unit] for unit in units]
    return go_to(start, goal, max_velocity=velocity, max_acceleration=acceleration)


def range_of(limits: Bounded, remedy: str = "") -> tuple[Floats, Floats]:
    """Return lower and upper limits, (n,) each [rad|m]; refuse joints without, with a remedy."""
    lower, upper = limits.lower, limits.upper
    for j in np.flatnonzero(~(np.isfinite(lower) & np.isfinite(upper))):
        raise InputError(f'joint "{limits.joint_names[j]}": has no limits to move within{remedy}')
    return lower, upper


def random_within(limits: Bounded, seconds: float, rng: np.random.Generator) -> Trajectory:
    """Return a slow random motion, each joint independently over half of its range.

    Args:
        seconds: Duration [s].
    """
    lower, upper = range_of(limits)
    middle, half = 0.5 * (lower + upper), 0.25 * (upper - lower)
    fastest = np.array([GENTLE_VELOCITY[unit] for unit in limits.joint_units])
    return random_sinusoids(
        rng, seconds, lower=middle - half, upper=middle + half, turning_band=0.25 * half,
        slowest=0.4 * fastest, fastest=fastest,
    )  # fmt: skip


def move_to(
    plant: Plant,
    q: ArrayLike,
    *,
    joints: Sequence[str] | None = None,
    max_velocity: ArrayLike | None = None,
    observe: Observer | None = None,
    progress: Progress = silent,
) -> None:
    """Bring the named joints, or all, to q (k,) [rad|m], arriving together; the others hold their setpoint.

    A goal outside the limits is a LimitError, before anything moves; a start there is not. `max_velocity` (k,)
    [rad/s|m/s] is GENTLE_VELOCITY when None. Where measured positions are not finite for 20 ticks the robot is paused:
    NotFiniteError.
    """
    require_ready(plant, "servo_jp")
    moved = _indices(plant, joints)
    goal = as_array("q", q, (len(moved),))
    motion = _approach(plant, moved, goal, max_velocity)
    _stream(plant, motion, moved, observe, progress, is_way=True)


def run_trajectory(
    plant: Plant,
    trajectory: Trajectory,
    *,
    joints: Sequence[str] | None = None,
    max_velocity: ArrayLike | None = None,
    observe: Observer | None = None,
    progress: Progress = silent,
) -> None:
    """Run a trajectory on a plant, one setpoint a tick; joints not named hold their setpoint. Errors as `move_to`.

    The plant first goes to its start, gently. A late tick delays the motion, it never makes it leap. Speeds up to
    `max_velocity` (k,) [rad/s|m/s] are let pass, any when None; `observe` is called after every tick, the approach's
    too.
    """
    require_ready(plant, "servo_jp")
    moved = _indices(plant, joints, trajectory)
    check_motion(plant, trajectory, joints=joints, max_velocity=max_velocity)
    gentle = np.array([GENTLE_VELOCITY[plant.joint_units[j]] for j in moved])
    slowest = gentle if max_velocity is None else np.minimum(gentle, max_velocity)
    approach = _approach(plant, moved, trajectory(0.0).q, slowest)
    whole = approach.duration + trajectory.duration
    share = approach.duration / whole if whole > 0.0 else 0.0
    if approach.duration > 0.0:
        _stream(plant, approach, moved, observe, lambda done: progress(share * done), is_way=True)
    _stream(plant, trajectory, moved, observe, lambda done: progress(share + (1.0 - share) * done))


def arrive(plant: Plant, q: Floats) -> None:
    """Wait until a robot behind a transport has taken up the last setpoint (n,) [rad|m]; half a second at most."""
    for _ in range(round(_ARRIVAL_S / plant.period)):
        if plant.operating_state().state != "ENABLED" or np.abs(plant.setpoint_js().q - q).max() <= _ARRIVED_WITHIN:
            return
        plant.wait()


def _stream(
    plant: Plant,
    trajectory: Trajectory,
    moved: NDArray[np.int64],
    observe: Observer | None,
    progress: Progress,
    *,
    is_way: bool = False,
) -> None:
    """Send one setpoint a tick; the last one is the trajectory's end. On a way there observers get times below 0."""
    held = np.array(plant.setpoint_js().q)
    none = np.zeros(len(held))
    finite = FiniteTicks(plant.joint_names, plant.measured_js().q)
    ticks = int(np.ceil(trajectory.duration / plant.period - 1e-9))
    begin = -ticks * plant.period if is_way else 0.0
    progress(0.0)
    for first in range(1, ticks + 1, _BLOCK):
        last = min(first + _BLOCK, ticks + 1)
        q, qd, qdd = trajectory.sample(np.arange(first, last) * plant.period)
        rows = np.tile(held, (last - first, 1))
        rows[:, moved] = q
        for k in range(last - first):
            state = plant.operating_state()
            if state.state != "ENABLED":
                raise NotReadyError(
                    f"stopped {(first + k - 1) * plant.period:.3f} s into a motion of {trajectory.duration:.3f} s: "
                    f"the robot is {state_in_words(plant, state)}, expected ENABLED"
                )
            plant.servo_jp(rows[k])
            plant.wait()
            measured = plant.measured_js()
            try:
                finite.update(measured.q)
            except NotFiniteError as error:
                leave_safe(plant, finite.held, error)
                raise
            if observe is not None:
                velocity, acceleration = none.copy(), none.copy()
                velocity[moved], acceleration[moved] = qd[k], qdd[k]
                observe(measured, Reference(rows[k], velocity, acceleration), begin + (first + k) * plant.period)
        progress((last - 1) / ticks)
    if ticks == 0:
        progress(1.0)


def _approach(plant: Plant, moved: NDArray[np.int64], goal: Floats, max_velocity: ArrayLike | None) -> Trajectory:
    """Go-to from the plant's setpoint; measured positions would make it leap back by its control error."""
    units = [plant.joint_units[j] for j in moved]
    start = np.array(plant.setpoint_js().q)[moved]
    if np.abs(goal - start).max(initial=0.0) <= _THERE:
        start = goal
    motion = gentle_way(start, goal, units, max_velocity=max_velocity)
    # on the way every joint stays between start and goal, so the goal alone decides
    check_motion(plant, Rest(goal, 0.0), joints=[plant.joint_names[j] for j in moved])
    return motion


def _indices(limits: Bounded, joints: Sequence[str] | None, trajectory: Trajectory | None = None) -> NDArray[np.int64]:
    """Return places of named joints, or all; refuse other names, and another number than a trajectory moves."""
    names = limits.joint_names if joints is None else tuple(joints)
    if not set(names) <= set(limits.joint_names) or len(set(names)) < len(names):
        raise InputError(
            f"joints: expected different names among {', '.join(limits.joint_names)}; got {', '.join(names)}"
        )
    if trajectory is not None and (k := len(trajectory(0.0).q)) != len(names):
        raise InputError(
            f"joints: the trajectory moves {k}; expected as many names, got {len(names)}: {', '.join(names)}"
        )
    return np.array([limits.joint_names.index(name) for name in names], dtype=np.int64)
