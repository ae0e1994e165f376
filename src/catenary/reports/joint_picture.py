"""The picture of one joint's errors: over time, and how they are spread."""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.evaluate import Evaluation
from catenary.calibration.model import CalibrationModel
from catenary.reports.page import Picture, picture
from catenary.units import DISPLAY

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RAW, OFFSET, MODEL, INTERVAL = "#8a94a3", "#4b6b94", "#d9622b", "#2a7f4f"
MOST_POINTS = 2_000  # drawn one by one; more lines would hide each other
STRETCHES = 300  # of a longer recording, each drawn as the range and the median of its errors
LONGEST_STEP = 5.0  # times the median step of a recording: beyond it rows are missing
SHOWN_SHARE = 0.998  # of the errors, that a picture's range is made for
LONGEST_LABEL = 32  # characters in a line of a legend


@dataclass(frozen=True)
class ErrorSeries:
    """Errors (N,) in deg or mm, and how they are drawn."""

    label: str
    color: str
    values: Floats


def joint_picture(
    evaluation: Evaluation, model: CalibrationModel, j: int, *, name: str | None = None
) -> Picture:
    """Draw the error of one joint over time and as histograms: raw, after the fixed offset, after the model.

    Lines end where rows are missing in time; far errors that would flatten the rest are counted in the caption.

    Args:
        evaluation: The errors.
        model: The model.
        j: Number of the joint.
        name: The model's name; its kind when None.
    """
    from matplotlib.figure import Figure

    shown = name if name is not None else model.kind
    unit, scale = DISPLAY[model.joint_units[j]]
    series = [
        ErrorSeries("raw", RAW, scale * evaluation.raw[:, j]),
        ErrorSeries("fixed offset", OFFSET, scale * evaluation.after_offset[:, j]),
        ErrorSeries(shown, MODEL, scale * evaluation.after_model[:, j]),
    ]
    figure = Figure(figsize=(10, 3.1), layout="constrained")
    over_time, histogram = figure.subplots(1, 2, width_ratios=[2.6, 1])
    _draw_over_time(over_time, evaluation, series)
    if evaluation.level is not None:
        _draw_interval(over_time, evaluation, scale * evaluation.interval[:, j])
    over_time.set_ylabel(f"error [{unit}]")
    beyond = _limit(over_time, series)
    _draw_histograms(histogram, series[1:], unit)
    handles, labels = over_time.get_legend_handles_labels()
    legend = figure.legend(
        handles,
        [wrapped(label) for label in labels],
        loc="outside upper right",
        ncols=4,
        frameon=False,
        fontsize=9,
    )
    for handle in legend.get_lines():
        handle.set_linewidth(3.0)
    joint = evaluation.joints[j]
    caption = (
        f"{joint.name}: RMSE {joint.raw_rmse:.3f} {unit} raw, {joint.offset_rmse:.3f} {unit} after the fixed "
        f"offset, {joint.rmse:.3f} {unit} after {shown}. Left: over time, no line where rows are missing; "
        "right: how often each error occurs."
    )
    if beyond:
        caption += f" Rows that lie beyond the picture: {beyond:,}."
    if len(evaluation.data) > MOST_POINTS:
        caption += f" Lines: the median over each of about {STRETCHES} stretches; bands: all errors in them."
    if evaluation.level is not None:
        caption += (
            f" Dashed: the interval of {shown}, which is to hold {100.0 * evaluation.level:g} % of its errors; "
            f"it holds {100.0 * joint.coverage:.1f} %."
        )
    return picture(figure, caption, f"Errors of joint {joint.name} over time, and their histogram.")


def wrapped(label: str) -> str:
    """Return a legend's label in lines, none of it lost."""
    return "\n".join(textwrap.wrap(label, LONGEST_LABEL)) or label


def row_breaks(evaluation: Evaluation) -> np.ndarray:
    """Return the rows before which rows are missing or another recording begins."""
    data = evaluation.data
    new = _new_recordings(evaluation)
    size = np.array([source.rows for source in data.sources], dtype=float)[data.recording]
    left_out = np.diff(np.rint(data.position * size)) > 1.0
    step = np.diff(data.time)
    usual = np.median(step[~new]) if (~new).any() else 0.0
    return np.flatnonzero(new | left_out | (step > LONGEST_STEP * usual)) + 1


def _limit(axes: "Axes", series: Sequence[ErrorSeries]) -> int:
    """Show nearly all errors of a picture; return how many rows of any series lie beyond it."""
    tails = (0.5 * (1.0 - SHOWN_SHARE), 0.5 * (1.0 + SHOWN_SHARE))
    low, high = np.array([np.quantile(line.values, tails) for line in series]).T
    bottom, top = min(0.0, low.min()), max(0.0, high.max())
    margin = 0.25 * (top - bottom)
    lower, upper = axes.get_ylim()
    if bottom == top or (lower >= bottom - margin and upper <= top + margin):
        return 0
    axes.set_ylim(max(lower, bottom - margin), min(upper, top + margin))
    lower, upper = axes.get_ylim()
    return int(np.any([(line.values < lower) | (line.values > upper) for line in series], axis=0).sum())


def _draw_over_time(axes: "Axes", evaluation: Evaluation, series: Sequence[ErrorSeries]) -> None:
    x, recordings = _running_time(evaluation)
    stretches, gaps = _stretches(x, row_breaks(evaluation))
    first = np.array([rows[0] for rows in stretches])

    def parted(values: Floats) -> Floats:
        return np.insert(values, gaps, np.nan)

    at = parted(x[first])
    alone = _alone(len(stretches), gaps)
    for line in series:
        if len(stretches) == len(x):
            middle = line.values
        else:
            middle = np.array([np.median(line.values[rows]) for rows in stretches])
            low = np.array([line.values[rows].min() for rows in stretches])
            high = np.array([line.values[rows].max() for rows in stretches])
            axes.fill_between(at, parted(low), parted(high), color=line.color, alpha=0.3, linewidth=0.0)
        axes.plot(at, parted(middle), color=line.color, linewidth=0.9, label=line.label)
        axes.plot(x[first][alone], middle[alone], ".", color=line.color, markersize=2.0)
    for row in recordings:
        axes.axvline(x[row], color=RAW, linewidth=0.8, linestyle=":")
    axes.axhline(0.0, color="#1c2430", linewidth=0.6)
    unit = "time [s]" if evaluation.window_unit == "s" else "row"
    axes.set_xlabel(
        f"{unit}, {len(recordings) + 1} recordings one after the other" if len(recordings) else unit
    )
    axes.margins(x=0.01)


def _draw_interval(axes: "Axes", evaluation: Evaluation, half_width: Floats) -> None:
    """Draw the interval about zero error as a band; of a stretch of rows the median."""
    x, _ = _running_time(evaluation)
    stretches, gaps = _stretches(x, row_breaks(evaluation))
    middle = np.array([np.median(half_width[rows]) for rows in stretches])
    first = np.array([rows[0] for rows in stretches])
    at, width = (np.insert(values, gaps, np.nan) for values in (x[first], middle))
    axes.fill_between(at, -width, width, color=INTERVAL, alpha=0.12, linewidth=0.0, zorder=0)
    for edge, label in ((width, f"interval, {100.0 * (evaluation.level or 0.0):g} %"), (-width, None)):
        axes.plot(at, edge, color=INTERVAL, linewidth=0.9, linestyle="--", label=label)


def _stretches(x: Floats, breaks: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
    """Rows to draw as one, and before which of these no line goes on.

    Each row by itself, or about STRETCHES parts of a longer recording; then a break is a gap longer than a part, which
    shorter ones vanish in.
    """
    rows = len(x)
    if rows <= MOST_POINTS:
        return [np.array([row]) for row in range(rows)], breaks
    shortest = max(float(x[-1] - x[0]) / STRETCHES, 1e-12)
    wide = breaks[(x[breaks] - x[breaks - 1] > shortest) | (x[breaks] <= x[breaks - 1])]
    parts = [
        np.array_split(part, min(len(part), round(STRETCHES * len(part) / rows) or 1))
        for part in np.split(np.arange(rows), wide)
    ]
    return [stretch for part in parts for stretch in part], np.cumsum([len(part) for part in parts])[:-1]


def _alone(count: int, gaps: np.ndarray) -> np.ndarray:
    """Return which of `count` points no line reaches: those between two gaps."""
    edge = np.zeros(count + 1, dtype=bool)
    edge[[0, count]] = True
    edge[gaps] = True
    return np.asarray(edge[:-1] & edge[1:])


def _draw_histograms(axes: "Axes", series: Sequence[ErrorSeries], unit: str) -> None:
    widest = max(float(np.quantile(np.abs(line.values), 0.995)) for line in series)
    edges = np.linspace(-widest, widest, 61).tolist() if widest > 0.0 else 10
    for line in series:
        axes.hist(line.values, bins=edges, color=line.color, alpha=0.65)
    axes.set_xlabel(f"error [{unit}]")
    axes.set_ylabel("rows")


def _new_recordings(evaluation: Evaluation) -> np.ndarray:
    """Return between which rows another recording begins, (N - 1,)."""
    data = evaluation.data
    return np.asarray((np.diff(data.recording) != 0) | (np.diff(data.time) < 0.0))


def _running_time(evaluation: Evaluation) -> tuple[np.ndarray, np.ndarray]:
    """Time that keeps rising where recordings follow each other, and the rows where another one begins."""
    time, new = evaluation.data.time, _new_recordings(evaluation)
    step = np.where(new, 0.0, np.diff(time))
    return time[0] + np.concatenate([[0.0], np.cumsum(step)]), np.flatnonzero(new) + 1
