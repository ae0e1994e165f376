"""Friction and joint limits as impulses at the end of a step. Compiled."""

import math

import numpy as np

from catenary.arrays import Floats
from catenary.kernels.compiled import compiled, inlined
from catenary.simulation.joint_hardware import DriveParameters
from catenary.simulation.joint_step import StepMotion, solve_factored

SWEEPS = 1000  # of projected Gauss-Seidel, at most
SETTLED = 1e-13  # [rad/s|m/s] change in a sweep below which impulses are found


@compiled
def finish_step(joints: DriveParameters, motion: StepMotion, step: float) -> bool:
    """Let friction and stops act on a step that was made without them, and take it.

    Impulses on velocities, found by projected Gauss-Seidel on the inverse mass matrix: friction brings a joint to
    rest with at most its Coulomb torque times the step, a stop takes the velocity into it (no bounce). A joint that
    sticks does not move at all, and none passes its limit.

    Args:
        joints: The arm's hardware.
        motion: Its end becomes the next step's start; the mass matrix is that of the first stage.
        step: [s].

    Returns:
        False, and nothing has moved, where the end is not finite.
    """
    n, nz = len(joints.joints), len(motion.parts)
    stop = np.zeros(nz)  # 1 at a lower stop, -1 at an upper one
    acts = False
    for k in range(nz):
        part = motion.parts[k]
        if not (math.isfinite(part.position) and math.isfinite(part.rate)):
            return False
        if k < n:
            stop[k] = _stop_at(joints, k, part.position)
        acts = acts or stop[k] != 0.0 or joints.parts[k].friction > 0.0
    if acts:
        _apply_impulses(joints, motion, stop, step)
    for k in range(nz):
        part = motion.parts[k]
        part.start, part.start_rate = part.position, part.rate
    return True


@inlined
def _stop_at(joints: DriveParameters, j: int, position: float) -> float:
    joint = joints.joints[j]
    return 1.0 if position < joint.lower else -1.0 if position > joint.upper else 0.0


@inlined
def _apply_impulses(joints: DriveParameters, motion: StepMotion, stop: Floats, step: float) -> None:
    n, nz = len(joints.joints), len(motion.parts)
    response = np.zeros((nz, nz))  # inverse mass matrix, symmetric
    for k in range(n):
        response[k, k] = 1.0
        solve_factored(motion.factor[0], response[k, :n])
    for k in range(n, nz):
        response[k, k] = 1.0 / joints.parts[k].inertia
    rate = np.empty(nz)
    for k in range(nz):
        rate[k] = motion.parts[k].rate
    free = rate.copy()
    friction_impulse, stop_impulse = np.zeros(nz), np.zeros(nz)
    for _ in range(SWEEPS):
        change = 0.0
        for k in range(nz):
            most = joints.parts[k].friction * step
            if most > 0.0:
                wanted = min(max(friction_impulse[k] - rate[k] / response[k, k], -most), most)
                change = max(change, _apply(response, k, wanted - friction_impulse[k], rate))
                friction_impulse[k] = wanted
            if stop[k] == 0.0 and k < n:  # other joints may push it into its stop
                stop[k] = _stop_at(joints, k, motion.parts[k].position + 0.5 * step * (rate[k] - free[k]))
            if stop[k] != 0.0:
                wanted = stop[k] * max(stop[k] * (stop_impulse[k] - rate[k] / response[k, k]), 0.0)
                change = max(change, _apply(response, k, wanted - stop_impulse[k], rate))
                stop_impulse[k] = wanted
        if change < SETTLED:
            break
    for k in range(nz):
        part, friction = motion.parts[k], joints.parts[k].friction
        part.position += 0.5 * step * (rate[k] - free[k])  # a constant force over the step
        part.rate = rate[k]
        if friction > 0.0 and abs(friction_impulse[k]) < friction * step:
            part.rate = 0.0
            if part.start_rate == 0.0:
                part.position = part.start
        if stop_impulse[k] != 0.0:  # it ran into its stop within the step, and lies there
            part.position = joints.joints[k].lower if stop[k] > 0.0 else joints.joints[k].upper
            part.rate = 0.0
    for k in range(n):  # those that others pushed beyond theirs; their speed is taken in the next step
        part, joint = motion.parts[k], joints.joints[k]
        part.position = min(max(part.position, joint.lower), joint.upper)


@inlined
def _apply(response: Floats, k: int, impulse: float, rate: Floats) -> float:
    """Apply an impulse at k; returns by how much that changed its velocity."""
    for i in range(len(rate)):
        rate[i] += response[k, i] * impulse
    return abs(float(response[k, k]) * impulse)
