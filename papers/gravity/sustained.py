"""A base that accelerates for long, and a controller that is not told: how far joint 1 goes, and why not delta g / kp.

Lewis and Hannaford 2014 leave sustained acceleration to future work. Through ideal drives PD with gains Kp goes by
delta g / Kp, where delta g = g(q, gravity - a) - g(q, gravity) is missing. Three things stand between that and a robot:

- Its drives. The firmware takes joint torques to motors by the nominal ratios and coupling C, the cables take them back
  by the true ones: joints get D = C*ᵀ (1 + R) C⁻ᵀ of what was asked for, R the relative errors of the ratios.
- Gravity's own stiffness G = dg/dq, at the joints' true positions, which move with the drives' ratios and with the
  stretch of the cables, stiffness K; and Gc, that of the term which a controller adds at the reported ones.
- Friction: a joint rests anywhere within friction / kp of its place, and stays where it first came to rest.

Without the last, linear, x the motion of the reported joints and y that of the true ones (`frictionless`):

    D (Gc - Kp) x = delta g + G y        y = C*⁻¹ ((1 + R)⁻¹ C x - K⁻¹ C*⁻ᵀ (delta g + G y))

Run it with `make gravity-figures`; it writes gravity_sustained.json and .html and prints the table.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catenary import CablePlant, gravity_torque, load_robot
from catenary.arrays import Floats
from catenary.reports.page import Block, Picture, Table, Text, picture
from catenary.simulation.cable_parameters import CableArm, load_cable_arm
from catenary.spatial import LEVEL
from catenary.transmission.coupling import winding_of
from catenary.workflows.gravity.motions import RAVEN_START
from catenary.workflows.gravity.simulated_arm import raven_gains
from papers.arguments import folder_argument
from papers.figures import FOUR_COLORS, LABELS, panels
from papers.gravity.step import ACCELERATION, ALONG, ONSET, CuedBase, Response, respond
from papers.plant.targets import joint_1_friction
from papers.results import shown, write_results

CONTROLLERS = ("sg", "pd")
SLOW = 2.0  # [s] an onset that the arm follows without swinging
FRICTION = ("rotor_friction", "rotor_load_friction", "link_friction", "link_load_friction")
STEP = 1e-5  # [rad|m] of the finite differences of gravity


class Case(NamedTuple):
    """An arm, and how quickly the acceleration comes."""

    name: str
    arm: CableArm
    onset: float  # [s]


class Change(NamedTuple):
    """By how much joint 1's error changed, and what is expected [deg]."""

    case: str
    onset: float  # [s]
    controller: str
    ideal: float  # delta g / kp
    expected: float  # with the drives and gravity's own stiffness, without friction
    band: float  # by which friction may keep a joint from its place, before as after, to either side
    simulated: float
    response: Response


def without_friction(arm: CableArm) -> CableArm:
    """Return the arm without any friction of its positioning joints."""
    return arm._replace(cable=arm.cable.replace(**{name: np.zeros(3) for name in FRICTION}))


def with_believed_drives(arm: CableArm) -> CableArm:
    """Return the arm with the ratios and the coupling that its firmware assumes."""
    return arm._replace(
        cable=arm.cable.replace(ratio_error=np.zeros(3), coupling=arm.firmware.coupling.copy())
    )


CASES = (
    Case("as it is", load_cable_arm(), ONSET),
    Case(f"as it is, in {SLOW:g} s", load_cable_arm(), SLOW),
    Case("no friction", without_friction(load_cable_arm()), ONSET),
    Case("no friction, drives as believed", with_believed_drives(without_friction(load_cable_arm())), ONSET),
)


def missing() -> Floats:
    """Return delta g at RAVEN_START, (3,) [Nm, Nm, N]."""
    return gravity_torque(load_robot("raven2"), RAVEN_START, -ACCELERATION * ALONG)


def drive_gain(arm: CableArm) -> Floats:
    """Return D (3, 3), from the joint torques asked of the firmware to those that the joints get without friction."""
    true, believed = _winding(arm.cable.coupling), _winding(arm.firmware.coupling)
    gain: Floats = true.T @ np.diag(1.0 + arm.cable.ratio_error) @ np.linalg.inv(believed.T)
    return gain


def frictionless(arm: CableArm, controller: str) -> Floats:
    """Return the change of the reported joints' error (3,) [rad, rad, m] without friction.

    Args:
        arm: Its numbers.
        controller: "pd" or "sg".
    """
    kp = np.diag(raven_gains(arm.firmware).kp)
    true, believed = _winding(arm.cable.coupling), _winding(arm.firmware.coupling)
    R = np.diag(1.0 + arm.cable.ratio_error)
    G = _gravity_stiffness(LEVEL - ACCELERATION * ALONG)
    Gc = _gravity_stiffness(LEVEL) if controller == "sg" else np.zeros((3, 3))
    follow = (
        np.linalg.inv(true) @ np.linalg.inv(R) @ believed
    )  # true joints per reported, cables not stretched
    stretch = np.linalg.inv(true) @ np.diag(1.0 / arm.cable.stiffness) @ np.linalg.inv(true.T)
    # y = loose (follow x - stretch delta g)
    loose = np.linalg.inv(np.eye(3) + stretch @ G)
    torque = missing() - G @ loose @ stretch @ missing()
    x = np.linalg.solve(drive_gain(arm) @ (Gc - kp) - G @ loose @ follow, torque)
    change: Floats = -np.asarray(x, dtype=np.float64)
    return change


def friction_band(arm: CableArm) -> float:
    """Return how far friction may keep joint 1 from its equilibrium, to either side [rad]."""
    torque = gravity_torque(load_robot("raven2"), RAVEN_START, LEVEL - ACCELERATION * ALONG)
    kp = raven_gains(arm.firmware).kp
    return joint_1_friction(arm, float(abs(torque[0]))) / float(drive_gain(arm)[0, 0] * kp[0])


def accelerated(case: Case, controllers: Sequence[str] = CONTROLLERS) -> list[Change]:
    """Home the arm, and drive its base off under each controller."""
    plant = CablePlant(case.arm, base=CuedBase(acceleration=ACCELERATION, onset=case.onset))
    plant.home()
    ideal = float(missing()[0] / raven_gains(case.arm.firmware).kp[0])
    changes = []
    for name in controllers:
        response = respond(plant, "drive", name)
        expected = float(frictionless(case.arm, name)[0])
        degrees = [float(np.rad2deg(value)) for value in (ideal, expected, friction_band(case.arm))]
        changes.append(
            Change(case.name, case.onset, name, degrees[0], degrees[1], degrees[2], response.final, response)
        )
    return changes


def _winding(coupling: Floats) -> Floats:
    """Return C (3, 3), the winding of the cables per joint."""
    return np.array([winding_of(coupling, unit) for unit in np.eye(3)]).T


def _gravity_stiffness(gravity: Floats) -> Floats:
    """Return dg/dq (3, 3) at RAVEN_START."""
    model, q = load_robot("raven2"), np.array(RAVEN_START)
    columns = [
        (gravity_torque(model, q + step, gravity) - gravity_torque(model, q - step, gravity)) / (2.0 * STEP)
        for step in STEP * np.eye(3)
    ]
    return np.stack(columns, axis=1)


def change_table(changes: Sequence[Change]) -> Table:
    """Return the expected and the simulated change of joint 1's error, and both over delta g / kp."""
    return Table(
        [
            "robot",
            "controller",
            "expected [deg]",
            "friction [deg]",
            "simulated [deg]",
            "expected / ideal",
            "simulated / ideal",
        ],
        [
            [
                change.case,
                LABELS[change.controller],
                f"{change.expected:+.4f}",
                f"± {change.band:.4f}",
                f"{change.simulated:+.4f}",
                f"{change.expected / change.ideal:.3f}",
                f"{change.simulated / change.ideal:.3f}",
            ]
            for change in changes
        ],
    )


def figure(changes: Sequence[Change]) -> Picture:
    """Draw joint 1's change of error over time under the first controller, for each case."""
    drawn, (axes,) = panels(1, 3.6)
    first = [change for change in changes if change.controller == changes[0].controller]
    for change, color in zip(first, FOUR_COLORS, strict=False):
        error = np.array(change.response.error) - change.response.before
        axes.plot(change.response.time, error, color=color, label=change.case)
    axes.axhline(first[0].expected, color="#7a8699", lw=0.8, ls="--", label="expected without friction")
    axes.axhline(first[0].ideal, color="#7a8699", lw=0.8, ls=":", label="missing torque / kp")
    axes.set_xlabel("time since the base drove off [s]")
    axes.set_ylabel("change of joint 1's error [deg]")
    axes.legend(frameon=False, fontsize=8, ncols=3)
    return picture(
        drawn, f"Base accelerating at {ACCELERATION:g} m/s2 along x; {LABELS[first[0].controller]}."
    )


def main(
    folder: Path, cases: Sequence[Case] = CASES, controllers: Sequence[str] = CONTROLLERS
) -> list[Change]:
    """Run all cases, print the table, write gravity_sustained.json and .html."""
    changes: list[Change] = []
    for case in cases:
        changes += accelerated(case, controllers)
        print(f"  {case.name}: done", file=sys.stderr, flush=True)
    blocks: list[Block] = [figure(changes)]
    blocks += shown("Joint 1", change_table(changes))
    blocks.append(
        Text(
            f"Ideal is the missing torque over kp, {changes[0].ideal:+.4f} deg. Expected has the drives' true ratios "
            "and coupling and gravity's own stiffness in it, and no friction. Friction may hold the joint that far "
            "from its place, before as after. The acceleration comes within "
            f"{ONSET:g} s, where the row does not say otherwise. Errors are desired minus reported position."
        )
    )
    write_results(
        folder,
        "gravity_sustained",
        "Sustained acceleration of the base, simulated",
        "How far joint 1 goes when its controller is not told, with and without friction, and what is expected.",
        blocks,
        configuration={
            "robot": "nominal",
            "pose": list(RAVEN_START),
            "acceleration_m_s2": ACCELERATION,
            "cases": [case.name for case in cases],
            "controllers": list(controllers),
            "onset_s": [case.onset for case in cases],
            "missing_torque": missing().tolist(),
        },
        results=[{**change._asdict(), "response": change.response._asdict()} for change in changes],
    )
    return changes


if __name__ == "__main__":
    main(folder_argument(__doc__))
