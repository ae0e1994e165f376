"""Capsules along the links of a robot whose description shows none of them.

From a link's joint to those it carries, thick enough to hold the link's mass as a body of the density of water:
arms are hollow tubes with motors and gears in them. A UR10e's upper arm (13.05 kg over 0.61 m) comes out some 75 mm in
radius. An assumption, not a measurement: a robot whose shapes matter needs a description that has them.
"""

import numpy as np

from catenary.arrays import Floats
from catenary.robots.geometry import Geometry, Shape, capsule_between
from catenary.robots.model import RobotModel
from catenary.spatial import identity_pose

DENSITY = 1000.0  # [kg/m3] of water
SHORT = 1e-6  # [m] a segment of less is a point


def capsules_along_links(model: RobotModel, radius: float | None = None) -> Geometry | None:
    """Return capsules along the links; None where neither masses nor a radius say how thick they are.

    Where the centre of mass lies outside a capsule to the next joint, two capsules pass through it.

    Args:
        model: The robot.
        radius: Of all capsules [m]; by the links' masses when None.
    """
    known = [i for i, mass in enumerate(model.tree.mass) if mass > 0.0]
    if radius is None and not known:
        return None
    shapes: list[Shape] = []
    radii: list[float] = []
    for link, name in enumerate(model.link_names):
        mass = float(model.tree.mass[link])
        if radius is None and mass == 0.0:
            continue
        segments = _segments(model, link)
        thick = _thickness(mass, segments) if radius is None else radius
        segments = _through_com(segments, model.tree.com[link], thick) if mass > 0.0 else segments
        if radius is None:
            thick = _thickness(mass, segments)
        radii.append(thick)
        shapes += [_shape(name, link, segment, thick) for segment in segments]
    for child in np.flatnonzero(model.tree.parent < 0):
        end = model.tree.origin[child]
        if np.linalg.norm(end) > SHORT:
            shapes.append(_shape(model.base, -1, (np.zeros(3), end), radii[0]))
    thickness = f"{1000 * min(radii):.0f} to {1000 * max(radii):.0f} mm"
    by = "as given" if radius is not None else "as thick as their masses are in water"
    return Geometry(
        model.name, tuple(shapes), f"capsules along its links, {thickness} in radius, {by}", assumed=True
    )


Segment = tuple[Floats, Floats]


def _segments(model: RobotModel, link: int) -> list[Segment]:
    """Return what a link spans in its own frame: from its joint to each one it carries, or to its last frame."""
    ends = [model.tree.origin[c] for c in np.flatnonzero(model.tree.parent == link)]
    if not ends:
        ends = [frame.pose.position for frame in model.frames.values() if frame.link == link]
        ends = sorted(ends, key=lambda end: float(np.linalg.norm(end)))[-1:]
    far = [end for end in ends if np.linalg.norm(end) > SHORT]
    return [(np.zeros(3), end) for end in far] or [(np.zeros(3), np.zeros(3))]


def _through_com(segments: list[Segment], com: Floats, radius: float) -> list[Segment]:
    if min(_distance(com, segment) for segment in segments) <= radius:
        return segments
    nearest = min(segments, key=lambda segment: _distance(com, segment))
    others = [segment for segment in segments if segment is not nearest]
    halves = [(nearest[0], com), (com, nearest[1])]
    return [*others, *(half for half in halves if np.linalg.norm(half[1] - half[0]) > SHORT)]


def _distance(point: Floats, segment: Segment) -> float:
    start, along = segment[0], segment[1] - segment[0]
    square = float(along @ along)
    share = 0.0 if square == 0.0 else float(np.clip((point - start) @ along / square, 0.0, 1.0))
    return float(np.linalg.norm(point - start - share * along))


def _thickness(mass: float, segments: list[Segment]) -> float:
    """Return the radius r at which capsules hold a mass: m / density = pi r^2 length + 4/3 pi r^3."""
    length = sum(float(np.linalg.norm(end - start)) for start, end in segments)
    roots = np.roots([4.0 / 3.0 * np.pi, np.pi * length, 0.0, -mass / DENSITY])
    return float(roots[np.isclose(roots.imag, 0.0) & (roots.real > 0.0)].real[0])


def _shape(name: str, link: int, segment: Segment, radius: float) -> Shape:
    pose, capsule = capsule_between(segment[0], segment[1], radius)
    return Shape(name, link, identity_pose() @ pose, capsule)
