"""Figure 8 of the gravity paper: the PD term's share of the torque at static poses, over the base's angle.

RMS of the PD term over RMS of the whole torque, over all poses. The poses, and the two ways in which the arm comes to
them: `static_poses.py`. Joint friction of the simulated robot was fitted to a test of this kind, on other poses, so
that the share with sensed gravity is "very close to zero" as the paper has it; how the share changes with the base's
angle, with the nominal vector and from robot to robot was not. Claims are judged on joint 1, about which the base is
turned: joints 2 and 3 carry little gravity against their friction. Cases are those of figure 7.
"""

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from catenary.arrays import Floats
from catenary.reports.page import Table
from papers.claims import by_count, graded, mean_and_spread
from papers.experiment import Claim, Experiment, Judgement, Outcomes, Report, TitledPicture, TitledTable, after_headline
from papers.figures import COLORS, LABELS, panels
from papers.gravity.published import LARGEST_BASE_DEG
from papers.gravity.static_poses import CONTROLLERS, DRIVEN, Approach, angles_of, approaches_of, cases, rms, static

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COMPENSATED = CONTROLLERS[1:]
NEAR_ZERO = 10.0  # [%]
CONTRAST = 4.0  # times


def shares(outcomes: Outcomes, controller: str, angle_deg: float, approach: Approach = DRIVEN) -> Floats:
    """Return the PD share of every joint [%], (robots, 3)."""
    found = []
    for result in outcomes.of(static, angle_deg=angle_deg, approach=approach):
        did = result[controller]
        found.append(100.0 * rms(did["feedback"]) / rms(did["torque"]))
    return np.array(found).reshape(-1, 3)


def report(outcomes: Outcomes) -> Report:
    """Return PD shares and errors by base, controller, joint and way of coming to the poses."""
    tables = []
    for approach in approaches_of(outcomes):
        tables += [
            TitledTable(f"PD share of the torque [%], {approach}", _shares(outcomes, approach)),
            TitledTable(f"RMS error over the poses, {approach}", _errors(outcomes, approach)),
        ]
    caption = "PD share of joint 1 over the base's angle; every robot a line, the nominal one in bold"
    return Report(tables, [TitledPicture(caption, _picture(outcomes))], _of_joints_2_and_3(outcomes))


def _of_joints_2_and_3(outcomes: Outcomes) -> list[str]:
    """Say how much PD gives where friction is most of what holds a joint."""
    remarks = []
    for approach in approaches_of(outcomes):
        found = shares(outcomes, "dg", 0, approach)
        if len(found):
            told = ", ".join(f"joint {joint + 1} {mean_and_spread(found[:, joint], 1)} %" for joint in range(3))
            remarks.append(f"{approach}: {told}")
    if not remarks:
        return []
    return [
        f"Claims are of joint 1. On a level base the PD term gives, with DG, of the torque of {'; '.join(remarks)}. "
        "Driven, joints 2 and 3 leave their friction to PD, which is most of what holds them."
    ]


def _shares(outcomes: Outcomes, approach: Approach) -> Table:
    header = [f"J{joint + 1}, {LABELS[name]}" for joint in range(3) for name in COMPENSATED]
    rows = []
    for angle in angles_of(outcomes):
        by_name = {name: shares(outcomes, name, angle, approach) for name in COMPENSATED}
        cells = [mean_and_spread(by_name[name][:, joint], 1) for joint in range(3) for name in COMPENSATED]
        rows.append([f"{angle}", *cells])
    return Table(["base [deg]", *header], rows)


def _errors(outcomes: Outcomes, approach: Approach) -> Table:
    rows = []
    for angle in angles_of(outcomes):
        for name in CONTROLLERS:
            results = outcomes.of(static, angle_deg=angle, approach=approach)
            errors = np.array([rms(result[name]["error"]) for result in results]).reshape(-1, 3)
            rows.append([f"{angle} deg, {LABELS[name]}", *(mean_and_spread(errors[:, joint]) for joint in range(3))])
    return Table(["base, controller", "J1 [deg]", "J2 [deg]", "J3 [mm]"], rows)


def _picture(outcomes: Outcomes) -> "Figure":
    approaches = sorted(approaches_of(outcomes))  # driven first
    figure, axes = panels(max(len(approaches), 1), 3.6, sharey=True)
    angles = angles_of(outcomes)
    for axis, approach in zip(axes, approaches, strict=False):
        for name in COMPENSATED:
            by_robot = np.array([shares(outcomes, name, angle, approach)[:, 0] for angle in angles]).T
            for k, share in enumerate(by_robot):
                style = {"linewidth": 2.0, "label": LABELS[name]} if k == 0 else {"linewidth": 0.7, "alpha": 0.6}
                axis.plot(angles, share, "o-", color=COLORS[name], markersize=3, **style)
        axis.set_title(approach, fontsize=10)
        axis.set_xlabel("base about Z0 [deg]")
        axis.set_ylim(bottom=0.0)
    axes[0].set_ylabel("PD share of joint 1 [%]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False, fontsize=9)
    return figure


def _by_angle(outcomes: Outcomes, name: str) -> tuple[list[float], str]:
    """Return joint 1's PD share by the base's angle, means over robots, and in words with its spread."""
    found = {angle: shares(outcomes, name, angle)[:, 0] for angle in angles_of(outcomes)}
    told = ", ".join(f"{angle} deg {mean_and_spread(share, 1)} %" for angle, share in found.items())
    return [float(share.mean()) for share in found.values()], f"{LABELS[name]}: {told}"


def _near_zero(outcomes: Outcomes) -> Judgement:
    means, told = _by_angle(outcomes, "dg")
    return by_count([mean <= NEAR_ZERO for mean in means], told)


def _rises(outcomes: Outcomes) -> Judgement:
    means, told = _by_angle(outcomes, "sg")
    return by_count([late > early for early, late in pairwise(means)], told)


def _contrast(outcomes: Outcomes) -> Judgement:
    sg, dg = (shares(outcomes, name, LARGEST_BASE_DEG)[:, 0] for name in COMPENSATED)
    told = f"SG {mean_and_spread(sg, 1)} %, DG {mean_and_spread(dg, 1)} %"
    ratio = float(sg.mean() / dg.mean())
    return graded(ratio >= CONTRAST, ratio > 1.0, told)


CLAIMS = (
    Claim(
        "With DG the PD term exerts nearly zero torque on joint 1 at every base angle",
        "V-A, figure 8",
        "nearly zero, no number",
        f"joint 1, driven, mean over robots: PD share at most {NEAR_ZERO:.0f} % at every angle; same direction: at "
        "more than half of them",
        _near_zero,
        fitted=True,
    ),
    Claim(
        "With SG the PD term has to do more on joint 1 with increasing base angles",
        "V-A, figure 8",
        "rises, no number",
        "joint 1, driven, mean over robots: the share rises at every step of the base's angle; same direction: at "
        "more than half of them",
        _rises,
    ),
    Claim(
        f"At {LARGEST_BASE_DEG} deg the contrast on joint 1 is stark",
        "V-A, figure 8",
        "stark contrast, no number",
        f"joint 1, driven, mean over robots: SG's share at least {CONTRAST:.0f} times DG's; same direction: more",
        _contrast,
    ),
)

EXPERIMENT = Experiment(
    name="gravity-figure-8",
    paper="gravity",
    place="figure 8",
    title="The PD term's share of the torque at static poses",
    about=after_headline(__doc__),
    cases=cases,
    report=report,
    minutes=20.0,
    claims=CLAIMS,
)
