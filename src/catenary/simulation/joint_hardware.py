"""What is built into an arm's joints besides rigid links, friction, rotors, springs, stops; whether a step suits it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_not_negative, one_for_all
from catenary.errors import InputError
from catenary.robots.model import RobotModel

Integers = NDArray[np.int64]


@dataclass(frozen=True)
class JointHardware:
    """The drives of an arm, each number for all joints alike or one a joint (n,); ideal drives when left alone.

    A joint with a finite stiffness is elastic: a rotor, on which torque, friction and damping act, turns the joint
    through a spring [Spong 1987, Modeling and control of elastic joint robots: rotors turn about their own axes
    only]. The robot then reports the rotor's position, as one with encoders on its motors does. All of it is seen
    at the joint, that is after the gearbox: a rotor of inertia J behind a ratio N counts N² J.
    """

    friction: ArrayLike = 0.0  # Coulomb friction [Nm|N]
    damping: ArrayLike = 0.0  # viscous [Nms/rad|Ns/m]
    armature: ArrayLike = 0.0  # rotor inertia [kg m2|kg]
    stiffness: ArrayLike = np.inf  # of the transmission [Nm/rad|N/m]
    spring_damping: ArrayLike = 0.0  # across it [Nms/rad|Ns/m]


class DriveParameters(NamedTuple):
    """An arm's drives for compiled code.

    Its nz moving parts are the robot's n coordinates, then the m rotors of those that are elastic: spring e is between
    joint elastic[e] and moving part n + e.
    """

    coupling: Floats  # (n_tree, n)
    dof: Integers  # (n_tree,) where MuJoCo keeps a tree coordinate's velocity
    at: Integers  # (n_tree,) and its position
    offset: Floats  # (n_tree,) of a tree coordinate at the robot's zero [rad|m]
    drive: Integers  # (n,) the moving part on which a joint's motor acts: itself, or its rotor
    lower: Floats  # (n,) [rad|m]
    upper: Floats
    elastic: Integers  # (m,)
    stiffness: Floats  # (m,) [Nm/rad|N/m]
    spring_damping: Floats  # (m,) [Nms/rad|Ns/m]
    inertia: Floats  # (nz,) of the rotor [kg m2|kg]
    friction: Floats  # (nz,) [Nm|N]
    damping: Floats  # (nz,) [Nms/rad|Ns/m]


def drive_parameters(model: RobotModel, hardware: JointHardware, dof: Integers, at: Integers) -> DriveParameters:
    """Check an arm's hardware."""
    n = model.n
    friction, damping, armature, stiffness, spring_damping = (
        as_not_negative(name, one_for_all(values, n), (n,), finite=name != "stiffness")
        for name, values in vars(hardware).items()
    )
    elastic = np.flatnonzero(np.isfinite(stiffness))
    for j in elastic:
        if not (stiffness[j] > 0.0 and armature[j] > 0.0):
            raise InputError(
                f'joint "{model.joint_names[j]}": stiffness {stiffness[j]:g} and armature {armature[j]:g}: '
                "an elastic joint needs both above zero"
            )
    drive = np.arange(n)
    drive[elastic] = n + np.arange(len(elastic))
    parts = np.zeros((3, n + len(elastic)))
    parts[:, drive] = armature, friction, damping
    return DriveParameters(
        np.array(model.coupling), dof, at, np.array(model.offset), drive, np.array(model.lower), np.array(model.upper),
        elastic, stiffness[elastic], spring_damping[elastic], *parts,
    )  # fmt: skip


MOST = 2.0  # of |eigenvalue| times step; Runge-Kutta's fourth-order method is stable to 2.78, and accurate below 1
LEAST_INERTIA = 1e-10  # [kg m2|kg] of a joint; massless links are given 1e-12 kg


def require_stable(joints: DriveParameters, mass: Floats, step: float, names: Sequence[str]) -> None:
    """Refuse joints that move no mass, and a step that is too long.

    mass (nz, nz) is that of all that moves, where the arm stands; step in s.
    """
    n, nz = len(joints.drive), len(mass)
    bare = [name for name, m in zip(names, np.diag(mass), strict=False) if m < LEAST_INERTIA]
    if bare:
        raise InputError(
            f"joint(s) {', '.join(bare)} move no mass: their motion is not determined; "
            "give them an armature (rotor inertia), or their links inertia"
        )
    if np.linalg.eigvalsh(mass)[0] <= 0.0:
        raise InputError(
            "the mass matrix is singular: some joints together move no mass; give them an armature (rotor inertia)"
        )
    stiffness, damping = np.zeros((nz, nz)), np.diag(joints.damping)
    for e, (j, k, d) in enumerate(zip(joints.elastic, joints.stiffness, joints.spring_damping, strict=True)):
        across = np.zeros(nz)
        across[n + e], across[j] = 1.0, -1.0
        stiffness += k * np.outer(across, across)
        damping += d * np.outer(across, across)
    motion = np.block(
        [[np.zeros((nz, nz)), np.eye(nz)], [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)]]
    )
    fastest = float(np.abs(np.linalg.eigvals(motion)).max())
    if fastest * step > MOST:
        raise InputError(
            f"springs or dampers act within {1e3 / fastest:.3g} ms, too stiff for steps of {1e3 * step:.3g} ms; "
            f"take at least {math.ceil(fastest * step / MOST)} times as many substeps"
        )
