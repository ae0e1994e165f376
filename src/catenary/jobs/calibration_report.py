"""The page about a calibration: errors before and after, per joint, and the model's card."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catenary import __version__
from catenary.calibration.card import Card
from catenary.calibration.evaluate import DISPLAY, Evaluation, Spread
from catenary.calibration.model import CalibrationModel
from catenary.page import Block, Heading, Listing, Picture, Table, Text, picture, write_page

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RAW, OFFSET, MODEL = "#b8c0cc", "#4b6b94", "#d9622b"
MOST_POINTS = 20_000  # drawn per line; longer recordings are thinned


def write_calibration_report(
    path: Path,
    model: CalibrationModel,
    card: Card,
    evaluation: Evaluation,
    *,
    tested_on: str,
    spread: Sequence[Spread] = (),
    notes: Sequence[str] = (),
    comparison: tuple[Sequence[str], Sequence[Sequence[str]]] | None = None,
) -> None:
    """Write one self-contained page.

    Args:
        path: The HTML file.
        model: The model.
        card: Its card.
        evaluation: Its errors.
        tested_on: Which data these are, in words.
        spread: Errors of a cross-validation, if there was one.
        notes: What a reader must know about the data.
        comparison: Header and rows of a table of several models, to open the page with.
    """
    simulated = bool(card["simulated"]) or any(s.simulated for s in evaluation.data.sources)
    blocks: list[Block] = [
        Heading("Error per joint"),
        error_table(evaluation),
        Text(
            "RMSE raw, after the fixed offset (the mean error of the training data) and after the model; per cent of "
            "the fixed offset's, as in Peng et al., table I; largest error raw and after the model; share of rows "
            "outside the model's valid range, where it falls back to the fixed offset."
        ),
        *(Text(note) for note in notes),
    ]
    if comparison is not None:
        blocks[:0] = [Heading("Every model"), Table(*comparison)]
    for j, name in enumerate(model.joint_names):
        blocks += [Heading(f"Joint {name}"), joint_picture(evaluation, model, j)]
    blocks += [Heading("RMSE of the model over time"), window_table(evaluation)]
    if spread:
        blocks += [Heading("Cross-validation over blocks of time"), spread_table(spread)]
    blocks += [
        Heading("The model"),
        Table(["", ""], card_rows(card)),
        Listing("The whole card", json.dumps(card, indent=2, ensure_ascii=False)),
    ]
    robot = card.get("robot") or "an arm"
    write_page(
        path,
        f"Calibration of {robot}: {model_name(model)}",
        f"Tested on {tested_on}: {len(evaluation.data):,} rows.",
        blocks,
        footer=f"catenary {__version__}",
        simulated=simulated,
    )


def model_name(model: CalibrationModel) -> str:
    """Kind, preset and memory of a model, in words."""
    name = model.kind if model.preset is None else f"{model.kind}, preset {model.preset}"
    if model.features.history:
        name += f", {model.features.history} previous commands"
    if model.features.play:
        name += ", play states"
    return name


def error_table(evaluation: Evaluation) -> Table:
    """RMSE and maximum per joint, raw, after the fixed offset and after the model."""
    return Table(
        ["joint", "unit", "raw", "offset", "model", "of offset", "raw max", "max", "outside"],
        [
            [
                j.name,
                j.unit,
                f"{j.raw_rmse:.3f}",
                f"{j.offset_rmse:.3f}",
                f"{j.rmse:.3f}",
                f"{j.percent_of_offset:.1f} %",
                f"{j.raw_max:.2f}",
                f"{j.max:.2f}",
                f"{100.0 * j.outside_valid_range:.1f} %",
            ]
            for j in evaluation.joints
        ],
    )


def window_table(evaluation: Evaluation) -> Table:
    """RMSE after the model per window of time."""
    unit = evaluation.window_unit
    names = [f"{j.name} [{j.unit}]" for j in evaluation.joints]
    return Table(
        ["recording", f"from [{unit}]", f"to [{unit}]", "rows", *names],
        [
            [
                w.recording,
                f"{w.start:.0f}",
                f"{w.end:.0f}",
                str(w.n),
                *(f"{value:.3f}" for value in w.rmse),
            ]
            for w in evaluation.windows
        ],
    )


def spread_table(spread: Sequence[Spread]) -> Table:
    """Mean and standard deviation over the blocks."""
    return Table(
        ["joint", "unit", "blocks", "offset RMSE", "model RMSE"],
        [
            [
                s.joint,
                s.unit,
                str(s.folds),
                f"{s.offset_rmse_mean:.3f} ± {s.offset_rmse_sd:.3f}",
                f"{s.rmse_mean:.3f} ± {s.rmse_sd:.3f}",
            ]
            for s in spread
        ],
    )


def card_rows(card: Card) -> list[list[str]]:
    """The card's main lines."""
    data = ", ".join(f"{s['name']} ({s['rows']:,} rows, {_short(s['sha256'])})" for s in card["data"])
    inputs = [entry["name"] for entry in card["inputs"]]
    shown = ", ".join(inputs[:8]) + (f" and {len(inputs) - 8} more" if len(inputs) > 8 else "")
    version = ", ".join(f"{name} {number}" for name, number in card["version"].items())
    return [
        ["kind", card["kind"] + (f", preset {card['preset']}" if card["preset"] else "")],
        ["target", card["target"]],
        ["inputs", shown],
        ["scaling", card["scaling"]],
        ["fitted to", f"{card['rows']:,} rows of {data}"],
        ["seed", str(card["run"]["seed"])],
        ["version", version],
    ]


def joint_picture(evaluation: Evaluation, model: CalibrationModel, j: int) -> Picture:
    """Error of one joint over time and as histograms: raw, after the fixed offset, after the model."""
    from matplotlib.figure import Figure

    unit, scale = DISPLAY[model.joint_units[j]]
    step = max(1, len(evaluation.data) // MOST_POINTS)
    x, gaps = _running_time(evaluation)
    series = [
        ("raw", RAW, 0.8, scale * evaluation.raw[:, j]),
        ("fixed offset", OFFSET, 0.6, scale * evaluation.after_offset[:, j]),
        (model.kind, MODEL, 0.9, scale * evaluation.after_model[:, j]),
    ]
    figure = Figure(figsize=(10, 3.1), layout="constrained")
    over_time, histogram = figure.subplots(1, 2, width_ratios=[2.6, 1])
    for label, color, width, values in series:
        line = values[::step].copy()
        line[np.isin(np.arange(0, len(values), step), gaps)] = np.nan
        over_time.plot(x[::step], line, color=color, linewidth=width, label=label)
    over_time.set_xlabel("time [s]" if evaluation.window_unit == "s" else "row")
    over_time.set_ylabel(f"error of {model.joint_names[j]} [{unit}]")
    over_time.margins(x=0.01)
    _draw_histograms(histogram, series[1:], unit)
    handles, labels = over_time.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=3, frameon=False, fontsize=9)
    for axes in (over_time, histogram):
        axes.axhline(0.0, color="#1c2430", linewidth=0.6) if axes is over_time else None
        axes.spines[["top", "right"]].set_visible(False)
    joint = evaluation.joints[j]
    return picture(
        figure,
        f"{joint.name}: RMSE {joint.raw_rmse:.3f} {unit} raw, {joint.offset_rmse:.3f} {unit} after the fixed "
        f"offset, {joint.rmse:.3f} {unit} after the model.",
    )


def _draw_histograms(axes: "Axes", series: Sequence[tuple[str, str, float, np.ndarray]], unit: str) -> None:
    widest = max(float(np.quantile(np.abs(values), 0.995)) for _, _, _, values in series)
    edges = np.linspace(-widest, widest, 61).tolist() if widest > 0.0 else 10
    for _, color, _, values in series:
        axes.hist(values, bins=edges, color=color, alpha=0.65)
    axes.set_xlabel(f"error [{unit}]")
    axes.set_ylabel("rows")


def _running_time(evaluation: Evaluation) -> tuple[np.ndarray, np.ndarray]:
    """Time that keeps rising where recordings follow each other, and the rows where a line must break."""
    time = evaluation.data.time
    step = np.diff(time)
    new = (np.diff(evaluation.data.recording) != 0) | (step < 0.0)
    step = np.where(new, 0.0, step)
    return np.concatenate([[0.0], np.cumsum(step)]), np.flatnonzero(new) + 1


def _short(digest: str | None) -> str:
    return f"sha256 {digest[:12]}" if digest else "no hash"
