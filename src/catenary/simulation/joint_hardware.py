"""Joint drives of a simulated arm: friction, rotors, elastic joints, stops; their Runge-Kutta step and its stability.

Motors and springs act within a step with given rigid-body terms; friction and joint limits are impulses at its end.
The step is compiled.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_not_negative, one_for_all
from catenary.errors import InputError
from catenary.kernels.compiled import compiled, inlined
from catenary.robots.model import RobotModel

Integers = NDArray[np.int64]


@dataclass(frozen=True)
class JointHardware:
    """Drive parameters of an arm, a scalar for all joints or (n,); ideal drives by default.

    A joint with a finite stiffness is elastic: a rotor, on which torque, friction and damping act, moves the joint
    through a spring [Spong 1987, Modeling and control of elastic joint robots: rotors turn about their own axes
    only]. The robot then reports the rotor's position, like one with encoders on its motors. All parameters are on the
    joint's side of the gearbox: a rotor of inertia J behind a ratio N has N² J.
    """

    friction: ArrayLike = 0.0  # Coulomb friction [Nm|N]
    damping: ArrayLike = 0.0  # viscous [Nms/rad|Ns/m]
    armature: ArrayLike = 0.0  # rotor inertia [kg m2|kg]
    stiffness: ArrayLike = np.inf  # of the transmission [Nm/rad|N/m]
    spring_damping: ArrayLike = 0.0  # across it [Nms/rad|Ns/m]


class DriveParameters(NamedTuple):
    """Drives of an arm for compiled code.

    The nz moving parts are the robot's n coordinates, then the m rotors of elastic joints: spring e connects joint
    elastic[e] with moving part n + e.
    """

    coupling: Floats  # (n_tree, n)
    dof: Integers  # (n_tree,) indices of the tree coordinates' velocities in MuJoCo
    at: Integers  # (n_tree,) and of their positions
    offset: Floats  # (n_tree,) tree coordinates at the robot's zero [rad|m]
    drive: Integers  # (n,) moving part driven by a joint's motor: the joint, or its rotor
    lower: Floats  # (n,) [rad|m]
    upper: Floats
    elastic: Integers  # (m,)
    stiffness: Floats  # (m,) [Nm/rad|N/m]
    spring_damping: Floats  # (m,) [Nms/rad|Ns/m]
    inertia: Floats  # (nz,) of the rotor [kg m2|kg]
    friction: Floats  # (nz,) [Nm|N]
    damping: Floats  # (nz,) [Nms/rad|Ns/m]


def drive_parameters(model: RobotModel, hardware: JointHardware, dof: Integers, at: Integers) -> DriveParameters:
    """Check an arm's drives and return them for compiled code; dof and at (n_tree,) as in `DriveParameters`."""
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


# of |eigenvalue| times step; Runge-Kutta's fourth-order method is stable to 2.78, and accurate below 1
_MAX_EIGENVALUE_STEP = 2.0
_MIN_INERTIA = 1e-10  # [kg m2|kg] of a joint; massless links have 1e-12 kg


def require_stable(joints: DriveParameters, mass: Floats, step: float, names: Sequence[str]) -> None:
    """Refuse joints without inertia in the mass matrix (nz, nz), and a step [s] too long for springs and dampers."""
    n, nz = len(joints.drive), len(mass)
    bare = [name for name, m in zip(names, np.diag(mass), strict=False) if m < _MIN_INERTIA]
    if bare:
        raise InputError(
            f"joint(s) {', '.join(bare)} move no mass: their motion is not determined; "
            "add rotor inertia (armature) or link inertia"
        )
    if np.linalg.eigvalsh(mass)[0] <= 0.0:
        raise InputError("the mass matrix is singular: some joints together move no mass; add rotor inertia (armature)")
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
    if fastest * step > _MAX_EIGENVALUE_STEP:
        raise InputError(
            f"springs or dampers have a time constant of {1e3 / fastest:.3g} ms, too short for steps of "
            f"{1e3 * step:.3g} ms; "
            f"use at least {math.ceil(fastest * step / _MAX_EIGENVALUE_STEP)} times as many substeps"
        )


class TreeTerms(NamedTuple):
    """Terms of M xdd + h = torque of the tree in MuJoCo's coordinates, and its state; see `dof` and `at`."""

    q: Floats  # (nq,) positions [rad|m]
    qd: Floats  # (nv,) velocities
    mass: Floats  # (nv, nv) mass matrix
    bias: Floats  # (nv,) velocity, gravity and base motion torques


class StepMotion(NamedTuple):
    """Integration step of an arm's nz moving parts."""

    start: Floats  # (nz,) at the start of the step, and between steps [rad|m]
    start_rate: Floats
    position: Floats  # (nz,) of a stage; after the last one, at the end of the step
    rate: Floats
    acceleration: Floats  # (4, nz) of the stages
    factor: Floats  # (4, n, n) Cholesky factors of the stages' mass matrices, in the lower triangles


def new_motion(n: int, nz: int) -> StepMotion:
    """Return n joints and nz moving parts at zero, at rest."""
    start, start_rate, position, rate = np.zeros((4, nz))
    return StepMotion(start, start_rate, position, rate, np.zeros((4, nz)), np.zeros((4, n, n)))


@inlined
def along_robot(joints: DriveParameters, tree: TreeTerms, mass: Floats, bias: Floats) -> None:
    """Project the rigid-body terms on the robot's coordinates: M = A' M_tree A, h = A' h_tree; A is the coupling."""
    n_tree, n = joints.coupling.shape
    half = np.zeros((n_tree, n))
    for i in range(n_tree):
        for k in range(n_tree):
            m = tree.mass[joints.dof[i], joints.dof[k]]
            if m != 0.0:
                for c in range(n):
                    half[i, c] += m * joints.coupling[k, c]
    mass[:, :] = 0.0
    bias[:] = 0.0
    for i in range(n_tree):
        for r in range(n):
            a = joints.coupling[i, r]
            if a != 0.0:
                bias[r] += a * tree.bias[joints.dof[i]]
                for c in range(n):
                    mass[r, c] += a * half[i, c]
    for r in range(n):
        mass[r, r] += joints.inertia[r]


@compiled
def begin_step(joints: DriveParameters, motion: StepMotion, tree: TreeTerms) -> None:
    """Start a step at the arm's state, and write the tree's positions and velocities."""
    motion.position[:], motion.rate[:] = motion.start, motion.start_rate
    _place_tree(joints, motion, tree)


@inlined
def _place_tree(joints: DriveParameters, motion: StepMotion, tree: TreeTerms) -> None:
    n_tree, n = joints.coupling.shape
    for i in range(n_tree):
        x, xd = joints.offset[i], 0.0
        for c in range(n):
            x += joints.coupling[i, c] * motion.position[c]
            xd += joints.coupling[i, c] * motion.rate[c]
        tree.q[joints.at[i]] = x
        tree.qd[joints.dof[i]] = xd


@compiled
def end_stage(
    joints: DriveParameters, motion: StepMotion, tree: TreeTerms, effort: Floats, stage: int, step: float
) -> bool:
    """Compute a stage's accelerations without friction and stops, and advance to the next stage, or to the step's end.

    Runge-Kutta's fourth-order method for position' = rate, rate' = acceleration; effort (n,) is that of the motors
    [Nm|N], stage 0 to 3. Returns False if the mass matrix is singular.
    """
    if not _find_accelerations(joints, motion, tree, effort, stage):
        return False
    h = step if stage == 2 else 0.5 * step
    for k in range(len(motion.start)):
        start, rate, a = motion.start[k], motion.start_rate[k], motion.acceleration[:, k]
        if stage == 3:
            motion.position[k] = start + step * rate + step * step / 6.0 * (a[0] + a[1] + a[2])
            motion.rate[k] = rate + step / 6.0 * (a[0] + 2.0 * (a[1] + a[2]) + a[3])
        else:
            before = a[stage - 1] if stage > 0 else 0.0
            motion.position[k] = start + h * (rate + 0.5 * step * before)
            motion.rate[k] = rate + h * a[stage]
    _place_tree(joints, motion, tree)
    return True


@inlined
def _find_accelerations(
    joints: DriveParameters, motion: StepMotion, tree: TreeTerms, effort: Floats, stage: int
) -> bool:
    n, m = len(joints.drive), len(joints.elastic)
    torque, bias = np.zeros(n + m), np.empty(n)
    factor = motion.factor[stage]
    along_robot(joints, tree, factor, bias)
    if not factorise(factor):
        return False
    for j in range(n):
        torque[j] -= bias[j]
        torque[joints.drive[j]] += effort[j]
    for e in range(m):
        link, rotor = joints.elastic[e], n + e
        pull = joints.stiffness[e] * (motion.position[rotor] - motion.position[link])
        pull += joints.spring_damping[e] * (motion.rate[rotor] - motion.rate[link])
        torque[link] += pull
        torque[rotor] -= pull
    for k in range(n + m):
        torque[k] -= joints.damping[k] * motion.rate[k]
    solve_factored(factor, torque[:n])
    for k in range(n + m):
        motion.acceleration[stage, k] = torque[k] if k < n else torque[k] / joints.inertia[k]
    return True


# solvers of symmetric positive definite systems for loops: bounded time, no library call, no exception


@inlined
def factorise(A: Floats) -> bool:
    """Overwrite the lower triangle of A (n, n) with its Cholesky factor L; return false if A is indefinite."""
    for i in range(A.shape[0]):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= A[i, k] * A[j, k]
            if i == j:
                if not total > 0.0:  # also when it is NaN
                    return False
                A[i, i] = math.sqrt(total)
            else:
                A[i, j] = total / A[j, j]
    return True


@inlined
def solve_factored(L: Floats, b: Floats) -> None:
    """Overwrite b (n,) with the solution of L L^T x = b, from the lower triangle of L (n, n)."""
    for i in range(L.shape[0]):
        total = b[i]
        for k in range(i):
            total -= L[i, k] * b[k]
        b[i] = total / L[i, i]
    for i in range(L.shape[0] - 1, -1, -1):
        total = b[i]
        for k in range(i + 1, L.shape[0]):
            total -= L[k, i] * b[k]
        b[i] = total / L[i, i]


_MAX_SWEEPS = 1000  # of projected Gauss-Seidel
_SETTLED_CHANGE = 1e-13  # [rad/s|m/s] change in a sweep at convergence


@compiled
def finish_step(joints: DriveParameters, motion: StepMotion, step: float) -> bool:
    """Apply friction and stops as impulses at the end of a step, and accept the step.

    The impulses solve a complementarity problem by projected Gauss-Seidel on the inverse mass matrix of the first
    stage: friction brings a joint to rest with at most its Coulomb torque times the step, a stop absorbs the velocity
    into it (no bounce). A joint that sticks does not move at all, and none passes its limit. Returns False, with the
    state unchanged, if the end is not finite.
    """
    n, nz = len(joints.drive), len(motion.start)
    stop = np.zeros(nz)  # 1 at a lower stop, -1 at an upper one
    acts = False
    for k in range(nz):
        if not (math.isfinite(motion.position[k]) and math.isfinite(motion.rate[k])):
            return False
        if k < n:
            stop[k] = _stop_at(joints, k, motion.position[k])
        acts = acts or stop[k] != 0.0 or joints.friction[k] > 0.0
    if acts:
        _apply_impulses(joints, motion, stop, step)
    motion.start[:], motion.start_rate[:] = motion.position, motion.rate
    return True


@inlined
def _stop_at(joints: DriveParameters, j: int, position: float) -> float:
    return 1.0 if position < joints.lower[j] else -1.0 if position > joints.upper[j] else 0.0


@inlined
def _apply_impulses(joints: DriveParameters, motion: StepMotion, stop: Floats, step: float) -> None:
    n, nz = len(joints.drive), len(motion.start)
    response = np.zeros((nz, nz))  # inverse mass matrix, symmetric
    for k in range(n):
        response[k, k] = 1.0
        solve_factored(motion.factor[0], response[k, :n])
    for k in range(n, nz):
        response[k, k] = 1.0 / joints.inertia[k]
    rate, free = motion.rate, motion.rate.copy()
    friction_impulse, stop_impulse = np.zeros(nz), np.zeros(nz)
    for _ in range(_MAX_SWEEPS):
        change = 0.0
        for k in range(nz):
            limit = joints.friction[k] * step
            if limit > 0.0:
                impulse = min(max(friction_impulse[k] - rate[k] / response[k, k], -limit), limit)
                change = max(change, _apply(response, k, impulse - friction_impulse[k], rate))
                friction_impulse[k] = impulse
            if stop[k] == 0.0 and k < n:  # impulses of other joints may push it into its stop
                stop[k] = _stop_at(joints, k, motion.position[k] + 0.5 * step * (rate[k] - free[k]))
            if stop[k] != 0.0:
                impulse = stop[k] * max(stop[k] * (stop_impulse[k] - rate[k] / response[k, k]), 0.0)
                change = max(change, _apply(response, k, impulse - stop_impulse[k], rate))
                stop_impulse[k] = impulse
        if change < _SETTLED_CHANGE:
            break
    for k in range(nz):
        motion.position[k] += 0.5 * step * (rate[k] - free[k])  # a constant force over the step
        if joints.friction[k] > 0.0 and abs(friction_impulse[k]) < joints.friction[k] * step:
            rate[k] = 0.0
            if motion.start_rate[k] == 0.0:
                motion.position[k] = motion.start[k]
        if stop_impulse[k] != 0.0:  # it hit its stop within the step, and rests there
            motion.position[k] = joints.lower[k] if stop[k] > 0.0 else joints.upper[k]
            rate[k] = 0.0
    for k in range(n):  # joints pushed beyond their stop by others; their speed is absorbed in the next step
        motion.position[k] = min(max(motion.position[k], joints.lower[k]), joints.upper[k])


@inlined
def _apply(response: Floats, k: int, impulse: float, rate: Floats) -> float:
    """Apply an impulse at k, and return the change of its velocity."""
    for i in range(len(rate)):
        rate[i] += response[k, i] * impulse
    return abs(float(response[k, k]) * impulse)
