"""Torques of an arm's joints as bars: Nm and N on axes of their own, with the motors' limits."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.robots.model import RobotModel
from catenary.units import TORQUE_UNIT, in_words

BAR, RANGE, LIMIT = "#4b6b94", "#1c2430", "#c0392b"
LEAST_TORQUE = 1e-9  # [Nm|N] that is no rounding
SHOWN_LIMIT = 3.0  # times the largest bar: limits beyond are told in words alone
WIDE_TEXT, SHORT_TEXT = 0.31, 0.16  # of the width: what is written beside a bar
LONGEST_NAME = 24  # characters beside a bar


def joints_by_unit(model: RobotModel) -> dict[str, list[int]]:
    """Return the joints that turn and those that slide, by the unit of what moves them; units without a joint not."""
    units = [TORQUE_UNIT[unit] for unit in model.joint_units]
    return {unit: [j for j, own in enumerate(units) if own == unit] for unit in dict.fromkeys(units)}


def draw_torque_bars(places: Sequence[Any], model: RobotModel, q: Floats, tau: Floats) -> None:
    """Draw a bar for each joint's torque, the first joint on top.

    Args:
        places: Matplotlib's axes, one for each unit of `joints_by_unit`.
        model: The robot.
        q: (n,) where its joints are [rad|m].
        tau: (N, n) torques [Nm|N]; bars are of the first row, lines from the least to the greatest of all.
    """
    for axes, (unit, joints) in zip(places, joints_by_unit(model).items(), strict=True):
        _draw_unit(axes, model, q, tau, unit, joints)


def _draw_unit(
    axes: Any, model: RobotModel, q: Floats, tau: Floats, unit: str, joints: Sequence[int]
) -> None:
    rows = np.arange(len(joints))
    own, limits = tau[:, joints], model.effort_limit[list(joints)]
    reach = max(float(np.abs(own).max(initial=0.0)), LEAST_TORQUE)
    axes.barh(rows, own[0], height=0.5, color=BAR)
    if len(own) > 1:
        axes.hlines(rows, own.min(axis=0), own.max(axis=0), color=RANGE, linewidth=1.2)
    shown = limits <= SHOWN_LIMIT * reach
    for side in (-1.0, 1.0):
        axes.vlines(side * limits[shown], rows[shown] - 0.4, rows[shown] + 0.4, color=LIMIT, linewidth=1.5)
    # names of the values stand beside the bars, so that a short one can be read as well
    for row, (value, limit, least, greatest) in enumerate(
        zip(own[0], limits, own.min(axis=0), own.max(axis=0), strict=True)
    ):
        share = f" ({100.0 * abs(value) / limit:.0f} % of {limit:g})" if np.isfinite(limit) else ""
        side = -1.0 if value < 0.0 else 1.0
        axes.annotate(
            f"{value:.3g}{share}" if abs(value) > LEAST_TORQUE else "0",
            (min(least, 0.0) if side < 0.0 else max(greatest, 0.0), row), xytext=(4.0 * side, 0.0),
            textcoords="offset points", fontsize=8, va="center", ha="left" if side > 0.0 else "right",
            bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 0.8},
        )  # fmt: skip
    low = min(0.0, float(own.min(initial=0.0)), *(-limits[shown]))
    high = max(0.0, float(own.max(initial=0.0)), *limits[shown])
    # room for what is written at the ends, as a share of the whole width
    written = WIDE_TEXT if np.isfinite(limits).any() else SHORT_TEXT
    left = written if (own[0] < -LEAST_TORQUE).any() else 0.02
    whole = (high - low) / (1.0 - left - written) if high > low else 1.0
    axes.set_xlim(low - left * whole, high + written * whole)
    axes.axvline(0.0, color=RANGE, linewidth=0.6)
    axes.set_yticks(rows, [_name(model, j, q[j]) for j in joints], fontsize=8)
    axes.set_ylim(len(joints) - 0.5, -0.5)
    axes.set_xlabel(f"[{unit}]{'; red: limit of the motor' if shown.any() else ''}", fontsize=8)
    axes.tick_params(axis="x", labelsize=7)
    axes.tick_params(axis="y", length=0)
    axes.spines[["top", "right", "left"]].set_visible(False)


def _name(model: RobotModel, joint: int, position: float) -> str:
    name = model.joint_names[joint]
    cut = name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 3]}..."
    return f"{joint + 1}  {cut}\n{in_words(position, model.joint_units[joint], 1)}"
