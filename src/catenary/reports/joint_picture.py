"""The picture of one joint's errors: over time, and how they are spread."""

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

RAW, OFFSET, MODEL, INTERVAL = "#b8c0cc", "#4b6b94", "#d9622b", "#2a7f4f"
MOST_POINTS = 2_000  # drawn one by one; more lines would hide each other
STRETCHES = 300  # of a longer recording, each drawn as the range and the median of its errors


@dataclass(frozen=True)
class ErrorSeries:
    """Errors (N,) in deg or mm, and how they are drawn."""

    label: str
    color: str
    values: Floats


def joint_picture(evaluation: Evaluation, model: CalibrationModel, j: int) -> Picture:
    """Draw the error of one joint over time and as histograms: raw, after the fixed offset, after the model."""
    from matplotlib.figure import Figure

    unit, scale = DISPLAY[model.joint_units[j]]
    series = [
        ErrorSeries("raw", RAW, scale * evaluation.raw[:, j]),
        ErrorSeries("fixed offset", OFFSET, scale * evaluation.after_offset[:, j]),
        ErrorSeries(model.kind, MODEL, scale * evaluation.after_model[:, j]),
    ]
    figure = Figure(figsize=(10, 3.1), layout="constrained")
    over_time, histogram = figure.subplots(1, 2, width_ratios=[2.6, 1])
    _draw_over_time(over_time, evaluation, series)
    if evaluation.level is not None:
        _draw_interval(over_time, evaluation, scale * evaluation.interval[:, j])
    over_time.set_ylabel(f"error of {model.joint_names[j]} [{unit}]")
    _draw_histograms(histogram, series[1:], unit)
    handles, labels = over_time.get_legend_handles_labels()
    legend = figure.legend(handles, labels, loc="outside upper right", ncols=4, frameon=False, fontsize=9)
    for handle in legend.get_lines():
        handle.set_linewidth(3.0)
    joint = evaluation.joints[j]
    caption = (
        f"{joint.name}: RMSE {joint.raw_rmse:.3f} {unit} raw, {joint.offset_rmse:.3f} {unit} after the fixed "
        f"offset, {joint.rmse:.3f} {unit} after the model."
    )
    if len(evaluation.data) > MOST_POINTS:
        caption += f" Lines: the median over each of about {STRETCHES} stretches; bands: all errors in them."
    if evaluation.level is not None:
        caption += (
            f" Dashed: the model's interval, which is to hold {100.0 * evaluation.level:g} % of its errors; it holds "
            f"{100.0 * joint.coverage:.1f} %."
        )
    return picture(figure, caption)


def _draw_over_time(axes: "Axes", evaluation: Evaluation, series: Sequence[ErrorSeries]) -> None:
    x, breaks = _running_time(evaluation)
    stretches = _stretches(len(x), breaks)
    first = np.array([rows[0] for rows in stretches])
    gaps = np.flatnonzero(np.isin(first, breaks))  # where a line must not go on

    def parted(values: Floats) -> Floats:
        return np.insert(values, gaps, np.nan)

    at = parted(x[first])
    for line in series:
        if len(stretches) == len(x):
            middle = line.values
        else:
            middle = np.array([np.median(line.values[rows]) for rows in stretches])
            low = np.array([line.values[rows].min() for rows in stretches])
            high = np.array([line.values[rows].max() for rows in stretches])
            axes.fill_between(at, parted(low), parted(high), color=line.color, alpha=0.3, linewidth=0.0)
        axes.plot(at, parted(middle), color=line.color, linewidth=0.9, label=line.label)
    for row in breaks:
        axes.axvline(x[row], color=RAW, linewidth=0.8, linestyle=":")
    axes.axhline(0.0, color="#1c2430", linewidth=0.6)
    unit = "time [s]" if evaluation.window_unit == "s" else "row"
    axes.set_xlabel(f"{unit}, {len(breaks) + 1} recordings one after the other" if len(breaks) else unit)
    axes.margins(x=0.01)


def _draw_interval(axes: "Axes", evaluation: Evaluation, half_width: Floats) -> None:
    """Draw the interval about zero error as a band; of a stretch of rows the median."""
    x, breaks = _running_time(evaluation)
    stretches = _stretches(len(x), breaks)
    middle = np.array([np.median(half_width[rows]) for rows in stretches])
    first = np.array([rows[0] for rows in stretches])
    gaps = np.flatnonzero(np.isin(first, breaks))
    at, width = (np.insert(values, gaps, np.nan) for values in (x[first], middle))
    axes.fill_between(at, -width, width, color=INTERVAL, alpha=0.12, linewidth=0.0, zorder=0)
    for edge, label in ((width, f"interval, {100.0 * (evaluation.level or 0.0):g} %"), (-width, None)):
        axes.plot(at, edge, color=INTERVAL, linewidth=0.9, linestyle="--", label=label)


def _stretches(rows: int, breaks: np.ndarray) -> list[np.ndarray]:
    """Rows to draw as one: each by itself, or about STRETCHES equal parts that end where recordings end."""
    if rows <= MOST_POINTS:
        return [np.array([row]) for row in range(rows)]
    parts = np.split(np.arange(rows), breaks)
    return [
        stretch
        for part in parts
        for stretch in np.array_split(part, min(len(part), round(STRETCHES * len(part) / rows) or 1))
    ]


def _draw_histograms(axes: "Axes", series: Sequence[ErrorSeries], unit: str) -> None:
    widest = max(float(np.quantile(np.abs(line.values), 0.995)) for line in series)
    edges = np.linspace(-widest, widest, 61).tolist() if widest > 0.0 else 10
    for line in series:
        axes.hist(line.values, bins=edges, color=line.color, alpha=0.65)
    axes.set_xlabel(f"error [{unit}]")
    axes.set_ylabel("rows")


def _running_time(evaluation: Evaluation) -> tuple[np.ndarray, np.ndarray]:
    """Time that keeps rising where recordings follow each other, and the rows where another one begins."""
    time = evaluation.data.time
    step = np.diff(time)
    new = (np.diff(evaluation.data.recording) != 0) | (step < 0.0)
    step = np.where(new, 0.0, step)
    return time[0] + np.concatenate([[0.0], np.cumsum(step)]), np.flatnonzero(new) + 1
