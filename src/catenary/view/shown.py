"""What a page is to show: an arm, its shapes, its controls; and how much room it takes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.kinematics import link_poses
from catenary.robots.model import RobotModel
from catenary.view.controls import ControlTab
from catenary.view.shapes import ArmShapes

WIDEST = {"rad": np.pi, "m": 0.5}  # to either side of zero, of a joint without limits


@dataclass(frozen=True)
class Shown:
    """An arm on a page."""

    title: str
    model: RobotModel
    shapes: ArmShapes
    tabs: tuple[ControlTab, ...] = ()
    start: Floats | None = None  # (n,) [rad|m] where the camera finds it; the middle of its ranges when None
    legend: Mapping[str, str] = field(default_factory=dict)  # by arm: what it is


class Extent(NamedTuple):
    """A ball that holds an arm where it stands at first."""

    centre: Floats  # (3,) [m] in the base frame
    radius: float  # [m]


def extent_of(shown: Shown) -> Extent:
    """Return the ball about an arm's shapes and its base's origin."""
    model = shown.model
    q = middle_of_ranges(model) if shown.start is None else shown.start
    rotations, positions = link_poses(model, q)
    points = [np.zeros((1, 3))]
    for mesh, rotation, position in zip(shown.shapes.links, rotations, positions, strict=True):
        points.append(mesh.vertices @ rotation.T + position)
    if shown.shapes.base is not None:
        points.append(shown.shapes.base.vertices)
    every = np.vstack(points)
    centre = 0.5 * (every.min(axis=0) + every.max(axis=0))
    return Extent(centre, float(np.linalg.norm(every - centre, axis=1).max()))


def middle_of_ranges(model: RobotModel) -> Floats:
    """Return the middle of the joints' ranges (n,) [rad|m]; of one without limits zero."""
    widest = np.array([WIDEST[unit] for unit in model.joint_units])
    lower = np.where(np.isfinite(model.lower), model.lower, -widest)
    upper = np.where(np.isfinite(model.upper), model.upper, widest)
    middle: Floats = 0.5 * (lower + upper)
    return middle
