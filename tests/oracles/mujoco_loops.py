"""What a mechanism's motors hold and feel, by MuJoCo's own Jacobian of its equality constraints."""

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Held(NamedTuple):
    gap: float  # [m or rad] by which the equalities are off
    torque: Floats  # (m,) that holds the motors
    mass: Floats  # (m, m) that they feel


def held(text: str, motors: list[str], joints: dict[str, float], gravity: Floats) -> Held:
    """Return what the motors hold with all joints placed: null space of MuJoCo's constraint, by the motors' rates."""
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.gravity[:] = gravity
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    for name, value in joints.items():
        data.joint(name).qpos = value
    mujoco.mj_forward(model, data)
    is_equality = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    A = data.efc_J.reshape(-1, model.nv)[is_equality]
    driven = [int(model.joint(name).dofadr[0]) for name in motors]
    _, sizes, rows = np.linalg.svd(A)
    free = rows[np.count_nonzero(sizes > 1e-9 * sizes[0]) :].T  # (nv, m)
    J = free @ np.linalg.inv(free[driven])
    M = np.zeros((model.nv, model.nv))
    for row, unit in zip(M, np.eye(model.nv), strict=True):
        mujoco.mj_mulM(model, data, row, unit)
    return Held(float(np.abs(data.efc_pos[is_equality]).max()), J.T @ data.qfrc_bias, J.T @ M @ J)
