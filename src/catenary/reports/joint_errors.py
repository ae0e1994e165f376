"""Errors of a calibration's joints: tables per joint, over time and within intervals, and a picture of each joint."""

import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.conformal import coverage_verdicts
from catenary.calibration.evaluate import Evaluation, Spread
from catenary.calibration.fit_recordings import LeftOut
from catenary.calibration.model import CalibrationModel
from catenary.reports.page import BLUE, ORANGE, Block, Column, Heading, Picture, Table, Text, joint_columns, picture
from catenary.units import DISPLAY

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

RAW, OFFSET, MODEL, INTERVAL = "#8a94a3", BLUE, ORANGE, "#2a7f4f"
MAX_POINTS = 10_000  # of a line; more would hide each other
_GAP_STEPS = 5.0  # times the median step of a recording: beyond it rows are missing
_SHOWN_SHARE = 0.998  # of the errors, that a picture's range is made for
_LABEL_WIDTH = 32  # characters in a line of a legend


def in_units(units: Iterable[str]) -> str:
    """Return the units of a column: [deg], [mm], or [deg|mm] where each row names its own."""
    return f"[{'|'.join(sorted(set(units)))}]"


def error_table(
    evaluation: Evaluation, name: str = "model", *, title: str = "RMSE and largest error per joint"
) -> Table:
    """Return RMSE per joint raw, after the fixed offset and after the model, and the share outside its valid range."""
    unit = in_units(joint.unit for joint in evaluation.joints)
    columns: list[Column] = [
        ("joint", "name"), "unit", (f"raw RMSE {unit}", "raw_rmse:.3f"),
        (f"fixed offset RMSE {unit}", "offset_rmse:.3f"), (f"{name} RMSE {unit}", "rmse:.3f"),
        ("of fixed offset [%]", lambda joint: percent(joint.percent_of_offset, 1)),
        (f"largest raw {unit}", "raw_max:.2f"), (f"largest {name} {unit}", "max:.2f"),
        ("outside [% of rows]", "outside_valid_range:.1f %"),
    ]  # fmt: skip
    return Table(columns, evaluation.joints, title)


def error_blocks(evaluation: Evaluation, name: str) -> list[Block]:
    """Return what a page says of the errors of every joint."""
    return [
        Heading("Error per joint"),
        error_table(evaluation, name),
        Text(
            "Raw: as the robot reports. Fixed offset: after the mean error of the training data is taken off, the "
            f"baseline of Peng et al. (2024), table I. {name[:1].upper()}{name[1:]}: after the correction; per cent of "
            "the fixed offset's. Outside: share of rows whose inputs lie beyond what the model was trained on (its "
            "valid range); there it gives the fixed offset, and a wider interval."
        ),
    ]


def percent(value: float, digits: int) -> str:
    """Return a percentage as text; a dash for NaN, a percentage of nothing."""
    return f"{value:.{digits}f} %" if np.isfinite(value) else "-"


def window_table(evaluation: Evaluation) -> Table:
    """Return the RMSE after the model per window of time."""
    unit = evaluation.window_unit
    first: list[Column] = ["recording", (f"from [{unit}]", "start:.0f"), (f"to [{unit}]", "end:.0f"), ("rows", "n")]
    joints = [(joint.name, joint.unit) for joint in evaluation.joints]
    per_joint = joint_columns(joints, lambda window, k: window.rmse[k], ".3f")
    return Table([*first, *per_joint], evaluation.windows, "RMSE of the model over time")


def spread_table(spread: Sequence[Spread], name: str = "model") -> Table:
    """Return mean and standard deviation of the RMSE over blocks of a cross-validation, and what they let expect."""
    unit = in_units(s.unit for s in spread)
    columns: list[Column] = [
        "joint", "unit", ("blocks", "folds"),
        (f"fixed offset RMSE {unit}", lambda s: f"{s.offset_rmse_mean:.3f} ± {s.offset_rmse_sd:.3f}"),
        (f"{name} RMSE {unit}", lambda s: f"{s.rmse_mean:.3f} ± {s.rmse_sd:.3f}"),
    ]  # fmt: skip
    if all(s.rmse_low is not None for s in spread):
        columns.append((f"as trained {unit}", lambda s: f"{s.rmse_low:.3f} to {s.rmse_high:.3f}"))
        columns.append((f"in the margin {unit}", lambda s: f"at most {s.rmse_margin:.3f}"))
    if all(s.held_low is not None for s in spread):
        shares = "in intervals [% of rows]"
        columns.append((shares, lambda s: f"{100 * s.held_low:.0f} to {100 * s.held_high:.0f} %"))
    return Table(columns, spread, "RMSE on data that the fit did not see, and on a stretch to come")


def left_out_table(found: Sequence[LeftOut]) -> Table:
    """Return the error by joint with and without the rows that a fit left out."""
    unit = in_units(each.unit for each in found)
    columns: list[Column] = [
        "joint", "unit", ("beyond limit [rows]", "beyond"), ("left out [% of rows]", "share_of_rows:.2f %"),
        ("carry [% of error]", "share_of_error:.0f %"), (f"RMSE without {unit}", "rmse_without:.3f"),
        (f"with {unit}", "rmse_with:.3f"),
    ]  # fmt: skip
    return Table(columns, found, f"Error with and without the {found[0].rows} measured rows left out")


def coverage_table(evaluation: Evaluation) -> Table | None:
    """Return width and coverage of the intervals per joint, and whether they hold; None for a model without."""
    if evaluation.level is None:
        return None
    unit = in_units(joint.unit for joint in evaluation.joints)
    verdicts = dict(zip(evaluation.joints, coverage_verdicts(evaluation), strict=True))
    columns: list[Column] = [("joint", "name"), "unit", (f"half-width {unit}", "half_width:.3f")]
    columns += [("held [% of rows]", "coverage:.3g %"), ("verdict", verdicts.__getitem__)]
    asked = f"{100.0 * evaluation.level:.3g} %"
    return Table(columns, evaluation.joints, f"Errors within the model's intervals, which are to hold {asked}")


def coverage_blocks(evaluation: Evaluation) -> list[Block]:
    """Return what a page says of a model's intervals."""
    table = coverage_table(evaluation)
    if table is None or evaluation.level is None:
        text = "The model has no intervals: they are estimated from a cross-validation of enough rows."
        return [Heading("Intervals"), Text(text)]
    return [
        Heading("Intervals"),
        table,
        Text(
            f"Each corrected position comes with an interval that is to hold {100.0 * evaluation.level:.3g} % of "
            "errors on later data of the same kind: median half-width, share of rows whose error lies within it. "
            "Beyond where training rows lay intervals are wider. Too narrow: so small a share is not laid to chance, "
            "counting blocks of time, whose rows depend on each other."
        ),
    ]


@dataclass(frozen=True)
class ErrorSeries:
    """Errors (N,) in deg or mm, and how they are drawn."""

    label: str
    color: str
    values: Floats


def error_series(evaluation: Evaluation, j: int, name: str) -> list[ErrorSeries]:
    """Return a joint's errors in deg or mm: raw, after the fixed offset, after the model, which is called `name`."""
    scale = DISPLAY[evaluation.data.joint_units[j]][1]
    return [
        ErrorSeries("raw", RAW, scale * evaluation.raw[:, j]),
        ErrorSeries("fixed offset", OFFSET, scale * evaluation.after_offset[:, j]),
        ErrorSeries(name, MODEL, scale * evaluation.after_model[:, j]),
    ]


def joint_picture(evaluation: Evaluation, model: CalibrationModel, j: int, *, name: str | None = None) -> Picture:
    """Draw the error of one joint over time and as histograms: raw, after the fixed offset, after the model."""
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
    caption = f"{joint.name}: {errors}, {joint.rmse:.3f} {unit} after {shown}. Left: over time, with no line where rows"
    caption += f" are missing; below it {shown} alone, close up; right: how often each error occurs."
    caption += f" Rows that lie beyond the picture: {beyond:,}." if beyond else ""
    if evaluation.level is not None:
        level = f"which is to hold {100.0 * evaluation.level:g} % of its errors"
        caption += f" Shaded: the interval of {shown}, {level}; it holds {100.0 * joint.coverage:.1f} %."
    return picture(figure, caption, f"Errors of joint {joint.name} over time, and their histogram.")


def draw_legend(figure: "Figure", **where: Any) -> None:
    """Name the lines and the interval of a joint's errors once, above its panels."""
    named = [each for axes in figure.axes for each in zip(*axes.get_legend_handles_labels(), strict=True)]
    labels = ["\n".join(textwrap.wrap(label, _LABEL_WIDTH)) or label for _, label in named]
    legend = figure.legend([line for line, _ in named], labels, **where)
    for handle in legend.get_lines():
        handle.set_linewidth(3.0)


def _limit(axes: "Axes", series: Sequence[ErrorSeries]) -> int:
    """Show nearly all errors of a picture; return how many rows of any series lie beyond it."""
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
    """Draw a joint's errors over time, the last close up below, with its interval; return how many rows lie beyond."""
    whole, close = panels
    x, recordings = running_time(evaluation)
    shown = np.arange(0, len(x), len(x) // MAX_POINTS + 1)
    new, step = _new_recordings(evaluation), np.diff(evaluation.data.time)
    usual = np.median(step[~new]) if (~new).any() else 0.0
    breaks = np.flatnonzero(new | (step > _GAP_STEPS * usual)) + 1  # before these rows some are missing
    gaps = np.unique(np.searchsorted(shown, breaks))
    unit, scale = DISPLAY[evaluation.data.joint_units[j]]

    def parted(values: Floats) -> Floats:
        return np.insert(values[shown], gaps[gaps < len(shown)], np.nan)

    at, corrected = parted(x), series[-1]
    close.sharex(whole)
    for line in series:  # a row between two gaps has no line, but a dot
        whole.plot(at, parted(line.values), ".-", color=line.color, linewidth=0.7, markersize=1.0, label=line.label)
    close.plot(at, parted(corrected.values), ".-", color=corrected.color, linewidth=0.7, markersize=1.0)
    reach = float(np.quantile(np.abs(corrected.values), _SHOWN_SHARE))
    if evaluation.level is not None:
        width = scale * evaluation.interval[:, j]
        reach, label = max(reach, float(np.median(width))), f"interval, {100.0 * evaluation.level:g} %"
        close.fill_between(at, -parted(width), parted(width), color=INTERVAL, alpha=0.25, zorder=0, label=label)
    if reach > 0.0:
        close.set_ylim(-1.3 * reach, 1.3 * reach)
    for axes in panels:
        for row in recordings:
            axes.axvline(x[row], color=RAW, linewidth=0.8, linestyle=":")
        axes.axhline(0.0, color="#1c2430", linewidth=0.6)
        axes.set_ylabel(f"error [{unit}]")
        axes.margins(x=0.01)
    time = "time [s]" if evaluation.window_unit == "s" else "row"
    close.set_xlabel(f"{time}, {len(recordings) + 1} recordings one after the other" if len(recordings) else time)
    whole.tick_params(labelbottom=False)
    return _limit(whole, series)


def draw_histograms(axes: "Axes", series: Sequence[ErrorSeries], unit: str) -> None:
    """Draw how often each error occurs, all but the farthest, in `unit`."""
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


def running_time(evaluation: Evaluation) -> tuple[np.ndarray, np.ndarray]:
    """Return time that keeps rising where recordings follow each other, and the rows where another one begins."""
    time, new = evaluation.data.time, _new_recordings(evaluation)
    step = np.where(new, 0.0, np.diff(time))
    return time[0] + np.concatenate([[0.0], np.cumsum(step)]), np.flatnonzero(new) + 1
