"""The arm in space with its tip's path, by measured, reported and corrected joints."""

from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.kinematics import frame_poses, link_poses
from catenary.reports.joint_picture import MODEL, RAW, wrapped
from catenary.reports.page import Picture, picture
from catenary.reports.tip import TipErrors

MEASURED, LINK = "#1c2430", "#4b6b94"
MOST_POINTS = 3_000  # of a path
STRETCH = 120  # rows of the path that are drawn close up
LEAST_ROWS = 6  # of them
FARTHEST = 12.0  # times the raw error: how far the tip goes in them
LEAST_EXTENT = 1.0  # [mm] of a picture


def arm_picture(tip: TipErrors, name: str, row_breaks: Floats) -> Picture:
    """Draw the arm with its tip's path, and a stretch of the path close up with where the tip was said to be.

    Args:
        tip: Where the tip was.
        name: The model's name.
        row_breaks: (B,) rows before which rows are missing: no line goes across.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 5.0), layout="constrained")
    arm = figure.add_subplot(1, 2, 1, projection="3d")
    close = figure.add_subplot(1, 2, 2, projection="3d")
    kept = np.arange(0, len(tip.true), max(1, len(tip.true) // MOST_POINTS))
    path = 1e3 * np.insert(tip.true[kept], np.searchsorted(kept, row_breaks), np.nan, axis=0)
    arm.plot(*path.T, color=MEASURED, linewidth=0.5, alpha=0.6)
    middle = int(np.argmin(np.linalg.norm(tip.true - tip.true.mean(axis=0), axis=1)))
    points = _draw_arm(arm, tip, middle)
    _equal(arm, np.vstack([points, path[np.isfinite(path).all(axis=1)]]))
    arm.set_title("arm and path of its tip", fontsize=9)

    rows = _stretch(tip, row_breaks)
    drawn = []
    for points, color, label, style in (
        (tip.reported, RAW, "raw", "-"),
        (tip.corrected, MODEL, name, "-"),
        (tip.true, MEASURED, "measured", "--"),
    ):
        near = 1e3 * points[rows]
        close.plot(*near.T, color=color, linewidth=1.4, linestyle=style, label=wrapped(label))
        drawn.append(near)
    _equal(close, np.vstack(drawn))
    close.set_title(f"close up: {rows.stop - rows.start} rows of the path", fontsize=9)
    figure.legend(
        *close.get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False, fontsize=9
    )
    caption = (
        f"Left: robot {tip.robot.name} in its base frame (square: base, dot: tip), and the path of its tip by measured "
        f"joints. Right: a stretch of the path, and where the tip is by raw joints and after {name}. RMSE of the tip: "
        f"{1e3 * tip.raw.rmse:.3f} mm raw, {1e3 * tip.model.rmse:.3f} mm after {name}."
    )
    return picture(
        figure, caption, "The arm drawn in space with the path of its tip, and a part of the path close up."
    )


def _draw_arm(axes: Any, tip: TipErrors, row: int) -> Floats:
    """Draw the links of the arm at one row as lines between their frames; return its points in mm, (P, 3)."""
    robot = tip.robot
    origins = link_poses(robot, tip.q[row])[1]
    ends = [frame_poses(robot, tip.q[row])[1]]
    frame = robot.frame()
    for link, parent in enumerate(robot.tree.parent):
        start = np.zeros(3) if parent < 0 else origins[parent]
        axes.plot(
            *(1e3 * np.vstack([start, origins[link]])).T, color=LINK, linewidth=2.5, marker="o", markersize=3
        )
    start = origins[frame.link] if frame.link >= 0 else np.zeros(3)
    axes.plot(*(1e3 * np.vstack([start, ends[0]])).T, color=LINK, linewidth=2.5)
    points: Floats = 1e3 * np.vstack([np.zeros((1, 3)), origins, ends])
    axes.plot(*points[0][:, None], "s", color=LINK, markersize=6)
    axes.plot(*points[-1][:, None], "o", color=MODEL, markersize=6)
    return points


def _stretch(tip: TipErrors, row_breaks: Floats) -> slice:
    """Return rows without a gap, so short that the raw error can be seen beside the way that the tip goes."""
    starts = np.concatenate([[0], row_breaks, [len(tip.true)]]).astype(int)
    longest = int(np.argmax(np.minimum(np.diff(starts), STRETCH)))
    first, end = starts[longest], min(starts[longest] + STRETCH, starts[longest + 1])
    away = np.linalg.norm(tip.true[first:end] - tip.true[first], axis=1)
    far = np.flatnonzero(away > FARTHEST * tip.raw.rmse)
    least = min(first + LEAST_ROWS, end)
    return slice(int(first), int(max(least, first + far[0])) if len(far) else int(end))


def _equal(axes: Any, points: Floats) -> None:
    """Show a millimetre as long along every axis, and name the axes."""
    middle = (points.max(axis=0) + points.min(axis=0)) / 2.0
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
    axes.set_box_aspect((1.0, 1.0, 1.0), zoom=0.88)
    axes.tick_params(labelsize=7)
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(_few())


def _few() -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(4)
