"""What an identified robot's friction and rotors are joint by joint, for those who know no other: simulators, URDF."""

from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.robots.actuation import Actuation, actuation_terms


class JointDrives(NamedTuple):
    """Friction and rotors of every joint by itself, zero where nothing is known."""

    friction: Floats  # (n,) Coulomb [Nm or N]
    damping: Floats  # (n,) viscous [Nms/rad or Ns/m]
    armature: Floats  # (n,) rotors [kg m2 or kg]
    left_out: tuple[str, ...]  # effects that are none of these, by kind and name


def joint_drives(actuation: Actuation, n: int) -> JointDrives | None:
    """Return Coulomb and viscous friction and rotors of the joints; None where no numbers are known.

    Presliding friction counts as the Coulomb friction that it becomes in steady sliding. Effects on several joints at
    once, constants, springs, known torques, and friction that differs by direction, speed or load are left out.
    """
    if actuation.values is None:
        return None
    friction, damping, armature = np.zeros(n), np.zeros(n), np.zeros(n)
    left_out = [f"known torque {known.name}" for known in actuation.known_torques]
    for term, value in zip(actuation_terms(actuation), actuation.values, strict=True):
        moved = np.flatnonzero(term.combination)
        i, factor = int(moved[0]), abs(float(term.combination[moved[0]]))
        if len(moved) > 1:
            left_out.append(f"{term.kind} {term.name}")
        elif term.kind in ("coulomb", "presliding"):
            friction[i] += factor * value
        elif term.kind == "viscous":
            damping[i] += factor**2 * value
        elif term.kind == "motor_inertia":
            armature[i] += factor**2 * value
        elif value != 0.0:
            left_out.append(f"{term.kind} {term.name}")
    # a solver's zero may lie a rounding below
    friction, damping, armature = (np.maximum(v, 0.0) for v in (friction, damping, armature))
    return JointDrives(friction, damping, armature, tuple(left_out))
