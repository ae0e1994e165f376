"""The arm in space with its tip's path, by measured, reported and corrected joints."""

import numpy as np

from catenary.arrays import Floats
from catenary.reports.arm_in_space import draw_links, equal_axes
from catenary.reports.joint_picture import MODEL, RAW, wrapped
from catenary.reports.page import Picture, picture
from catenary.reports.tip import TipErrors

MEASURED = "#1c2430"
MOST_POINTS = 3_000  # of a path
STRETCH = 120  # rows of the path that are drawn close up
LEAST_ROWS = 6  # of them
FARTHEST = 12.0  # times the raw error: how far the tip goes in them


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
    points = draw_links(arm, tip.robot, tip.q[middle])
    equal_axes(arm, np.vstack([points, path[np.isfinite(path).all(axis=1)]]))
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
    equal_axes(close, np.vstack(drawn))
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


def _stretch(tip: TipErrors, row_breaks: Floats) -> slice:
    """Return rows without a gap, so short that the raw error can be seen beside the way that the tip goes."""
    starts = np.concatenate([[0], row_breaks, [len(tip.true)]]).astype(int)
    longest = int(np.argmax(np.minimum(np.diff(starts), STRETCH)))
    first, end = starts[longest], min(starts[longest] + STRETCH, starts[longest + 1])
    away = np.linalg.norm(tip.true[first:end] - tip.true[first], axis=1)
    far = np.flatnonzero(away > FARTHEST * tip.raw.rmse)
    least = min(first + LEAST_ROWS, end)
    return slice(int(first), int(max(least, first + far[0])) if len(far) else int(end))
