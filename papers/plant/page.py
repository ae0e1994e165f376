"""Target against reached, for every target of the simulated RAVEN-II, with the verdict and why."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catenary import Corrector
from catenary.arrays import Floats
from catenary.reports.page import Block, Heading, Remarks, Table, write_page
from catenary.simulation.cable_parameters import CableArm
from papers.calibration.published import (
    HOMINGS_J3,
    HOMINGS_LINEAR_J1,
    HOMINGS_LINEAR_J2,
    LOADED_LINEAR_HOUR_0,
    LOADED_LINEAR_HOUR_5,
    SIX_HOURS_LINEAR,
    SIX_HOURS_OFFSET,
    TABLE_1,
)
from papers.plant.evaluation import (
    directions,
    directions_in_turn,
    homed,
    homings,
    mean_errors,
    offset_model,
    recordings,
    six_hours,
)
from papers.plant.pd_share import BASE_ANGLES_DEG, pd_share
from papers.plant.targets import (
    CLOSE,
    DRIFT,
    FREE,
    FRICTION,
    JOINT_1_FRICTION,
    PD_SHARE_LIMIT,
    STATIC_SHARE_LIMIT,
    TARGETS,
    Free,
    joint_1_friction,
)

UNITS = "deg, deg, mm"
PAYLOAD = 0.5  # [kg]
LOSS_TRIED = 5.0  # times the rate at which cables lose stiffness
WHY_HOURS = [
    "Hour 0 conflicts with table I: without load and at once, the paper's linear model has .247 and .132 on J2 and J3 "
    "here, .186 and .166 in table I. They are two recordings of one robot; the simulated robot is that of table I.",
    "500 g: the paper's drift under load is twice that without, here it is smaller. Beyond the remote centre a weight "
    "takes load off joint 1's cable, and set grows with load: another law of wear would be needed, or another lever.",
    "Joint 1's set has the sign with which the raw error grows, as the paper's does from direction to direction.",
]
WHY_DIRECTIONS = [
    "Every zig-zag covers the same box evenly, so the mean that a fixed offset takes away is the same, whatever the "
    "robot: with one test motion the directions differ by 0.3 % at most. Run-out and its phases, coupling, the tool's "
    "friction, tried out to their bounds, change how large the error is, not that.",
    "The paper's raw errors differ between directions too, which no model of one robot at rest can do: on joint 1 they "
    "rise in the order of the table, from 1.930 to 2.219, as on a robot that wears while one direction is recorded "
    "after another. Joint 3's fixed offset of .628 beside .486 takes a shift of .4 mm between training and test: "
    "homing again, or another day. The last column is one robot, homed once, in the order of the table, with a test "
    "motion for each: raw of joint 1 rises there too, and fixed offsets differ by up to a fifth.",
]
WHY_HOMING = [
    "While joint 1 is still on its way to its stop, joint 2's motor, already at its own, follows the coupling: where "
    "homing begins shows in joint 2's registration. Here each homing draws it anew; the paper's grows.",
]


class Fitted(NamedTuple):
    """By which factors the refit moved the parameters."""

    friction: Floats
    table_1: Floats
    drift: Floats
    loss: Floats  # (3,) relative change of the last hour's error when cables lose stiffness LOSS_TRIED times as fast

    def table(self) -> Table:
        """Return every free parameter with its factor and its bounds."""
        groups: tuple[tuple[str, tuple[Free, ...], Floats], ...] = (
            ("static gravity test", FRICTION, self.friction),
            ("table I", FREE, self.table_1),
            ("six-hour drift", DRIFT, self.drift),
        )
        return Table(
            ["parameter", "joint", "fitted to", "factor", "allowed"],
            [
                [
                    free.field,
                    f"J{free.joint + 1}",
                    to,
                    f"{factor:.3f}",
                    f"{1 / free.factor:.2f} to {free.factor:.2f}",
                ]
                for to, group, factors in groups
                for free, factor in zip(group, factors, strict=True)
            ],
        )

    def about_loss(self) -> str:
        """Say why the rate of stiffness loss was not fitted."""
        return (
            f"The rate of stiffness loss is not fitted: with {LOSS_TRIED:.0f} times the rate, the linear model's error "
            f"of the last hour changes by {', '.join(f'{share:+.1%}' for share in self.loss)} (J1, J2, J3). The drift "
            "does not tell it; it stays assumed."
        )


class Section(NamedTuple):
    """One table of the page: target against reached, and why what was not reached was not."""

    title: str
    table: Table
    remarks: Sequence[str]


def verdict(reached: Floats, target: Sequence[float]) -> str:
    """Say "reached", or which joints are off by how much."""
    off = np.asarray(reached) / np.asarray(target) - 1.0
    missed = [f"J{j + 1} {share:+.0%}" for j, share in enumerate(off) if abs(share) > CLOSE]
    return ", ".join(missed) or "reached"


def table_1(arm: CableArm) -> Section:
    """Compare the nine errors that ratios, coupling, run-out, hysteresis and stiffness were fitted to."""
    reached = mean_errors(arm)
    rows = [
        [key, _text(target), _text(reached[key]), verdict(reached[key], target)]
        for key, target in TARGETS.items()
    ]
    return Section(
        "Table I, direction J2-J3", Table(["RMSE", f"paper [{UNITS}]", "reached", "verdict"], rows), []
    )


def static_gravity(arm: CableArm) -> Section:
    """Compare PD's share of joint 1's torque on a tilted base."""
    corrector = Corrector(offset_model(recordings(homed(arm))[0]))
    rows, held = [], 0.0
    for angle in BASE_ANGLES_DEG:
        sensed, level = pd_share(arm, angle, sensed=True), pd_share(arm, angle, sensed=False)
        calibrated = pd_share(arm, angle, sensed=True, corrector=corrector)
        held = held or float(sensed.torque[0])
        tilted = angle == BASE_ANGLES_DEG[-1]
        good = sensed.share[0] < PD_SHARE_LIMIT and (not tilted or level.share[0] > STATIC_SHARE_LIMIT)
        rows.append(
            [
                f"{angle:.0f}",
                f"DG < {PD_SHARE_LIMIT:.0f}" + (f", SG > {STATIC_SHARE_LIMIT:.0f}" if tilted else ""),
                f"{sensed.share[0]:.1f}",
                f"{level.share[0]:.1f}",
                f"{calibrated.share[0]:.1f}",
                f"{sensed.share[1]:.0f}, {sensed.share[2]:.0f}",
                "reached" if good else "not reached",
            ]
        )
    friction, (least, most) = joint_1_friction(arm, held), JOINT_1_FRICTION
    table = Table(
        [
            "base [deg]",
            "target [%]",
            "DG, J1 [%]",
            "SG, J1 [%]",
            "DG calibrated, J1 [%]",
            "DG, J2, J3 [%]",
            "verdict",
        ],
        rows,
    )
    within = "within" if least <= friction <= most else "outside"
    remarks = [
        f"Friction of joint 1 in all, under the torque that holds it on a level base: {friction:.2f} Nm, {within} the "
        f"target of {least} to {most} Nm.",
        "The controller takes the positions that the robot reports, the firmware's PD gains in joint units, and "
        "gravity as the plant senses it (DG) or of a level base (SG). Joint 1 is reported about 2 deg wrong, and so "
        "gravity by about 0.1 Nm. With calibrated positions (fixed offset) PD has less to do. "
        "Joints 2 and 3 carry little weight: what holds them is friction.",
    ]
    return Section("Static gravity test", table, remarks)


def hours_and_loads(arm: CableArm) -> Section:
    """Compare six hours of motion, unloaded and with 500 g."""
    first, last = six_hours(arm)
    loaded_first, loaded_last = six_hours(arm, PAYLOAD)
    bare_first, bare_last = six_hours(arm, PAYLOAD, trained_loaded=False)
    rows = []
    for name, role, target, reached in (
        ("linear, hour 0", "checked", SIX_HOURS_LINEAR[0], first.linear),
        ("linear, hour 5", "fitted", SIX_HOURS_LINEAR[1], last.linear),
        ("fixed offset, hour 0", "checked", SIX_HOURS_OFFSET[0], first.offset),
        ("fixed offset, hour 5", "checked", SIX_HOURS_OFFSET[1], last.offset),
        ("linear, 500 g, hour 0", "checked", LOADED_LINEAR_HOUR_0, loaded_first.linear),
        ("linear, 500 g, hour 5", "checked", LOADED_LINEAR_HOUR_5, loaded_last.linear),
        ("the same, trained without load, hour 0", "checked", LOADED_LINEAR_HOUR_0, bare_first.linear),
        ("the same, trained without load, hour 5", "checked", LOADED_LINEAR_HOUR_5, bare_last.linear),
    ):
        rows.append([name, role, _text(target), _text(reached), verdict(reached, target)])
    table = Table(["RMSE", "role", f"paper [{UNITS}]", "reached", "verdict"], rows)
    return Section("Six hours of motion, unloaded and with 500 g", table, WHY_HOURS)


def every_direction(arm: CableArm) -> Section:
    """Compare raw error and fixed offset of every direction, on fresh robots and on one that wears."""
    fresh, worn = directions(arm), directions_in_turn(arm)
    rows = []
    for direction, published in TABLE_1.items():
        for name in ("raw", "fixed offset"):
            target = published[name]
            here = fresh[direction][name]
            cells = [_text(target), _text(here), verdict(here, target), _text(worn[direction][name])]
            rows.append([f"{direction}, {name}", *cells])
    header = ["RMSE", f"paper [{UNITS}]", "reached, fresh robot", "verdict", "reached, one after another"]
    return Section("Every direction", Table(header, rows), WHY_DIRECTIONS)


def after_homing(arm: CableArm) -> Section:
    """Compare a linear model before and after homing again, which it did not see in training."""
    reached = homings(arm)
    rows = []
    for k, here in enumerate(reached):
        paper = {0: HOMINGS_LINEAR_J2[0], len(reached) - 1: HOMINGS_LINEAR_J2[1]}.get(k)
        rows.append([f"after {k}", "-" if paper is None else f"-, {paper:.3f}, -", _text(here)])
    least, most = np.min(reached, axis=0), np.max(reached, axis=0)
    for name, values in (("least", least), ("greatest", most)):
        k = int(name == "greatest")
        paper_range = f"{HOMINGS_LINEAR_J1[k]:.3f}, {HOMINGS_LINEAR_J2[k]:.3f}, {HOMINGS_J3[k]:.3f}"
        rows.append([f"{name} of all", paper_range, _text(values)])
    table = Table(["homings", f"paper [{UNITS}]", "reached"], rows)
    spread = most - least
    spares = spread[1] > 2.0 * spread[0] and spread[0] < 0.1 and spread[2] < 0.1
    told = "reached" if spares else "not reached"
    return Section(
        "Homing again from wherever a motion ended",
        table,
        [f"J2 spreads, J1 and J3 are spared: {told}.", *WHY_HOMING],
    )


def sections(arm: CableArm) -> list[Section]:
    """Evaluate everything, printing each table as it is done."""
    done = []
    for section in (table_1, static_gravity, hours_and_loads, every_direction, after_homing):
        done.append(section(arm))
        show(done[-1].title, done[-1].table)
    return done


def write_plant_page(path: Path, arm: CableArm, fitted: Fitted | None = None) -> None:
    """Evaluate an arm and write target against reached, and what was fitted, if anything was just now."""
    path.parent.mkdir(parents=True, exist_ok=True)
    blocks: list[Block] = []
    for section in sections(arm):
        blocks += [Heading(section.title), section.table, Remarks(section.remarks)]
    if fitted is not None:
        blocks += [Heading("Parameters"), fitted.table(), Remarks([fitted.about_loss()])]
    write_page(
        path,
        "The simulated RAVEN-II: target against reached",
        "Peng et al., a real robot, and Lewis, Hannaford 2014, beside one simulated robot, its parameters fitted in "
        f"three steps. Reached: within {CLOSE:.0%} on every joint.",
        blocks,
        simulated=True,
    )


def show(title: str, table: Table) -> None:
    """Print a table as Markdown."""
    print(f"\n{title}\n\n| " + " | ".join(table.header) + " |\n|" + "---|" * len(table.header))
    for row in table.rows:
        print("| " + " | ".join(row) + " |", flush=True)


def _text(values: Sequence[float] | Floats) -> str:
    return ", ".join(f"{value:.3f}" for value in values)
