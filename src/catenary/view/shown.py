"""The contents of a page as data: an arm, its shapes and controls, and the space that it takes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.kinematics import link_poses
from catenary.plant import Bounded, JointRanges
from catenary.robots.model import RobotModel

if TYPE_CHECKING:  # what draws shapes comes with the extra `view`, which is looked for first
    from catenary.view.shapes import ArmShapes

Value = float | bool | str
_ENDLESS_RANGE = {"rad": np.pi, "m": 0.5}  # to either side of zero, of a joint without limits


class Change(NamedTuple):
    """A change on the page: the name of a control, and its new value."""

    name: str
    value: Value


class Control(NamedTuple):
    """Something to press, pull or choose.

    Of buttons in a row the one that is pressed is the change's value.
    """

    kind: Literal["slider", "choice", "switch", "buttons"]
    name: str
    label: str  # with its unit
    value: Value | None = None  # none of buttons
    options: tuple[Any, ...] = ()  # what may be chosen; a slider's low and high end, and its step
    hint: str = ""


@dataclass(frozen=True)
class ControlTab:
    """Controls that are shown together."""

    label: str
    controls: tuple[Control, ...]
    text: str = ""  # above them


def accepted(control: Control, value: object) -> Value | None:
    """Return a value from a browser as the control may have it, within a slider's ends; None where it may not."""
    if control.kind == "slider":
        low, high, _ = control.options
        finite = isinstance(value, int | float) and math.isfinite(value)
        return min(max(float(value), low), high) if finite else None  # type: ignore[arg-type]
    if control.kind == "switch":
        return value if isinstance(value, bool) else None
    return str(value) if value in control.options else None


@dataclass(frozen=True)
class Shown:
    """An arm on a page."""

    title: str
    model: RobotModel
    shapes: "ArmShapes"
    tabs: tuple[ControlTab, ...] = ()
    start: Floats | None = None  # (n,) [rad|m] where the camera finds it; the middle of its ranges when None
    legend: Mapping[str, str] = field(default_factory=dict)  # by arm: what it is
    recording: Mapping[str, Floats] | None = None  # of which curves are drawn; those of the states when None
    nominal_hz: float = math.nan  # at which a robot's ticks should come


def extent_of(shown: Shown) -> tuple[Floats, float]:
    """Return the ball about an arm's shapes and its base's origin: centre (3,) in the base frame and radius [m]."""
    model = shown.model
    ranges = finite_ranges(model)
    q = 0.5 * (ranges.lower + ranges.upper) if shown.start is None else shown.start
    rotations, positions = link_poses(model, q)
    points = [np.zeros((1, 3))]
    for mesh, rotation, position in zip(shown.shapes.links, rotations, positions, strict=True):
        points.append(mesh.vertices @ rotation.T + position)
    if shown.shapes.base is not None:
        points.append(shown.shapes.base.vertices)
    every = np.vstack(points)
    centre = 0.5 * (every.min(axis=0) + every.max(axis=0))
    return centre, float(np.linalg.norm(every - centre, axis=1).max())


def finite_ranges(limits: Bounded) -> JointRanges:
    """Return ranges of joints, all of them finite."""
    widest = np.array([_ENDLESS_RANGE[unit] for unit in limits.joint_units])
    lower = np.where(np.isfinite(limits.lower), limits.lower, -widest)
    upper = np.where(np.isfinite(limits.upper), limits.upper, widest)
    return JointRanges(limits.joint_names, limits.joint_units, lower, upper)
