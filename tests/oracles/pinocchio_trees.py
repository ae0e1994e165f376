"""The random robots in Pinocchio, built joint by joint through its API."""

from typing import Literal

import numpy as np
import pinocchio
from numpy.typing import NDArray

from catenary.robots.assembly import Link
from oracles.random_trees import Floats, RandomRobot


def pinocchio_model(robot: RandomRobot, *, base: Literal["fixed", "free"] = "fixed") -> pinocchio.Model:
    """Build the robot joint by joint through Pinocchio's API; link frames become its frames."""
    model = pinocchio.Model()
    model.gravity.linear = np.zeros(3)
    root = 0
    if base == "free":
        root = model.addJoint(0, pinocchio.JointModelFreeFlyer(), pinocchio.SE3.Identity(), "base")
        model.appendBodyToJoint(root, pinocchio.Inertia(1.0, np.zeros(3), np.eye(3)), pinocchio.SE3.Identity())
    joint_of = {"base": (root, pinocchio.SE3.Identity())}
    for link in _depth_first(robot.links, "base"):
        joint, placement = joint_of[link.parent]
        placement = placement * pinocchio.SE3(link.pose.rotation, link.pose.position)
        own = pinocchio.SE3(link.frame.rotation, link.frame.position)
        if link.joint == "fixed":
            placement = placement * own
        else:
            axis = link.axis / np.linalg.norm(link.axis)
            kind = (
                pinocchio.JointModelPrismaticUnaligned(axis)
                if link.joint == "prismatic"
                else pinocchio.JointModelRevoluteUnaligned(axis)
            )
            joint = model.addJoint(joint, kind, placement, link.name)
            placement = own
        assert link.inertia is not None
        body = pinocchio.Inertia(link.inertia.mass, link.inertia.com, link.inertia.inertia)
        model.appendBodyToJoint(joint, body, placement)
        model.addFrame(pinocchio.Frame(f"{link.name}_frame", joint, placement, pinocchio.FrameType.OP_FRAME))
        joint_of[link.name] = (joint, placement)
    return model


def _depth_first(links: list[Link], parent: str) -> list[Link]:
    """Order the links depth first.

    Pinocchio's mass and Coriolis matrices are wrong unless the joints of a subtree are numbered in a row.
    """
    ordered: list[Link] = []
    for link in links:
        if link.parent == parent:
            ordered += [link, *_depth_first(links, link.name)]
    return ordered


def pinocchio_order(robot: RandomRobot, model: pinocchio.Model) -> NDArray[np.int64]:
    """Index of every tree joint in Pinocchio's velocities."""
    return np.array([model.joints[model.getJointId(name)].idx_v for name in robot.model.link_names])


def pinocchio_vector(robot: RandomRobot, model: pinocchio.Model, values: Floats) -> Floats:
    """Tree values in Pinocchio's order, for a robot on a fixed base."""
    out = np.zeros(model.nv)
    out[pinocchio_order(robot, model)] = values
    return out
