"""Figure 7 of the gravity paper: calculated gravity terms beside the torque that PD alone holds static poses with.

As in section IV-B the terms are calculated while PD alone holds the arm, where it reports to stand: SG by the gravity
of a level base, DG by the sensed one. They differ from PD's torque by friction, and by what the robot's reported
positions are off. The poses, and the two ways in which the arm comes to them: `static_poses.py`.

Joints 2 and 3 carry little gravity against their friction, so claims are judged on joint 1, about which the base is
turned. The friction of the simulated robot was fitted so that PD has little to give beside sensed gravity (figure 8),
from which it follows that the terms match PD's torque on a level base. How they part on tilted ones was not fitted.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

from catenary.arrays import Floats
from papers.experiment import Experiment, Judgement, Outcomes, Report
from papers.figures import COLORS, LABELS, legend_above, panels
from papers.gravity.published import FIGURE_7_DEG, LARGEST_BASE_DEG
from papers.gravity.static_poses import CONTROLLERS, DRIVEN, Approach, angles_of, approaches_of, cases, rms, static
from papers.kit import by_count, by_robot, cells, graded, rows, sample, table, told, unless_missing

OF_FIGURE_8 = """Figure 8 of the gravity paper: the PD term's share of the torque, over the base's angle.

RMS of the PD term over RMS of the whole torque, over all poses. The poses, and the two ways in which the arm comes to
them: `static_poses.py`. Joint friction of the simulated robot was fitted to a test of this kind, on other poses, so
that the share with sensed gravity is "very close to zero" as the paper has it; how the share changes with the base's
angle, with the nominal vector and from robot to robot was not. Claims are judged on joint 1, about which the base is
turned: joints 2 and 3 carry little gravity against their friction. Cases are those of figure 7.
"""
TERMS = COMPENSATED = CONTROLLERS[1:]  # terms of gravity, and the controllers that have them
LEVEL_DEG, TILTED_DEG = FIGURE_7_DEG
MATCHED = 10.0  # [%] of PD's torque that a term which matches may be off
NEAR = 25.0  # [%] the same, for "same direction"
NEAR_ZERO = 10.0  # [%] of the PD share
CONTRAST = 4.0  # times
Measure = Callable[[Outcomes, str, float, Approach], Floats]


def held(o: Outcomes, controller: str, what: str, angle_deg: float, approach: Approach) -> Floats:
    """Return what a controller had at every pose on a base, (robots, poses, 3)."""
    return sample(o, static, controller, what, angle_deg=angle_deg, approach=approach)


def differences(o: Outcomes, term: str, angle_deg: float, approach: Approach = DRIVEN) -> Floats:
    """Return RMS of PD's torque less a term over RMS of PD's torque [%], (robots, 3)."""
    torque, calculated = (held(o, "pd", what, angle_deg, approach) for what in ("torque", term))
    return by_robot([100.0 * rms(own - of_term) / rms(own) for own, of_term in zip(torque, calculated, strict=True)])


def shares(o: Outcomes, controller: str, angle_deg: float, approach: Approach = DRIVEN) -> Floats:
    """Return the PD share of every joint [%], (robots, 3)."""
    feedback, torque = (held(o, controller, what, angle_deg, approach) for what in ("feedback", "torque"))
    return by_robot([100.0 * rms(own) / rms(whole) for own, whole in zip(feedback, torque, strict=True)])


def by_base(o: Outcomes, measure: Measure, approach: Approach) -> list[list[str]]:
    """Return a row for every base: a measure of every joint and term."""

    def row(angle: float) -> list[Any]:
        found = [measure(o, name, angle, approach) for name in TERMS]
        return [angle, *(f"{each[:, joint]:.1f}" for joint in range(3) for each in found)]

    return rows(row, angles_of(o))


def report_7(o: Outcomes) -> Report:
    """Return how far the terms are from PD's torque by base, joint and way of coming to the poses."""
    header = ["base [deg]", *(f"J{joint}, {term.upper()}" for joint in (1, 2, 3) for term in TERMS)]
    title = "PD's torque less the term, RMS over RMS of PD's torque [%]"
    tables = [table(f"{title}, {each}", header, by_base(o, differences, each)) for each in approaches_of(o)]
    caption = (
        "Joint 1: calculated gravity terms beside the torque that PD alone holds with, nominal robot; driven to each "
        "pose from below, and placed there"
    )
    return Report(tables, {caption: _torques(o)}, _of_joints_2_and_3(o))


@unless_missing
def _of_joints_2_and_3(o: Outcomes) -> str:
    """Say how far the terms are off where friction is most of what holds a joint."""
    off = cells(differences(o, "dg", LEVEL_DEG), 1)
    return (
        "Claims are of joint 1. On a level base, driven, the DG term is off PD's torque on "
        f"{', '.join(f'joint {joint} by {each} %' for joint, each in enumerate(off, 1))}: joints 2 and 3 carry little "
        "gravity against their friction."
    )


def _torques(o: Outcomes) -> Any:
    approaches = sorted(approaches_of(o))  # driven first
    figure, axes = panels(2, 3.0 * len(approaches), rows=len(approaches), sharey="row")
    for k, approach in enumerate(approaches):
        for axis, angle in zip(axes[2 * k :], FIGURE_7_DEG, strict=False):
            for of, result in list(o.items(static, angle_deg=angle, approach=approach))[:1]:
                for name, label in (("pd", "PD: its torque"), *((term, f"{term.upper()} term") for term in TERMS)):
                    torques = [row[0] for row in result["pd"]["torque" if name == "pd" else name]]
                    axis.plot(of["poses_deg"], torques, "o-", color=COLORS[name], label=label)
            axis.set_title(f"base at {angle} deg, {approach}", fontsize=10)
        axes[2 * k].set_ylabel("torque of joint 1 [Nm]")
    for axis in axes[-2:]:
        axis.set_xlabel("joint 1 [deg]")
    legend_above(figure, axes[0], columns=3)
    return figure


FIGURE_7 = Experiment(
    "gravity-figure-7", "figure 7", "Calculated gravity terms beside the torque of PD", __doc__,
    cases, report_7, minutes=13.0,
)  # fmt: skip


@FIGURE_7.claim(
    "On a level base both calculated terms match the PD torques of joint 1",
    "V-A, figure 7",
    "matched, no number",
    f"joint 1, driven, mean over robots: both terms within {MATCHED:.0f} % of PD's torque (RMS over the poses); same "
    f"direction: within {NEAR:.0f} %",
    fitted=True,
)
def _match(o: Outcomes) -> Judgement:
    off = {f"{term.upper()} off by": differences(o, term, LEVEL_DEG)[:, 0] for term in TERMS}
    largest = max(each.mean() for each in off.values())
    return graded(largest <= MATCHED, largest <= NEAR, told(off, ".1f", " %"))


@FIGURE_7.claim(
    f"At {TILTED_DEG} deg the SG term of joint 1 diverges, the DG term does not",
    "V-A, figure 7",
    "drawn, no number",
    "joint 1, driven, mean over robots: SG off by three times as much as on a level base and as DG, DG within "
    f"{MATCHED:.0f} %; same direction: SG off by more than both",
)
def _diverge(o: Outcomes) -> Judgement:
    level, tilted = (differences(o, "sg", angle)[:, 0] for angle in FIGURE_7_DEG)
    dg = differences(o, "dg", TILTED_DEG)[:, 0]
    most = max(level.mean(), dg.mean())
    diverges = tilted.mean() >= 3.0 * most and dg.mean() <= MATCHED
    said = f"SG off by {tilted:.1f} %, on a level base {level:.1f} %; DG by {dg:.1f} %"
    return graded(diverges, tilted.mean() > most, said)


@FIGURE_7.claim(
    "The SG term of joint 1 becomes less accurate at increasing base angles",
    "V-A",
    "as expected, no number",
    "joint 1, driven, mean over robots: further off at every step of the base's angle; same direction: at more than "
    "half of them",
)
def _less_accurate(o: Outcomes) -> Judgement:
    return _rises(o, differences, "sg", "SG off")


def _rises(o: Outcomes, measure: Measure, name: str, words: str) -> Judgement:
    """Judge whether joint 1's measure, mean over robots, rises at every step of the base's angle."""
    found = {f"{angle} deg": measure(o, name, angle, DRIVEN)[:, 0] for angle in angles_of(o)}
    steps = pairwise(each.mean() for each in found.values())
    return by_count([late > early for early, late in steps], f"{words}: {told(found, '.1f', ' %')}")


def report_8(o: Outcomes) -> Report:
    """Return PD shares and errors by base, controller, joint and way of coming to the poses."""
    header = ["base [deg]", *(f"J{joint}, {LABELS[name]}" for joint in (1, 2, 3) for name in COMPENSATED)]
    tables = []
    for approach in approaches_of(o):

        def row(angle: float, name: str, approach: Approach = approach) -> list[str]:
            errors = by_robot([rms(each) for each in held(o, name, "error", angle, approach)])
            return [f"{angle} deg, {LABELS[name]}", *cells(errors)]

        errors = rows(row, angles_of(o), CONTROLLERS)
        tables += [
            table(f"PD share of the torque [%], {approach}", header, by_base(o, shares, approach)),
            table(f"RMS error over the poses, {approach}", "base, controller | J1 [deg] | J2 [deg] | J3 [mm]", errors),
        ]
    caption = "PD share of joint 1 over the base's angle; every robot a line, the nominal one in bold"
    return Report(tables, {caption: _shares(o)}, _shares_of_joints_2_and_3(o))


@unless_missing
def _shares_of_joints_2_and_3(o: Outcomes) -> str:
    """Say how much PD gives where friction is most of what holds a joint."""
    found = {approach: cells(shares(o, "dg", 0, approach), 1) for approach in approaches_of(o)}
    parts = "; ".join(
        f"{approach}: {', '.join(f'joint {joint} {each} %' for joint, each in enumerate(of, 1))}"
        for approach, of in found.items()
    )
    return (
        f"Claims are of joint 1. On a level base the PD term gives, with DG, of the torque of {parts}. Driven, joints "
        "2 and 3 leave their friction to PD, which is most of what holds them."
    )


def _shares(o: Outcomes) -> Any:
    approaches, angles = sorted(approaches_of(o)), angles_of(o)  # driven first
    figure, axes = panels(len(approaches), 3.6, sharey=True)
    for axis, approach in zip(axes, approaches, strict=False):
        for name in COMPENSATED:
            for k, share in enumerate(zip(*(shares(o, name, each, approach)[:, 0] for each in angles), strict=True)):
                style = {"linewidth": 2.0, "label": LABELS[name]} if k == 0 else {"linewidth": 0.7, "alpha": 0.6}
                axis.plot(angles, share, "o-", color=COLORS[name], markersize=3, **style)
        axis.set_title(approach, fontsize=10)
        axis.set_xlabel("base about Z0 [deg]")
        axis.set_ylim(bottom=0.0)
    axes[0].set_ylabel("PD share of joint 1 [%]")
    legend_above(figure, axes[0], columns=2)
    return figure


FIGURE_8 = Experiment(
    "gravity-figure-8", "figure 8", "The PD term's share of the torque at static poses", OF_FIGURE_8,
    cases, report_8, minutes=1.0,
)  # fmt: skip


@FIGURE_8.claim(
    "With DG the PD term exerts nearly zero torque on joint 1 at every base angle",
    "V-A, figure 8",
    "nearly zero, no number",
    f"joint 1, driven, mean over robots: PD share at most {NEAR_ZERO:.0f} % at every angle; same direction: at more "
    "than half of them",
    fitted=True,
)
def _near_zero(o: Outcomes) -> Judgement:
    found = {f"{angle} deg": shares(o, "dg", angle)[:, 0] for angle in angles_of(o)}
    small = [each.mean() <= NEAR_ZERO for each in found.values()]
    return by_count(small, f"{LABELS['dg']}: {told(found, '.1f', ' %')}")


@FIGURE_8.claim(
    "With SG the PD term has to do more on joint 1 with increasing base angles",
    "V-A, figure 8",
    "rises, no number",
    "joint 1, driven, mean over robots: the share rises at every step of the base's angle; same direction: at more "
    "than half of them",
)
def _share_rises(o: Outcomes) -> Judgement:
    return _rises(o, shares, "sg", LABELS["sg"])


@FIGURE_8.claim(
    f"At {LARGEST_BASE_DEG} deg the contrast on joint 1 is stark",
    "V-A, figure 8",
    "stark contrast, no number",
    f"joint 1, driven, mean over robots: SG's share at least {CONTRAST:.0f} times DG's; same direction: more",
)
def _contrast(o: Outcomes) -> Judgement:
    sg, dg = (shares(o, name, LARGEST_BASE_DEG)[:, 0] for name in COMPENSATED)
    ratio = sg.mean() / dg.mean()
    return graded(ratio >= CONTRAST, ratio > 1.0, f"SG {sg:.1f} %, DG {dg:.1f} %")
