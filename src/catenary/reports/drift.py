"""Reports of a model over days: drift of its error and the first failure; refresh of each joint."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from catenary.calibration.dataset import CalibrationData
from catenary.calibration.model_drift import CardStretch, DriftFound, Stretch, since_in_words
from catenary.calibration.model_refresh import JointChange, Refreshed
from catenary.reports import page
from catenary.tables import Column, Table, in_units, joint_columns
from catenary.units import DISPLAY

_MAX_LABELS = 12  # below a picture


def drift_tables(drift: DriftFound) -> list[Table]:
    """Return tables with a row for each stretch between homings, or each card: RMSE per joint, ! beyond the limit."""
    joints = _joints(drift)
    errors = joint_columns(joints, lambda s, j: f"{s.rmse[j]:.3f}{' !' if s.beyond[j] else ''}", "")
    if any(isinstance(stretch, CardStretch) for stretch in drift.stretches):
        card: list[Column] = [("card", "recording"), "date", "instrument", "tool", ("delay [s]", "delay:+.3f")]
        zeros = joint_columns(joints, lambda s, j: s.zeros[j], "+.3f")
        return [
            Table([*card, *errors], drift.stretches, "RMSE on data that each model did not see; ! beyond"),
            Table([*card[:2], *zeros], drift.stretches, "Zeros, added to each joint"),
        ]
    return [Table(["recording", "homing", "date", "rows", *errors], drift.stretches, "RMSE between homings; ! beyond")]


def write_drift_report(path: Path, drift: DriftFound, *, model: str, notes: Sequence[str] = ()) -> None:
    """Write the drift report: verdict, plot of the error over days and homings, table.

    Args:
        drift: Errors between homings, and the first stretch beyond the limit of each joint.
    """
    failures = since_in_words(drift)
    first, last = drift.stretches[0], drift.stretches[-1]
    lead = f"{'; '.join(failures)}." if failures else f"{model} holds on the last of {len(drift.stretches)} stretches."
    blocks: list[page.Block] = [
        page.Text(f"From {_place(first)} to {_place(last)}. Beyond means: {drift.judged_by}."),
        *([page.Remarks(list(notes))] if notes else []),
        page.Heading("Error over days and homings"),
        drift_picture(drift),
        page.Heading("Numbers"),
        *drift_tables(drift),
        page.Text("! beyond. A recording is split where the encoders' offsets change, and where its clock goes back."),
    ]
    page.write_page(path, f"Drift of {model}", lead, blocks)


def drift_picture(drift: DriftFound) -> page.Picture:
    """Plot the RMSE of every joint over the stretches, those beyond the limit in another colour and shape."""
    number = np.arange(len(drift.stretches))
    figure, panels = page.joint_panels(_joints(drift), 1.7, spare=1.0)
    for j, (axes,) in enumerate(panels):
        rmse = np.array([stretch.rmse[j] for stretch in drift.stretches])
        beyond = np.array([stretch.beyond[j] for stretch in drift.stretches])
        axes.plot(number, rmse, color=page.GREY, linewidth=1.0, zorder=1)
        axes.scatter(number[~beyond], rmse[~beyond], color=page.BLUE, marker="o", label="holds", zorder=2)
        axes.scatter(number[beyond], rmse[beyond], color=page.ORANGE, marker="X", label="beyond", zorder=2)
        since = drift.since[j]
        if since is not None:
            axes.axvspan(since - 0.5, len(number) - 0.5, color=page.ORANGE, alpha=0.1, linewidth=0.0)
        axes.set_ylim(bottom=0.0)
    shown = number[:: max(1, -(-len(number) // _MAX_LABELS))]
    labels = [_place(drift.stretches[k]) for k in shown]
    axes.set_xticks(shown, labels, rotation=30, ha="right", fontsize=8)
    axes.set_xlim(-0.5, len(number) - 0.5)
    handles = {label: handle for axes in panels.flat for handle, label in zip(*axes.get_legend_handles_labels())}  # noqa: B905
    figure.legend(handles.values(), handles.keys(), loc="outside upper right", ncols=2, frameon=False)
    return page.picture(figure, "RMSE of the corrected positions; shaded: the model is beyond from there to the end.")


def _joints(drift: DriftFound) -> list[tuple[str, str]]:
    return [(name, DISPLAY[unit][0]) for name, unit in zip(drift.joint_names, drift.joint_units, strict=True)]


def _place(stretch: Stretch) -> str:
    day = stretch.date or stretch.recording
    return f"{day}, homing {stretch.homing}" if stretch.homing else day


PROMISE = "promised: 95 % interval of the RMSE over other minutes of this day with similar motion"


def refresh_table(changes: Sequence[JointChange], rows: int) -> Table:
    """Return a table with a row for each joint: its change, its error before and after, and the promised error.

    Args:
        rows: Number of new rows.
    """
    unit = in_units(change.unit for change in changes)
    columns: list[Column] = [
        ("joint", "name"), "unit", "change", (f"moved {unit}", "moved:+.3f"),
        (f"RMSE before {unit}", "rmse_before:.3f"), (f"on blocks after {unit}", "rmse_after:.3f"),
        (f"promised {unit}", lambda change: f"{change.rmse_low:.3f} to {change.rmse_high:.3f}"),
    ]  # fmt: skip
    return Table(columns, changes, f"Refresh of each joint, on {rows:,} new rows")


def write_refresh_report(
    path: Path, refreshed: Refreshed, data: CalibrationData, *, model: str, moved: str, notes: Sequence[str] = ()
) -> None:
    """Write the report of a refresh: table, and plots of each joint's error before and after.

    Args:
        moved: Summary of the changes.
    """
    blocks: list[page.Block] = [
        *([page.Remarks(list(notes))] if notes else []),
        page.Heading("Refresh of each joint"),
        refresh_table(refreshed.changes, len(data)),
        page.Text(f"{PROMISE[0].upper()}{PROMISE[1:]}. Errors after are cross-validated over blocks of time."),
        page.Heading("Errors on the new rows"),
        refresh_picture(refreshed, data),
    ]
    sources = ", ".join(source.name for source in data.sources)
    page.write_page(path, f"Refresh of {model}", f"Moved: {moved}. With {len(data):,} rows of {sources}.", blocks)


def refresh_picture(refreshed: Refreshed, data: CalibrationData) -> page.Picture:
    """Plot each joint's error before the refresh, and the cross-validated error after it."""
    row = np.arange(len(data))
    joints = [(change.name, change.unit) for change in refreshed.changes]
    figure, panels = page.joint_panels(joints, 1.7, spare=0.8)
    for j, (axes,) in enumerate(panels):
        change = refreshed.changes[j]
        scale = DISPLAY[data.joint_units[j]][1]
        axes.plot(row, scale * refreshed.before[:, j], color=page.GREY, linewidth=1.0, label="before")
        axes.plot(row, scale * refreshed.left[:, j], color=page.BLUE, linewidth=1.0, label="after, on blocks")
        for side, label in ((1.0, "promised RMSE"), (-1.0, None)):
            axes.axhline(side * change.rmse_high, color=page.ORANGE, linewidth=1.2, linestyle="--", label=label)
    axes.set_xlabel("row")
    axes.set_xlim(0, max(1, len(data) - 1))
    figure.legend(*axes.get_legend_handles_labels(), loc="outside upper right", ncols=3, frameon=False)
    return page.picture(figure, "Errors of the corrected positions; dashed: +- the largest promised RMSE.")
