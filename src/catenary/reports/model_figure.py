"""Figures of recordings: a model's errors on one joint for a paper, and commands laid over measurements.

The paper's has errors over time, close up and as a histogram, hysteresis, coverage, delay. The other is of the fastest
joint, before and after the re-timing.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.evaluate import Evaluation
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.reports import joint_errors
from catenary.reports.joint_errors import MODEL, OFFSET
from catenary.units import DISPLAY
from catenary.verdict.delay import delay_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_SHOWN_S, _MIN_SHOWN_ROWS = 10.0, 40  # of motion without a delay; and rows of it, at least
_MIN_REACH = {"rad": 0.02, "m": 1e-3}  # of a joint that moves, not one whose sensor is noisy
_SHOWN_DELAYS = 20.0  # that the shown motion is long
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
    count = min(len(t), int(max(_MIN_SHOWN_ROWS, (_SHOWN_DELAYS * delay or _SHOWN_S) / max(step, 1e-9))))
    reach = np.ptp(log.q_nominal, axis=0)
    moved = reach > [_MIN_REACH[unit] for unit in log.joint_units]
    if joint is not None:
        moved &= np.arange(len(moved)) == joint
    steps = np.diff(log.q_nominal, axis=0) * log.ok[1:, None] / np.where(moved, reach, np.inf)
    ways = [np.cumsum(np.maximum(way, 0.0), axis=0) for way in (steps, -steps)]
    to, fro = (np.vstack([np.zeros_like(reach), way]) for way in ways)
    both = np.minimum(*(way[count - 1 :] - way[: len(way) - count + 1] for way in (to, fro)))
    first, j = np.unravel_index(np.argmax(both), both.shape)
    return int(j) if joint is None else joint, slice(int(first), int(first) + count)


_WIDTH_INCH = 3.5  # of a journal's column
_HEIGHT_INCH = 9.2  # of the six panels
_COVERAGE_BLOCKS = 20  # of time, each with its share of errors within the interval
_STYLE: dict[Any, Any] = {
    "font.size": 7.0,
    "axes.titlesize": 7.0,
    "axes.linewidth": 0.6,
    "legend.fontsize": 6.5,
    "legend.frameon": False,
    "lines.linewidth": 0.8,
}


def model_figure(evaluation: Evaluation, log: MotionLog, joint: str | None = None, *, name: str = "model") -> "Figure":
    """Draw what a calibration model does for one joint, the first when None, of `log`; one journal column wide."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    names = evaluation.data.joint_names
    if joint is not None and joint not in names:
        raise InputError(f"--joint {joint}: expected one of {', '.join(names)}")
    j = 0 if joint is None else names.index(joint)
    unit, scale = DISPLAY[evaluation.data.joint_units[j]]
    series = joint_errors.error_series(evaluation, j, name)
    with rc_context(_STYLE):
        figure = Figure(figsize=(_WIDTH_INCH, _HEIGHT_INCH), layout="constrained")
        over_time, close, histogram, loop, coverage, delay = figure.subplots(6, 1)
        joint_errors.draw_errors_over_time((over_time, close), evaluation, j, series)
        joint_errors.draw_legend(figure, loc="outside upper center", ncols=2)
        joint_errors.draw_histograms(histogram, series[1:], unit)
        shown = slice(None, None, len(evaluation.data) // joint_errors.MAX_POINTS + 1)
        for line in series[1:]:
            command = scale * evaluation.data.q_nominal[shown, j]
            loop.plot(command, line.values[shown], ".", color=line.color, markersize=1.0)
        loop.set_xlabel(f"commanded {names[j]} [{unit}]")
        loop.set_ylabel(f"error [{unit}]")
        _draw_coverage(coverage, evaluation, j)
        t = times_of(log)
        draw_overlay(delay, log, t, j, busy_rows(log, t, joint=j)[1])
        found, in_unit = delay_of(log), "s" if log.time is not None else "rows"
        delay.set_title(f"delay {found.low:+.3f} to {found.high:+.3f} {in_unit}", loc="right")
        delay.set_xlabel(f"time [{in_unit}]")
        delay.legend(ncols=2, loc="best")
        for letter, axes in zip("abcdef", figure.axes, strict=True):
            axes.set_title(f"({letter})", loc="left")
            axes.spines[["top", "right"]].set_visible(False)
    return figure


def _draw_coverage(axes: "Axes", evaluation: Evaluation, j: int) -> None:
    """Draw the share of errors within the interval over blocks of time, and the share that was asked for."""
    x = joint_errors.running_time(evaluation)[0]
    axes.set_xlabel("time [s]" if evaluation.window_unit == "s" else "row")
    axes.set_ylabel("within interval [%]")
    axes.set_ylim(0.0, 105.0)
    if evaluation.level is None:
        axes.text(0.5, 0.5, "the model has no intervals", ha="center", transform=axes.transAxes)
        return
    parts = np.array_split(np.arange(len(x)), min(_COVERAGE_BLOCKS, len(x)))
    share = [100.0 * evaluation.held[rows, j].mean() for rows in parts]
    axes.step([x[rows[0]] for rows in parts] + [x[-1]], [*share, share[-1]], where="post", color=joint_errors.MODEL)
    axes.axhline(100.0 * evaluation.level, color=joint_errors.INTERVAL, linestyle="--")
    axes.axhline(100.0 * evaluation.held[:, j].mean(), color=joint_errors.RAW, linestyle=":")
