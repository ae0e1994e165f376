"""Gravity torques of an arm at a pose, on a tilted base or under any gravity."""

from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.gravity.torque import gravity_torque
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL
from catenary.units import TORQUE_UNIT


@dataclass(frozen=True)
class GravityTorques:
    """Torques that hold an arm still, here and on a level base."""

    robot: str
    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]  # "rad" or "m"
    q: Floats  # (n,) [rad|m]
    gravity: Floats  # (3,) in base axes [m/s2]
    tau: Floats  # (n,) [Nm|N]
    level: Floats  # (n,) on a level base

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the torques, Nm or N."""
        return tuple(TORQUE_UNIT[unit] for unit in self.joint_units)

    def as_data(self) -> dict[str, Any]:
        """Return plain data in SI."""
        return {
            "robot": self.robot,
            "joints": self.joint_names,
            "q": self.q.tolist(),
            "gravity": self.gravity.tolist(),
            "tau": self.tau.tolist(),
            "unit": self.units,
            "level": self.level.tolist(),
        }


def gravity_torques(model: RobotModel, q: ArrayLike, gravity: ArrayLike = LEVEL) -> GravityTorques:
    """Return the torques at q (n,) [rad|m] under gravity (3,) in base axes [m/s2].

    Raises:
        MissingInertiaError: Links without inertia, by name.
        InputError: An argument has another shape or is not finite.
    """
    vector = as_array("gravity", gravity, (3,))
    return GravityTorques(
        model.name,
        model.joint_names,
        model.joint_units,
        as_array("q", q, (model.n,)),
        vector,
        gravity_torque(model, q, vector),
        gravity_torque(model, q, LEVEL),
    )
