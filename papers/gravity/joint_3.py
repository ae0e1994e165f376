"""Joint 3 with and without compensation, on robots whose insertion has other friction and another coupling.

Lewis and Hannaford 2014, section V-B: "Joint 3 had higher errors with gravity compensated control over PD-only
control". Whether it has is judged by figure 9's own runs; here is looked into why not. Joint 3's numbers are taken far
to either side, to see whether it is a matter of these: the Cartesian sinusoids of figure 9, one cycle along each axis,
sent as joint references, base at 20 degrees, an accelerometer in the loop, with either damping. With absolute damping,
the robot's own, nearly all of joint 3's error is the lag kd / kp times its speed, which no gravity term touches; with
damping relative to the reference there is none.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, get_args

import numpy as np

from catenary.arrays import Floats
from catenary.control.pd import Damping
from catenary.simulation.cable_parameters import CableArm
from papers.experiment import Case, Experiment, Outcomes, Report, Result, Scope, run
from papers.figures import COLORS, LABELS, legend_above, panels
from papers.gravity.raven_base import raven_of_2014, turned_base
from papers.gravity.tracking import CONTROLLERS, run_controllers
from papers.kit import Missing, mean_and_spread, rows, sample, table

BASE_DEG = 20.0
FRICTION = ("rotor_friction", "rotor_load_friction", "link_friction", "link_load_friction")
JOINT = 2
DAMPINGS: tuple[Damping, ...] = get_args(Damping)


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
    arm = raven_of_2014()
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
    """Follow the motion with each controller; return joint 3's RMS error by controller [mm]."""
    arm = varied_joint_3(Variation("", friction, coupling))
    pairs = [(name, damping) for name in controllers]
    runs = run_controllers(seed, turned_base(BASE_DEG), pairs, cycles=1, axes=axes, arm=arm)
    return {each.controller: float(each.rms_error[JOINT]) for each in runs}


def cases(scope: Scope) -> list[Case]:
    """Return a case per robot, variation and damping."""
    few = scope.quick
    controllers, axes = (list(CONTROLLERS[::2]), ["z"]) if few else (list(CONTROLLERS), ["x", "y", "z"])
    return [
        errors.case(
            seed=seed, friction=each.friction, coupling=each.coupling, damping=damping,
            controllers=controllers, axes=axes,
        )
        for seed in scope.robots
        for each in (VARIATIONS[:1] if few else VARIATIONS)
        for damping in (("absolute",) if few else DAMPINGS)
    ]  # fmt: skip


def of(o: Outcomes, name: str, variation: Variation, damping: Damping) -> Floats:
    """Return joint 3's RMS error with a controller, robot by robot [mm]."""
    return sample(o, errors, name, friction=variation.friction, coupling=variation.coupling, damping=damping)


def changes(o: Outcomes, name: str, variation: Variation, damping: Damping) -> Floats:
    """Return by how much a controller changes joint 3's error against PD [%], robot by robot; empty where none ran."""
    try:
        return 100.0 * (of(o, name, variation, damping) / of(o, "pd", variation, damping) - 1.0)
    except Missing:
        return np.zeros(0)


def report(o: Outcomes) -> Report:
    """Return joint 3's RMS error with PD alone, and by how much compensation changes it."""

    def row(damping: Damping, each: Variation) -> list[str]:
        compared = [mean_and_spread(changes(o, name, each, damping), 2) for name in COMPENSATED]
        return [f"{each.name}, {damping} damping", f"{of(o, 'pd', each, damping):.4f}", *compared]

    header = ["joint 3, damping", "PD [mm]", *(f"{LABELS[name]} against PD [%]" for name in COMPENSATED)]
    tables = [table(f"RMS error of joint 3, base at {BASE_DEG:g} deg", header, rows(row, DAMPINGS, VARIATIONS))]
    caption = "Joint 3's RMS error against PD alone; bars are means, dots are robots"
    return Report(tables, {caption: _picture(o)}, _highest(o))


def _highest(o: Outcomes) -> list[str]:
    """Say how far compensation raises joint 3's error at most, of all variations."""
    parts = []
    for damping in DAMPINGS:
        by_case = {(each.name, name): changes(o, name, each, damping) for each in VARIATIONS for name in COMPENSATED}
        if there := [key for key, values in by_case.items() if len(values)]:
            worst = max(there, key=lambda key: float(by_case[key].mean()))
            parts.append(f"{damping} damping {by_case[worst]:.2f} % ({worst[0]}, {LABELS[worst[1]]})")
    return [f"Joint 3's error with compensation against PD alone, where it comes out highest: {'; '.join(parts)}."]


def _picture(o: Outcomes) -> Any:
    figure, axes = panels(2, 3.6)
    for panel, damping in zip(axes, DAMPINGS, strict=True):
        for k, name in enumerate(COMPENSATED):
            for i, variation in enumerate(VARIATIONS):
                samples = changes(o, name, variation, damping)
                if len(samples):
                    place, label = i + 0.4 * (k - 0.5), LABELS[name] if i == 0 else None
                    panel.bar(place, samples.mean(), 0.36, color=COLORS[name], label=label)
                    panel.plot(np.full(len(samples), place), samples, "o", color="white", mec="#1c2430", ms=3)
        panel.axhline(0.0, color="#1c2430", lw=0.8)
        names = [each.name for each in VARIATIONS]
        panel.set_xticks(range(len(VARIATIONS)), names, fontsize=8, rotation=20, ha="right")
        panel.set_title(f"{damping} damping", fontsize=10)
    axes[0].set_ylabel("joint 3's error against PD [%]")
    legend_above(figure, axes[0], columns=2)
    return figure


EXPERIMENT = Experiment(
    "gravity-joint-3", "section V-B", "Joint 3 with other friction and coupling", __doc__,
    cases, report, minutes=6.0, drawn=2,
)  # fmt: skip
