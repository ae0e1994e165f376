"""Joint 3 with and without compensation, on robots whose insertion has other friction and another coupling.

Lewis and Hannaford 2014, section V-B: joint 3 has higher errors with gravity compensation. The simulated robot does not
show it. Here its numbers for joint 3 are taken far to either side, to see whether that is a matter of these: the
Cartesian sinusoids of figure 9, one cycle along each axis, base at 20 degrees, with either damping.

Run it with `make gravity-figures`; it writes gravity_joint_3.json and .html and prints the table.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, get_args

import numpy as np

from catenary.arrays import Floats
from catenary.control.pd import Damping
from catenary.reports.page import Block, Table, Text
from catenary.simulation.cable_parameters import CableArm, load_cable_arm
from papers.arguments import folder_argument
from papers.figures import LABELS
from papers.gravity.raven_base import turned_base
from papers.gravity.tracking import CONTROLLERS, Run, run_controllers
from papers.results import shown, write_results

BASE_DEG = 20.0
FRICTION = ("rotor_friction", "rotor_load_friction", "link_friction", "link_load_friction")
JOINT = 2


class Variation(NamedTuple):
    """A robot whose joint 3 is another."""

    name: str
    friction: float = 1.0  # factor of joint 3's
    coupling: float = 1.0  # factor of c02 and c12


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


def joint_3_table(runs: Sequence[tuple[str, Run]]) -> Table:
    """Return the RMS error of joint 3 with PD alone, and by how much compensation changes it."""
    errors = {(name, run.damping, run.controller): run.rms_error[JOINT] for name, run in runs}
    rows = []
    for name, damping in dict.fromkeys((name, run.damping) for name, run in runs):
        plain = errors[name, damping, "pd"]
        changes = [100.0 * (errors[name, damping, c] / plain - 1.0) for c in CONTROLLERS[1:]]
        rows.append([name, damping, f"{plain:.4f}", *(f"{change:+.2f} %" for change in changes)])
    compared = [f"{LABELS[c]} against PD" for c in CONTROLLERS[1:]]
    return Table(["robot", "damping", "PD [mm]", *compared], rows)


def main(
    folder: Path,
    variations: Sequence[Variation] = VARIATIONS,
    axes: Sequence[str] = ("x", "y", "z"),
    dampings: Sequence[Damping] = get_args(Damping),
) -> list[tuple[str, Run]]:
    """Run all robots, print the table, write gravity_joint_3.json and .html; the runs by their robots' names."""
    wanted: list[tuple[str, Damping]] = [(name, d) for d in dampings for name in CONTROLLERS]
    runs: list[tuple[str, Run]] = []
    for variation in variations:
        arm, base = varied_joint_3(variation), turned_base(BASE_DEG)
        done = run_controllers(None, base, wanted, cycles=1, axes=axes, arm=arm)
        runs += [(variation.name, run) for run in done]
        print(f"  {variation.name}: done", file=sys.stderr, flush=True)
    blocks: list[Block] = shown("RMS error of joint 3", joint_3_table(runs))
    blocks.append(
        Text(
            "With absolute damping, the robot's own, nearly all of the error is the lag kd / kp times the speed, which "
            "no gravity term touches; with damping relative to the reference there is none."
        )
    )
    write_results(
        folder,
        "gravity_joint_3",
        "Joint 3 with other friction and coupling, simulated",
        "Does gravity compensation make joint 3 worse, as Lewis and Hannaford 2014 say of theirs?",
        blocks,
        configuration={
            "robot": "nominal, joint 3 varied",
            "variations": [variation.name for variation in variations],
            "base_deg": BASE_DEG,
            "cycles": 1,
            "axes": list(axes),
        },
        results=[{"variation": name, **run._asdict()} for name, run in runs],
    )
    return runs


if __name__ == "__main__":
    main(folder_argument(__doc__))
