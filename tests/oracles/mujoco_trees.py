"""The random robots in MuJoCo, compiled from MJCF text."""

from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from catenary.robots.assembly import Link
from catenary.spatial import quaternion_from_rotation
from oracles.random_trees import Floats, RandomRobot


def text(values: Floats) -> str:
    return " ".join(f"{v:.17g}" for v in np.ravel(values))


def inertial(mass: float, com: Floats, I: Floats) -> str:
    six = I[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    return f'<inertial mass="{mass:.17g}" pos="{text(com)}" fullinertia="{text(six)}"/>'


def _mjcf_bodies(links: list[Link], parent: str) -> str:
    """The joint's frame and the link's own frame are two bodies, the second welded to the first."""
    out = ""
    for link in links:
        if link.parent != parent:
            continue
        body = link.inertia
        assert body is not None
        joint = ""
        if link.joint != "fixed":
            kind = "slide" if link.joint == "prismatic" else "hinge"
            joint = f'<joint name="{link.name}" type="{kind}" axis="{text(link.axis)}"/>'
        out += (
            f'<body name="{link.name}_joint" pos="{text(link.pose.position)}" '
            f'quat="{text(quaternion_from_rotation(link.pose.rotation))}">{joint}'
            f'<body name="{link.name}" pos="{text(link.frame.position)}" '
            f'quat="{text(quaternion_from_rotation(link.frame.rotation))}">'
            f"{inertial(body.mass, body.com, body.inertia)}"
            f"{_mjcf_bodies(links, link.name)}</body></body>"
        )
    return out


def mujoco_model(
    robot: RandomRobot, *, gravity: Floats | None = None, base: Literal["fixed", "free"] = "fixed"
) -> mujoco.MjModel:
    """Compile the robot for MuJoCo, on the world or on a body with a free joint (base="free")."""
    bodies = _mjcf_bodies(robot.links, "base")
    if base == "free":
        inertial = '<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/>'
        bodies = f'<body name="base"><freejoint name="base"/>{inertial}{bodies}</body>'
    g = np.zeros(3) if gravity is None else gravity
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><option gravity="{text(g)}"/><worldbody>{bodies}</worldbody></mujoco>'
    )


def mujoco_order(robot: RandomRobot, model: mujoco.MjModel) -> NDArray[np.int64]:
    """Index of every tree joint in MuJoCo's velocities."""
    return np.array([model.joint(name).dofadr[0] for name in robot.model.link_names])


def mujoco_data(robot: RandomRobot, model: mujoco.MjModel, q: Floats) -> mujoco.MjData:
    """Data at the coordinates q and at rest, with everything that depends on them computed."""
    data = mujoco.MjData(model)
    x = robot.model.coupling @ q + robot.model.offset
    for name, value in zip(robot.model.link_names, x, strict=True):
        data.joint(name).qpos = value
    mujoco.mj_forward(model, data)
    return data


def mujoco_mass_matrix(robot: RandomRobot, model: mujoco.MjModel, data: mujoco.MjData) -> Floats:
    """Mass matrix of the tree's joints."""
    columns = np.zeros((model.nv, model.nv))
    for k in range(model.nv):
        mujoco.mj_mulM(model, data, columns[k], np.eye(model.nv)[k])
    order = mujoco_order(robot, model)
    return columns[np.ix_(order, order)]
