"""What a motion must keep: limits of position, speed, acceleration and torque, and distances from what it could hit."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_array
from catenary.collision.scene import Clearance, CollisionScene
from catenary.dynamics.inverse_dynamics import inverse_dynamics
from catenary.errors import InputError
from catenary.identification.fourier_series import FourierSeries
from catenary.robots.model import RobotModel

MARGIN = 0.05  # of a coordinate's range kept clear of its limits
EFFORT = 0.95  # of the torque limit that a motion may take, by the robot's own masses
TORQUE_ROWS = 1000  # of a motion at which torques are compared with their limits
SEARCH_ROWS = 160  # of a motion that are looked at while it is searched for
DIP = 0.003  # [m] by which a distance may fall between these rows; the search keeps more than the margin


@dataclass(frozen=True)
class Room:
    """Limits of position and velocity, all finite, and of acceleration and torque, inf where there are none."""

    lower: Floats  # (n,)
    upper: Floats
    velocity: Floats
    acceleration: Floats
    effort: Floats

    def inner(self) -> tuple[Floats, Floats]:
        """Return the limits of position that designs keep to, a twentieth of the range inside."""
        slack = MARGIN * (self.upper - self.lower)
        return self.lower + slack, self.upper - slack


def room_of(
    model: RobotModel,
    *,
    lower: ArrayLike | None = None,
    upper: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    acceleration: ArrayLike | None = None,
    effort: ArrayLike | None = None,
) -> Room:
    """Return the limits to stay within: the robot's own, or narrower ones (n,) [rad, m, rad/s, m/s, ..., Nm, N]."""
    limits: tuple[tuple[str, ArrayLike], ...] = (
        ("lower", model.lower if lower is None else lower),
        ("upper", model.upper if upper is None else upper),
        ("velocity", model.velocity_limit if velocity is None else velocity),
        ("acceleration", np.full(model.n, np.inf) if acceleration is None else acceleration),
        ("effort", model.effort_limit if effort is None else effort),
    )
    room = {key: as_array(key, values, (model.n,), finite=False) for key, values in limits}
    low, high, fastest, accelerated, strongest = room.values()
    beyond = (low < model.lower) | (high > model.upper) | (fastest > model.velocity_limit)
    beyond |= strongest > model.effort_limit
    for i, name in enumerate(model.joint_names):
        where = f'robot "{model.name}"'
        for key in ("lower", "upper", "velocity"):
            if not np.isfinite(room[key][i]):
                raise InputError(f"{where}: no {key} limit of {name}: give --{key} for all {model.n} joints")
        if not low[i] < high[i] or not fastest[i] > 0.0:
            raise InputError(f"{where}: {name}: expected lower < upper and a velocity above zero")
        if not (accelerated[i] > 0.0 and strongest[i] > 0.0):
            raise InputError(f"{where}: {name}: expected limits of acceleration and torque above zero")
        if beyond[i]:
            raise InputError(f"{where}: {name}: the limits given go beyond the robot's own")
    return Room(low, high, fastest, accelerated, strongest)


@dataclass(frozen=True)
class MotionLimits:
    """All that a motion of one robot must keep."""

    model: RobotModel
    room: Room
    gravity: Floats  # (3,) [m/s2] in base axes
    scene: CollisionScene | None = None  # None: collisions are unchecked
    margin: float = 0.01  # [m]

    @property
    def has_torques(self) -> bool:
        """Whether the robot's masses tell torques, and it has limits of them."""
        known = not self.model.missing_inertia and not self.model.missing_tensor
        return known and bool(np.isfinite(self.room.effort).any()) and bool(self.model.tree.mass.any())

    @property
    def is_narrow(self) -> bool:
        """Whether anything beside limits of position and velocity is to be kept."""
        return self.scene is not None or self.has_torques or bool(np.isfinite(self.room.acceleration).any())

    def torque(self, q: Floats, qd: Floats, qdd: Floats) -> Floats:
        """Return the torques (N, n) of a motion by the robot's own masses, without friction [Nm or N]."""
        return inverse_dynamics(self.model, q, qd, qdd, self.gravity)

    def free_poses(self, q: Floats) -> Floats:
        """Return which of configurations (N, n) may be rested in, (M, n)."""
        free: NDArray[np.bool_] = np.ones(len(q), dtype=bool)
        if self.has_torques:
            still = np.zeros_like(q)
            over = np.abs(self.torque(q, still, still)) > EFFORT * self.room.effort
            free = np.asarray(~over.any(axis=1))
        if self.scene is not None and free.any():
            free[free] = ~self.scene.touching(q[free], self.margin + DIP).any(axis=1)
        return np.asarray(q[free])

    def seem_kept(self, series: FourierSeries) -> bool:
        """Return whether a motion within the limits of position and velocity keeps the others at some of its rows."""
        if (series.acceleration_bound > self.room.acceleration).any():
            return False
        if not self.is_narrow:
            return True
        rows = series.sample(np.arange(SEARCH_ROWS) * series.period / SEARCH_ROWS)
        if self.has_torques and (np.abs(self.torque(*rows)) > EFFORT * self.room.effort).any():
            return False
        return self.scene is None or self.scene.keeps_apart(rows[0], self.margin + DIP)

    def check(self, path: FourierSeries) -> "CheckedMotion":
        """Return whether a motion keeps all limits: at every instant, torques at a thousand rows of it."""
        names, room = self.model.joint_names, self.room
        low, high, fastest = path.extremes()
        torque = None
        for what, over in (
            ("falls below its lower limit", low < room.lower),
            ("exceeds its upper limit", high > room.upper),
            ("exceeds its limit of velocity", fastest > room.velocity),
            ("exceeds its limit of acceleration", path.acceleration_bound > room.acceleration),
        ):
            if over.any():
                return CheckedMotion(f"{names[int(np.argmax(over))]} {what}", None, None)
        if self.has_torques:
            times = np.linspace(0.0, path.duration, TORQUE_ROWS)
            torque = np.abs(self.torque(*path.sample(times))).max(axis=0) / room.effort
            if (torque > 1.0).any():
                worst = int(np.argmax(torque))
                return CheckedMotion(f"{names[worst]} needs {torque[worst]:.2f} of its torque limit", torque, None)
        if self.scene is None:
            return CheckedMotion(None, torque, None)
        found = self.scene.clearance(path, self.margin)
        fault = None
        if not found.is_kept:
            a, b = found.pair
            fault = (
                f"{a} and {b} come within {1000 * self.margin:g} mm: "
                f"{1000 * found.distance:.1f} mm at {found.time:.3f} s"
            )
        return CheckedMotion(fault, torque, found)


@dataclass(frozen=True)
class CheckedMotion:
    """What holds of a motion."""

    fault: str | None  # the first limit that it does not keep, in words
    torque: Floats | None  # (n,) largest share of the torque limits; None where masses or limits are unknown
    clearance: Clearance | None  # None where collisions are unchecked, or another limit is not kept
