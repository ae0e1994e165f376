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

SHOWN, SHOWN_ROWS = 10.0, 40  # [s] of motion, and rows of it, at least
DELAYS = 20.0  # that the shown motion is long, at least
CAPTION = "Measured positions less their median error there. Where the lines turn at unlike times, a delay is left."


def overlay(log: MotionLog, before: float = 0.0, after: float = 0.0) -> "Figure":
    """Draw the fastest joint where it moves most, as it was recorded and re-timed.

    Args:
        log: With measured positions.
        before: How much later its measurements were stamped when it was recorded [s|rows].
        after: The same of the re-timed ones; as `before` where nothing was re-timed.
    """
    from matplotlib.figure import Figure

    assert log.q_encoder is not None
    t, j = times_of(log), _fastest(log)
    rows = busy_rows(log, t, j, max(abs(before), abs(after)))
    in_unit = "s" if log.time is not None else "rows"
    shifts = [("as recorded", before)] + [(f"re-timed by {before - after:+.3g} {in_unit}", after)] * (before != after)
    figure = Figure(figsize=(9.0, 2.6 * len(shifts) + 0.4), layout="constrained")
    panels = figure.subplots(len(shifts), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (said, shift) in zip(panels, shifts, strict=True):
        draw_overlay(axes, log, t, j, rows, shift)
        axes.set_title(said, loc="left", fontsize=10)
        axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel(f"time [{in_unit}]")
    figure.axes[0].legend(frameon=False, ncols=2, loc="upper right")
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


def _fastest(log: MotionLog) -> int:
    """Return the joint that crosses its range soonest."""
    reach = np.ptp(log.q_nominal, axis=0)
    speed = np.abs(np.diff(log.q_nominal, axis=0)).mean(axis=0) / np.where(reach > 0.0, reach, np.inf)
    return int(np.argmax(speed))


def busy_rows(log: MotionLog, t: Floats, j: int, delay: float = 0.0) -> slice:
    """Return the rows where a joint moves most, so many that a delay [s|rows] shows."""
    step = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
    count = min(len(t), int(max(SHOWN_ROWS, max(SHOWN, DELAYS * delay) / max(step, 1e-9))))
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(log.q_nominal[:, j])) * log.ok[1:])])
    first = int(np.argmax(way[count - 1 :] - way[: len(way) - count + 1]))
    return slice(first, first + count)
