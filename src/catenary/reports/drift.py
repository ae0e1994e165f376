"""A page on a model's error over days and homings, and since when it no longer holds."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from catenary.calibration.model_drift import CardStretch, DriftFound, Stretch, since_in_words
from catenary.reports.page import (
    Block,
    Heading,
    Picture,
    Remarks,
    Table,
    TableColumn,
    Text,
    joint_columns,
    joint_panels,
    picture,
    write_page,
)
from catenary.units import DISPLAY

HOLDS, BEYOND = "#4b6b94", "#d9622b"
MOST_LABELS = 12  # below a picture


def drift_tables(found: DriftFound) -> list[Table]:
    """Return a row for each stretch between homings, or each card: RMSE of every joint, ! where it is beyond."""
    joints = [(n, DISPLAY[u][0]) for n, u in zip(found.joint_names, found.joint_units, strict=True)]
    errors = joint_columns(joints, lambda s, j: f"{s.rmse[j]:.3f}{' !' if s.beyond[j] else ''}", "")
    if any(isinstance(stretch, CardStretch) for stretch in found.stretches):
        card = [TableColumn("card", "recording"), *(TableColumn(name, name) for name in ("date", "instrument", "tool"))]
        delay, title = TableColumn("delay [s]", "delay", "+.3f"), "RMSE on data that each model did not see; ! beyond"
        zeros = joint_columns(joints, lambda s, j: s.zeros[j], "+.3f")
        return [
            Table([*card, delay, *errors], found.stretches, title),
            Table([*card[:2], *zeros], found.stretches, "Zeros: what is added to each joint"),
        ]
    first = [TableColumn(name, name) for name in ("recording", "homing", "date", "rows")]
    return [Table([*first, *errors], found.stretches, "RMSE between homings; ! beyond")]


def write_drift_report(path: Path, found: DriftFound, *, model: str, notes: Sequence[str] = ()) -> None:
    """Write the verdict, a picture of the error over days and homings, and the table."""
    told = since_in_words(found)
    first, last = found.stretches[0], found.stretches[-1]
    lead = f"{'; '.join(told)}." if told else f"{model} holds on the last of {len(found.stretches)} stretches."
    blocks: list[Block] = [
        Text(f"From {_place(first)} to {_place(last)}. Beyond means: {found.judged_by}."),
        *([Remarks(list(notes))] if notes else []),
        Heading("Error over days and homings"),
        drift_picture(found),
        Heading("Numbers"),
        *drift_tables(found),
        Text("! beyond. A recording is cut where the encoders' offsets change, and where its clock goes back."),
    ]
    write_page(path, f"Drift of {model}", lead, blocks)


def drift_picture(found: DriftFound) -> Picture:
    """Draw the RMSE of every joint, stretch after stretch, those beyond in another colour and shape."""
    number = np.arange(len(found.stretches))
    figure, panels = joint_panels(len(found.joint_names), 1.7, spare=1.0)
    for j, (axes,) in enumerate(panels):
        rmse = np.array([stretch.rmse[j] for stretch in found.stretches])
        beyond = np.array([stretch.beyond[j] for stretch in found.stretches])
        axes.plot(number, rmse, color="#b8c0cc", linewidth=1.0, zorder=1)
        axes.scatter(number[~beyond], rmse[~beyond], color=HOLDS, marker="o", label="holds", zorder=2)
        axes.scatter(number[beyond], rmse[beyond], color=BEYOND, marker="X", label="beyond", zorder=2)
        since = found.since[j]
        if since is not None:
            axes.axvspan(since - 0.5, len(number) - 0.5, color=BEYOND, alpha=0.1, linewidth=0.0)
        axes.set_ylim(bottom=0.0)
        axes.set_ylabel(f"{found.joint_names[j]} [{DISPLAY[found.joint_units[j]][0]}]")
    shown = number[:: max(1, -(-len(number) // MOST_LABELS))]
    labels = [_place(found.stretches[k]) for k in shown]
    axes.set_xticks(shown, labels, rotation=30, ha="right", fontsize=8)
    axes.set_xlim(-0.5, len(number) - 0.5)
    handles = {label: handle for axes in panels.flat for handle, label in zip(*axes.get_legend_handles_labels())}  # noqa: B905
    figure.legend(handles.values(), handles.keys(), loc="outside upper right", ncols=2, frameon=False)
    return picture(figure, "RMSE of the corrected positions; shaded: the model is beyond from there to the end.")


def _place(stretch: Stretch) -> str:
    day = stretch.date or stretch.recording
    return f"{day}, homing {stretch.homing}" if stretch.homing else day
