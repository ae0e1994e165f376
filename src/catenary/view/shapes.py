"""The shape of each link of an arm, from its kinematics alone: tubes from joint to joint."""

from dataclasses import dataclass, field

import numpy as np

from catenary.arrays import Floats
from catenary.robots.model import RobotModel
from catenary.view.tubes import Mesh, joined, tube

THICKNESS = 0.032  # radius of a tube, times the arm's length
HUB = 2.6  # length of a joint's hub, times the tube's radius to either side
TIP = 0.45  # radius of the last link and the tool, times the tube's
NEAR = 0.01  # times the arm's length: joints nearer than this lie in one point
ARC = 0.72  # radius of a spherical linkage, times the way from its centre to what slides through it
STEPS = 24  # of an arc
TRAVEL = 0.5  # [m] of a slider without limits


@dataclass(frozen=True)
class ArmShapes:
    """An arm to be drawn: a mesh fixed to each link's frame, and one to the base."""

    links: tuple[Mesh, ...]  # (n_tree,) in the links' frames
    base: Mesh | None  # in the base frame
    length: float  # [m] of the arm from end to end of its chain: how large everything about it is drawn


@dataclass
class _Parts:
    """Tubes by link; -1 is the base."""

    found: dict[int, list[Mesh]] = field(default_factory=dict)

    def add(self, link: int, mesh: Mesh) -> None:
        self.found.setdefault(link, []).append(mesh)

    def mesh(self, link: int) -> Mesh | None:
        return joined(self.found[link]) if link in self.found else None


def arm_shapes(model: RobotModel) -> ArmShapes:
    """Return the shapes of an arm's links.

    A link is a tube from its joint to each joint that it carries, a revolute joint a hub along its axis, a prismatic
    one a rail over its range. Where revolute axes and a slider meet in one point, as at the port of a RAVEN-II or a
    da Vinci arm, the links are arcs about that point, which is what such a spherical linkage looks like.
    """
    length = arm_length(model)
    radius = THICKNESS * length
    parts = _Parts()
    spherical = _spherical_joints(model, NEAR * length)
    if spherical:
        _draw_spherical(model, parts, spherical, radius)
    n = len(model.link_names)
    children: dict[int, list[int]] = {}
    for child, parent in enumerate(model.tree.parent):
        children.setdefault(int(parent), []).append(child)
    for link in range(-1, n):
        for child in children.get(link, []):
            if child not in spherical:
                _draw_way(model, parts, link, child, radius, NEAR * length)
    for link in range(n):
        if link not in spherical and not model.tree.prismatic[link]:
            axis = model.tree.axis[link]
            # a wrist's hubs lie in one another: thinner ones at the end of the chain
            size = radius * (1.25 if children.get(link) else 2.0 * TIP)
            parts.add(link, tube(np.outer([-HUB / 2.0, HUB / 2.0], axis) * size, size))
    frame = model.frame()
    if np.linalg.norm(frame.pose.position) > NEAR * length:
        parts.add(frame.link, tube([np.zeros(3), frame.pose.position], TIP * radius))
    links = tuple(parts.mesh(link) or _point(radius) for link in range(n))
    return ArmShapes(links, parts.mesh(-1), length)


def arm_length(model: RobotModel) -> float:
    """Return the length of the longest chain of a robot [m]: ways from joint to joint, sliders half out."""
    tree = model.tree
    reach = np.zeros(len(tree.parent))
    for i, parent in enumerate(tree.parent):
        low, high = _travel(model, i)
        slide = 0.5 * (low + high) if tree.prismatic[i] else 0.0
        step = float(np.linalg.norm(tree.origin[i] + slide * (tree.rotation[i] @ tree.axis[i])))
        reach[i] = step + (reach[parent] if parent >= 0 else 0.0)
    frame = model.frame()
    tip = float(np.linalg.norm(frame.pose.position)) + (reach[frame.link] if frame.link >= 0 else 0.0)
    return max(tip, float(reach.max(initial=0.0)), 1e-3)


def _travel(model: RobotModel, link: int) -> tuple[float, float]:
    """Return between which tree coordinates a joint moves [rad|m]."""
    row = model.coupling[link]
    with np.errstate(invalid="ignore"):
        ends = np.array([row * model.lower, row * model.upper])
    ends = np.where(row == 0.0, 0.0, ends)
    low, high = np.minimum(*ends).sum() + model.offset[link], np.maximum(*ends).sum() + model.offset[link]
    if not (np.isfinite(low) and np.isfinite(high)):
        return 0.0, TRAVEL
    return float(low), float(high)


def _draw_way(model: RobotModel, parts: _Parts, link: int, child: int, radius: float, near: float) -> None:
    """Draw what a link has between its own joint and that of a child."""
    tree = model.tree
    origin = tree.origin[child]
    if tree.prismatic[child]:
        axis = tree.rotation[child] @ tree.axis[child]
        low, high = _travel(model, child)
        if high - low > near:
            parts.add(link, tube(origin + np.outer([low, high], axis), 0.6 * radius))
    if np.linalg.norm(origin) > near:
        parts.add(link, tube([np.zeros(3), origin], radius))


def _spherical_joints(model: RobotModel, near: float) -> list[int]:
    """Return the revolute joints that meet in one point with a slider after them, the first two or more of a robot."""
    tree = model.tree
    found: list[int] = []
    for i, parent in enumerate(tree.parent):
        chained = parent == i - 1 and (i == 0 or np.linalg.norm(tree.origin[i]) < near)
        if not chained:
            return []
        if tree.prismatic[i]:
            # what slides runs through the centre
            return found if len(found) >= 2 else []
        found.append(i)
    return []


def _draw_spherical(model: RobotModel, parts: _Parts, joints: list[int], radius: float) -> None:
    """Draw links as arcs about the point in which their axes meet, at hubs on the side of the slider's carriage."""
    tree = model.tree
    slider = joints[-1] + 1
    low, high = _travel(model, slider)
    middle = 0.5 * (low + high)
    size = ARC * abs(middle)
    # unit vectors to the hubs of joint i and i + 1, both in the frame of link i: axes turn nothing about themselves
    toward = np.sign(middle) * (tree.rotation[slider] @ tree.axis[slider])
    rail_end = (max(abs(low), abs(high)) / abs(middle)) * abs(middle) * toward
    parts.add(joints[-1], tube([size * toward, rail_end], 0.8 * radius))
    for joint in reversed(joints):
        axis = tree.axis[joint]
        hub = axis if axis @ toward > 0.0 else -axis
        parts.add(joint, tube(size * _arc(hub, toward), 0.8 * radius))
        parts.add(joint, tube(np.outer([size - HUB * radius, size + HUB * radius], hub), 1.3 * radius))
        toward = tree.rotation[joint] @ hub
    centre = tree.origin[joints[0]]
    foot = centre + 1.35 * size * toward
    parts.add(-1, tube([centre + (size + HUB * radius) * toward, foot], 1.6 * radius))


def _arc(a: Floats, b: Floats) -> Floats:
    """Return unit vectors (STEPS, 3) from one to another, along the great circle."""
    angle = float(np.arccos(np.clip(a @ b, -1.0, 1.0)))
    share = np.linspace(0.0, 1.0, STEPS)[:, None]
    if angle < 1e-3:
        return np.vstack([a, a + 1e-3 * np.cross(a, [0.3, 0.5, 0.7])])
    rows: Floats = (np.sin((1.0 - share) * angle) * a + np.sin(share * angle) * b) / np.sin(angle)
    return rows


def _point(radius: float) -> Mesh:
    """Return what a link without any extent is drawn as."""
    return tube([[0.0, 0.0, -0.1 * radius], [0.0, 0.0, 0.1 * radius]], TIP * radius)
