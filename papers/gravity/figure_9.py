"""Figure 9 of the gravity paper: tracking errors of three controllers on a base at 0 to 20 degrees.

Lewis and Hannaford 2014, sections IV-B and V-B: sinusoids of 3.1 inch and 4 s, two cycles along each Cartesian axis,
sent as workspace increments at 1000 Hz; RMS of desired minus reported joint position. DG takes the last sample of an
accelerometer at 100 Hz, with its noise, resolution and latency.

Choices where the paper is silent: gains and damping are those of the robot's own control, whose damping is absolute
(kd times the joint's velocity, not the error's). The motion begins in the middle of the reach; its phase starts and
stops smoothly. Beside the paper's way stand the same motion as joint references, better sensors, and every other
controller with either damping, on the nominal robot.
"""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.reports.page import Table
from papers.claims import by_count, graded, mean_and_spread
from papers.experiment import (
    Case,
    Claim,
    Experiment,
    Judgement,
    Outcomes,
    Report,
    Scope,
    TitledPicture,
    TitledTable,
    after_headline,
)
from papers.figures import COLORS, legend_below, panels
from papers.gravity import published
from papers.gravity.tracking import CALLED, CONTROLLERS, SENSORS, follow_sinusoids

ANGLES_DEG = (0, 5, 10, 15, 20)
LAST = str(ANGLES_DEG[-1])
WAYS = ("increments", "joints")
UNITS = ("deg", "deg", "mm")
OTHERS = ("elastic-constant", "elastic-online", "elastic-biased", "inertia", "computed-torque")
FOLLOW_VELOCITY = ("inertia", "computed-torque")  # damped relative to the reference by their law
USUAL = tuple((name, "absolute") for name in CONTROLLERS)
BETTER_SENSORS = tuple((name, "absolute") for name in SENSORS[1:])
ALL_OTHERS = (
    *((name, "absolute") for name in OTHERS if name not in FOLLOW_VELOCITY),
    *((name, "relative") for name in (*CONTROLLERS, *OTHERS)),
)
CLOSE = 3.0  # percentage points within which a gain is the paper's
SIGNIFICANT = 1.0  # percent of PD's error that could be told in a bar of the figure
NO_GAIN = 2.0  # percent of PD's error below which a gain counts as lost


def cases(scope: Scope) -> list[Case]:
    """Return a case for every robot, base and way of sending, and further controllers on the nominal robot."""
    if scope.quick:
        return [follow_sinusoids.case(seed=None, base=LAST, way="increments", controllers=USUAL, cycles=1, axes=["y"])]
    usual = [
        follow_sinusoids.case(seed=seed, base=str(angle), way=way, controllers=USUAL)
        for seed in scope.robots
        for angle in ANGLES_DEG
        for way in WAYS
    ]
    return [
        *usual,
        follow_sinusoids.case(seed=None, base=LAST, way="increments", controllers=BETTER_SENSORS),
        follow_sinusoids.case(seed=None, base=LAST, way="joints", controllers=ALL_OTHERS),
    ]


def errors(outcomes: Outcomes, base: str, way: str, controller: str, damping: str = "absolute") -> Floats:
    """Return the RMS joint errors of a controller, (robots, 3) [deg, deg, mm]."""
    key = f"{controller} {damping}"
    found = outcomes.of(follow_sinusoids, base=base, way=way)
    return np.array([result[key]["rms_error"] for result in found if key in result]).reshape(-1, 3)


def gains(outcomes: Outcomes, base: str, controller: str, joint: int, way: str = "increments") -> Floats:
    """Return by how many percent a controller's error is below PD's, robot by robot."""
    plain, here = (errors(outcomes, base, way, name)[:, joint] for name in ("pd", controller))
    return 100.0 * (1.0 - here / plain) if len(plain) == len(here) else np.zeros(0)


def error_table(outcomes: Outcomes, bases: tuple[str, ...], way: str, names: tuple[str, ...]) -> Table:
    """Return RMS errors of every joint by base and controller, the change against PD, and the tip's error."""
    rows = []
    for base in bases:
        for name in names:
            values = errors(outcomes, base, way, name)
            if not len(values):
                continue
            key = f"{name} absolute"
            found = [r[key] for r in outcomes.of(follow_sinusoids, base=base, way=way) if key in r]
            change = gains(outcomes, base, name, 0, way)
            rows.append(
                [
                    f"{base} deg" if base.isdigit() else base,
                    CALLED[name],
                    *(mean_and_spread(column) for column in values.T),
                    "-" if name == "pd" or not len(change) else f"{mean_and_spread(-change, 1)} %",
                    f"{100.0 * np.mean([one['pd_share'][0] for one in found]):.0f} %",
                    mean_and_spread([one["tip_mm"][3] for one in found], 2),
                    mean_and_spread([one["true_tip_mm"] for one in found], 2),
                ]
            )
    header = ["base", "controller", *(f"J{j + 1} [{unit}]" for j, unit in enumerate(UNITS))]
    return Table([*header, "J1 against PD", "PD share J1", "tip, reported [mm]", "tip, true [mm]"], rows)


def others_table(outcomes: Outcomes) -> Table:
    """Return every other controller with either damping, and better sensors, on the nominal robot."""
    return others_of(outcomes, LAST, WAYS)


def others_of(outcomes: Outcomes, base: str, ways: Sequence[str] = WAYS[1:]) -> Table:
    """Return controllers beside the usual three on a base, on the nominal robot, sent in some ways."""
    rows = []
    for way in ways:
        for result in outcomes.of(follow_sinusoids, base=base, way=way, seed=None):
            for one in result.values():
                if (one["controller"], one["damping"]) in USUAL:
                    continue
                rows.append(
                    [
                        CALLED.get(one["controller"], one["controller"]),
                        one["damping"],
                        way,
                        *(f"{error:.4f}" for error in one["rms_error"]),
                        *(f"{100.0 * share:.1f} %" for share in one["pd_share"]),
                    ]
                )
    header = ["controller", "damping", "sent as", "J1 [deg]", "J2 [deg]", "J3 [mm]", "PD share J1", "J2", "J3"]
    return Table(header, rows)


def picture(outcomes: Outcomes, bases: tuple[str, ...], names: tuple[str, ...]) -> Any:
    """Draw RMS errors of the three joints by base: bars are means over robots, dots are robots."""
    drawn, three = panels(3, 3.7)
    for joint, axes in enumerate(three):
        for k, name in enumerate(names):
            for i, base in enumerate(bases):
                values = errors(outcomes, base, "increments", name)[:, joint]
                if not len(values):
                    continue
                place = i + 0.8 / len(names) * (k - 0.5 * (len(names) - 1))
                color = COLORS.get(name, "#8fb8a8")
                label = CALLED[name] if i == 0 else None
                axes.bar(place, values.mean(), 0.72 / len(names), color=color, label=label)
                axes.plot(np.full(len(values), place), values, "o", color="white", markeredgecolor="#1c2430", ms=2.5)
        axes.set_xticks(range(len(bases)), [f"{base} deg" if base.isdigit() else base for base in bases], fontsize=8)
        axes.set_title(f"joint {joint + 1}", fontsize=10)
        axes.set_ylabel(f"RMS error [{UNITS[joint]}]")
    legend_below(drawn, three[0], columns=len(names))
    return drawn


def report(outcomes: Outcomes) -> Report:
    """Return the paper's picture, its table for either way of sending, and further controllers."""
    bases = tuple(str(angle) for angle in ANGLES_DEG if outcomes.of(follow_sinusoids, base=str(angle)))
    titles = {"increments": "Sent as workspace increments, as the paper did", "joints": "Sent as joint references"}
    tables = [TitledTable(titles[way], error_table(outcomes, bases, way, CONTROLLERS)) for way in WAYS]
    tables.append(
        TitledTable(f"Better sensors, and other controllers: nominal robot, base at {LAST} deg", others_table(outcomes))
    )
    drawn = picture(outcomes, bases, CONTROLLERS)
    caption = "RMS of desired minus reported position by base angle; bars are means, dots are robots"
    return Report([one for one in tables if one.table.rows], [TitledPicture(caption, drawn)], _efforts_told(outcomes))


def efforts(outcomes: Outcomes, base: str, controller: str, joint: int) -> Floats:
    """Return the RMS of a controller's PD term on a joint, robot by robot [Nm|N]."""
    key = f"{controller} absolute"
    found = [one[key] for one in outcomes.of(follow_sinusoids, base=base, way="increments") if key in one]
    return np.array([one["pd_share"][joint] * one["rms_torque"][joint] for one in found])


def _efforts_told(outcomes: Outcomes) -> list[str]:
    """Say what PD still gives to joints 1 and 3: how much of gravity SG lacks, and what gravity is to joint 3."""
    first = {name: efforts(outcomes, LAST, name, 0) for name in CONTROLLERS}
    third = {name: efforts(outcomes, LAST, name, 2) for name in CONTROLLERS}
    if not all(len(found) for found in first.values()):
        return []
    one, three = (
        ", ".join(f"{CALLED[name]} {mean_and_spread(found, 2)} {unit}" for name, found in by_name.items())
        for by_name, unit in ((first, "Nm"), (third, "N"))
    )
    return [
        f"RMS of the PD term at {LAST} deg, joint 1: {one}; joint 3, nearly all of it to overcome its own damping: "
        f"{three}."
    ]


def gain_of_dg(outcomes: Outcomes, base: str) -> Judgement:
    """Judge by how much joint 1's error with DG lies below PD's on a base: the paper's 12 % on both."""
    gain = gains(outcomes, base, "dg", 0)
    close = abs(gain.mean() - published.GAIN_PERCENT) <= CLOSE
    return graded(close, gain.mean() > 0.0, f"{mean_and_spread(gain, 1)} % below PD")


def _no_gain_of_sg(outcomes: Outcomes) -> Judgement:
    gain, level = gains(outcomes, LAST, "sg", 0), gains(outcomes, "0", "sg", 0)
    told = f"{mean_and_spread(gain, 1)} % below PD at {LAST} deg, {mean_and_spread(level, 1)} % at 0 deg"
    dynamic = gains(outcomes, LAST, "dg", 0)
    return graded(gain.mean() < NO_GAIN, gain.mean() < dynamic.mean(), told)


def _order(outcomes: Outcomes) -> Judgement:
    means = [errors(outcomes, LAST, "increments", name) for name in CONTROLLERS]
    pd, sg, dg = (float(each[:, 0].mean()) for each in means)
    told = ", ".join(mean_and_spread(each[:, 0]) for each in means)
    return by_count([pd > sg, sg > dg], f"{told} deg")


def _static_increases(outcomes: Outcomes) -> Judgement:
    found = {str(angle): errors(outcomes, str(angle), "increments", "sg")[:, 0] for angle in ANGLES_DEG}
    told = ", ".join(f"{angle} deg {mean_and_spread(each)}" for angle, each in found.items())
    last = float(found[LAST].mean())
    rises = [last > float(each.mean()) for angle, each in found.items() if angle != LAST]
    return graded(all(rises), rises[0], f"joint 1, {CALLED['sg']}: {told} deg")


def _less_effort(outcomes: Outcomes) -> Judgement:
    pairs = {angle: [efforts(outcomes, str(angle), name, 0) for name in ("sg", "dg")] for angle in ANGLES_DEG[1:]}
    told = ", ".join(
        f"{angle} deg {mean_and_spread(sg, 2)} to {mean_and_spread(dg, 2)}" for angle, (sg, dg) in pairs.items()
    )
    return by_count([dg.mean() < sg.mean() for sg, dg in pairs.values()], f"SG to DG: {told} Nm")


def _joint_3_worse(outcomes: Outcomes) -> Judgement:
    parts = {name: -gains(outcomes, LAST, name, 2) for name in ("sg", "dg")}
    told = ", ".join(f"{CALLED[name]} {mean_and_spread(each, 2)} %" for name, each in parts.items())
    return by_count([each.mean() > 0.0 for each in parts.values()], f"against PD: {told}")


def _joint_3_not_better(outcomes: Outcomes) -> Judgement:
    parts = {name: gains(outcomes, LAST, name, 2) for name in ("sg", "dg")}
    told = ", ".join(f"{CALLED[name]} {mean_and_spread(each, 2)} %" for name, each in parts.items())
    return by_count([each.mean() < SIGNIFICANT for each in parts.values()], f"below PD: {told}")


CLAIMS = (
    Claim(
        "Joint 1's error is about 12 % below PD's with DG at 20 deg",
        "V-B, figure 9",
        "around 12 %",
        f"within {CLOSE:.0f} percentage points in the mean over robots; same direction: below",
        partial(gain_of_dg, base=LAST),
    ),
    Claim(
        "At 20 deg SG's wrong vector has negated its improvement of joint 1",
        "V-B, figure 9",
        "no improvement",
        f"less than {NO_GAIN:.0f} % below PD in the mean over robots; same direction: a smaller gain than DG's",
        _no_gain_of_sg,
        "SG lacks a part of gravity, PD alone all of it (remark), so SG must still help; to lose all gain the nominal "
        "vector would have to be as wrong as none. The paper's robot may have been off level at its 0 deg.",
    ),
    Claim(
        "Joint 1's tracking error at 20 deg: PD > SG > DG",
        "V-B, figure 9",
        "DG best; SG at PD's level",
        "both inequalities, mean over robots",
        _order,
    ),
    Claim(
        "The error of joint 1 with SG increases at 20 deg",
        "V-B, figure 9",
        "increased; no number",
        "joint 1's RMS error with SG is larger at 20 deg than at every smaller angle, mean over robots; same "
        "direction: than at 0 deg",
        _static_increases,
    ),
    Claim(
        "Sensed gravity decreases the PD term's effort in tracking",
        "VI",
        "decreased; no number",
        "RMS of joint 1's PD term smaller with DG than with SG on every tilted base, mean over robots; same "
        "direction: on more than half of them",
        _less_effort,
    ),
    Claim(
        "Joint 3 has higher errors with compensation",
        "V-B, figure 9",
        "higher; no number",
        "higher than PD's with SG and with DG at 20 deg, mean over robots",
        _joint_3_worse,
        "Joint 3's error is the lag of its own damping: its PD term has that to overcome with every controller "
        "(remark), and no gravity model, right or wrong, shows in it. Other friction and another coupling do not "
        "change that: experiment gravity-joint-3.",
    ),
    Claim(
        "Joint 3 does not improve significantly",
        "VI",
        "not significantly; no number",
        f"less than {SIGNIFICANT:g} % below PD's with SG and with DG at 20 deg, mean over robots",
        _joint_3_not_better,
    ),
)

EXPERIMENT = Experiment(
    name="gravity-figure-9",
    paper="gravity",
    place="figure 9",
    title="Tracking on a tilted base",
    about=after_headline(__doc__),
    cases=cases,
    report=report,
    minutes=17.0,
    claims=CLAIMS,
)
