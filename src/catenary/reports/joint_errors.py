"""Plots and tables of a calibration's joint errors: over time, histograms, intervals, a journal figure, delays."""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.conformal import coverage_verdicts
from catenary.calibration.evaluate import Evaluation, error_table
from catenary.calibration.model import CalibrationModel
from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.reports.page import BLUE, GREY, ORANGE, Block, Heading, Picture, Text, picture
from catenary.tables import Column, Table, in_units, joint_columns
from catenary.units import DISPLAY
from catenary.verdict.delay import delay_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_RAW, _OFFSET, _MODEL, _INTERVAL = GREY, BLUE, ORANGE, "#2a7f4f"
_MAX_POINTS = 10_000  # of a line
_GAP_STEPS = 5.0  # longest step without a gap, in median steps of a recording
_SHOWN_SHARE = 0.998  # of the errors within a plot's range
_LABEL_WIDTH = 32  # characters in a line of a legend


def error_blocks(evaluation: Evaluation, name: str) -> list[Block]:
    """Return the blocks of a page on the errors of every joint."""
    return [
        Heading("Error per joint"),
        error_table(evaluation, name),
        Text(
            "Raw: as the robot reports. Fixed offset: after subtracting the mean error of the training data, the "
            f"baseline of Peng et al. (2024), table I. {name[:1].upper()}{name[1:]}: after the correction; per cent of "
            "the fixed offset's. Outside: share of rows with inputs outside the model's valid range, that of its "
            "training data; there it applies the fixed offset, with a wider interval."
        ),
    ]


def window_table(evaluation: Evaluation) -> Table:
    """Return the RMSE after the model per window of time."""
    unit = evaluation.window_unit
    first: list[Column] = ["recording", (f"from [{unit}]", "start:.0f"), (f"to [{unit}]", "end:.0f"), ("rows", "n")]
    joints = [(joint.name, joint.unit) for joint in evaluation.joints]
    per_joint = joint_columns(joints, lambda window, k: window.rmse[k], ".3f")
    return Table([*first, *per_joint], evaluation.windows, "RMSE of the model over time")


def coverage_table(evaluation: Evaluation) -> Table | None:
    """Return a table of width, coverage and verdict of the intervals per joint; None for a model without intervals."""
    if evaluation.level is None:
        return None
    unit = in_units(joint.unit for joint in evaluation.joints)
    verdicts = dict(zip(evaluation.joints, coverage_verdicts(evaluation), strict=True))
    columns: list[Column] = [("joint", "name"), "unit", (f"half-width {unit}", "half_width:.3f")]
    columns += [("held [% of rows]", "coverage:.3g %"), ("verdict", verdicts.__getitem__)]
    nominal = f"{100.0 * evaluation.level:.3g} %"
    return Table(columns, evaluation.joints, f"Errors within the model's intervals, nominal coverage {nominal}")


def coverage_blocks(evaluation: Evaluation) -> list[Block]:
    """Return the blocks of a page on a model's intervals."""
    table = coverage_table(evaluation)
    if table is None or evaluation.level is None:
        text = "The model has no intervals: they are estimated from a cross-validation of enough rows."
        return [Heading("Intervals"), Text(text)]
    return [
        Heading("Intervals"),
        table,
        Text(
            f"Each corrected position has an interval with a nominal coverage of {100.0 * evaluation.level:.3g} % on "
            "later data of the same kind: median half-width, share of rows with the error inside. Outside the training "
            "data intervals are wider. Too narrow: chance does not explain so small a share, by a test over blocks of "
            "time, since rows are correlated."
        ),
    ]


@dataclass(frozen=True)
class ErrorSeries:
    """Errors (N,) in deg or mm, with label and colour."""

    label: str
    color: str
    values: Floats


def error_series(evaluation: Evaluation, j: int, name: str) -> list[ErrorSeries]:
    """Return a joint's errors in deg or mm: raw, after the fixed offset, after the model labelled `name`."""
    scale = DISPLAY[evaluation.data.joint_units[j]][1]
    return [
        ErrorSeries("raw", _RAW, scale * evaluation.raw[:, j]),
        ErrorSeries("fixed offset", _OFFSET, scale * evaluation.after_offset[:, j]),
        ErrorSeries(name, _MODEL, scale * evaluation.after_model[:, j]),
    ]


def joint_picture(evaluation: Evaluation, model: CalibrationModel, j: int, *, name: str | None = None) -> Picture:
    """Plot the error of one joint over time and as histograms: raw, after the fixed offset, after the model."""
    from matplotlib.figure import Figure

    shown = name if name is not None else model.kind
    unit = DISPLAY[model.joint_units[j]][0]
    series = error_series(evaluation, j, shown)
    figure = Figure(figsize=(10, 4.4), layout="constrained")
    panels = figure.subplot_mosaic([["all", "often"], ["close", "often"]], width_ratios=[2.6, 1], height_ratios=[3, 2])
    beyond = draw_errors_over_time((panels["all"], panels["close"]), evaluation, j, series)
    draw_histograms(panels["often"], series[1:], unit)
    draw_legend(figure, loc="outside upper right", ncols=4, frameon=False, fontsize=9)
    joint = evaluation.joints[j]
    errors = f"RMSE {joint.raw_rmse:.3f} {unit} raw, {joint.offset_rmse:.3f} {unit} after the fixed offset"
    x, worst = running_time(evaluation)[0], int(np.argmax(np.abs(series[-1].values)))
    panels["close"].plot(x[worst], series[-1].values[worst], "o", color=_MODEL, fillstyle="none", clip_on=False)
    at = f"{x[worst]:.0f} s" if evaluation.window_unit == "s" else f"row {x[worst]:.0f}"
    caption = f"{joint.name}: {errors}, {joint.rmse:.3f} {unit} after {shown}, at worst"
    caption += f" {series[-1].values[worst]:+.3f} {unit} at {at} (circle). Left: over time, with gaps at missing rows;"
    caption += f" below, {shown} alone, close up; right: histogram."
    caption += f" Rows outside the plot: {beyond:,}." if beyond else ""
    if evaluation.level is not None:
        level = f"nominal coverage {100.0 * evaluation.level:g} %"
        caption += f" Shaded: the interval of {shown}, {level}; actual {100.0 * joint.coverage:.1f} %."
    return picture(figure, caption, f"Errors of joint {joint.name} over time, and their histogram.")


def draw_legend(figure: "Figure", **where: Any) -> None:
    """Draw one legend for the lines and the interval of a joint's errors."""
    named = [entry for axes in figure.axes for entry in zip(*axes.get_legend_handles_labels(), strict=True)]
    labels = ["\n".join(textwrap.wrap(label, _LABEL_WIDTH)) or label for _, label in named]
    legend = figure.legend([line for line, _ in named], labels, **where)
    for handle in legend.get_lines():
        handle.set_linewidth(3.0)


def _limit(axes: "Axes", series: Sequence[ErrorSeries]) -> int:
    """Limit a plot to nearly all errors; return the number of rows outside it in any series."""
    tails = (0.5 * (1.0 - _SHOWN_SHARE), 0.5 * (1.0 + _SHOWN_SHARE))
    low, high = np.array([np.quantile(line.values, tails) for line in series]).T
    bottom, top = min(0.0, low.min()), max(0.0, high.max())
    margin = 0.25 * (top - bottom)
    lower, upper = axes.get_ylim()
    if bottom == top or (lower >= bottom - margin and upper <= top + margin):
        return 0
    axes.set_ylim(max(lower, bottom - margin), min(upper, top + margin))
    lower, upper = axes.get_ylim()
    return int(np.any([(line.values < lower) | (line.values > upper) for line in series], axis=0).sum())


def draw_errors_over_time(
    panels: tuple["Axes", "Axes"], evaluation: Evaluation, j: int, series: Sequence[ErrorSeries]
) -> int:
    """Plot a joint's errors over time, the last one close up with its interval; return the number of rows outside."""
    whole, close = panels
    x, recordings = running_time(evaluation)
    shown = np.arange(0, len(x), len(x) // _MAX_POINTS + 1)
    new, step = _new_recordings(evaluation), np.diff(evaluation.data.time)
    usual = np.median(step[~new]) if (~new).any() else 0.0
    breaks = np.flatnonzero(new | (step > _GAP_STEPS * usual)) + 1  # first rows after a gap
    gaps = np.unique(np.searchsorted(shown, breaks))
    unit, scale = DISPLAY[evaluation.data.joint_units[j]]

    def parted(values: Floats) -> Floats:
        return np.insert(values[shown], gaps[gaps < len(shown)], np.nan)

    at, corrected = parted(x), series[-1]
    close.sharex(whole)
    for line in series:  # with dots, for single rows between gaps
        whole.plot(at, parted(line.values), ".-", color=line.color, linewidth=0.7, markersize=1.0, label=line.label)
    close.plot(at, parted(corrected.values), ".-", color=corrected.color, linewidth=0.7, markersize=1.0)
    reach = float(np.quantile(np.abs(corrected.values), _SHOWN_SHARE))
    if evaluation.level is not None:
        width = scale * evaluation.interval[:, j]
        reach, label = max(reach, float(np.median(width))), f"interval, {100.0 * evaluation.level:g} %"
        close.fill_between(at, -parted(width), parted(width), color=_INTERVAL, alpha=0.25, zorder=0, label=label)
    if reach > 0.0:
        close.set_ylim(-1.3 * reach, 1.3 * reach)
    for axes in panels:
        for row in recordings:
            axes.axvline(x[row], color=_RAW, linewidth=0.8, linestyle=":")
        axes.axhline(0.0, color="#1c2430", linewidth=0.6)
        axes.set_ylabel(f"error [{unit}]")
        axes.margins(x=0.01)
    time = "time [s]" if evaluation.window_unit == "s" else "row"
    close.set_xlabel(f"{time}, {len(recordings) + 1} recordings one after the other" if len(recordings) else time)
    whole.tick_params(labelbottom=False)
    return _limit(whole, series)


def draw_histograms(axes: "Axes", series: Sequence[ErrorSeries], unit: str) -> None:
    """Plot histograms of the errors in `unit`, without the outermost."""
    widest = max(float(np.quantile(np.abs(line.values), 0.995)) for line in series)
    edges = np.linspace(-widest, widest, 61).tolist() if widest > 0.0 else 10
    for line in series:
        axes.hist(line.values, bins=edges, color=line.color, alpha=0.65)
    axes.set_xlabel(f"error [{unit}]")
    axes.set_ylabel("rows")


def _new_recordings(evaluation: Evaluation) -> np.ndarray:
    """Return a mask of the steps between rows at which a new recording starts, (N - 1,)."""
    data = evaluation.data
    return np.asarray((np.diff(data.recording) != 0) | (np.diff(data.time) < 0.0))


def running_time(evaluation: Evaluation) -> tuple[np.ndarray, np.ndarray]:
    """Return the time (N,) accumulated over all recordings, and the first rows of all but the first."""
    time, new = evaluation.data.time, _new_recordings(evaluation)
    step = np.where(new, 0.0, np.diff(time))
    return time[0] + np.concatenate([[0.0], np.cumsum(step)]), np.flatnonzero(new) + 1


_SHOWN_S, _MIN_SHOWN_ROWS = 10.0, 40  # of motion without a delay
_MIN_REACH = {"rad": 0.02, "m": 1e-3}  # of a joint that moves, beyond sensor noise
_SHOWN_DELAYS = 20.0  # length of the shown motion, in delays
CAPTION = "Measured positions minus their median error. Where the lines turn at different times, a delay remains."


def overlay(log: MotionLog, before: float = 0.0, after: float = 0.0) -> "Figure":
    """Plot the fastest joint's commands and measurements, as recorded and re-timed.

    Args:
        log: Recording with encoder positions.
        before, after: Delay of the measurements [s|rows], as recorded and after re-timing.
    """
    from matplotlib.figure import Figure

    assert log.q_encoder is not None
    t = times_of(log)
    j, rows = busy_rows(log, t, max(abs(before), abs(after)))
    in_unit = "s" if log.time is not None else "rows"
    shifts = [("as recorded", before)] + [(f"re-timed by {before - after:+.3g} {in_unit}", after)] * (before != after)
    figure = Figure(figsize=(9.0, 2.6 * len(shifts) + 0.4), layout="constrained")
    panels = figure.subplots(len(shifts), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (title, shift) in zip(panels, shifts, strict=True):
        draw_overlay(axes, log, t, j, rows, shift)
        axes.set_title(title, loc="left", fontsize=10)
        axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel(f"time [{in_unit}]")
    figure.axes[0].legend(frameon=False, ncols=2, loc="best")
    return figure


def draw_overlay(axes: "Axes", log: MotionLog, t: Floats, j: int, rows: slice, shift: float = 0.0) -> None:
    """Plot a joint's commands, and its measurements shifted in time by `shift` [s|rows], minus their median error."""
    assert log.q_encoder is not None
    unit, scale = DISPLAY[log.joint_units[j]]
    command, seen = scale * log.q_nominal[rows, j], scale * np.where(log.ok, log.q_encoder[:, j], np.nan)[rows]
    level = np.nanmedian(seen - command) if np.isfinite(seen).any() else 0.0
    axes.plot(t[rows], command, color=_OFFSET, label="commanded")
    axes.plot(t[rows] + shift, seen - level, ".-", color=_MODEL, linewidth=1.0, markersize=3.0, label="measured")
    axes.set_ylabel(f"{log.joint_names[j]} [{unit}]")


def times_of(log: MotionLog) -> Floats:
    """Return the time of each row [s], or its index without stamps."""
    return np.arange(float(len(log))) if log.time is None else log.time


def busy_rows(log: MotionLog, t: Floats, delay: float = 0.0, joint: int | None = None) -> tuple[int, slice]:
    """Return the fastest joint, or a given one, and the rows where it reverses most, which show a delay [s|rows]."""
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
_COVERAGE_BLOCKS = 20  # of time
_STYLE: dict[Any, Any] = {
    "font.size": 7.0,
    "axes.titlesize": 7.0,
    "axes.linewidth": 0.6,
    "legend.fontsize": 6.5,
    "legend.frameon": False,
    "lines.linewidth": 0.8,
}


def model_figure(evaluation: Evaluation, log: MotionLog, joint: str | None = None, *, name: str = "model") -> "Figure":
    """Plot the effect of a calibration model on one joint, as a figure of one journal column.

    Args:
        joint: Name; the first joint when None.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    names = evaluation.data.joint_names
    if joint is not None and joint not in names:
        raise InputError(f"--joint {joint}: expected one of {', '.join(names)}")
    j = 0 if joint is None else names.index(joint)
    unit, scale = DISPLAY[evaluation.data.joint_units[j]]
    series = error_series(evaluation, j, name)
    with rc_context(_STYLE):
        figure = Figure(figsize=(_WIDTH_INCH, _HEIGHT_INCH), layout="constrained")
        over_time, close, histogram, loop, coverage, delay = figure.subplots(6, 1)
        draw_errors_over_time((over_time, close), evaluation, j, series)
        draw_legend(figure, loc="outside upper center", ncols=2)
        draw_histograms(histogram, series[1:], unit)
        shown = slice(None, None, len(evaluation.data) // _MAX_POINTS + 1)
        for line in series[1:]:
            command = scale * evaluation.data.q_nominal[shown, j]
            loop.plot(command, line.values[shown], ".", color=line.color, markersize=1.0)
        loop.set_xlabel(f"commanded {names[j]} [{unit}]")
        loop.set_ylabel(f"error [{unit}]")
        _draw_coverage(coverage, evaluation, j)
        t = times_of(log)
        draw_overlay(delay, log, t, j, busy_rows(log, t, joint=j)[1])
        lag, in_unit = delay_of(log), "s" if log.time is not None else "rows"
        delay.set_title(f"delay {lag.low:+.3f} to {lag.high:+.3f} {in_unit}", loc="right")
        delay.set_xlabel(f"time [{in_unit}]")
        delay.legend(ncols=2, loc="best")
        for letter, axes in zip("abcdef", figure.axes, strict=True):
            axes.set_title(f"({letter})", loc="left")
            axes.spines[["top", "right"]].set_visible(False)
    return figure


def _draw_coverage(axes: "Axes", evaluation: Evaluation, j: int) -> None:
    x = running_time(evaluation)[0]
    axes.set_xlabel("time [s]" if evaluation.window_unit == "s" else "row")
    axes.set_ylabel("within interval [%]")
    axes.set_ylim(0.0, 105.0)
    if evaluation.level is None:
        axes.text(0.5, 0.5, "the model has no intervals", ha="center", transform=axes.transAxes)
        return
    parts = np.array_split(np.arange(len(x)), min(_COVERAGE_BLOCKS, len(x)))
    share = [100.0 * evaluation.held[rows, j].mean() for rows in parts]
    axes.step([x[rows[0]] for rows in parts] + [x[-1]], [*share, share[-1]], where="post", color=_MODEL)
    axes.axhline(100.0 * evaluation.level, color=_INTERVAL, linestyle="--")
    axes.axhline(100.0 * evaluation.held[:, j].mean(), color=_RAW, linestyle=":")
