"""A figure of one joint for a paper: errors over time, close up and as a histogram, hysteresis, coverage, delay."""

from typing import TYPE_CHECKING, Any

import numpy as np

from catenary.calibration.evaluate import Evaluation
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.reports import joint_errors
from catenary.reports.overlay import busy_rows, draw_overlay, times_of
from catenary.units import DISPLAY
from catenary.verdict.delay import delay_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMN = 3.5  # width of a journal's column [inch]
HEIGHT = 9.2  # of the six panels [inch]
BLOCKS = 20  # of time, each with its share of errors within the interval
STYLE: dict[Any, Any] = {
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
    with rc_context(STYLE):
        figure = Figure(figsize=(COLUMN, HEIGHT), layout="constrained")
        over_time, close, histogram, loop, coverage, delay = figure.subplots(6, 1)
        joint_errors.draw_errors_over_time((over_time, close), evaluation, j, series)
        joint_errors.draw_legend(figure, loc="outside upper center", ncols=2)
        joint_errors.draw_histograms(histogram, series[1:], unit)
        shown = slice(None, None, len(evaluation.data) // joint_errors.MOST_POINTS + 1)
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
    parts = np.array_split(np.arange(len(x)), min(BLOCKS, len(x)))
    share = [100.0 * evaluation.held[rows, j].mean() for rows in parts]
    axes.step([x[rows[0]] for rows in parts] + [x[-1]], [*share, share[-1]], where="post", color=joint_errors.MODEL)
    axes.axhline(100.0 * evaluation.level, color=joint_errors.INTERVAL, linestyle="--")
    axes.axhline(100.0 * evaluation.held[:, j].mean(), color=joint_errors.RAW, linestyle=":")
