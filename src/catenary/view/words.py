"""What a page says of a state, as text with simple marks."""

from html import escape

import numpy as np

from catenary.units import DISPLAY
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


def joints_html(shown: Shown, state: ViewState) -> str:
    """Return a table of the joints [deg|mm]: reported, calibrated with its interval (? outside), true."""
    columns = [name for name in ("reported", "calibrated", "true") if name in shown.legend]
    rows = {"reported": state.q, "calibrated": state.calibrated, "true": state.true}
    head = "".join(
        f'<th style="text-align:right;padding-left:6px;vertical-align:bottom">'
        f'<span style="color:{COLOURS[name]}">&#9632;</span> {escape(shown.legend[name])}</th>'
        for name in columns
    )
    body = []
    for j, (name, unit) in enumerate(zip(shown.model.joint_names, shown.model.joint_units, strict=True)):
        shown_unit, scale = DISPLAY[unit]
        cells = []
        for column in columns:
            text = _number(scale * rows[column][j])
            if column == "calibrated":
                if np.isfinite(state.interval[j]):
                    text += f" &plusmn; {_number(scale * state.interval[j])}"
                if state.inside[j] == 0.0:
                    text += "?"
            cells.append(f'<td style="text-align:right;padding-left:6px;white-space:nowrap">{text}</td>')
        body.append(f"<tr><td>{escape(name)} [{shown_unit}]</td>{''.join(cells)}</tr>")
    return _block(f'<table style="width:100%"><tr><th></th>{head}</tr>{"".join(body)}</table>')


def gravity_html(state: ViewState) -> str:
    """Return the gravity vectors and what tells them apart."""
    lines = []
    for name, vector in (("measured", state.gravity), ("assumed", state.assumed)):
        if np.isfinite(vector).all():
            x, y, z = vector
            mark = f'<span style="color:{GRAVITY_COLOURS[name]}">&#9632;</span>'
            lines.append(f"{mark} gravity {name}: {x:.2f}, {y:.2f}, {z:.2f} m/s&sup2;")
    if len(lines) == 2:
        lines.append(f"{angle_between(state.gravity, state.assumed):.1f} deg apart")
    if np.isfinite(state.gravity_age):
        lines.append(f"measured {1e3 * state.gravity_age:.0f} ms ago")
    return _block("<br>".join(lines))


def angle_between(a: np.ndarray, b: np.ndarray) -> float:
    """Return the angle between two vectors [deg]."""
    return float(np.rad2deg(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def _number(value: float) -> str:
    return f"{value:.2f}" if np.isfinite(value) else "&ndash;"


def _block(text: str) -> str:
    return f'<div style="font-size:0.75em;padding:0 0.9em 0.4em;line-height:1.5">{text}</div>'
