"""Robots written as URDF, for other programs to read."""

from math import atan2, hypot
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from scipy.spatial.transform import Rotation

from catenary.arrays import Floats
from catenary.errors import UnsupportedModelError
from catenary.robots.actuation import JointDrives, joint_drives
from catenary.robots.model import RobotModel
from catenary.spatial import Pose

_UNLIMITED = 1e3  # URDF's <limit> has no infinity [m, rad/s, m/s, Nm, N]


def urdf_text(model: RobotModel) -> str:
    """Return a robot as URDF: a joint that follows another is a mimic joint, named frames are fixed links.

    A link whose inertia about its centre of mass is not known has none here either. Coordinates that move no link
    (motors that carry friction only) have no place in URDF and are left out. Of an actuation whose numbers are known
    the Coulomb and viscous friction of joints by themselves is written (<dynamics>); URDF has nothing for the rest.
    """
    root = Element("robot", name=model.name)
    SubElement(root, "link", name=model.base)
    drives = _drives(model)
    friction = None if model.actuation is None else joint_drives(model.actuation, model.n)
    for i in range(len(model.link_names)):
        _add_link(root, model, i)
        _add_joint(root, model, i, drives[i], friction)
    for frame, (link, pose) in model.frames.items():
        moved = not (np.array_equal(pose.rotation, np.eye(3)) and not pose.position.any())
        if frame == model.base or (frame in model.link_names and not moved):
            continue  # those that are a link's own
        name = f"{frame}_frame" if frame in model.link_names else frame
        SubElement(root, "link", name=name)
        joint = SubElement(root, "joint", name=f"{name}_fixed", type="fixed")
        SubElement(joint, "parent", link=model.base if link < 0 else model.link_names[link])
        SubElement(joint, "child", link=name)
        _add_origin(joint, pose)
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _drives(model: RobotModel) -> list[tuple[int, float, bool]]:
    """Return each tree joint's coordinate, its ratio to it, and whether it stands for that coordinate."""
    drives: list[tuple[int, float, bool]] = []
    led: set[int] = set()
    for i, row in enumerate(model.coupling):
        moved_by = np.flatnonzero(row)
        if len(moved_by) != 1:
            names = " and ".join(model.joint_names[c] for c in moved_by) or "nothing"
            raise UnsupportedModelError(
                f'robot "{model.name}": link "{model.link_names[i]}" moves with {names}: URDF joints follow one other'
            )
        coordinate, factor = int(moved_by[0]), float(row[moved_by[0]])
        leads = abs(factor) == 1.0 and coordinate not in led
        led |= {coordinate} if leads else set()
        drives.append((coordinate, factor, leads))
    for coordinate, _, _ in drives:
        if coordinate not in led:
            raise UnsupportedModelError(
                f'robot "{model.name}": no joint follows {model.joint_names[coordinate]} one to one, as a URDF '
                "joint that others mimic must"
            )
    return drives


def _add_link(root: Element, model: RobotModel, i: int) -> None:
    link = SubElement(root, "link", name=model.link_names[i])
    if model.tree.mass[i] <= 0.0:
        return
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=_text(model.tree.com[i]), rpy="0 0 0")
    SubElement(inertial, "mass", value=repr(float(model.tree.mass[i])))
    if model.link_names[i] in model.missing_tensor:
        return
    tensor = model.tree.inertia[i]
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    entries = zip(keys, tensor[np.triu_indices(3)], strict=True)
    SubElement(inertial, "inertia", {key: repr(float(value)) for key, value in entries})


def _add_joint(
    root: Element, model: RobotModel, i: int, drive: tuple[int, float, bool], friction: JointDrives | None
) -> None:
    coordinate, factor, leads = drive
    slides = bool(model.tree.prismatic[i])
    low, high = sorted(
        factor * limit + (0.0 if leads else float(model.offset[i])) if np.isfinite(limit) else np.sign(factor) * limit
        for limit in (model.lower[coordinate], model.upper[coordinate])
    )
    if leads:
        low, high = float(model.lower[coordinate]), float(model.upper[coordinate])
    endless = not slides and not (np.isfinite(low) and np.isfinite(high))
    name = model.joint_names[coordinate] if leads else f"{model.link_names[i]}_joint"
    kind = "prismatic" if slides else "continuous" if endless else "revolute"
    joint = SubElement(root, "joint", name=name, type=kind)
    parent = int(model.tree.parent[i])
    SubElement(joint, "parent", link=model.base if parent < 0 else model.link_names[parent])
    SubElement(joint, "child", link=model.link_names[i])
    R, p, axis = model.tree.rotation[i], model.tree.origin[i], model.tree.axis[i]
    # one that leads is the coordinate itself: its offset goes into its place, its sign into its axis
    if leads:
        if slides:
            p = p + R @ axis * float(model.offset[i])
        else:
            R = R @ Rotation.from_rotvec(axis * float(model.offset[i])).as_matrix()
        axis = axis * factor
    _add_origin(joint, Pose(R, p))
    SubElement(joint, "axis", xyz=_text(axis))
    if not leads:
        follows = {"joint": model.joint_names[coordinate], "multiplier": repr(factor)}
        SubElement(joint, "mimic", follows, offset=repr(float(model.offset[i])))
    bounds = {} if endless else {"lower": _finite(low), "upper": _finite(high)}
    fastest = abs(factor) * float(model.velocity_limit[coordinate])
    strongest = float(model.effort_limit[coordinate])
    SubElement(joint, "limit", bounds, velocity=_finite(fastest), effort=_finite(strongest))
    if leads and friction is not None:
        damping, coulomb = friction.damping[coordinate], friction.friction[coordinate]
        SubElement(joint, "dynamics", damping=repr(float(damping)), friction=repr(float(coulomb)))


def _add_origin(element: Element, pose: Pose) -> None:
    R = pose.rotation
    along = hypot(R[0, 0], R[1, 0])
    pitch = atan2(-R[2, 0], along)
    # at a pitch of a quarter turn roll and yaw turn about one axis: all of it is given to roll
    roll = atan2(R[2, 1], R[2, 2]) if along > 1e-9 else atan2(-R[1, 2], R[1, 1])
    yaw = atan2(R[1, 0], R[0, 0]) if along > 1e-9 else 0.0
    SubElement(element, "origin", xyz=_text(pose.position), rpy=_text(np.array([roll, pitch, yaw])))


def _text(vector: Floats) -> str:
    return " ".join(repr(float(v)) for v in vector)


def _finite(value: float) -> str:
    return repr(float(np.clip(value, -_UNLIMITED, _UNLIMITED)))
