"""Static poses along joint 1 on a tilted base, held by PD alone, PD+SG and PD+DG: the cases of figures 7 and 8.

Lewis and Hannaford 2014, section IV-B: "Each controller was used to maintain a static pose at increments along the
range of the first joint", base angles about the Z0 axis, the robot's own gains.

Choices where the paper is silent:
- Positions are those that the robot reports, at its motors, uncalibrated, as the paper's were; so is the error.
- How the arm comes to a pose decides what friction leaves to the PD term, so both ways are run. "placed": it is put
  there, passively held by sensed gravity, and the controller takes over with the setpoint where the arm stands, as the
  robot's software does on each change of mode. "driven": the controller itself drives it there, from below, at
  0.2 rad/s; the PD term then keeps up to the whole friction. Claims are judged on "driven": the paper's controllers
  were "used to maintain" their poses one after another.
- Joints 2 and 3 stand at home, 90 deg and 0.40 m.
- Gravity is what the accelerometer of figures 9 and 10 says: its last sample, at 100 Hz, with noise, resolution and
  latency, at the base's origin. It has run since before the controllers take over. DG takes it as it comes; the terms
  that are calculated beside PD take its mean over the time that counts.
"""

from collections.abc import Callable, Sequence
from copy import deepcopy
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary import CablePlant, gravity_torque, run_loop
from catenary.arrays import Floats
from catenary.control.controllers import HOLDS, make_controller
from catenary.control.loop import GravitySource, Tick
from catenary.control.pd import SplitController
from catenary.spatial import LEVEL
from catenary.trajectories.reference import Rest
from catenary.workflows.gravity_trials import SimulatedArm, raven_arm, with_approach
from papers.experiment import Case, Experiment, Judgement, Outcomes, Report, Result, Scope, run
from papers.figures import COLORS, LABELS, legend_above, panels
from papers.gravity.published import FIGURE_7_DEG, LARGEST_BASE_DEG
from papers.gravity.raven_base import SHOWN, raven_of_2014, turned_base
from papers.gravity.tracking import CONTROLLERS, gravity_source
from papers.kit import as_text, by_count, by_robot, cells, graded, grid, rows, sample, table, unless_missing

OF_FIGURE_7 = """Figure 7 of the gravity paper: calculated gravity terms beside the torque of PD alone at static poses.

As in section IV-B the terms are calculated while PD alone holds the arm, where it reports to stand: SG by the gravity
of a level base, DG by the sensed one. They differ from PD's torque by friction, and by what the robot's reported
positions are off. The poses, and the two ways in which the arm comes to them: `static_poses.py`.

Joints 2 and 3 carry little gravity against their friction, so claims are judged on joint 1, about which the base is
turned. The friction of the simulated robot was fitted so that PD has little to give beside sensed gravity (figure 8),
from which it follows that the terms match PD's torque on a level base. How they part on tilted ones was not fitted.
"""
OF_FIGURE_8 = """Figure 8 of the gravity paper: the PD term's share of the torque, over the base's angle.

RMS of the PD term over RMS of the whole torque, over all poses. The poses, and the two ways in which the arm comes to
them: `static_poses.py`. Joint friction of the simulated robot was fitted to a test of this kind, on other poses, so
that the share with sensed gravity is "very close to zero" as the paper has it; how the share changes with the base's
angle, with the nominal vector and from robot to robot was not. Claims are judged on joint 1, about which the base is
turned: joints 2 and 3 carry little gravity against their friction. Cases are those of figure 7.
"""
Approach = Literal["placed", "driven"]
DRIVEN: Approach = "driven"
APPROACHES: tuple[Approach, ...] = ("placed", DRIVEN)
ANGLES_DEG = (0, 5, 10, 15, 20, 25)  # about Z0; the paper's text says 0 to 20, its figure 7 shows 25
POSES_DEG = (5.0, 21.0, 37.0, 53.0, 69.0, 85.0)  # of joint 1
QUICK_ANGLES_DEG, QUICK_POSES_DEG = (0, 25), (37.0,)
HOME = (np.pi / 2, 0.40)  # joints 2 and 3 [rad, m]
SETTLE = 1.0  # [s] at a pose before it counts
RELEASE = 0.3  # [s] passively held before a controller takes over
WATCHED = 0.5  # [s] that count
TERMS = COMPENSATED = CONTROLLERS[1:]  # terms of gravity, and the controllers that have them
LEVEL_DEG, TILTED_DEG = FIGURE_7_DEG
MATCHED = 10.0  # [%] of PD's torque that a term which matches may be off
NEAR = 25.0  # [%] the same, for "same direction"
NEAR_ZERO = 10.0  # [%] of the PD share
CONTRAST = 4.0  # times
Measure = Callable[[Outcomes, str, float, Approach], Floats]


class Stood(NamedTuple):
    """What a controller did at one pose; means over the watched time, each (3,)."""

    error: Floats  # desired minus reported [rad, rad, m]
    feedback: Floats  # PD term [Nm, Nm, N]
    torque: Floats  # [Nm, Nm, N]
    reported: Floats  # [rad, rad, m]
    gravity: Floats  # sensed, in base axes [m/s2]


@run(revision=2)
def static(*, seed: int | None, angle_deg: float, approach: Approach, poses_deg: Sequence[float]) -> Result:
    """Hold joint 1 at each pose with each controller, on a base turned about Z0 from power-on.

    Args:
        angle_deg: Of the base about Z0 [deg].
        approach: How the arm comes to the poses.
        poses_deg: Of joint 1, in their order [deg].

    Returns:
        By controller, "error" [deg, deg, mm], "feedback" (the PD term) and "torque" [Nm, Nm, N], a row per pose; of
        PD also the gravity torques "sg" and "dg", calculated where it reports to stand.
    """
    plant = CablePlant(raven_of_2014(), seed=seed, base=turned_base(angle_deg))
    plant.home()
    whole = _placed(plant, poses_deg) if approach == "placed" else _driven(plant, poses_deg)
    results: dict[str, dict[str, list[list[float]]]] = {
        name: {
            "error": _rows([each.error * SHOWN for each in stood]),
            "feedback": _rows([each.feedback for each in stood]),
            "torque": _rows([each.torque for each in stood]),
        }
        for name, stood in whole.items()
    }
    model = raven_arm(plant).model
    level = [gravity_torque(model, each.reported, LEVEL) for each in whole["pd"]]
    sensed = [gravity_torque(model, each.reported, each.gravity) for each in whole["pd"]]
    results["pd"] |= {"sg": _rows(level), "dg": _rows(sensed)}
    return results


def _driven(plant: CablePlant, poses_deg: Sequence[float]) -> dict[str, list[Stood]]:
    stood = {}
    for name in CONTROLLERS:
        own = deepcopy(plant)
        arm, sensed = raven_arm(own), gravity_source("dg", own)
        controller = make_controller(name, arm)
        stood[name] = [stand(arm, controller, pose(deg), move=True, sensed=sensed) for deg in poses_deg]
    return stood


def _placed(plant: CablePlant, poses_deg: Sequence[float]) -> dict[str, list[Stood]]:
    arm, sensed = raven_arm(plant), gravity_source("dg", plant)
    stood: dict[str, list[Stood]] = {name: [] for name in CONTROLLERS}
    placing, free = make_controller("dg", arm), make_controller("dg", arm, among=HOLDS)
    for deg in poses_deg:
        limits = arm.limits()
        whole, _ = with_approach(arm, Rest(pose(deg), 0.0), SETTLE)
        run_loop(arm.plant, placing, whole, limits=limits, gravity=sensed)
        run_loop(arm.plant, free, Rest(pose(deg), RELEASE), limits=limits, gravity=sensed)
        for name in CONTROLLERS:  # each finds the arm as it was placed
            own, source = deepcopy((plant, sensed))
            twin = raven_arm(own)
            here = twin.plant.measured_js().q
            stood[name].append(stand(twin, make_controller(name, twin), here, move=False, sensed=source))
    return stood


def stand(
    arm: SimulatedArm, controller: SplitController, q: Floats, *, move: bool, sensed: GravitySource | None = None
) -> Stood:
    """Stand at q, after going there or at once; gravity is what the plant says where no source is given."""
    standing = Rest(q, SETTLE + WATCHED)
    whole, begin = with_approach(arm, standing, 0.0) if move else (standing, 0.0)
    seen: list[tuple[Floats, ...]] = []

    def observe(tick: Tick) -> None:
        if tick.time >= begin + SETTLE - 1e-9 and tick.tau is not None:
            error = tick.reference.q - tick.state.q
            seen.append((error, controller.feedback.copy(), tick.tau, tick.state.q, tick.state.gravity))

    run_loop(arm.plant, controller, whole, limits=arm.limits(), gravity=sensed, observers=[observe])
    return Stood(*(np.mean(column, axis=0) for column in zip(*seen, strict=True)))


def pose(deg: float) -> Floats:
    """Return where the arm stands with joint 1 at an angle [deg], (3,) [rad, rad, m]."""
    return np.array([np.deg2rad(deg), *HOME])


def _rows(rows: Sequence[Floats]) -> list[list[float]]:
    return [[float(value) for value in row] for row in rows]


def cases(scope: Scope) -> list[Case]:
    """Return a case per robot, base and way of coming to the poses."""
    approaches = (DRIVEN,) if scope.quick else APPROACHES
    angles, poses = (QUICK_ANGLES_DEG, QUICK_POSES_DEG) if scope.quick else (ANGLES_DEG, POSES_DEG)
    return grid(static, {"seed": scope.robots, "approach": approaches, "angle_deg": angles}, poses_deg=list(poses))


def angles_of(o: Outcomes) -> list[float]:
    """Return the bases that were run [deg]."""
    return sorted({args["angle_deg"] for args, _ in o.items(static)})


def approaches_of(o: Outcomes) -> list[Approach]:
    """Return the ways of coming to the poses that were run."""
    run_so = {args["approach"] for args, _ in o.items(static)}
    return [approach for approach in APPROACHES if approach in run_so]


def rms(rows: ArrayLike) -> Floats:
    """Return the RMS over poses of each joint's values, (3,)."""
    values: Floats = np.sqrt(np.mean(np.square(rows), axis=0))
    return values


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
        values = [measure(o, name, angle, approach) for name in TERMS]
        return [angle, *(f"{each[:, joint]:.1f}" for joint in range(3) for each in values)]

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
    "gravity-figure-7", "figure 7", "Calculated gravity terms beside the torque of PD", OF_FIGURE_7,
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
    return graded(largest <= MATCHED, largest <= NEAR, as_text(off, ".1f", " %"))


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
    larger = max(level.mean(), dg.mean())
    diverges = tilted.mean() >= 3.0 * larger and dg.mean() <= MATCHED
    text = f"SG off by {tilted:.1f} %, on a level base {level:.1f} %; DG by {dg:.1f} %"
    return graded(diverges, tilted.mean() > larger, text)


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
    by_angle = {f"{angle} deg": measure(o, name, angle, DRIVEN)[:, 0] for angle in angles_of(o)}
    steps = pairwise(each.mean() for each in by_angle.values())
    return by_count([late > early for early, late in steps], f"{words}: {as_text(by_angle, '.1f', ' %')}")


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
    texts = {approach: cells(shares(o, "dg", 0, approach), 1) for approach in approaches_of(o)}
    parts = "; ".join(
        f"{approach}: {', '.join(f'joint {joint} {each} %' for joint, each in enumerate(of, 1))}"
        for approach, of in texts.items()
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
    by_angle = {f"{angle} deg": shares(o, "dg", angle)[:, 0] for angle in angles_of(o)}
    small = [each.mean() <= NEAR_ZERO for each in by_angle.values()]
    return by_count(small, f"{LABELS['dg']}: {as_text(by_angle, '.1f', ' %')}")


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
