"""A state as HTML: status, table of joints, gravity."""

from functools import partial
from html import escape

import numpy as np

from catenary.reports.page import Table, TableColumn
from catenary.units import DISPLAY
from catenary.view.curves import Plot
from catenary.view.shown import Shown
from catenary.view.state import ViewState

COLOURS = {"reported": "#3b6fb5", "calibrated": "#1f9d55", "true": "#a8a39a"}
GRAVITY_COLOURS = {"measured": "#7a4fbf", "assumed": "#6d747e"}


def status_html(state: ViewState) -> str:
    """Return what the robot does, and warnings."""
    lines = [f"<b>{escape(state.mode)}</b> &nbsp; {state.time:.1f} s" if state.mode else f"{state.time:.1f} s"]
    lines += [f'<span style="color:#c0392b">&#9888; {escape(warning)}</span>' for warning in state.warnings]
    if not state.warnings:
        lines.append('<span style="color:#1f9d55">no warnings</span>')
    return _block("<br>".join(lines))


def joints_table(shown: Shown, state: ViewState) -> Table:
    """Return a table of the joints [deg|mm]: reported, calibrated with its interval (? outside), true."""
    rows = {"reported": state.q, "calibrated": state.calibrated, "true": state.true}
    units = [DISPLAY[unit] for unit in shown.model.joint_units]

    def cell(name: str, j: int) -> str | None:
        scale = units[j][1]
        value, interval = scale * rows[name][j], scale * state.interval[j]
        if not np.isfinite(value):
            return None
        about = f" \u00b1 {interval:.2f}" if name == "calibrated" and np.isfinite(interval) else ""
        return f"{value:.2f}{about}{'?' if name == 'calibrated' and state.inside[j] == 0.0 else ''}"

    joints = TableColumn("", lambda j: f"{shown.model.joint_names[j]} [{units[j][0]}]")
    columns = [TableColumn(shown.legend[name], partial(cell, name)) for name in rows if name in shown.legend]
    return Table([joints, *columns], range(shown.model.n))


def joints_html(shown: Shown, state: ViewState) -> str:
    """Return the table of the joints, its columns marked in the colours of the arms."""
    table = joints_table(shown, state)
    marks = ["", *(_square(colour) for name, colour in COLOURS.items() if name in shown.legend)]
    head = [f"{mark} {escape(heading)}" for mark, heading in zip(marks, table.header, strict=True)]
    rows = [_row("th", head), *(_row("td", [escape(cell) for cell in row]) for row in table.rows)]
    return _block(f'<table style="width:100%">{"".join(rows)}</table>')


def _row(kind: str, cells: list[str]) -> str:
    right = f"text-align:right;padding-left:6px;vertical-align:bottom{';white-space:nowrap' if kind == 'td' else ''}"
    placed = [f'<{kind} style="{right if k else ""}">{cell}</{kind}>' for k, cell in enumerate(cells)]
    return f"<tr>{''.join(placed)}</tr>"


def _square(colour: str, *, dashed: bool = False) -> str:
    return f'<span style="color:{colour}">{"&#9476;" if dashed else "&#9632;"}</span>'


def gravity_html(state: ViewState) -> str:
    """Return the gravity vectors and what tells them apart."""
    lines = []
    for name, vector in (("measured", state.gravity), ("assumed", state.assumed)):
        if np.isfinite(vector).all():
            x, y, z = vector
            lines.append(f"{_square(GRAVITY_COLOURS[name])} gravity {name}: {x:.2f}, {y:.2f}, {z:.2f} m/s&sup2;")
    if len(lines) == 2:
        lines.append(f"{angle_between(state.gravity, state.assumed):.1f} deg apart")
    if np.isfinite(state.gravity_age):
        lines.append(f"measured {1e3 * state.gravity_age:.0f} ms ago")
    return _block("<br>".join(lines))


def legend_html(plot: Plot) -> str:
    """Return the legend of a plot: each known curve's mark, name, and value now, or at the last time before."""
    place = int(np.searchsorted(plot.time, 0.0, side="right")) - 1
    told = [
        f'<span style="white-space:nowrap;padding-right:0.7em">{_square(curve.colour, dashed=curve.dashed)} '
        f"{escape(curve.label)} {curve.values[place]:.3g}</span>"
        for curve in plot.known()
        if curve.label
    ]
    return _block(" ".join(told))


def angle_between(a: np.ndarray, b: np.ndarray) -> float:
    """Return the angle between two vectors [deg]."""
    return float(np.rad2deg(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def _block(text: str) -> str:
    return f'<div style="font-size:0.75em;padding:0 0.9em 0.4em;line-height:1.5">{text}</div>'
