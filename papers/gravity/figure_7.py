"""Figure 7 of the gravity paper: calculated gravity terms beside the torque that PD alone holds static poses with.

As in section IV-B the terms are calculated while PD alone holds the arm, where it reports to stand: SG by the gravity
of a level base, DG by the sensed one. They differ from PD's torque by friction, and by what the robot's reported
positions are off. The poses, and the two ways in which the arm comes to them: `static_poses.py`.

Joints 2 and 3 carry little gravity against their friction, so claims are judged on joint 1, about which the base is
turned. The friction of the simulated robot was fitted so that PD has little to give beside sensed gravity (figure 8),
from which it follows that the terms match PD's torque on a level base. How they part on tilted ones was not fitted.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from catenary.arrays import Floats
from catenary.reports.page import Table
from papers.claims import by_count, graded, mean_and_spread
from papers.experiment import Claim, Experiment, Judgement, Outcomes, Report, TitledPicture, TitledTable, after_headline
from papers.figures import COLORS, panels
from papers.gravity.published import FIGURE_7_DEG
from papers.gravity.static_poses import DRIVEN, Approach, angles_of, approaches_of, cases, rms, static

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TERMS = ("sg", "dg")
LEVEL_DEG, TILTED_DEG = FIGURE_7_DEG
MATCHED = 10.0  # [%] of PD's torque that a term which matches may be off
NEAR = 25.0  # [%] the same, for "same direction"


def differences(outcomes: Outcomes, term: str, angle_deg: float, approach: Approach = DRIVEN) -> Floats:
    """Return RMS of PD's torque less a term over RMS of PD's torque [%], (robots, 3)."""
    found = []
    for result in outcomes.of(static, angle_deg=angle_deg, approach=approach):
        held, calculated = np.array(result["pd"]["torque"]), np.array(result["pd"][term])
        found.append(100.0 * rms(held - calculated) / rms(held))
    return np.array(found).reshape(-1, 3)


def report(outcomes: Outcomes) -> Report:
    """Return how far the terms are from PD's torque by base, joint and way of coming to the poses."""
    tables = [
        TitledTable(
            f"PD's torque less the term, RMS over RMS of PD's torque [%], {approach}", _table(outcomes, approach)
        )
        for approach in approaches_of(outcomes)
    ]
    caption = (
        "Joint 1: calculated gravity terms beside the torque that PD alone holds with, nominal robot; "
        "driven to each pose from below, and placed there"
    )
    return Report(tables, [TitledPicture(caption, _picture(outcomes))], _of_joints_2_and_3(outcomes))


def _of_joints_2_and_3(outcomes: Outcomes) -> list[str]:
    """Say how far the terms are off where friction is most of what holds a joint."""
    level = differences(outcomes, "dg", LEVEL_DEG)
    if not len(level):
        return []
    told = ", ".join(f"joint {joint + 1} by {mean_and_spread(level[:, joint], 1)} %" for joint in range(3))
    return [
        f"Claims are of joint 1. On a level base, driven, the DG term is off PD's torque on {told}: joints 2 and 3 "
        "carry little gravity against their friction."
    ]


def _table(outcomes: Outcomes, approach: Approach) -> Table:
    rows = []
    for angle in angles_of(outcomes):
        by_term = {term: differences(outcomes, term, angle, approach) for term in TERMS}
        rows.append(
            [f"{angle}"] + [mean_and_spread(by_term[term][:, joint], 1) for joint in range(3) for term in TERMS]
        )
    return Table(["base [deg]", *(f"J{joint + 1}, {term.upper()}" for joint in range(3) for term in TERMS)], rows)


def _picture(outcomes: Outcomes) -> "Figure":
    approaches = sorted(approaches_of(outcomes))  # driven first
    figure, axes = panels(2, 3.0 * max(len(approaches), 1), rows=max(len(approaches), 1), sharey="row")
    for k, approach in enumerate(approaches):
        for axis, angle in zip(axes[2 * k :], FIGURE_7_DEG, strict=False):
            for told, result in list(outcomes.items(static, angle_deg=angle, approach=approach))[:1]:
                poses, held = told["poses_deg"], result["pd"]
                axis.plot(poses, _joint_1(held["torque"]), "o-", color=COLORS["pd"], label="PD: its torque")
                for term in TERMS:
                    axis.plot(poses, _joint_1(held[term]), "o-", color=COLORS[term], label=f"{term.upper()} term")
            axis.set_title(f"base at {angle} deg, {approach}", fontsize=10)
        axes[2 * k].set_ylabel("torque of joint 1 [Nm]")
    for axis in axes[-2:]:
        axis.set_xlabel("joint 1 [deg]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False, fontsize=9)
    return figure


def _joint_1(rows: Sequence[Sequence[float]]) -> list[float]:
    return [row[0] for row in rows]


def _match(outcomes: Outcomes) -> Judgement:
    means = [differences(outcomes, term, LEVEL_DEG)[:, 0] for term in TERMS]
    told = ", ".join(
        f"{term.upper()} off by {mean_and_spread(mean, 1)} %" for term, mean in zip(TERMS, means, strict=True)
    )
    largest = max(float(mean.mean()) for mean in means)
    return graded(largest <= MATCHED, largest <= NEAR, told)


def _diverge(outcomes: Outcomes) -> Judgement:
    level, tilted = (differences(outcomes, "sg", angle)[:, 0] for angle in FIGURE_7_DEG)
    dg = differences(outcomes, "dg", TILTED_DEG)[:, 0]
    told = (
        f"SG off by {mean_and_spread(tilted, 1)} %, on a level base {mean_and_spread(level, 1)} %; "
        f"DG by {mean_and_spread(dg, 1)} %"
    )
    off, still = float(tilted.mean()), float(dg.mean())
    if off >= 3.0 * max(float(level.mean()), still) and still <= MATCHED:
        return Judgement("reproduced", told)
    return Judgement("same direction" if off > max(float(level.mean()), still) else "not reproduced", told)


def _less_accurate(outcomes: Outcomes) -> Judgement:
    found = {angle: differences(outcomes, "sg", angle)[:, 0] for angle in angles_of(outcomes)}
    told = ", ".join(f"{angle} deg {mean_and_spread(off, 1)} %" for angle, off in found.items())
    means = [float(off.mean()) for off in found.values()]
    return by_count([late > early for early, late in pairwise(means)], f"SG off: {told}")


CLAIMS = (
    Claim(
        "On a level base both calculated terms match the PD torques of joint 1",
        "V-A, figure 7",
        "matched, no number",
        f"joint 1, driven, mean over robots: both terms within {MATCHED:.0f} % of PD's torque (RMS over the poses); "
        f"same direction: within {NEAR:.0f} %",
        _match,
        fitted=True,
    ),
    Claim(
        f"At {TILTED_DEG} deg the SG term of joint 1 diverges, the DG term does not",
        "V-A, figure 7",
        "drawn, no number",
        f"joint 1, driven, mean over robots: SG off by three times as much as on a level base and as DG, DG within "
        f"{MATCHED:.0f} %; same direction: SG off by more than both",
        _diverge,
    ),
    Claim(
        "The SG term of joint 1 becomes less accurate at increasing base angles",
        "V-A",
        "as expected, no number",
        "joint 1, driven, mean over robots: further off at every step of the base's angle; same direction: at more "
        "than half of them",
        _less_accurate,
    ),
)

EXPERIMENT = Experiment(
    name="gravity-figure-7",
    paper="gravity",
    place="figure 7",
    title="Calculated gravity terms beside the torque of PD",
    about=after_headline(__doc__),
    cases=cases,
    report=report,
    minutes=13.0,
    claims=CLAIMS,
)
