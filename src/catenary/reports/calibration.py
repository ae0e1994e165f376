"""The page about a calibration: errors before and after, per joint, and the model's card."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from catenary.calibration.choice import JointChoice
from catenary.calibration.evaluate import Evaluation, Spread
from catenary.calibration.model import CalibrationModel, Card
from catenary.files import json_text
from catenary.reports.intervals import coverage_blocks
from catenary.reports.joint_picture import joint_picture
from catenary.reports.page import Block, Facts, Heading, Listing, Remarks, Table, Text, write_page


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
    opening: Sequence[Block] = (),
    further: Sequence[Block] = (),
) -> None:
    """Write the page about a calibration, one self-contained file.

    Args:
        path: The HTML file.
        model: The model.
        card: Its card.
        evaluation: Its errors.
        tested_on: Which data these are, in words.
        spread: Errors of a cross-validation, if there was one.
        notes: What a reader must know about the data.
        comparison: Header and rows of a table of several models, to open the page with.
        opening: What else to open the page with.
        further: What else to say before the model's card.
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
        *([Remarks(notes)] if notes else []),
        *coverage_blocks(evaluation),
    ]
    if comparison is not None:
        blocks[:0] = [Heading("Every model"), Table(*comparison)]
    blocks[:0] = opening
    for j, name in enumerate(model.joint_names):
        blocks += [Heading(f"Joint {name}"), joint_picture(evaluation, model, j)]
    blocks += [Heading("RMSE of the model over time"), window_table(evaluation)]
    if spread:
        blocks += [Heading("Cross-validation over blocks of time"), spread_table(spread)]
    blocks += [
        *further,
        Heading("The model"),
        Facts(card_facts(card)),
        Listing("The whole card", json_text(card)),
    ]
    title = f"Calibration of {card.get('robot') or 'an arm'}: {model_name(model)}"
    lead = f"Tested on {tested_on}: {len(evaluation.data):,} rows."
    write_page(path, title, lead, blocks, simulated=simulated)


def model_name(model: CalibrationModel) -> str:
    """Return a model's kind, preset and memory in words."""
    name = model.kind if model.preset is None else f"{model.kind}, preset {model.preset}"
    if model.features.history:
        name += f", {model.features.history} previous commands"
    if model.features.play:
        name += ", play states"
    return name


def error_table(evaluation: Evaluation) -> Table:
    """Return RMSE and maximum per joint: raw, after the fixed offset and after the model."""
    rows = []
    for j in evaluation.joints:
        errors = [f"{value:.3f}" for value in (j.raw_rmse, j.offset_rmse, j.rmse)]
        largest = [f"{value:.2f}" for value in (j.raw_max, j.max)]
        outside = f"{100.0 * j.outside_valid_range:.1f} %"
        rows.append([j.name, j.unit, *errors, percent(j.percent_of_offset, 1), *largest, outside])
    header = ["joint", "unit", "raw", "offset", "model", "of offset", "raw max", "model max", "outside"]
    return Table(header, rows)


def percent(value: float, digits: int) -> str:
    """Return a percentage as text; a dash for NaN, a percentage of nothing."""
    return f"{value:.{digits}f} %" if np.isfinite(value) else "-"


def window_table(evaluation: Evaluation) -> Table:
    """Return the RMSE after the model per window of time."""
    unit = evaluation.window_unit
    names = [f"{j.name} [{j.unit}]" for j in evaluation.joints]
    header = ["recording", f"from [{unit}]", f"to [{unit}]", "rows", *names]
    rows = [
        [w.recording, f"{w.start:.0f}", f"{w.end:.0f}", str(w.n), *(f"{value:.3f}" for value in w.rmse)]
        for w in evaluation.windows
    ]
    return Table(header, rows)


def spread_table(spread: Sequence[Spread]) -> Table:
    """Return mean and standard deviation of the RMSE over the blocks of a cross-validation."""
    rows = []
    for s in spread:
        offset = f"{s.offset_rmse_mean:.3f} ± {s.offset_rmse_sd:.3f}"
        rows.append([s.joint, s.unit, str(s.folds), offset, f"{s.rmse_mean:.3f} ± {s.rmse_sd:.3f}"])
    return Table(["joint", "unit", "blocks", "offset RMSE", "model RMSE"], rows)


def card_facts(card: Card) -> list[tuple[str, str]]:
    """Return the card's main lines."""
    data = ", ".join(f"{s['name']} ({s['rows']:,} rows, {_short(s['sha256'])})" for s in card["data"])
    version = ", ".join(f"{name} {number}" for name, number in card["version"].items())
    return [
        ("kind", card["kind"] + (f", preset {card['preset']}" if card["preset"] else "")),
        *(("chosen", str(JointChoice(**choice))) for choice in card.get("choice") or ()),
        ("target", f"joint {card['target']}"),
        ("inputs", shortened([entry["name"] for entry in card["inputs"]])),
        ("scaling", card["scaling"]),
        ("fitted to", f"{card['rows']:,} rows of {data}"),
        ("seed", str(card["run"]["seed"])),
        ("version", version),
    ]


def shortened(names: Sequence[str], most: int = 8) -> str:
    """Return the first names of a list, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def _short(digest: str | None) -> str:
    return f"sha256 {digest[:12]}" if digest else "no hash"
