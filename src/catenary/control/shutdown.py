"""Shutdown of a loop: the robot holds by its firmware, or goes without torque and is paused; and when to give up."""

import contextlib
from collections.abc import Callable, Sequence
from math import isfinite

import numpy as np

from catenary.arrays import Floats
from catenary.errors import CatenaryError, InputError, NotFiniteError, RobotHeldError, TransportError
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
        found = []
        for what, counts in zip(("measured position", "torque"), self._lost, strict=True):
            joints = [f'"{name}" ({count} ticks)' for name, count in zip(self._names, counts, strict=True) if count]
            if joints:
                found.append(f"{what} of {', '.join(joints)}")
        return "; ".join(found)


def hold(plant: Plant, q: Floats) -> bool:
    """Command positions q (n,) and return True, or zero torque where the robot takes none or q is not finite."""
    if "servo_jp" in plant.supports and np.isfinite(q).all():
        plant.servo_jp(q)
        return True
    plant.servo_jf(np.zeros(len(q)))
    return False


def leave_safe(plant: Plant, last: Floats, error: BaseException) -> None:
    """Hold where a robot is measured to be, or go limp, then pause; what fails on the way is told with the error.

    `last` (n,) [rad|m] stands in for joints that are not measured now.
    """

    def stay() -> None:
        q = last
        with contextlib.suppress(Exception):  # measuring may be what failed
            now = plant.measured_js().q
            q = np.where(np.isfinite(now), now, last)
        hold(plant, q)

    attempt(error, holding=stay, pausing=lambda: plant.state_command("pause"))


def attempt(error: BaseException, **actions: Callable[[], object]) -> None:
    """Do things to a robot one after the other, such as holding and pausing it, while an error is under way.

    One that fails is told with the error and keeps no other from being done; neither does a Ctrl-C, which is raised
    afterwards unless the error is one itself. A robot that another program moves is left to that one.
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
