"""The picture of a robot at one instant: poses of arms, tips and arrows."""

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from catenary.arrays import Floats
from catenary.dynamics.kinematics import link_poses
from catenary.monitor import Snapshot
from catenary.robots.model import RobotModel
from catenary.spatial import LEVEL

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
