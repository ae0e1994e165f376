"""A robot's tree as MJCF text: what MuJoCo simulates of any RobotModel."""

from xml.sax.saxutils import quoteattr

import numpy as np

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.robots.model import RobotModel
from catenary.spatial import quaternion_from_rotation

# MuJoCo refuses moving bodies below mjMINVAL = 1e-15; a massless link gets this much, which no torque shows
LEAST_MASS = 1e-12  # [kg]
LEAST_INERTIA = 1e-14  # [kg m2]
_ROUNDING = 1e-9  # of the largest moment, by which the triangle inequality may be missed


def tree_mjcf(model: RobotModel) -> str:
    """Write the tree as MJCF, on a body, the base, with a free joint, in weightlessness.

    Body and joint i have the name of link i, the body's frame is frame i of the tree. The joints are the tree's
    own, each free to move by itself: MJCF has no joint that moves by a linear combination of others, only soft
    constraints that nearly make it so. Who simulates this sets tree coordinate = coupling q + offset.
    """
    model.require_inertia()
    children: list[list[int]] = [[] for _ in range(len(model.link_names) + 1)]
    for i, parent in enumerate(model.tree.parent):
        children[parent].append(i)  # those of the base (-1) come last
    # written from the leaves, since children come after their parents
    body = [""] * len(model.link_names)
    for i in reversed(range(len(body))):
        body[i] = _body(model, i, "".join(body[c] for c in children[i]))
    links = "".join(body[c] for c in children[-1])
    return (
        f"<mujoco model={quoteattr(model.name)}>\n"
        '<compiler angle="radian"/>\n'
        '<option gravity="0 0 0"><flag contact="disable"/></option>\n'
        f"<worldbody><body name={quoteattr(model.base)}><freejoint/>"
        f'<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/>\n{links}</body></worldbody>\n</mujoco>\n'
    )


def _body(model: RobotModel, i: int, inside: str) -> str:
    tree, name = model.tree, quoteattr(model.link_names[i])
    moments, axes = _principal(model, i)
    return (
        f'<body name={name} pos="{_text(tree.origin[i])}" '
        f'quat="{_text(quaternion_from_rotation(tree.rotation[i]))}">'
        f'<joint name={name} type="{"slide" if tree.prismatic[i] else "hinge"}" axis="{_text(tree.axis[i])}"/>'
        f'<inertial mass="{max(tree.mass[i], LEAST_MASS):.17g}" pos="{_text(tree.com[i])}" '
        f'quat="{_text(quaternion_from_rotation(axes))}" diaginertia="{_text(moments)}"/>\n{inside}</body>\n'
    )


def _principal(model: RobotModel, i: int) -> tuple[Floats, Floats]:
    """Return the principal moments (3,), rising, and their axes as columns, right-handed."""
    moments, axes = np.linalg.eigh(model.tree.inertia[i])
    axes = axes * np.linalg.det(axes)
    tolerance = _ROUNDING * moments[2]
    if moments[0] < -tolerance or moments[0] + moments[1] < moments[2] - tolerance:
        raise InputError(
            f'robot "{model.name}": link "{model.link_names[i]}": principal moments of inertia '
            f"{moments.tolist()} kg m2 are not those of a rigid body; expected none below zero, and each at most "
            "the sum of the other two"
        )
    moments = np.maximum(moments, LEAST_INERTIA)
    # a rod's moments (0, I, I) may miss the inequality by rounding, and MuJoCo takes it exactly
    moments[0] += max(0.0, moments[2] - moments[1] - moments[0])
    return moments, axes


def _text(values: Floats) -> str:
    return " ".join(f"{v:.17g}" for v in values)
