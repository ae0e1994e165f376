"""A page on a refresh: what became of each joint, what that promises of the rest of the day, and errors in time."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from catenary.calibration.dataset import CalibrationData
from catenary.calibration.model_refresh import JointChange, Refreshed
from catenary.reports.joint_errors import in_units
from catenary.reports.page import (
    Block,
    Heading,
    Picture,
    Remarks,
    Table,
    TableColumn,
    Text,
    joint_panels,
    picture,
    write_page,
)
from catenary.units import DISPLAY

BEFORE, AFTER, PROMISED = "#b8c0cc", "#4b6b94", "#d9622b"
PROMISE = "promised: between what the RMSE of other minutes of this day lies, of motion like these, 19 times of 20"


def refresh_table(changes: Sequence[JointChange], rows: int) -> Table:
    """Return a row for each joint: what moved, its error before and after, and what is promised."""
    unit = in_units(change.unit for change in changes)
    columns = [
        TableColumn("joint", "name"),
        TableColumn("unit", "unit"),
        TableColumn("change", "change"),
        TableColumn(f"moved {unit}", "moved", "+.3f"),
        TableColumn(f"RMSE before {unit}", "rmse_before", ".3f"),
        TableColumn(f"on blocks after {unit}", "rmse_after", ".3f"),
        TableColumn(f"promised {unit}", lambda change: f"{change.rmse_low:.3f} to {change.rmse_high:.3f}"),
    ]
    return Table(columns, changes, f"What became of each joint, on {rows:,} new rows")


def write_refresh_report(
    path: Path, refreshed: Refreshed, data: CalibrationData, *, model: str, moved: str, notes: Sequence[str] = ()
) -> None:
    """Write what moved, the table, and a picture of each joint's error before and after."""
    blocks: list[Block] = [
        *([Remarks(list(notes))] if notes else []),
        Heading("What became of each joint"),
        refresh_table(refreshed.changes, len(data)),
        Text(f"{PROMISE[0].upper()}{PROMISE[1:]}. Rows after are each of a fit that did not see their block of time."),
        Heading("Errors on the new rows"),
        refresh_picture(refreshed, data),
    ]
    sources = ", ".join(source.name for source in data.sources)
    write_page(path, f"Refresh of {model}", f"Moved: {moved}. With {len(data):,} rows of {sources}.", blocks)


def refresh_picture(refreshed: Refreshed, data: CalibrationData) -> Picture:
    """Draw each joint's error before the refresh, and after it on blocks that were not fitted to."""
    row = np.arange(len(data))
    figure, panels = joint_panels(len(refreshed.changes), 1.7, spare=0.8)
    for j, (axes,) in enumerate(panels):
        change = refreshed.changes[j]
        scale = DISPLAY[data.joint_units[j]][1]
        axes.plot(row, scale * refreshed.before[:, j], color=BEFORE, linewidth=1.0, label="before")
        axes.plot(row, scale * refreshed.left[:, j], color=AFTER, linewidth=1.0, label="after, on blocks")
        for side, label in ((1.0, "promised RMSE"), (-1.0, None)):
            axes.axhline(side * change.rmse_high, color=PROMISED, linewidth=1.2, linestyle="--", label=label)
        axes.set_ylabel(f"{change.name} [{change.unit}]")
    axes.set_xlabel("row")
    axes.set_xlim(0, max(1, len(data) - 1))
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper right", ncols=3, frameon=False)
    return picture(figure, "Errors of the corrected positions; dashed: the promised RMSE at its largest, both ways.")
