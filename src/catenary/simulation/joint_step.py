"""One step of an arm whose rigid-body terms are given: springs, friction, stops. Compiled."""

import math

import numpy as np

from catenary.arrays import Floats
from catenary.kernels.compiled import compiled, inlined
from catenary.simulation.joint_hardware import JointNumbers, PackedJoints, joints_of

# rows of a step's work: where it began, where a stage looks and at last the end, accelerations of the four stages
Z0, ZD0, Z, ZD, A, MOTION = 0, 1, 2, 3, 4, 8
SWEEPS = 1000  # of projected Gauss-Seidel, at most
SETTLED = 1e-13  # [rad/s|m/s] change in a sweep below which impulses are found


@inlined
def _to_robot(joints: JointNumbers, tree_mass: Floats, tree_bias: Floats, mass: Floats, bias: Floats) -> None:
    """Write the rigid-body terms along the robot's coordinates: M = A' M_tree A, h = A' h_tree; A the coupling."""
    n_tree, n = joints.coupling.shape
    half = np.zeros((n_tree, n))
    for i in range(n_tree):
        for k in range(n_tree):
            m = tree_mass[joints.dof[i], joints.dof[k]]
            if m != 0.0:
                for c in range(n):
                    half[i, c] += m * joints.coupling[k, c]
    mass[:, :] = 0.0
    bias[:] = 0.0
    for i in range(n_tree):
        for r in range(n):
            a = joints.coupling[i, r]
            if a != 0.0:
                bias[r] += a * tree_bias[joints.dof[i]]
                for c in range(n):
                    mass[r, c] += a * half[i, c]
    for r in range(n):
        mass[r, r] += joints.inertia[r]


@inlined
def _factor(matrix: Floats, factor: Floats) -> bool:
    """Write the Cholesky factor; false where there is none."""
    n = len(matrix)
    for i in range(n):
        for k in range(i + 1):
            total = matrix[i, k]
            for l in range(k):
                total -= factor[i, l] * factor[k, l]
            if k < i:
                factor[i, k] = total / factor[k, k]
            elif total > 0.0:
                factor[i, i] = math.sqrt(total)
            else:
                return False
    return True


@inlined
def _solve(factor: Floats, x: Floats) -> None:
    """Solve in place."""
    n = len(factor)
    for i in range(n):
        for k in range(i):
            x[i] -= factor[i, k] * x[k]
        x[i] /= factor[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= factor[k, i] * x[k]
        x[i] /= factor[i, i]


@inlined
def _springs(joints: JointNumbers, z: Floats, zd: Floats, out: Floats) -> None:
    """Write the torques (m,) by which rotors pull their joints."""
    n = len(joints.drive)
    for e in range(len(joints.elastic)):
        j = joints.elastic[e]
        out[e] = joints.stiffness[e] * (z[n + e] - z[j]) + joints.spring_damping[e] * (zd[n + e] - zd[j])


@compiled
def begin_step(packed: PackedJoints, motion: Floats, tree_q: Floats, tree_qd: Floats) -> None:
    """Begin a step where the arm is.

    Args:
        packed: The arm's hardware.
        motion: (8, nz) rows of MOTION; positions and velocities of the stage are written.
        tree_q: MuJoCo's positions; those of the tree's joints are written.
        tree_qd: MuJoCo's velocities, likewise.
    """
    motion[Z], motion[ZD] = motion[Z0], motion[ZD0]
    _show(joints_of(packed), motion, tree_q, tree_qd)


@inlined
def _show(joints: JointNumbers, motion: Floats, tree_q: Floats, tree_qd: Floats) -> None:
    """Write the tree's coordinates and their rates where MuJoCo looks."""
    n_tree, n = joints.coupling.shape
    for i in range(n_tree):
        x, xd = joints.offset[i], 0.0
        for c in range(n):
            x += joints.coupling[i, c] * motion[Z, c]
            xd += joints.coupling[i, c] * motion[ZD, c]
        tree_q[joints.at[i]] = x
        tree_qd[joints.dof[i]] = xd


@compiled
def end_stage(
    packed: PackedJoints,
    stage: int,
    step: float,
    tree_mass: Floats,
    tree_bias: Floats,
    effort: Floats,
    motion: Floats,
    factors: Floats,
    tree_q: Floats,
    tree_qd: Floats,
) -> bool:
    """Find a stage's accelerations without friction and stops, and go to the next; to the step's end after stage 3.

    Runge-Kutta's fourth-order method for z' = zd, zd' = a.

    Args:
        packed: The arm's hardware.
        stage: 0 to 3.
        step: [s].
        tree_mass: (nv, nv) mass matrix of MuJoCo's tree.
        tree_bias: (nv,) its velocity, gravity and base motion torques.
        effort: (n,) motor torques.
        motion: (8, nz) rows of MOTION; the stage's accelerations, and the next positions and velocities are written.
        factors: (4, n, n) written at the stage: Cholesky factor of the mass matrix along the robot's coordinates.
        tree_q: MuJoCo's positions; those of the tree's joints are written.
        tree_qd: MuJoCo's velocities, likewise.

    Returns:
        False where the mass matrix is singular.
    """
    joints = joints_of(packed)
    if not _accelerations(
        joints, tree_mass, tree_bias, effort, motion[Z], motion[ZD], factors[stage], motion[A + stage]
    ):
        return False
    h = step if stage == 2 else 0.5 * step
    for k in range(motion.shape[1]):
        z0, zd0, a = motion[Z0, k], motion[ZD0, k], motion[A:, k]
        if stage == 3:
            motion[Z, k] = z0 + step * zd0 + step * step / 6.0 * (a[0] + a[1] + a[2])
            motion[ZD, k] = zd0 + step / 6.0 * (a[0] + 2.0 * (a[1] + a[2]) + a[3])
        else:
            before = a[stage - 1] if stage > 0 else 0.0
            motion[Z, k] = z0 + h * (zd0 + 0.5 * step * before)
            motion[ZD, k] = zd0 + h * a[stage]
    _show(joints, motion, tree_q, tree_qd)
    return True


@inlined
def _accelerations(
    joints: JointNumbers,
    tree_mass: Floats,
    tree_bias: Floats,
    effort: Floats,
    z: Floats,
    zd: Floats,
    factor: Floats,
    out: Floats,
) -> bool:
    n, m = len(joints.drive), len(joints.elastic)
    mass, bias, pull = np.empty((n, n)), np.empty(n), np.empty(m)
    _to_robot(joints, tree_mass, tree_bias, mass, bias)
    if not _factor(mass, factor):
        return False
    out[:] = 0.0
    for j in range(n):
        out[j] -= bias[j]
        out[joints.drive[j]] += effort[j]
    _springs(joints, z, zd, pull)
    for e in range(m):
        out[joints.elastic[e]] += pull[e]
        out[n + e] -= pull[e]
    for k in range(n + m):
        out[k] -= joints.damping[k] * zd[k]
    _solve(factor, out[:n])
    for k in range(n, n + m):
        out[k] /= joints.inertia[k]
    return True


@compiled
def finish_step(packed: PackedJoints, factor: Floats, step: float, motion: Floats) -> bool:
    """Let friction and stops act on a step that was made without them, and take it.

    Impulses on velocities, found by projected Gauss-Seidel on the inverse mass matrix: friction brings a joint to
    rest with at most its Coulomb torque times the step, a stop takes the velocity into it (no bounce). A joint that
    sticks does not move at all, and none passes its limit.

    Args:
        packed: The arm's hardware.
        factor: (n, n) Cholesky factor of the mass matrix as the step began.
        step: [s].
        motion: (8, nz) rows of MOTION; the first two become the step's end.

    Returns:
        False, and nothing has moved, where the end is not finite.
    """
    joints = joints_of(packed)
    z0, zd0, z, zd = motion[Z0], motion[ZD0], motion[Z], motion[ZD]
    n, nz = len(joints.drive), len(z)
    stop = np.zeros(nz)  # 1 at a lower stop, -1 at an upper one
    acts = False
    for k in range(nz):
        if not (math.isfinite(z[k]) and math.isfinite(zd[k])):
            return False
        if k < n:
            stop[k] = 1.0 if z[k] < joints.lower[k] else -1.0 if z[k] > joints.upper[k] else 0.0
        acts = acts or stop[k] != 0.0 or joints.friction[k] > 0.0
    if acts:
        _give_impulses(joints, factor, step, stop, z0, zd0, z, zd)
    z0[:] = z
    zd0[:] = zd
    return True


@inlined
def _give_impulses(
    joints: JointNumbers,
    factor: Floats,
    step: float,
    stop: Floats,
    z0: Floats,
    zd0: Floats,
    z: Floats,
    zd: Floats,
) -> None:
    n, nz = len(joints.drive), len(z)
    response = np.zeros((nz, nz))  # inverse mass matrix, symmetric
    for k in range(n):
        response[k, k] = 1.0
        _solve(factor, response[k, :n])
    for k in range(n, nz):
        response[k, k] = 1.0 / joints.inertia[k]
    free = zd.copy()
    rub, push = np.zeros(nz), np.zeros(nz)
    for _ in range(SWEEPS):
        change = 0.0
        for k in range(nz):
            most = joints.friction[k] * step
            if most > 0.0:
                wanted = min(max(rub[k] - zd[k] / response[k, k], -most), most)
                change = max(change, _give(response, k, wanted - rub[k], zd))
                rub[k] = wanted
            if stop[k] == 0.0 and k < n:  # others may push it into its stop
                end = z[k] + 0.5 * step * (zd[k] - free[k])
                stop[k] = 1.0 if end < joints.lower[k] else -1.0 if end > joints.upper[k] else 0.0
            if stop[k] != 0.0:
                wanted = stop[k] * max(stop[k] * (push[k] - zd[k] / response[k, k]), 0.0)
                change = max(change, _give(response, k, wanted - push[k], zd))
                push[k] = wanted
        if change < SETTLED:
            break
    for k in range(nz):
        z[k] += 0.5 * step * (zd[k] - free[k])  # a constant force over the step
        if joints.friction[k] > 0.0 and abs(rub[k]) < joints.friction[k] * step:
            zd[k] = 0.0
            if zd0[k] == 0.0:
                z[k] = z0[k]
        if push[k] != 0.0:  # it ran into its stop within the step, and lies there
            z[k] = joints.lower[k] if stop[k] > 0.0 else joints.upper[k]
            zd[k] = 0.0
    for k in range(n):  # those that others pushed beyond theirs; their speed is taken in the next step
        z[k] = min(max(z[k], joints.lower[k]), joints.upper[k])


@inlined
def _give(response: Floats, k: int, impulse: float, zd: Floats) -> float:
    """Give k an impulse; returns by how much that changed its velocity."""
    for l in range(len(zd)):
        zd[l] += response[k, l] * impulse
    return abs(float(response[k, k]) * impulse)


@compiled
def servo_torques(
    packed: PackedJoints,
    tree_mass: Floats,
    tree_bias: Floats,
    wanted: Floats,
    motion: Floats,
    bandwidth: float,
    slip: float,
    out: Floats,
) -> bool:
    """Write the torques (n,) of an ideal position servo: computed torque on what the motors move.

    a = w² (wanted - theta) - 2 w theta', tau = M a + h + damping + friction, with friction fed forward as
    F clip(error / slip, -1, 1): within `slip` of where it should be, a joint may stick.

    Returns:
        False where the mass matrix is singular.
    """
    joints = joints_of(packed)
    z, zd = motion[Z0], motion[ZD0]
    n, m = len(joints.drive), len(joints.elastic)
    mass, bias, pull = np.empty((n, n)), np.empty(n), np.empty(m)
    _to_robot(joints, tree_mass, tree_bias, mass, bias)
    _springs(joints, z, zd, pull)
    a = np.empty(n + m)
    for j in range(n):
        k = joints.drive[j]
        a[k] = bandwidth * (bandwidth * (wanted[j] - z[k]) - 2.0 * zd[k])
    # what hangs on springs accelerates as it must, and loads the rigid joints: M_ee a_e = pull - h_e - M_er a_r
    if m > 0:
        inner, factor, rest = np.empty((m, m)), np.zeros((m, m)), np.empty(m)
        for e in range(m):
            i = joints.elastic[e]
            rest[e] = pull[e] - bias[i]
            for j in range(n):
                if joints.drive[j] < n:
                    rest[e] -= mass[i, j] * a[j]
            for f in range(m):
                inner[e, f] = mass[i, joints.elastic[f]]
        if not _factor(inner, factor):
            return False
        _solve(factor, rest)
        for e in range(m):
            a[joints.elastic[e]] = rest[e]
    for j in range(n):
        k = joints.drive[j]
        ahead = min(max((wanted[j] - z[k]) / slip, -1.0), 1.0)
        torque = joints.damping[k] * zd[k] + joints.friction[k] * ahead
        if k == j:
            torque += bias[j]
            for l in range(n):
                torque += mass[j, l] * a[l]
        else:
            torque += joints.inertia[k] * a[k] + pull[k - n]
        out[j] = torque
    return True
