"""The state that the view shows, one instant as numbers and words, and its picture: poses of arms, tips and arrows."""

from collections import deque
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from catenary.arrays import Floats
from catenary.dynamics.kinematics import link_poses
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL

_SHOWN_WARNINGS = 6
_WORD_CHARACTERS = 140  # characters of a warning


class ViewState(NamedTuple):
    """An arm at one instant; NaN for what is not known. Joints are the model's."""

    time: float  # [s] of the robot
    q: Floats  # (n,) [rad|m] reported
    calibrated: Floats  # (n,) [rad|m]
    interval: Floats  # (n,) half-width about `calibrated` [rad|m]
    inside: Floats  # (n,) 1 inside the model's valid range, 0 outside
    true: Floats  # (n,) [rad|m]
    setpoint: Floats  # (n,) [rad|m]
    tau: Floats  # (n,) [Nm|N] as commanded
    gravity_tau: Floats  # (n,) [Nm|N] what holds the arm still
    feedback: Floats  # (n,) [Nm|N] what the errors asked for: the PD term
    gravity: Floats  # (3,) [m/s2] as measured, in the base frame
    assumed: Floats  # (3,) [m/s2] as the controller takes it to be
    actual: Floats  # (3,) [m/s2] as it is, which a simulation knows
    gravity_age: float = np.inf  # [s]; infinite for gravity that is not measured
    rate: float = np.nan  # at which ticks come, as a share of what it should be
    late: float = 0.0  # ticks late within the last second
    mode: str = ""  # what the robot does, in words
    warnings: tuple[str, ...] = ()
    values: Mapping[str, float | bool | str] = {}  # of the page's controls, where the program has set them


def unknown_state(n: int) -> ViewState:
    """Return the state of an arm of n joints of which nothing is known yet."""
    return ViewState(0.0, *np.full((9, n), np.nan), *np.full((3, 3), np.nan))


def shortened(state: ViewState) -> ViewState:
    """Return a state whose words take little room, whatever a robot's or a file's names are."""
    warnings = tuple(_word(warning) for warning in state.warnings[:_SHOWN_WARNINGS])
    return state._replace(mode=_word(state.mode), warnings=warnings)


def _word(text: str) -> str:
    """Return a text cut, and without what is none, as in a file's name."""
    return text[:_WORD_CHARACTERS].encode(errors="replace").decode()


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


def scene_of(model: RobotModel, state: ViewState) -> Scene:
    """Return the picture of a state."""
    rows = {"reported": state.q, "calibrated": state.calibrated, "true": state.true}
    known = {name: q for name, q in rows.items() if np.isfinite(q).all()}
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
    down = state.actual if np.isfinite(state.actual).all() else state.gravity
    return Scene(base_orientation(down), arms, _arrow(state.gravity), _arrow(state.assumed))


def base_orientation(gravity: ArrayLike) -> Floats:
    """Return how a base that feels gravity (3,) [m/s2] stands in the world (w, x, y, z), turned least."""
    vector = np.asarray(gravity, dtype=float)
    size = float(np.linalg.norm(vector))
    if not np.isfinite(size) or size < 1e-6:
        return np.array([1.0, 0.0, 0.0, 0.0])
    turn, _ = Rotation.align_vectors(LEVEL[None], vector[None] / size)
    return np.asarray(np.roll(turn.as_quat(canonical=True), 1))


def _arrow(gravity: Floats) -> Floats | None:
    return gravity / float(np.linalg.norm(LEVEL)) if np.isfinite(gravity).all() else None


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
