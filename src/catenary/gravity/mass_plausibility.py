"""Masses that cannot be: of bodies too dense or too large, centres of mass beyond their links, torques beyond motors.

Doubts, not errors: a Baxter's springs carry what its motors cannot, an arm under water is carried by it. Inertias that
no body has at all are doubts of the description itself (robots/link_inertia.py).
"""

import numpy as np

from catenary.arrays import Floats
from catenary.gravity.torque import gravity_torque
from catenary.robots.geometry import distance_to_segment
from catenary.robots.link_inertia import MIN_GYRATION_M
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL
from catenary.units import TORQUE_UNIT

_MAX_DENSITY = 30_000.0  # [kg/m3]; osmium has 22,600, whole links of arms 500 to 9,000
_MAX_SEMI_AXIS_M = 3.0  # [m] semi-axis of a link's ellipsoid
_MIN_AXIS_RATIO = 0.1  # of an ellipsoid's longest semi-axis: rods and plates without thickness are meant as such
_MAX_COM_OFFSET_M = 0.4  # [m] from the line between a link's joints and frames to its centre of mass
_HEAVIER_RATIO = 1.5  # times the moving mass of a robot's file
_LIGHTER_RATIO = 0.5
_POSE_COUNT = 300  # at random within the limits


def mass_doubts(model: RobotModel, *, described: RobotModel | None = None) -> tuple[str, ...]:
    """Return the implausible masses of a robot, as sentences.

    A link's mass and inertia are those of one homogeneous ellipsoid, with semi-axes a_k^2 = 5/2 (tr I - 2 I_k) / m:
    it is doubted above 30 t/m3 and beyond 3 m. Its centre of mass is doubted farther than 0.4 m, and than the link is
    long, from the lines between the joints and frames on it. Gravity is doubted where it asks more of a joint than its
    effort limit on a level base, at one of 300 random poses.

    Args:
        model: The robot; none is doubted of links without masses.
        described: The robot of the file that masses were identified for, whose sum of masses they are compared with.
    """
    if model.missing_inertia:
        return ()
    bare = model  # point masses that it carries are meant as such
    while bare.without_payload is not None:
        bare = bare.without_payload
    bodies = [doubt for link in range(len(bare.link_names)) for doubt in _of_link(bare, link)]
    own = 0.0 if described is None or described.missing_inertia else float(described.tree.mass.sum())
    total = float(model.tree.mass.sum())
    if own > 0.0 and not _LIGHTER_RATIO < total / own < _HEAVIER_RATIO:
        bodies.append(f"moving mass {total:.4g} kg, {total / own:.2g} times the {own:.4g} kg of the robot's file")
    return (*bodies, *_of_efforts(model))


def _of_link(model: RobotModel, link: int) -> list[str]:
    mass, com, name = float(model.tree.mass[link]), model.tree.com[link], model.link_names[link]
    if mass <= 0.0:
        return []
    doubts = []
    length, off = _extent_of(model, link, com)
    if off > max(_MAX_COM_OFFSET_M, length):
        doubts.append(f"its centre of mass lies {off:.2g} m off the line of its joints and frames, {length:.2g} m long")
    if name not in model.missing_tensor:
        moments = np.linalg.eigvalsh(model.tree.inertia[link])
        axes = np.sqrt(np.maximum(2.5 * (moments.sum() - 2.0 * moments) / mass, 0.0))
        volume = 4.0 / 3.0 * np.pi * float(np.prod(np.maximum(axes, _MIN_AXIS_RATIO * axes.max())))
        if mass > _MAX_DENSITY * volume:
            density = f"{mass / volume / 1000.0:.3g} t/m3" if axes.max() > MIN_GYRATION_M else "a point"
            doubts.append(f"{mass:.4g} kg with the inertia of {density}; the densest metal has 22.6 t/m3")
        if axes.max() > _MAX_SEMI_AXIS_M:
            doubts.append(f"{mass:.4g} kg with the inertia of a body of {axes.max():.3g} m to either side")
    return [f'link "{name}": {doubt}' for doubt in doubts]


def _extent_of(model: RobotModel, link: int, point: Floats) -> tuple[float, float]:
    """Return a link's extent between its joints and frames, and a point's distance from the lines between them [m]."""
    ends = [np.zeros(3), *model.tree.origin[model.tree.parent == link]]
    ends += [frame.pose.position for frame in model.frames.values() if frame.link == link]
    between = [(start, end) for k, start in enumerate(ends) for end in ends[: k + 1]]
    length = max(float(np.linalg.norm(end - start)) for start, end in between)
    return length, min(distance_to_segment(point, start, end) for start, end in between)


def _of_efforts(model: RobotModel) -> list[str]:
    """Return doubts about joints whose gravity torque exceeds their effort limit; limits of zero are placeholders."""
    turn = np.where(np.array(model.joint_units) == "rad", np.pi, 0.0)
    lower = np.where(np.isfinite(model.lower), model.lower, -turn)
    upper = np.maximum(np.where(np.isfinite(model.upper), model.upper, turn), lower)
    q = np.random.default_rng(0).uniform(lower, upper, (_POSE_COUNT, model.n))
    required = np.abs(gravity_torque(model, q, LEVEL)).max(axis=0)
    beyond = np.flatnonzero((model.effort_limit > 0.0) & (required > model.effort_limit))
    texts = [
        f"{model.joint_names[i]} up to {required[i]:.4g} {TORQUE_UNIT[model.joint_units[i]]} "
        f"(its effort limit is {model.effort_limit[i]:.4g})"
        for i in beyond
    ]
    return [f"gravity asks more than motors give: {', '.join(texts)}"] if texts else []
