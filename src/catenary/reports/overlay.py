"""Commands and measurements of the fastest joint laid over each other, before and after the re-timing."""

from typing import TYPE_CHECKING

import numpy as np

from catenary.arrays import Floats
from catenary.plant import MotionLog
from catenary.reports.joint_errors import MODEL, OFFSET
from catenary.reports.page import Picture, picture
from catenary.units import DISPLAY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN, SHOWN_ROWS = 10.0, 40  # [s] of motion without a delay; and rows of it, at least
SHOWN_REACH = {"rad": 0.02, "m": 1e-3}  # of a joint that moves, not one whose sensor is noisy
DELAYS = 20.0  # that the shown motion is long
CAPTION = "Measured positions less their median error there. Where the lines turn at unlike times, a delay is left."


def overlay(log: MotionLog, before: float = 0.0, after: float = 0.0) -> "Figure":
    """Draw the fastest joint's measurements as recorded, `before` [s|rows] late, and re-timed, `after` late."""
    from matplotlib.figure import Figure

    assert log.q_encoder is not None
    t = times_of(log)
    j, rows = busy_rows(log, t, max(abs(before), abs(after)))
    in_unit = "s" if log.time is not None else "rows"
    shifts = [("as recorded", before)] + [(f"re-timed by {before - after:+.3g} {in_unit}", after)] * (before != after)
    figure = Figure(figsize=(9.0, 2.6 * len(shifts) + 0.4), layout="constrained")
    panels = figure.subplots(len(shifts), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (said, shift) in zip(panels, shifts, strict=True):
        draw_overlay(axes, log, t, j, rows, shift)
        axes.set_title(said, loc="left", fontsize=10)
        axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel(f"time [{in_unit}]")
    figure.axes[0].legend(frameon=False, ncols=2, loc="best")
    return figure


def overlay_picture(log: MotionLog, before: float = 0.0) -> Picture:
    """Return it for a page, of a log whose measurements were re-timed by `before` [s|rows]."""
    return picture(overlay(log, before), f"{log.name}. {CAPTION}")


def draw_overlay(axes: "Axes", log: MotionLog, t: Floats, j: int, rows: slice, shift: float = 0.0) -> None:
    """Draw a joint's commands and its measurements, `shift` later [s|rows], less their median error."""
    assert log.q_encoder is not None
    unit, scale = DISPLAY[log.joint_units[j]]
    command, seen = scale * log.q_nominal[rows, j], scale * np.where(log.ok, log.q_encoder[:, j], np.nan)[rows]
    level = np.nanmedian(seen - command) if np.isfinite(seen).any() else 0.0
    axes.plot(t[rows], command, color=OFFSET, label="commanded")
    axes.plot(t[rows] + shift, seen - level, ".-", color=MODEL, linewidth=1.0, markersize=3.0, label="measured")
    axes.set_ylabel(f"{log.joint_names[j]} [{unit}]")


def times_of(log: MotionLog) -> Floats:
    """Return the time of each row [s], or its number where there are no stamps."""
    return np.arange(float(len(log))) if log.time is None else log.time


def busy_rows(log: MotionLog, t: Floats, delay: float = 0.0, joint: int | None = None) -> tuple[int, slice]:
    """Return the fastest joint, or this one, and the rows where it goes to and fro most: a delay [s|rows] shows."""
    step = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
    count = min(len(t), int(max(SHOWN_ROWS, (DELAYS * delay or SHOWN) / max(step, 1e-9))))
    reach = np.ptp(log.q_nominal, axis=0)
    moved = reach > [SHOWN_REACH[unit] for unit in log.joint_units]
    if joint is not None:
        moved &= np.arange(len(moved)) == joint
    steps = np.diff(log.q_nominal, axis=0) * log.ok[1:, None] / np.where(moved, reach, np.inf)
    ways = [np.cumsum(np.maximum(way, 0.0), axis=0) for way in (steps, -steps)]
    to, fro = (np.vstack([np.zeros_like(reach), way]) for way in ways)
    both = np.minimum(*(way[count - 1 :] - way[: len(way) - count + 1] for way in (to, fro)))
    first, j = np.unravel_index(np.argmax(both), both.shape)
    return int(j) if joint is None else joint, slice(int(first), int(first) + count)
