"""An arm in three dimensions: its links as lines, joints as dots, and axes of one scale."""

from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.kinematics import forward_kinematics, link_poses
from catenary.robots.model import RobotModel

LINK, TIP = "#4b6b94", "#d9622b"
LEAST_EXTENT = 1.0  # [mm] of a picture
APART = 1e-6  # [m] between points that are drawn as two


def end_frames(model: RobotModel) -> list[str]:
    """Return the frames at a robot's ends: its tip, and the farthest one on every other link that carries none."""
    farthest: dict[int, tuple[float, str]] = {}
    for name, (link, pose) in model.frames.items():
        distance = float(np.linalg.norm(pose.position))
        if link >= 0 and link not in model.tree.parent and distance > farthest.get(link, (APART, ""))[0]:
            farthest[link] = (distance, name)
    farthest.pop(model.frame().link, None)
    return [model.tip, *(name for _, name in farthest.values())]


def link_segments(model: RobotModel, q: Floats) -> Floats:
    """Return the lines that an arm is drawn by, from joint to joint and on to its ends, (S, 2, 3) [m].

    The first lines lead to the links' own frames, in the order of `model.link_names`, the others to `end_frames`.

    Args:
        model: The robot.
        q: (n,) where its joints are [rad|m].
    """
    origins = link_poses(model, q)[1]
    starts = [np.zeros(3) if parent < 0 else origins[parent] for parent in model.tree.parent]
    lines = list(zip(starts, origins, strict=True))
    for name in end_frames(model):
        link = model.frame(name).link
        lines.append((np.zeros(3) if link < 0 else origins[link], forward_kinematics(model, q, name)[1]))
    return np.array(lines)


def draw_links(
    axes: Any, model: RobotModel, q: Floats, *, color: str = LINK, width: float = 2.5, alpha: float = 1.0
) -> Floats:
    """Draw an arm as lines, with a square at its base and a dot at each end; return its points, (P, 3) [mm].

    Args:
        axes: Matplotlib's, of three dimensions, in mm.
        model: The robot.
        q: (n,) where its joints are [rad|m].
        color: Of the links.
        width: Of the lines [points].
        alpha: How opaque they are.
    """
    segments = 1e3 * link_segments(model, q)
    links = len(model.link_names)
    for k, line in enumerate(segments):
        dot = {"marker": "o", "markersize": 1.2 * width} if k < links else {}
        axes.plot(*line.T, color=color, linewidth=width, alpha=alpha, solid_capstyle="round", **dot)
    axes.plot(*np.zeros((3, 1)), "s", color=color, markersize=2.4 * width, alpha=alpha)
    axes.plot(*segments[links:, 1].T, "o", color=TIP, markersize=2.4 * width, alpha=alpha)
    points: Floats = np.vstack([np.zeros((1, 3)), segments.reshape(-1, 3)])
    return points


def equal_axes(axes: Any, points: Floats, *, zoom: float = 0.88) -> tuple[Floats, float]:
    """Show a millimetre as long along every axis, and name the axes; return the middle (3,) and half the width [mm]."""
    from matplotlib.ticker import MaxNLocator

    middle: Floats = (points.max(axis=0) + points.min(axis=0)) / 2.0
    half = max(LEAST_EXTENT, float(np.ptp(points, axis=0).max())) * 0.52
    for limits, label, name, at in zip(
        (axes.set_xlim, axes.set_ylim, axes.set_zlim),
        (axes.set_xlabel, axes.set_ylabel, axes.set_zlabel),
        "xyz",
        middle,
        strict=True,
    ):
        limits(at - half, at + half)
        label(f"{name} [mm]", fontsize=8)
    axes.set_box_aspect((1.0, 1.0, 1.0), zoom=zoom)
    axes.tick_params(labelsize=7)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(MaxNLocator(4))
    return middle, half
