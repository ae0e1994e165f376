"""The contents of a page as data: an arm, its shapes and controls, its picture at an instant."""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from catenary.arrays import Floats
from catenary.dynamics.kinematics import link_poses
from catenary.monitor import Snapshot
from catenary.plant import Bounded, JointRanges
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL

if TYPE_CHECKING:
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


ARMS = ("reported", "calibrated", "true")
_PATH_POINTS = 400  # points of a tip's path
_PATH_STEP = 0.002  # times the arm's length: the least way from one of its points to the next


class PlacedArm(NamedTuple):
    """An arm in the base frame."""

    wxyz: Floats  # (n_tree, 4) orientation of its links, quaternions
    positions: Floats  # (n_tree, 3) [m] of their frames
    tip: Floats  # (3,) [m]


class Scene(NamedTuple):
    """A picture of an arm."""

    base_wxyz: Floats  # (4,) orientation of the base in the world, whose z axis is up
    arms: dict[str, PlacedArm]  # by name, of ARMS; those that are known
    measured: Floats | None  # (3,) gravity in the base frame, of length 1 at 9.81 m/s2
    assumed: Floats | None  # likewise, as the controller assumes


def numbers(values: Floats | None, n: int) -> Floats:
    """Return those of the first n joints or axes, (n,); NaN for what is not known."""
    found = np.full(n, np.nan)
    if values is not None:
        found[: len(values)] = values[:n]
    return found


def joints_of(shot: Snapshot, n: int) -> dict[str, Floats]:
    """Return where each of ARMS has its first n joints [rad|m]."""
    return {name: numbers(q, n) for name, q in zip(ARMS, (shot.q, shot.calibrated, shot.true), strict=True)}


def scene_of(model: RobotModel, shot: Snapshot) -> Scene:
    """Return the picture of a robot whose first joints are the model's."""
    known = {name: q for name, q in joints_of(shot, model.n).items() if np.isfinite(q).all()}
    arms = {}
    if known:
        frame = model.frame()
        rotations, positions = link_poses(model, np.array(list(known.values())))
        for name, turned, moved in zip(known, rotations, positions, strict=True):
            tip = frame.pose.position
            if frame.link >= 0:
                tip = turned[frame.link] @ tip + moved[frame.link]
            wxyz = np.roll(Rotation.from_matrix(turned).as_quat(), 1, axis=-1)
            arms[name] = PlacedArm(wxyz, moved, tip)
    felt = shot.gravity if shot.actual is None else shot.actual
    return Scene(base_orientation(LEVEL if felt is None else felt), arms, _arrow(shot.gravity), _arrow(shot.assumed))


def base_orientation(gravity: ArrayLike) -> Floats:
    """Return how a base that feels gravity (3,) [m/s2] stands in the world (w, x, y, z), turned least."""
    vector = np.asarray(gravity, dtype=float)
    size = float(np.linalg.norm(vector))
    if not np.isfinite(size) or size < 1e-6:
        return np.array([1.0, 0.0, 0.0, 0.0])
    turn, _ = Rotation.align_vectors(LEVEL[None], vector[None] / size)
    return np.asarray(np.roll(turn.as_quat(canonical=True), 1))


def _arrow(gravity: Floats | None) -> Floats | None:
    known = gravity is not None and np.isfinite(gravity).all()
    return gravity / float(np.linalg.norm(LEVEL)) if gravity is not None and known else None


class TipPaths:
    """Recent paths of the arms' tips, in the base frame."""

    def __init__(self, length: float) -> None:
        """Begin without any point; the tip must travel a share of `length`, that of the arm [m], between points."""
        self._step = _PATH_STEP * length
        self._points: dict[str, deque[Floats]] = {name: deque(maxlen=_PATH_POINTS) for name in ARMS}

    def add(self, scene: Scene) -> None:
        """Take the tips of a picture."""
        for name, arm in scene.arms.items():
            points = self._points[name]
            if not points or np.linalg.norm(arm.tip - points[-1]) >= self._step:
                points.append(arm.tip)

    def clear(self) -> None:
        """Forget all points."""
        for points in self._points.values():
            points.clear()

    def segments(self, name: str) -> Floats:
        """Return the path of an arm's tip as lines from point to point, (K, 2, 3) [m]."""
        points = np.array(self._points[name])
        if len(points) < 2:
            return np.zeros((0, 2, 3))
        return np.stack([points[:-1], points[1:]], axis=1)
