"""LinkInertia: mass, centre of mass and inertia of one link, and what no body's inertia can be."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.robots.plausibility import MAX_INERTIA, MAX_MASS_KG, check_length, check_within
from catenary.spatial import Pose

_ROUNDING_RATIO = 1e-6  # of the largest entry of an inertia; files print six digits or more
MIN_GYRATION_M = 1e-5  # [m] radius of gyration that no part of a robot is below
MIN_DOUBTED_KG = 1e-3  # [kg] of links whose inertia is worth an objection


@dataclass(frozen=True)
class LinkInertia:
    """Mass [kg], centre of mass (3,) [m], inertia about it (3, 3) [kg m2], None where unknown; in the link's frame."""

    mass: float
    com: Floats
    inertia: Floats | None

    def moved(self, pose: Pose) -> "LinkInertia":
        """Return the same body seen from the frame that `pose` is expressed in."""
        R = pose.rotation
        turned = None if self.inertia is None else R @ self.inertia @ R.T
        return LinkInertia(self.mass, R @ self.com + pose.position, turned)

    def plus(self, other: "LinkInertia") -> "LinkInertia":
        """Return both bodies, in one frame, as one (parallel-axis theorem)."""
        mass = self.mass + other.mass
        com = (self.mass * self.com + other.mass * other.com) / mass if mass > 0.0 else np.zeros(3)
        if self.inertia is None or other.inertia is None:
            return LinkInertia(mass, com, None)
        inertia = self.inertia + other.inertia
        for body in (self, other):
            r = body.com - com
            inertia = inertia + body.mass * (r @ r * np.eye(3) - np.outer(r, r))
        return LinkInertia(mass, com, inertia)


def symmetric(six: Sequence[float] | Floats) -> Floats:
    """Return the tensor (3, 3) of its entries (xx, xy, xz, yy, yz, zz)."""
    xx, xy, xz, yy, yz, zz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


NO_INERTIA = LinkInertia(0.0, np.zeros(3), np.zeros((3, 3)))


def check_inertia(what: str, body: LinkInertia) -> None:
    """Refuse inertial parameters that no body has.

    Args:
        what, body: The body, which opens every message, and its mass, centre of mass and inertia.

    Raises:
        InputError: A mass that is negative, huge or not finite, a centre of mass too far away, or an inertia that is
            not symmetric.
    """
    if not np.isfinite(body.mass) or body.mass < 0.0:
        raise InputError(f"{what}: mass {body.mass} kg, expected a finite number, zero or more")
    check_within(f"{what}: mass", body.mass, MAX_MASS_KG, "kg")
    check_length(f"{what}: centre of mass", body.com)
    if body.inertia is None:
        return
    tensor = as_array(f"{what}: inertia", body.inertia, (3, 3))
    check_within(f"{what}: inertia", tensor, MAX_INERTIA, "kg m2")
    if np.abs(tensor - tensor.T).max() > _ROUNDING_RATIO * float(np.abs(tensor).max()):
        raise InputError(f"{what}: inertia must be symmetric, got {tensor.tolist()}")


def unphysical(mass: float, inertia: Floats) -> str | None:
    """Return in words why no body has an inertia (3, 3) [kg m2] about its centre of mass; None where one may."""
    moments = np.linalg.eigvalsh(inertia)
    if is_negative(mass, inertia):
        return f"inertia has a negative principal moment ({moments[0]:.3g} kg m2)"
    if moments[2] > moments[0] + moments[1] + _rounding(mass, inertia):
        shown = ", ".join(f"{m:.3g}" for m in moments)
        return f"inertia has principal moments {shown} kg m2; no body has one larger than the sum of the others"
    return None


def is_negative(mass: float, inertia: Floats) -> bool:
    """Return True if an inertia, (3, 3), has a principal moment below zero by more than rounding."""
    return bool(np.linalg.eigvalsh(inertia)[0] < -_rounding(mass, inertia))


def _rounding(mass: float, inertia: Floats) -> float:
    """Return the largest moment of inertia that rounding in a file can make of zero [kg m2]."""
    return max(_ROUNDING_RATIO * float(np.abs(inertia).max()), mass * MIN_GYRATION_M**2)
