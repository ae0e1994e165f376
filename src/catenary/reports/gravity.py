"""Tables and pages of tracking and holding under gravity."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from catenary.control.measures import Holding, Tracking
from catenary.reports.page import Block, Heading, Picture, Table, Text, picture, settings_facts, write_page
from catenary.units import DISPLAY, TORQUE_UNIT

ERROR, TORQUE, PD = "#4b6b94", "#b8c0cc", "#d9622b"
MOST_POINTS = 4_000  # in a line
LEAST_RANGE = 0.01  # [deg|mm] of a picture of drift, to either side


def tracking_table(result: Tracking) -> Table:
    """Return a table of RMS error, RMS of PD term and of torque, and PD share per joint."""
    rows = []
    for joint in result.as_data()["joints"]:
        share = joint["pd_share_percent"]
        rows.append(
            [
                joint["name"],
                f"{joint['rms_error']:.4f} {joint['unit']}",
                f"{joint['rms_pd']:.3f} {joint['torque_unit']}",
                f"{joint['rms_torque']:.3f} {joint['torque_unit']}",
                "-" if np.isnan(share) else f"{share:.1f} %",
            ]
        )
    return Table(["joint", "RMS error", "RMS PD term", "RMS torque", "PD share"], rows)


def holding_table(result: Holding) -> Table:
    """Return a table of each joint's drift, as it is and as reported at its motor."""
    rows = [
        [
            joint["name"],
            f"{joint['drift']:.4f} {joint['unit']}",
            f"{joint['reported_drift']:.4f} {joint['unit']}",
            f"{joint['moved']:+.4f} {joint['unit']}",
        ]
        for joint in result.as_data()["joints"]
    ]
    return Table(["joint", "drift", "as reported", "at the end"], rows)


def write_tracking_report(path: Path, result: Tracking, settings: Mapping[str, Any]) -> None:
    """Write a page with the table and a picture of errors and torques over time.

    Raises:
        FileFormatError: The file cannot be written.
    """
    text = Text(
        "Errors are desired minus reported joint positions, at the motors. PD share: RMS of the PD term over "
        "RMS of the whole torque; near 0 % where the model is right, beyond 100 % where the PD fights it."
    )
    blocks: list[Block] = [
        tracking_table(result),
        tracking_picture(result),
        text,
        Heading("Settings"),
        settings_facts(settings),
    ]
    lead = "Joint errors, and the PD term's share of the torque, as in Lewis and Hannaford 2014."
    write_page(path, f"Tracking with controller {settings['controller']}", lead, blocks, simulated=True)


def write_holding_report(path: Path, result: Holding, settings: Mapping[str, Any]) -> None:
    """Write a page with the table and a picture of every joint's drift over time.

    Raises:
        FileFormatError: The file cannot be written.
    """
    text = Text(
        "Drift is the largest distance from where a joint began: of the joint itself, then as the robot "
        "reports it at its motor. At the end: where it then was, seen from the start."
    )
    blocks: list[Block] = [
        holding_table(result),
        holding_picture(result),
        text,
        Heading("Settings"),
        settings_facts(settings),
    ]
    lead = "Gravity compensation alone, as in Lewis and Hannaford 2014: how far each joint drifts."
    write_page(path, f"Held by controller {settings['controller']}", lead, blocks, simulated=True)


def holding_picture(result: Holding) -> Picture:
    """Draw how far every joint is from where it began, over time, and as reported."""
    figure, rows, shown = _per_joint(result, columns=1)
    t = result.time[shown]
    for j, (axes,) in enumerate(rows):
        unit, scale = DISPLAY[result.joint_units[j]]
        for q, color, label in ((result.q, TORQUE, "as reported"), (result.q_true, ERROR, "joint")):
            axes.plot(t, scale * (q[shown, j] - q[0, j]), color=color, linewidth=1.2, label=label)
        low, high = axes.get_ylim()
        # rounding that fills a whole picture would look like a drift
        axes.set_ylim(min(low, -LEAST_RANGE), max(high, LEAST_RANGE))
        axes.set_ylabel(f"{result.joint_names[j]} [{unit}]")
    rows[0][0].legend(frameon=False, fontsize=8, ncols=2)
    return picture(figure, "Distance of every joint from where it began.")


def tracking_picture(result: Tracking) -> Picture:
    """Draw the error, and the torque with the PD term, of every joint over time."""
    figure, rows, shown = _per_joint(result, columns=2)
    t = result.time[shown]
    for j, (left, right) in enumerate(rows):
        unit, scale = DISPLAY[result.joint_units[j]]
        left.plot(t, scale * result.error[shown, j], color=ERROR, linewidth=0.8)
        left.set_ylabel(f"{result.joint_names[j]}: error [{unit}]")
        right.plot(t, result.torque[shown, j], color=TORQUE, linewidth=1.2, label="torque")
        right.plot(t, result.feedback[shown, j], color=PD, linewidth=0.8, label="PD term")
        right.set_ylabel(f"[{TORQUE_UNIT[result.joint_units[j]]}]")
    rows[0][1].legend(frameon=False, fontsize=8, ncols=2)
    return picture(figure, "Error of every joint, and its torque with the PD term's part.")


def _per_joint(result: Tracking | Holding, *, columns: int) -> tuple[Any, Any, slice]:
    """Return a figure, a row of axes over time for every joint, and which ticks to draw."""
    from matplotlib.figure import Figure

    n = len(result.joint_names)
    figure = Figure(figsize=(10, 1.9 * n), layout="constrained")
    rows = figure.subplots(n, columns, sharex=True, squeeze=False)
    for axes in rows.flat:
        axes.margins(x=0.01)
    for axes in rows[-1]:
        axes.set_xlabel("time [s]")
    return figure, rows, slice(None, None, max(1, len(result.time) // MOST_POINTS))
