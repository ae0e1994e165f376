"""Reports of gravity compensation: tracking errors, and drift of held joints; tables and plots."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from catenary.control.loop_report import Holding, Tracking
from catenary.reports import page
from catenary.tables import Column, Table
from catenary.units import DISPLAY, TORQUE_UNIT

_MAX_POINTS = 4_000  # in a line
_MIN_REACH = 0.01  # [deg|mm] half the range of a drift plot
# title, lead, explanation of table and plot
_TRACKING = (
    "Tracking with controller {controller}",
    "Joint errors, and the PD term's share of the torque, as in Lewis and Hannaford 2014.",
    "Errors are desired minus reported joint positions, at the motors. PD share: RMS of the PD term over "
    "RMS of the whole torque; near 0 % where the model is right, beyond 100 % where the PD fights it.",
)
_HOLDING = (
    "Held by controller {controller}",
    "Gravity compensation alone, as in Lewis and Hannaford 2014: the drift of each joint.",
    "Drift is the largest distance from the start: of the joint itself, then as the robot reports it at its motor. "
    "Report off by: the largest difference of both; gravity is computed from the reported position. At the end: final "
    "position relative to the start.",
)


def gravity_table(result: Tracking | Holding, title: str = "") -> Table:
    """Return a table with a row per joint: RMS error, PD term and torque of tracking, or drift of holding.

    Args:
        result: Of tracking or holding; its units become deg or mm, and Nm or N.
    """

    def of(heading: str, key: str, form: str, unit: str = "unit") -> Column:
        return heading, lambda joint: f"{joint[key]:{form}} {joint[unit]}"

    joints = result.as_data()["joints"]
    if isinstance(result, Holding):
        keys = {"drift": "drift", "as reported": "reported_drift", "report off by": "reported_off"}
        columns = [*(of(heading, key, ".4f") for heading, key in keys.items()), of("at the end", "moved", "+.4f")]
    else:
        share = dict(zip(result.joint_names, 100.0 * result.pd_share, strict=True))
        columns = [
            of("RMS error", "rms_error", ".4f"),
            of("RMS PD term", "rms_pd", ".3f", "torque_unit"),
            of("RMS torque", "rms_torque", ".3f", "torque_unit"),
            ("PD share", lambda joint: f"{share[joint['name']]:.1f} %"),
        ]
    return Table([("joint", "name"), *columns], joints, title)


def write_gravity_report(
    path: Path, result: Tracking | Holding, settings: Mapping[str, Any], *, arm: page.Picture | None = None
) -> None:
    """Write the report of a tracking or holding experiment: table, plot over time, settings.

    Args:
        settings: By name, including "controller".
    """
    title, lead, text = _HOLDING if isinstance(result, Holding) else _TRACKING
    drawn = holding_picture(result) if isinstance(result, Holding) else tracking_picture(result)
    pictured: list[page.Block] = [] if arm is None else [page.Heading("The arm"), arm]
    blocks: list[page.Block] = [
        gravity_table(result),
        drawn,
        page.Text(text),
        *pictured,
        page.Heading("Settings"),
        page.settings_facts(settings),
    ]
    page.write_page(path, title.format(**settings), lead, blocks, simulated=True)


def holding_picture(result: Holding) -> page.Picture:
    """Plot the distance of every joint from its start over time, true and as reported."""
    figure, rows, shown = _per_joint(result, columns=1)
    t = result.time[shown]
    for j, (axes,) in enumerate(rows):
        scale = DISPLAY[result.joint_units[j]][1]
        for q, color, label in ((result.q, page.GREY, "as reported"), (result.q_true, page.BLUE, "joint")):
            axes.plot(t, scale * (q[shown, j] - q[0, j]), color=color, linewidth=1.2, label=label)
        low, high = axes.get_ylim()
        # a minimum range, so that rounding does not look like drift
        axes.set_ylim(min(low, -_MIN_REACH), max(high, _MIN_REACH))
    rows[0][0].legend(frameon=False, fontsize=8, ncols=2)
    return page.picture(figure, "Distance of every joint from its start.")


def tracking_picture(result: Tracking) -> page.Picture:
    """Plot the error, and the torque with the PD term, of every joint over time."""
    figure, rows, shown = _per_joint(result, columns=2)
    t = result.time[shown]
    for j, (left, right) in enumerate(rows):
        scale = DISPLAY[result.joint_units[j]][1]
        left.plot(t, scale * result.error[shown, j], color=page.BLUE, linewidth=0.8)
        right.plot(t, result.torque[shown, j], color=page.GREY, linewidth=1.2, label="torque")
        right.plot(t, result.feedback[shown, j], color=page.ORANGE, linewidth=0.8, label="PD term")
        right.set_ylabel(f"[{TORQUE_UNIT[result.joint_units[j]]}]")
    rows[0][1].legend(frameon=False, fontsize=8, ncols=2)
    return page.picture(figure, "Error of every joint, and its torque with the PD term's part.")


def _per_joint(result: Tracking | Holding, *, columns: int) -> tuple[Any, Any, slice]:
    """Return a figure, a row of axes over time for every joint, and the ticks to draw."""
    joints = [(name, DISPLAY[unit][0]) for name, unit in zip(result.joint_names, result.joint_units, strict=True)]
    figure, rows = page.joint_panels(joints, 1.9, columns)
    for axes in rows.flat:
        axes.margins(x=0.01)
    for axes in rows[-1]:
        axes.set_xlabel("time [s]")
    return figure, rows, slice(None, None, max(1, len(result.time) // _MAX_POINTS))
