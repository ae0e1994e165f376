"""Shutdown of a loop: the robot holds by its firmware, or goes without torque and is paused; and when to give up."""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, Integers, as_array, one_for_all
from catenary.errors import CatenaryError, InputError, LimitError, NotFiniteError, RobotHeldError, TransportError
from catenary.kernels.bind import bind
from catenary.kernels.compiled import compiled
from catenary.plant import Plant

GIVE_UP_AFTER_TICKS = 20  # ticks in a row
_FORGIVEN = 0.25  # of a tick that was not finite, by one that is: at most a fifth of all ticks may be without for long


class FiniteTicks:
    """Watches that positions and torques are finite; `held` (n,) [rad|m] are the last finite positions to hold."""

    def __init__(self, joint_names: Sequence[str], q: Floats, give_up_after: int = GIVE_UP_AFTER_TICKS) -> None:
        """Begin at measured positions (n,) [rad|m]."""
        if not give_up_after >= 1:
            raise InputError(f"give_up_after: expected 1 tick or more, got {give_up_after}")
        self.held = np.array(q)
        self._names, self._limit = joint_names, give_up_after
        self._owed, self._ticks = 0.0, 0  # ticks not finite less what was forgiven, and ticks, since none was owed
        self._lost = np.zeros((2, len(q)), dtype=int)  # of these ticks: positions, torques, by joint

    def update(self, q: Floats, tau: Floats | None = None) -> None:
        """Look at a tick's measured positions (n,) [rad|m] and the torques (n,) [Nm|N] that were asked for."""
        # sums of few numbers are quicker in Python than in NumPy
        if isfinite(sum(q.tolist())) and (tau is None or isfinite(sum(tau.tolist()))):
            self.held = q
            self._owed = max(0.0, self._owed - _FORGIVEN)
            self._ticks += 1
            return
        if self._owed == 0.0:
            self._ticks = 0
            self._lost[:] = 0
        bad_q = ~np.isfinite(q)
        self.held = np.where(bad_q, self.held, q)
        self._lost += bad_q, np.zeros(len(q), dtype=bool) if tau is None else ~np.isfinite(tau)
        self._owed += 1.0
        self._ticks += 1
        if self._owed >= self._limit:
            raise NotFiniteError(
                f"not finite within {self._ticks} ticks: {self._in_words()}; expected finite numbers at least every "
                f"{self._limit} ticks, and in four of five"
            )

    def _in_words(self) -> str:
        parts = []
        for what, counts in zip(("measured position", "torque"), self._lost, strict=True):
            joints = [f'"{name}" ({count} ticks)' for name, count in zip(self._names, counts, strict=True) if count]
            if joints:
                parts.append(f"{what} of {', '.join(joints)}")
        return "; ".join(parts)


def hold_position(plant: Plant, q: Floats) -> bool:
    """Command a robot to hold positions; zero torque where it takes no positions or they are not finite.

    Args:
        plant, q: The robot, and positions (n,) [rad|m].

    Returns:
        Whether positions were commanded.
    """
    if "servo_jp" in plant.supports and np.isfinite(q).all():
        plant.servo_jp(q)
        return True
    plant.servo_jf(np.zeros(len(q)))
    return False


def leave_safe(plant: Plant, last: Floats, error: BaseException) -> None:
    """Hold a robot at its measured positions, or make it limp, then pause it, after an error.

    Args:
        plant: The robot.
        last: Last known positions (n,) [rad|m], for joints that are not measured now.
        error: The error; what fails on the way is added to it as a note.
    """

    def stay() -> None:
        q = last
        with contextlib.suppress(Exception):  # measuring may be what failed
            now = plant.measured_js().q
            q = np.where(np.isfinite(now), now, last)
        hold_position(plant, q)

    attempt(error, holding=stay, pausing=lambda: plant.state_command("pause"))


def attempt(error: BaseException, **actions: Callable[[], object]) -> None:
    """Do things to a robot one after the other, such as holding and pausing it, while an error is under way.

    A failing one is added to the error as a note and keeps no other from being done; neither does a Ctrl-C, which is
    raised afterwards unless the error is one itself. A robot that another program moves is left to that one.
    """
    if isinstance(error, RobotHeldError):
        return
    interrupt: KeyboardInterrupt | None = None
    for name, action in actions.items():
        try:
            action()
        except BaseException as another:
            if isinstance(another, KeyboardInterrupt) and not isinstance(error, KeyboardInterrupt):
                interrupt = another
            if isinstance(error, TransportError) and isinstance(another, TransportError):
                error.add_note(f"{name} the robot failed likewise")  # a robot that is silent is so to each
            else:
                why = str(another) if isinstance(another, CatenaryError) else repr(another)
                error.add_note(f"{name} the robot failed: {why}")
    if interrupt is not None:
        raise interrupt from error


# [rad], [m] of a setpoint in a tick, beyond what a joint's speed allows: more than rounding, less than what firmware
# stops at
MAX_STEP: Mapping[str, float] = {"rad": 0.02, "m": 0.002}
MAX_SPEED = {"rad": 2.0, "m": 0.5}  # [rad/s], [m/s] where a robot states no limit
# of a robot's own limit: critically damped PD overshoots a step of the wanted speed by exp(-2), 14 %
_OVERSHOOT = 1.2
# [s] that a speed is a mean over: a count of an encoder is none; it must last for half of that: a spike does not
_WINDOW_S = 0.02
_SPEED, _LEAP = 1, 2


class MotionGuard:
    """Watches measured speeds and the steps of the reference; LimitError where one is beyond what is allowed.

    A speed is the mean over 20 ms of the measured positions, by the robot's own clock where that goes on. It ends the
    motion once it was too large, and of one sign, for 10 ms: an encoder's spike that returns is not. The reference may
    step by what the largest speed allows in a tick and MAX_STEP.
    """

    def __init__(self, plant: Plant, reference: ArrayLike, period: float, max_speed: ArrayLike | None) -> None:
        """Begin at a reference (n,) [rad|m], in ticks of `period` [s].

        Args:
            max_speed: One for all or (n,) [rad/s|m/s], infinity for none; when None the plant's own `velocity_limit`
                and a fifth, and where it has none, or states zero, 2 rad/s and .5 m/s.
        """
        self._names, self._units, n = plant.joint_names, plant.joint_units, len(plant.joint_names)
        own = as_array("velocity_limit", getattr(plant, "velocity_limit", np.zeros(n)), (n,), finite=False)
        stated = (own > 0.0) & np.isfinite(own)
        fastest = np.where(stated, _OVERSHOOT * own, [MAX_SPEED[unit] for unit in self._units])
        limits = f"{_OVERSHOOT:g} times the robot's own limit", "as of robots that state no limit"
        self._why = [limits[0] if is_stated else limits[1] for is_stated in stated]
        if max_speed is not None:
            fastest, self._why = as_array("max_speed", one_for_all(max_speed, n), (n,), finite=False), ["max_speed"] * n
            if not (fastest > 0.0).all():
                raise InputError(f"max_speed: expected more than 0, got {fastest.tolist()}")
        self._fastest, self._leap = fastest, fastest * period + np.array([MAX_STEP[unit] for unit in self._units])
        ticks = max(1, round(_WINDOW_S / period))
        self._time, self._q, self._reference = np.zeros(1), np.zeros(n), np.zeros(n)
        self._finding = np.zeros(3)  # what was found, the joint, how much
        arrays = np.array([ticks * period]), self._time, self._q, self._reference, fastest, self._leap
        kept = np.full(ticks, np.nan), np.full((ticks, n), np.nan), as_array("q", reference, (n,)).copy()
        self._look = bind(_look, arrays, [*kept, np.zeros(n + 1, dtype=np.int64), self._finding])

    def update(self, time: float, q: Floats, reference: Floats) -> None:
        """Look at a tick's measured positions (n,) [rad|m], their time [s], and the reference (n,) [rad|m]."""
        self._time[0], self._q[:], self._reference[:] = time, q, reference
        self._look()
        if self._finding[0]:
            what, j, size = int(self._finding[0]), int(self._finding[1]), self._finding[2]
            name, unit, why = self._names[j], self._units[j], self._why[j]
            expected = f"expected at most {(self._fastest if what == _SPEED else self._leap)[j]:.4g} {unit}"
            meant = "if that is meant, run_loop(max_speed=...) allows more"
            if what == _SPEED:
                raise LimitError(f'joint "{name}" moves at {size:.4g} {unit}/s, {expected}/s, {why}; {meant}')
            raise LimitError(
                f'joint "{name}": the reference leaps by {size:.4g} {unit} between two ticks, {expected} ({why}: '
                f"{self._fastest[j]:.4g} {unit}/s); {meant}"
            )


@compiled
def _look(
    window: Floats,
    time: Floats,
    q: Floats,
    reference: Floats,
    fastest: Floats,
    leap: Floats,
    times: Floats,
    rows: Floats,
    last: Floats,
    counts: Integers,
    finding: Floats,
) -> None:
    """Look at a tick; counts (n + 1,) are ticks in a row that a joint was too fast, signed, and all ticks."""
    n = len(q)
    at = counts[n] % len(times)
    elapsed = time[0] - times[at]
    if not elapsed > 0.0:  # a clock that stands still, or was set back
        elapsed = window[0]
    for j in range(n):
        if abs(reference[j] - last[j]) > leap[j] and finding[0] == 0.0:
            finding[0], finding[1], finding[2] = _LEAP, j, abs(reference[j] - last[j])
        if np.isfinite(reference[j]):
            last[j] = reference[j]
        speed = (q[j] - rows[at, j]) / elapsed
        rows[at, j] = q[j]
        if not np.isfinite(speed):
            continue
        way = (speed > fastest[j]) - (speed < -fastest[j])
        counts[j] = counts[j] + way if counts[j] * way > 0 else way
        if abs(counts[j]) >= max(2, len(times) // 2) and finding[0] == 0.0:
            finding[0], finding[1], finding[2] = _SPEED, j, abs(speed)
    times[at] = time[0]
    counts[n] += 1
