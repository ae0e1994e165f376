"""The part of gravity that the firmware of an arm on a tilted base leaves to its user."""

from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_batch
from catenary.gravity.torque import gravity_torque
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL


def gravity_delta(model: RobotModel, q: ArrayLike, gravity: ArrayLike) -> Floats:
    """Torques to add where firmware compensates for a level base only: g(q, gravity) - g(q, level).

    g is linear in gravity, so this is g(q, gravity - level), exactly zero on a level base.

    Args:
        model: The robot, as the firmware knows it: payloads it was told of included.
        q: (n,) or (N, n) coordinates [rad or m].
        gravity: (3,) or (N, 3) true free-fall acceleration in base axes [m/s2].

    Returns:
        (n,) or (N, n) [Nm or N].

    Raises:
        MissingInertiaError: Links without inertia.
        InputError: An argument has another shape or is not finite.
    """
    rows, single = as_batch("gravity", gravity, 3)
    beyond = rows - LEVEL
    return gravity_torque(model, q, beyond[0] if single else beyond)
