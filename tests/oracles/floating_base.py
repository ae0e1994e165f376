"""Torques of an arm on a base that floats and is moved as one says, by MuJoCo and by Pinocchio."""

from collections.abc import Callable
from typing import NamedTuple

import mujoco
import numpy as np
import pinocchio

from catenary.dynamics.inverse_dynamics import BaseMotion
from oracles.mujoco_trees import mujoco_model, mujoco_order
from oracles.pinocchio_trees import pinocchio_model, pinocchio_order
from oracles.random_trees import Floats, RandomRobot


class Free(NamedTuple):
    """A base that floats in a world: how it stands, its velocity, and how it moves in its own axes."""

    R_world_base: Floats
    velocity: Floats
    motion: BaseMotion


STILL = Free(np.eye(3), np.zeros(3), BaseMotion(*np.zeros((3, 3))))


def by_mujoco(robot: RandomRobot, q: Floats, qd: Floats, qdd: Floats, gravity: Floats, base: Free) -> Floats:
    """Torques of a motion on a floating base, by MuJoCo's free joint."""
    m, (omega, alpha, acceleration, _) = robot.model, base.motion
    mj = mujoco_model(robot, gravity=base.R_world_base @ gravity, base="free")
    data = mujoco.MjData(mj)
    order = mujoco_order(robot, mj)
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, base.R_world_base.ravel())
    data.qpos[3:7] = quaternion
    data.qpos[order + 1] = m.coupling @ q + m.offset  # a free joint has 7 positions and 6 velocities
    # MuJoCo's free joint: linear parts in world axes, angular parts in the body's own
    data.qvel[:3], data.qvel[3:6] = base.velocity, omega
    data.qvel[order] = m.coupling @ qd
    mujoco.mj_forward(mj, data)
    data.qacc[:3], data.qacc[3:6] = base.R_world_base @ acceleration, alpha
    data.qacc[order] = m.coupling @ qdd
    result = np.zeros(mj.nv)
    mujoco.mj_rne(mj, data, 1, result)
    return m.coupling.T @ result[order]


def by_pinocchio(robot: RandomRobot, q: Floats, qd: Floats, qdd: Floats, gravity: Floats, base: Free) -> Floats:
    """Torques of a motion on a floating base, by Pinocchio's free flyer."""
    m, (omega, alpha, acceleration, _) = robot.model, base.motion
    pin = pinocchio_model(robot, base="free")
    pin.gravity.linear = base.R_world_base @ gravity
    order = pinocchio_order(robot, pin)
    x, xd, xdd = np.zeros(pin.nq), np.zeros(pin.nv), np.zeros(pin.nv)
    x[3:7] = pinocchio.Quaternion(base.R_world_base).coeffs()
    x[order + 1] = m.coupling @ q + m.offset
    xd[:3], xd[3:6] = base.velocity, omega
    # Pinocchio's acceleration is the spatial one: that of the origin as a point, less omega x velocity
    xdd[:3], xdd[3:6] = acceleration - np.cross(omega, base.velocity), alpha
    xd[order], xdd[order] = m.coupling @ qd, m.coupling @ qdd
    return m.coupling.T @ pinocchio.rnea(pin, pin.createData(), x, xd, xdd)[order]


def held(robot: RandomRobot, q: Floats, gravity: Floats, peer: Callable[..., Floats] = by_mujoco) -> Floats:
    """Torques that hold an arm on a base that stands still."""
    return peer(robot, q, *np.zeros((2, robot.model.n)), gravity, STILL)
