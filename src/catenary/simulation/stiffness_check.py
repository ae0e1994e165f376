"""Whether a step is short enough for an arm's springs and dampers, asked before anything moves."""

import math
from collections.abc import Sequence

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.simulation.joint_hardware import DriveParameters

MOST = 2.0  # of |eigenvalue| times step; Runge-Kutta's fourth-order method is stable to 2.78, and accurate below 1
LEAST_INERTIA = 1e-10  # [kg m2|kg] of a joint; massless links are given 1e-12 kg


def require_stable(joints: DriveParameters, mass: Floats, step: float, names: Sequence[str]) -> None:
    """Refuse joints that move no mass, and a step that is too long.

    Args:
        joints: The arm's hardware.
        mass: (nz, nz) mass matrix of all that moves, where the arm stands.
        step: [s].
        names: Of the joints.
    """
    n, nz = len(joints.joints), len(mass)
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
    stiffness, damping = np.zeros((nz, nz)), np.diag(joints.parts.damping)
    springs = joints.springs
    for e, (j, k, d) in enumerate(zip(springs.joint, springs.stiffness, springs.damping, strict=True)):
        across = np.zeros(nz)
        across[n + e], across[j] = 1.0, -1.0
        stiffness += k * np.outer(across, across)
        damping += d * np.outer(across, across)
    motion = np.block(
        [
            [np.zeros((nz, nz)), np.eye(nz)],
            [-np.linalg.solve(mass, stiffness), -np.linalg.solve(mass, damping)],
        ]
    )
    fastest = float(np.abs(np.linalg.eigvals(motion)).max())
    if fastest * step > MOST:
        raise InputError(
            f"springs or dampers act within {1e3 / fastest:.3g} ms, too stiff for steps of {1e3 * step:.3g} ms; "
            f"take at least {math.ceil(fastest * step / MOST)} times as many substeps"
        )
