"""Tables of a calibration's errors: per joint, over time, over blocks of time."""

from collections.abc import Iterable, Sequence

import numpy as np

from catenary.calibration.evaluate import Evaluation, Spread
from catenary.reports.page import Block, Heading, Table, Text
from catenary.units import DISPLAY
from catenary.verdict.pairs import OUTLIER_SPREADS, outliers

MOST_WINDOWS = 200  # rows of a page's table
MOST_COLUMNS = 8  # joints side by side on a page


def in_units(units: Iterable[str]) -> str:
    """Return the units of a column: [deg], [mm], or [deg|mm] where each row names its own."""
    return f"[{'|'.join(sorted(set(units)))}]"


def error_table(evaluation: Evaluation, name: str = "model") -> Table:
    """Return RMSE per joint raw, after the fixed offset and after the model, and the share outside its valid range."""
    unit = in_units(joint.unit for joint in evaluation.joints)
    rows = [
        [
            j.name,
            j.unit,
            *(f"{value:.3f}" for value in (j.raw_rmse, j.offset_rmse, j.rmse)),
            percent(j.percent_of_offset, 1),
            *(f"{value:.2f}" for value in (j.raw_max, j.max)),
            f"{100.0 * j.outside_valid_range:.1f} %",
        ]
        for j in evaluation.joints
    ]
    errors = [f"{kind} {unit}" for kind in ("raw RMSE", "fixed offset RMSE", f"{name} RMSE")]
    largest = [f"{kind} {unit}" for kind in ("largest raw", f"largest {name}")]
    return Table(["joint", "unit", *errors, "of fixed offset [%]", *largest, "outside [% of rows]"], rows)


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
        Heading("Bias, spread and outliers"),
        bias_table(evaluation, name),
        Text(
            "Bias: the mean error, that a new zero would take away. Spread: its standard deviation, that a zero "
            "cannot; RMSE² = bias² + spread². Outliers: rows whose error lies more than "
            f"{OUTLIER_SPREADS:g} robust standard deviations (1.4826 times the median absolute deviation) from the "
            "median, likely measurement failures; they count in every number here."
        ),
    ]


def bias_table(evaluation: Evaluation, name: str = "model") -> Table:
    """Return bias, spread and outliers of the errors per joint, raw and after the model."""
    scale = np.array([DISPLAY[unit][1] for unit in evaluation.data.joint_units])
    found = []
    for errors in (scale * evaluation.raw, scale * evaluation.after_model):
        counts, _ = outliers(errors)
        found.append((errors.mean(axis=0), errors.std(axis=0), counts))
    rows = []
    for j, joint in enumerate(evaluation.joints):
        cells = [text for mean, sd, _ in found for text in (f"{mean[j]:+.3f}", f"{sd[j]:.3f}")]
        rows.append([joint.name, joint.unit, *cells, *(f"{counts[j]:,}" for _, _, counts in found)])
    unit = in_units(joint.unit for joint in evaluation.joints)
    header = [f"{what} {kind} {unit}" for kind in ("raw", name) for what in ("bias", "spread")]
    return Table(["joint", "unit", *header, *(f"outliers {kind} [rows]" for kind in ("raw", name))], rows)


def percent(value: float, digits: int) -> str:
    """Return a percentage as text; a dash for NaN, a percentage of nothing."""
    return f"{value:.{digits}f} %" if np.isfinite(value) else "-"


def window_table(evaluation: Evaluation) -> Table:
    """Return the RMSE after the model per window of time."""
    return _windows(evaluation, range(len(evaluation.joints)), len(evaluation.windows))


def window_blocks(evaluation: Evaluation, name: str) -> list[Block]:
    """Return what a page says of the errors over time: tables of so many joints that a sheet of paper holds them."""
    joints = range(len(evaluation.joints))
    found: list[Block] = [
        Heading(f"RMSE of {name} over time"),
        *(_windows(evaluation, joints[k : k + MOST_COLUMNS], MOST_WINDOWS) for k in joints[::MOST_COLUMNS]),
    ]
    if len(evaluation.windows) > MOST_WINDOWS:
        found.append(Text(f"The first {MOST_WINDOWS} of {len(evaluation.windows):,} windows."))
    return found


def _windows(evaluation: Evaluation, joints: Sequence[int], most: int) -> Table:
    unit = evaluation.window_unit
    names = [f"{evaluation.joints[j].name} [{evaluation.joints[j].unit}]" for j in joints]
    rows = [
        [w.recording, f"{w.start:.0f}", f"{w.end:.0f}", str(w.n), *(f"{w.rmse[j]:.3f}" for j in joints)]
        for w in evaluation.windows[:most]
    ]
    return Table(["recording", f"from [{unit}]", f"to [{unit}]", "rows", *names], rows)


def spread_table(spread: Sequence[Spread], name: str = "model") -> Table:
    """Return mean and standard deviation of the RMSE over the blocks of a cross-validation."""
    unit = in_units(s.unit for s in spread)
    rows = []
    for s in spread:
        offset = f"{s.offset_rmse_mean:.3f} ± {s.offset_rmse_sd:.3f}"
        rows.append([s.joint, s.unit, str(s.folds), offset, f"{s.rmse_mean:.3f} ± {s.rmse_sd:.3f}"])
    return Table(["joint", "unit", "blocks", f"fixed offset RMSE {unit}", f"{name} RMSE {unit}"], rows)
