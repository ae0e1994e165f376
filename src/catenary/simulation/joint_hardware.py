"""What is built into an arm's joints besides rigid links: friction, damping, rotors, springs, stops."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.kernels.compiled import inlined
from catenary.robots.model import RobotModel


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


class JointNumbers(NamedTuple):
    """The same for compiled code, of nz moving things: the robot's n coordinates, then its m elastic rotors."""

    dof: NDArray[np.int64]  # (n_tree,) where MuJoCo keeps the tree's velocities
    at: NDArray[np.int64]  # (n_tree,) where it keeps their positions
    drive: NDArray[np.int64]  # (n,) what a joint's motor moves: itself, or its rotor
    elastic: NDArray[np.int64]  # (m,) joints with a spring
    coupling: Floats  # (n_tree, n)
    offset: Floats  # (n_tree,)
    inertia: Floats  # (nz,) rotor inertia [kg m2|kg]
    friction: Floats  # (nz,)
    damping: Floats  # (nz,)
    stiffness: Floats  # (m,)
    spring_damping: Floats  # (m,)
    lower: Floats  # (n,)
    upper: Floats  # (n,)


class PackedJoints(NamedTuple):
    """JointNumbers in two arrays: every array handed to compiled code costs 45 ns, and a tick makes seven calls."""

    whole: NDArray[np.int64]  # n_tree, n, m, then the whole numbers
    real: Floats  # the others, in the order of JointNumbers


def pack_joints(joints: JointNumbers) -> PackedJoints:
    """Lay all numbers end to end."""
    n_tree, n = joints.coupling.shape
    sizes = np.array([n_tree, n, len(joints.elastic)], dtype=np.int64)
    return PackedJoints(np.concatenate([sizes, *joints[:4]]), np.concatenate([a.ravel() for a in joints[4:]]))


@inlined
def joints_of(packed: PackedJoints) -> JointNumbers:
    """JointNumbers as views of packed ones; in compiled code."""
    whole, real = packed
    n_tree, n, m = whole[0], whole[1], whole[2]
    nz = n + m
    w = 3 + 2 * n_tree
    r = n_tree * n
    f = r + n_tree
    s = f + 3 * nz
    return JointNumbers(
        whole[3 : 3 + n_tree],
        whole[3 + n_tree : w],
        whole[w : w + n],
        whole[w + n :],
        real[:r].reshape(n_tree, n),
        real[r:f],
        real[f : f + nz],
        real[f + nz : f + 2 * nz],
        real[f + 2 * nz : s],
        real[s : s + m],
        real[s + m : s + 2 * m],
        real[s + 2 * m : s + 2 * m + n],
        real[s + 2 * m + n :],
    )


def joint_numbers(
    model: RobotModel, hardware: JointHardware, dof: NDArray[np.int64], at: NDArray[np.int64]
) -> JointNumbers:
    """Check an arm's hardware.

    Raises:
        InputError: Numbers that are negative or not finite, or an elastic joint without a rotor.
    """
    n = model.n
    friction = _per_joint("friction", hardware.friction, n)
    damping = _per_joint("damping", hardware.damping, n)
    armature = _per_joint("armature", hardware.armature, n)
    stiffness = _per_joint("stiffness", hardware.stiffness, n, finite=False)
    spring_damping = _per_joint("spring_damping", hardware.spring_damping, n)
    elastic = np.flatnonzero(np.isfinite(stiffness))
    for j in elastic:
        if not (stiffness[j] > 0.0 and armature[j] > 0.0):
            raise InputError(
                f'joint "{model.joint_names[j]}": stiffness {stiffness[j]:g} and armature {armature[j]:g}: '
                "an elastic joint needs both above zero"
            )
    drive = np.arange(n)
    drive[elastic] = n + np.arange(len(elastic))
    inertia, friction_z, damping_z = (np.zeros(n + len(elastic)) for _ in range(3))
    inertia[drive], friction_z[drive], damping_z[drive] = armature, friction, damping
    return JointNumbers(
        dof=dof,
        at=at,
        coupling=np.array(model.coupling),
        offset=np.array(model.offset),
        elastic=elastic.astype(np.int64),
        drive=drive.astype(np.int64),
        inertia=inertia,
        friction=friction_z,
        damping=damping_z,
        stiffness=stiffness[elastic],
        spring_damping=spring_damping[elastic],
        lower=np.array(model.lower),
        upper=np.array(model.upper),
    )


def _per_joint(name: str, values: ArrayLike, n: int, *, finite: bool = True) -> Floats:
    one = np.ndim(values) == 0
    array = as_array(name, values, () if one else (n,), finite=finite)
    if not (array >= 0.0).all():
        raise InputError(f"{name}: expected zero or more, got {array.tolist()}")
    return np.full(n, float(array)) if one else array
