"""Torques for servos that take none: as current, as an offset of the position that they hold, or as PWM.

current: I = tau / k. position: q_goal = q + tau / k, with k the stiffness of the servo's own proportional law. PWM:
duty = tau / k + qd / w, with k the stall torque and w the speed without load at full duty, whose back-EMF it overcomes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_array, as_not_negative, one_for_all
from catenary.dynamics.external_torque import IN_95_PERCENT
from catenary.errors import InputError


class ServoKind(NamedTuple):
    """One way to ask a servo for torque."""

    unit: str  # of its command
    gain: str  # unit of k
    command: Callable[[Any, Any, Any], Any]  # tau / k, q and qd / w to the command


SERVO_KINDS = {
    "current": ServoKind("A", "Nm/A", lambda share, q, speed: share),
    "position": ServoKind("rad", "Nm/rad", lambda share, q, speed: q + share),
    "pwm": ServoKind("of full duty", "Nm at full duty", lambda share, q, speed: share + speed),
}


@dataclass(frozen=True)
class Servo:
    """A servo at a joint.

    Args:
        kind: "current", "position" or "pwm".
        gain: k > 0 [Nm/A, Nm/rad, Nm at full duty]; `catenary identify --currents` finds that of currents.
        error: Its relative standard error.
        step: One count of the servo's register [A, rad, of full duty]; negative where it turns against the joint.
        limit: Largest size of the command [A, of full duty], or of the offset [rad].
        free_speed: w of PWM [rad/s].

    Examples:
        >>> servo = catenary.Servo("current", gain=1.8, error=0.05, step=2.69e-3, limit=4.0)
    """

    kind: str
    gain: float
    error: float = 0.0
    step: float = 1e-9
    limit: float = np.inf
    free_speed: float = np.inf

    def __post_init__(self) -> None:
        if self.kind not in SERVO_KINDS:
            raise InputError(f'servo kind "{self.kind}": expected one of {", ".join(SERVO_KINDS)}')
        for name in ("gain", "free_speed", "limit"):
            if not as_not_negative(name, getattr(self, name), (), finite=name == "gain") > 0.0:
                raise InputError(f"servo: {name}: expected a number above zero, got {getattr(self, name):g}")
        as_not_negative("error", self.error, ())
        if not as_array("step", self.step, ()) != 0.0:
            raise InputError("servo: step: expected one count's size, got zero")


class ServoCommand(NamedTuple):
    """Commands of servos, (n,) each."""

    value: Floats  # [A, rad, of full duty], within the limits
    counts: NDArray[np.int64]  # the same in the servo's register
    torque: Floats  # [Nm] that is exerted where the gains hold, less than what was asked for at a limit
    half_width: Floats  # [Nm] within which it lies in 95 of 100 cases, by the gain's error and the count's size


def servo_command(
    servos: Sequence[Servo], torque: ArrayLike, q: ArrayLike, qd: ArrayLike, *, deviation: ArrayLike = 0.0
) -> ServoCommand:
    """Return the commands by which servos exert torques, and how far these are known.

    Args:
        servos: n, one a joint.
        torque: (n,) [Nm].
        q: (n,) measured [rad], or where a position servo shall hold against the torque.
        qd: (n,) measured [rad/s].
        deviation: Standard deviation of the torque itself [Nm], one number or (n,).

    Examples:
        >>> servos = [catenary.Servo("current", gain=1.8, error=0.05, step=2.69e-3, limit=4.0)] * 2
        >>> command = catenary.servo_command(servos, torque=[1.2, 0.4], q=[0.3, 0.5], qd=[0.0, 0.0])
        >>> command.counts
        array([248,  83])
        >>> command.half_width.round(3)
        array([0.118, 0.039])
    """
    n = len(servos)
    tau, at, rate = (as_array(name, x, (n,)) for name, x in (("torque", torque), ("q", q), ("qd", qd)))
    gain, error, step, limit, free = (
        np.array([getattr(servo, key) for servo in servos]) for key in ("gain", "error", "step", "limit", "free_speed")
    )
    kinds = [SERVO_KINDS[servo.kind] for servo in servos]
    zero = np.array([kind.command(0.0, *pair) for kind, *pair in zip(kinds, at, rate / free, strict=True)])
    own = np.where([servo.kind == "position" for servo in servos], zero, 0.0)  # from where a limit counts
    value = own + np.clip(zero - own + tau / gain, -limit, limit)
    counts = np.rint(value / step).astype(np.int64)
    exerted = gain * (counts * step - zero)
    spread = as_not_negative("deviation", one_for_all(deviation, n), (n,))
    sigma = np.sqrt((exerted * error) ** 2 + spread**2 + (gain * step) ** 2 / 12.0)
    return ServoCommand(counts * step, counts, exerted, IN_95_PERCENT * sigma)
