"""Joint 3 with and without compensation, on robots whose insertion has other friction and another coupling.

Lewis and Hannaford 2014, section V-B: "Joint 3 had higher errors with gravity compensated control over PD-only
control". Whether it has is judged by figure 9's own runs; here is looked into why not. Joint 3's numbers are taken far
to either side, to see whether it is a matter of these: the Cartesian sinusoids of figure 9, one cycle along each axis,
sent as joint references, base at 20 degrees, an accelerometer in the loop, with either damping. With absolute damping,
the robot's own, nearly all of joint 3's error is the lag kd / kp times its speed, which no gravity term touches; with
damping relative to the reference there is none.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, get_args

import numpy as np

from catenary.arrays import Floats
from catenary.control.pd import Damping
from catenary.reports.page import Table
from catenary.simulation.cable_parameters import CableArm, load_cable_arm
from papers.claims import mean_and_spread
from papers.experiment import (
    Case,
    Experiment,
    Outcomes,
    Report,
    Result,
    Scope,
    TitledPicture,
    TitledTable,
    after_headline,
    run,
)
from papers.figures import COLORS, LABELS, panels
from papers.gravity.raven_base import turned_base
from papers.gravity.tracking import CONTROLLERS, run_controllers

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BASE_DEG = 20.0
FRICTION = ("rotor_friction", "rotor_load_friction", "link_friction", "link_load_friction")
JOINT = 2


class Variation(NamedTuple):
    """A robot whose joint 3 is another."""

    name: str
    friction: float = 1.0  # factor of joint 3's
    coupling: float = 1.0  # factor of c02 and c12


COMPENSATED = CONTROLLERS[1:]

VARIATIONS = (
    Variation("as it is"),
    Variation("friction times 4", friction=4.0),
    Variation("friction over 4", friction=0.25),
    Variation("coupling 30 % more", coupling=1.3),
    Variation("coupling 30 % less", coupling=0.7),
)


def varied_joint_3(variation: Variation) -> CableArm:
    """Return the nominal robot with another joint 3."""
    arm = load_cable_arm()
    only_3 = np.array([1.0, 1.0, variation.friction])
    changed: dict[str, Floats] = {name: getattr(arm.cable, name) * only_3 for name in FRICTION}
    changed["coupling"] = arm.cable.coupling * [1.0, variation.coupling, variation.coupling]
    return arm._replace(cable=arm.cable.replace(**changed))


@run(revision=1)
def errors(
    *,
    seed: int | None,
    friction: float,
    coupling: float,
    damping: Damping,
    controllers: Sequence[str],
    axes: Sequence[str],
) -> Result:
    """Follow the motion with each controller; return joint 3's RMS error by controller [mm].

    Args:
        seed: Of the robot; the nominal one when None.
        friction: Factor of joint 3's friction.
        coupling: Factor of c02 and c12.
        damping: Of the controllers.
        controllers: Of which each follows one cycle.
        axes: Of the sinusoids.
    """
    arm = varied_joint_3(Variation("", friction, coupling))
    wanted = [(name, damping) for name in controllers]
    runs = run_controllers(seed, turned_base(BASE_DEG), wanted, cycles=1, axes=axes, arm=arm)
    return {each.controller: float(each.rms_error[JOINT]) for each in runs}


def cases(scope: Scope) -> list[Case]:
    """Return a case per robot, variation and damping."""
    variations, axes = (VARIATIONS[:1], ["z"]) if scope.quick else (VARIATIONS, ["x", "y", "z"])
    dampings = ("absolute",) if scope.quick else get_args(Damping)
    return [
        errors.case(
            seed=seed,
            friction=variation.friction,
            coupling=variation.coupling,
            damping=damping,
            controllers=list(CONTROLLERS[::2] if scope.quick else CONTROLLERS),
            axes=axes,
        )
        for seed in scope.robots
        for variation in variations
        for damping in dampings
    ]


def changes(
    outcomes: Outcomes, controller: str, variation: Variation = VARIATIONS[0], damping: Damping = "absolute"
) -> Floats:
    """Return by how much a controller changes joint 3's error against PD [%], one for each robot."""
    found = outcomes.of(errors, friction=variation.friction, coupling=variation.coupling, damping=damping)
    return np.array([100.0 * (result[controller] / result["pd"] - 1.0) for result in found if controller in result])


def report(outcomes: Outcomes) -> Report:
    """Return joint 3's RMS error with PD alone, and by how much compensation changes it."""
    rows = []
    for damping in get_args(Damping):
        for variation in VARIATIONS:
            found = outcomes.of(errors, friction=variation.friction, coupling=variation.coupling, damping=damping)
            if found:
                compared = [mean_and_spread(changes(outcomes, name, variation, damping), 2) for name in COMPENSATED]
                plain = mean_and_spread((result["pd"] for result in found), 4)
                rows.append([f"{variation.name}, {damping} damping", plain, *compared])
    if not rows:
        return Report()
    header = ["joint 3, damping", "PD [mm]", *(f"{LABELS[name]} against PD [%]" for name in COMPENSATED)]
    caption = "Joint 3's RMS error against PD alone; bars are means, dots are robots"
    return Report(
        [TitledTable(f"RMS error of joint 3, base at {BASE_DEG:g} deg", Table(header, rows))],
        [TitledPicture(caption, _picture(outcomes))],
        _highest(outcomes),
    )


def _highest(outcomes: Outcomes) -> list[str]:
    """Say how far compensation raises joint 3's error at most, of all variations."""
    remarks = []
    for damping in get_args(Damping):
        found = {
            (variation.name, name): changes(outcomes, name, variation, damping)
            for variation in VARIATIONS
            for name in COMPENSATED
        }
        found = {key: values for key, values in found.items() if len(values)}
        if found:
            variation, name = max(found, key=lambda key: float(found[key].mean()))
            values = found[variation, name]
            remarks.append(f"{damping} damping {mean_and_spread(values, 2)} % ({variation}, {LABELS[name]})")
    told = "; ".join(remarks)
    return [f"Joint 3's error with compensation against PD alone, where it comes out highest: {told}."] if told else []


def _picture(outcomes: Outcomes) -> "Figure":
    figure, axes = panels(2, 3.6)
    for panel, damping in zip(axes, get_args(Damping), strict=True):
        for k, name in enumerate(COMPENSATED):
            for i, variation in enumerate(VARIATIONS):
                found = changes(outcomes, name, variation, damping)
                if len(found):
                    place = i + 0.4 * (k - 0.5)
                    label = LABELS[name] if i == 0 else None
                    panel.bar(place, found.mean(), 0.36, color=COLORS[name], label=label)
                    panel.plot(np.full(len(found), place), found, "o", color="white", mec="#1c2430", ms=3)
        panel.axhline(0.0, color="#1c2430", lw=0.8)
        panel.set_xticks(
            range(len(VARIATIONS)), [each.name for each in VARIATIONS], fontsize=8, rotation=20, ha="right"
        )
        panel.set_title(f"{damping} damping", fontsize=10)
    axes[0].set_ylabel("joint 3's error against PD [%]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False, fontsize=9)
    return figure


EXPERIMENT = Experiment(
    name="gravity-joint-3",
    paper="gravity",
    place="section V-B",
    title="Joint 3 with other friction and coupling",
    about=after_headline(__doc__),
    cases=cases,
    report=report,
    minutes=6.0,
    drawn=2,
)
