"""Joint 3 with and without compensation, on robots whose insertion has other friction and another coupling.

The gravity paper says that joint 3 has higher errors with compensation (V-B). The simulated robot's numbers for joint 3
are taken far to either side, to see whether that is a matter of these: the sinusoids of figure 9 as joint references,
one cycle along each axis, base at 20 degrees, the accelerometer in the loop. With absolute damping, the robot's own,
nearly all of the error is the lag kd / kp times the speed, which no gravity term touches; with damping relative to the
reference there is none.
"""

from collections.abc import Sequence

import numpy as np

from catenary.arrays import Floats
from catenary.control.pd import Damping
from catenary.reports.page import Table
from catenary.simulation.cable_parameters import CableArm, load_cable_arm
from papers.claims import NOT_MEASURED, by_count
from papers.experiment import (
    Case,
    Claim,
    Experiment,
    Judgement,
    Outcomes,
    Report,
    Result,
    Scope,
    TitledTable,
    run,
)
from papers.figures import LABELS
from papers.gravity.raven_base import turned_base
from papers.gravity.tracking import CONTROLLERS, run_controllers

# factors of joint 3's friction, and of its coupling to joints 1 and 2
VARIATIONS = {
    "as it is": (1.0, 1.0),
    "friction times 4": (4.0, 1.0),
    "friction over 4": (0.25, 1.0),
    "coupling 30 % more": (1.0, 1.3),
    "coupling 30 % less": (1.0, 0.7),
}
DAMPINGS: tuple[Damping, ...] = ("absolute", "relative")
BASE_DEG = 20.0
FRICTION = ("rotor_friction", "rotor_load_friction", "link_friction", "link_load_friction")
JOINT = 2


def varied_joint_3(friction: float, coupling: float) -> CableArm:
    """Return the nominal robot with joint 3's friction, and its coupling to joints 1 and 2, times a factor."""
    arm = load_cable_arm()
    only_3 = np.array([1.0, 1.0, friction])
    changed: dict[str, Floats] = {name: getattr(arm.cable, name) * only_3 for name in FRICTION}
    changed["coupling"] = arm.cable.coupling * [1.0, coupling, coupling]
    return arm._replace(cable=arm.cable.replace(**changed))


@run(revision=1)
def joint_3_errors(
    friction: float, coupling: float, damping: Damping, controllers: Sequence[str], axes: Sequence[str]
) -> Result:
    """Follow the sinusoids with a varied joint 3; return its RMS error by controller [mm]."""
    wanted = [(name, damping) for name in controllers]
    arm = varied_joint_3(friction, coupling)
    runs = run_controllers(None, turned_base(BASE_DEG), wanted, cycles=1, axes=axes, arm=arm)
    return {one.controller: one.rms_error[JOINT] for one in runs}


def cases(scope: Scope) -> list[Case]:
    """Return a case per variation and damping, of the nominal robot."""
    varied = list(VARIATIONS.values())
    return [
        joint_3_errors.case(
            friction=friction,
            coupling=coupling,
            damping=damping,
            controllers=CONTROLLERS[::2] if scope.quick else CONTROLLERS,
            axes=["z"] if scope.quick else ["x", "y", "z"],
        )
        for friction, coupling in (varied[1:2] if scope.quick else varied)
        for damping in (DAMPINGS[1:] if scope.quick else DAMPINGS)
    ]


def errors(outcomes: Outcomes) -> dict[tuple[str, str], Result]:
    """Return joint 3's RMS error [mm] of each controller, by variation and damping."""
    return {
        (name, told["damping"]): result
        for name, (friction, coupling) in VARIATIONS.items()
        for told, result in outcomes.items(joint_3_errors, friction=friction, coupling=coupling)
    }


def report(outcomes: Outcomes) -> Report:
    """Return joint 3's error with PD alone, and by how much compensation changes it."""
    rows = []
    for (name, damping), error in errors(outcomes).items():
        changes = [
            f"{100.0 * (error[c] / error['pd'] - 1.0):+.2f}" if c in error else "-" for c in CONTROLLERS[1:]
        ]
        rows.append([f"{name}, {damping} damping", f"{error['pd']:.4f}", *changes])
    header = ["robot", "PD [mm]", *(f"{LABELS[c]} against PD [%]" for c in CONTROLLERS[1:])]
    return Report([TitledTable("RMS error of joint 3", Table(header, rows))])


def _worse(outcomes: Outcomes) -> Judgement:
    found = errors(outcomes)
    if not found:
        return NOT_MEASURED
    changes = [100.0 * (e[c] / e["pd"] - 1.0) for e in found.values() for c in CONTROLLERS[1:]]
    told = f"{np.min(changes):+.2f} to {np.max(changes):+.2f} % against PD"
    return by_count([change > 0.0 for change in changes], told)


CLAIMS = (
    Claim(
        "Joint 3 has higher errors with compensation, whatever its friction and coupling",
        "V-B",
        "higher; no number",
        "above PD with SG and DG for every variation and damping; same direction: for more than half",
        _worse,
    ),
)

EXPERIMENT = Experiment(
    name="gravity-joint-3",
    paper="gravity",
    place="V-B",
    title="Joint 3 with other friction and coupling",
    about=(__doc__ or "").partition("\n")[2].strip(),
    cases=cases,
    report=report,
    minutes=8.0,
    claims=CLAIMS,
    drawn=0,
)
