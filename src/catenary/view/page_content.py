"""Content of a view's page as data: arm, meshes, controls, scene at an instant, tip paths, curves."""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from catenary.arrays import Floats
from catenary.dynamics.inverse_kinematics import search_range
from catenary.dynamics.kinematics import link_poses
from catenary.monitor import Snapshot
from catenary.plant import Bounded, Jointed, JointRanges
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL
from catenary.units import DISPLAY, TORQUE_UNIT

if TYPE_CHECKING:
    from catenary.view.meshes import ArmShapes


Value = float | bool | str


class Change(NamedTuple):
    """Change of a control: its name and new value."""

    name: str
    value: Value


class Control(NamedTuple):
    """Control on a page; the value of a row of buttons is the pressed one."""

    kind: Literal["slider", "choice", "switch", "buttons"]
    name: str
    label: str  # with its unit
    value: Value | None = None  # None for buttons
    options: tuple[Any, ...] = ()  # choices; of a slider: lower end, upper end, step
    hint: str = ""


@dataclass(frozen=True)
class ControlTab:
    """Tab of controls."""

    label: str
    controls: tuple[Control, ...]
    text: str = ""  # above them


def accepted(control: Control, value: object) -> Value | None:
    """Return a browser's value if valid for a control, clipped to a slider's range; None otherwise."""
    if control.kind == "slider":
        low, high, _ = control.options
        finite = isinstance(value, int | float) and math.isfinite(value)
        return min(max(float(value), low), high) if finite else None  # type: ignore[arg-type]
    if control.kind == "switch":
        return value if isinstance(value, bool) else None
    return str(value) if value in control.options else None


@dataclass(frozen=True)
class PageContent:
    """Content of a page: an arm with its controls."""

    title: str
    model: RobotModel
    shapes: "ArmShapes"
    tabs: tuple[ControlTab, ...] = ()
    start: Floats | None = None  # (n,) [rad|m] pose for the camera; the middle of its ranges when None
    legend: Mapping[str, str] = field(default_factory=dict)  # label, by name of ARMS
    recording: Mapping[str, Floats] | None = None  # source of the curves; the shown states when None
    nominal_hz: float = math.nan  # of a robot's ticks


def extent_of(shown: PageContent) -> tuple[Floats, float]:
    """Return the bounding sphere of an arm and its base's origin: centre (3,) in the base frame and radius [m]."""
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
    """Return finite joint ranges, as `search_range` has them of joints without limits."""
    return JointRanges(limits.joint_names, limits.joint_units, *search_range(limits))


ARMS = ("reported", "calibrated", "true")
_PATH_POINTS = 400  # of a tip's path
_PATH_STEP = 0.002  # minimum tip travel between path points, times the arm's length


class PlacedArm(NamedTuple):
    """An arm in the base frame."""

    wxyz: Floats  # (n_tree, 4) orientation of its links, quaternions
    positions: Floats  # (n_tree, 3) [m] of their frames
    tip: Floats  # (3,) [m]


class Scene(NamedTuple):
    """Arms and gravity at an instant."""

    base_wxyz: Floats  # (4,) orientation of the base in the world, whose z axis is up
    arms: dict[str, PlacedArm]  # known ones, by name of ARMS
    measured: Floats | None  # (3,) gravity in the base frame, of length 1 at 9.81 m/s2
    assumed: Floats | None  # (3,) likewise, as assumed by the controller


def numbers(values: Floats | None, n: int) -> Floats:
    """Return the first n values (n,); NaN for unknown ones."""
    padded = np.full(n, np.nan)
    if values is not None:
        padded[: len(values)] = values[:n]
    return padded


def joints_by_arm(shot: Snapshot, n: int) -> dict[str, Floats]:
    """Return the first n joint positions [rad|m] of the reported, calibrated and true arm, by name of `ARMS`."""
    return {name: numbers(q, n) for name, q in zip(ARMS, (shot.q, shot.calibrated, shot.true), strict=True)}


def scene_of_robot(model: RobotModel, shot: Snapshot) -> Scene:
    """Return the scene of a robot whose first joints are the model's."""
    known = {name: q for name, q in joints_by_arm(shot, model.n).items() if np.isfinite(q).all()}
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
    """Return the orientation (w, x, y, z) in the world of a base with gravity (3,) [m/s2], by the smallest rotation."""
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
        """Set the minimum travel between points by the arm's length [m]."""
        self._step = _PATH_STEP * length
        self._points: dict[str, deque[Floats]] = {name: deque(maxlen=_PATH_POINTS) for name in ARMS}

    def add(self, scene: Scene) -> None:
        """Add the tips of a scene."""
        for name, arm in scene.arms.items():
            points = self._points[name]
            if not points or np.linalg.norm(arm.tip - points[-1]) >= self._step:
                points.append(arm.tip)

    def clear(self) -> None:
        """Remove all points."""
        for points in self._points.values():
            points.clear()

    def segments(self, name: str) -> Floats:
        """Return the path of an arm's tip as line segments (K, 2, 3) [m]."""
        points = np.array(self._points[name])
        if len(points) < 2:
            return np.zeros((0, 2, 3))
        return np.stack([points[:-1], points[1:]], axis=1)


_SPAN_S = 30.0  # [s]
SPACING_S = 0.1  # [s] between two points of a curve


class Curve(NamedTuple):
    """A line of a plot."""

    label: str  # empty if it shares another curve's label
    values: Floats  # (K,) NaN: unknown
    colour: str
    dashed: bool = False


class Plot(NamedTuple):
    """Curves over one time axis."""

    title: str
    time: Floats  # (K,) [s] relative to now
    curves: tuple[Curve, ...]

    def known(self) -> tuple[Curve, ...]:
        """Return the curves with known values; unknown values repeat the last known one, since gaps cannot be drawn."""
        return tuple(
            curve._replace(values=_level(curve.values)) for curve in self.curves if np.isfinite(curve.values).any()
        )


def _level(values: Floats) -> Floats:
    """Replace values (K,) that are not finite by the last finite one before, or the first one after."""
    finite = np.isfinite(values)
    places = np.maximum.accumulate(np.where(finite, np.arange(len(values)), -1))
    return values[np.where(places < 0, int(np.argmax(finite)), places)]


_REPORTED, _CALIBRATED, _TRUE, _GRAVITY, _PD, _REST = ("#4b6b94", "#1f9d55", "#e07b00", "#7a4fbf", "#c0392b", "#8a8f98")


# of a snapshot
_OF_JOINTS = ("q", "true", "calibrated", "interval", "setpoint", "tau", "gravity_tau", "feedback")


class Curves:
    """Curves over the last half minute of states, or over the part of a recording around the present time.

    A recording has an array (K, n) [SI] for each known field of _OF_JOINTS, and its `time` (K,) [s].
    """

    def __init__(
        self, joints: Jointed, recording: Mapping[str, Floats] | None = None, nominal_hz: float = np.nan
    ) -> None:
        """Set the joints, the recording if any, and the nominal tick rate [Hz]."""
        self._names, self._units, self._recording = joints.joint_names, joints.joint_units, recording
        self._nominal_hz = nominal_hz
        # [s] drawn interval relative to now
        self.span = (-_SPAN_S, 0.0) if recording is None else (-0.5 * _SPAN_S, 0.5 * _SPAN_S)
        self._states: deque[Snapshot] = deque(maxlen=round(_SPAN_S / SPACING_S))
        self._now = 0.0

    def add(self, state: Snapshot) -> None:
        """Add a state; those too close to the last are skipped, and a step back in time restarts the curves."""
        self._now = state.time
        if self._states and state.time < self._states[-1].time:
            self._states.clear()
        if not self._states or state.time - self._states[-1].time >= SPACING_S - 1e-9:
            self._states.append(state)

    def plots(self, joint: int) -> tuple[Plot, ...]:
        """Return the plots of a joint: errors [deg|mm], torque [Nm|N] and, without a recording, the loop."""
        name, unit = self._names[joint], self._units[joint]
        if self._recording is not None:
            in_window = np.abs(self._recording["time"] - self._now) <= 0.5 * _SPAN_S
            part = {key: column[in_window] for key, column in self._recording.items()}
            return joint_plots(part, part["time"] - self._now, joint, name, unit)
        n, states = len(self._names), self._states
        columns = {key: np.array([numbers(getattr(state, key), n) for state in states]) for key in _OF_JOINTS}
        time, rate, late, age = np.array(
            [(s.time - states[-1].time, s.rate_hz or np.nan, s.late, s.gravity_age) for s in states], dtype=float
        ).T.reshape(4, -1)
        loop = (
            Curve("rate %", 100.0 * rate / self._nominal_hz, _REPORTED),
            Curve("late ticks/s", late, _PD),
            Curve("gravity age ms", 1e3 * age, _GRAVITY),
        )
        return (*joint_plots(columns, time, joint, name, unit), Plot("loop", time, loop))


def joint_plots(columns: Mapping[str, Floats], time: Floats, joint: int, name: str, unit: str) -> tuple[Plot, Plot]:
    """Return the plots of a joint: errors [deg|mm] and torque components [Nm|N]."""
    shown, scale = DISPLAY[unit]
    titles = f"{name}: error [{shown}]", f"{name}: torque [{TORQUE_UNIT[unit]}]"
    if len(time) == 0:
        return Plot(titles[0], time, ()), Plot(titles[1], time, ())

    def of(key: str) -> Floats:
        return columns[key][:, joint] if key in columns else np.full(len(time), np.nan)

    q, true, tau, gravity, interval = map(of, ("q", "true", "tau", "gravity_tau", "interval"))
    errors = (
        Curve("reported", scale * (q - true), _REPORTED),
        Curve("calibrated", scale * (of("calibrated") - true), _CALIBRATED),
        Curve("interval \u00b1", scale * interval, _CALIBRATED, True),
        Curve("", -scale * interval, _CALIBRATED, True),
        Curve("tracking", scale * (q - of("setpoint")), _REST),
    )
    torques = (
        Curve("total", tau, _REPORTED),
        Curve("gravity", gravity, _GRAVITY),
        Curve("PD", of("feedback"), _PD),
        Curve("friction, inertia", tau - gravity, _REST, True),
    )
    return Plot(titles[0], time, errors), Plot(titles[1], time, torques)
