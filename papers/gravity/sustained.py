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

The acceleration of `events.py` on the nominal robot, as it is and with one thing taken away after the other. Ideal is
the missing torque over kp. Friction may hold the joint that far from its place, before as after. The paper claims
nothing of it.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from catenary import CablePlant, gravity_torque, load_robot
from catenary.arrays import Floats
from catenary.simulation.cable_parameters import CableArm, load_cable_arm
from catenary.spatial import LEVEL
from catenary.transmission.cable_coupling import winding_of
from catenary.workflows.gravity.motions import RAVEN_START
from catenary.workflows.gravity.simulated_arm import raven_gains
from papers.experiment import Case, Experiment, Outcomes, Plain, Report, Result, Scope, TitledPicture, run
from papers.figures import FOUR_COLORS, LABELS, panels
from papers.gravity.events import ACCELERATION, ALONG, ONSET, CuedBase, respond
from papers.kit import table
from papers.plant.targets import joint_1_friction

CONTROLLERS = ("sg", "pd")
SLOW = 2.0  # [s] an onset that the arm follows without swinging
FRICTION = ("rotor_friction", "rotor_load_friction", "link_friction", "link_load_friction")
STEP = 1e-5  # [rad|m] of the finite differences of gravity
AS_IT_IS, NO_FRICTION, BELIEVED = "as it is", "no friction", "no friction, drives as believed"
# the arm, and how quickly the acceleration comes [s]
RUNS: tuple[tuple[str, float], ...] = ((AS_IT_IS, ONSET), (AS_IT_IS, SLOW), (NO_FRICTION, ONSET), (BELIEVED, ONSET))


def without_friction(arm: CableArm) -> CableArm:
    """Return the arm without any friction of its positioning joints."""
    return arm._replace(cable=arm.cable.replace(**{name: np.zeros(3) for name in FRICTION}))


def with_believed_drives(arm: CableArm) -> CableArm:
    """Return the arm with the ratios and the coupling that its firmware assumes."""
    return arm._replace(cable=arm.cable.replace(ratio_error=np.zeros(3), coupling=arm.firmware.coupling.copy()))


def arm_of(name: str) -> CableArm:
    """Return the nominal robot, as it is or with something taken away from it."""
    arm = load_cable_arm()
    if name == AS_IT_IS:
        return arm
    return with_believed_drives(without_friction(arm)) if name == BELIEVED else without_friction(arm)


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
    follow = np.linalg.inv(true) @ np.linalg.inv(R) @ believed  # true joints per reported, cables not stretched
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


@run(revision=1)
def accelerated(*, robot: str, onset: float, controllers: Sequence[str]) -> Result:
    """Home a robot, and drive its base off under each controller.

    Returns:
        By controller the change of joint 1's error [deg]: "ideal", delta g / kp; "expected", with the drives and
        gravity's own stiffness, without friction; "band", by which friction may keep the joint from its place, before
        as after, to either side; "simulated"; and "time" [s] with "change" for the picture.
    """
    arm = arm_of(robot)
    plant = CablePlant(arm, base=CuedBase(acceleration=ACCELERATION, onset=onset))
    plant.home()
    ideal = float(np.rad2deg(missing()[0] / raven_gains(arm.firmware).kp[0]))
    changes = {}
    for name in controllers:
        response = respond(plant, "drive", name)
        changes[name] = {
            "ideal": ideal,
            "expected": float(np.rad2deg(frictionless(arm, name)[0])),
            "band": float(np.rad2deg(friction_band(arm))),
            "simulated": response.final,
            "largest": response.largest,
            "time": response.time,
            "change": [round(error - response.before, 5) for error in response.error],
        }
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


def cases(scope: Scope) -> list[Case]:
    """Return a case per robot and onset."""
    runs, controllers = (RUNS[2:3], CONTROLLERS[:1]) if scope.quick else (RUNS, CONTROLLERS)
    return [accelerated.case(robot=robot, onset=onset, controllers=list(controllers)) for robot, onset in runs]


def report(o: Outcomes) -> Report:
    """Return the expected and the simulated change of joint 1's error, and both over delta g / kp."""
    content = [
        [
            *(f"{_named(told)}, {LABELS[name]}", f"{each['expected']:+.4f}", f"± {each['band']:.4f}"),
            f"{each['simulated']:+.4f}",
            *(f"{each[what] / each['ideal']:.3f}" for what in ("expected", "simulated")),
        ]
        for told, result in o.items(accelerated)
        for name, each in result.items()
    ]
    header = (
        "robot, controller | expected [deg] | friction [deg] | simulated [deg] | expected / ideal | simulated / ideal"
    )
    torque, ideal = missing(), next(iter(o.of(accelerated)[0].values()))["ideal"]
    remark = (
        f"While the base accelerates and the controller is not told, the joints lack {torque[0]:.3f} Nm, "
        f"{torque[1]:.3f} Nm and {torque[2]:.3f} N; over kp, ideal, joint 1 changes by {ideal:+.4f} deg. Of the torque "
        f"asked of joint 1 it gets {drive_gain(load_cable_arm())[0, 0]:.3f}."
    )
    caption = f"Base accelerating at {ACCELERATION:g} m/s2 along x; change of joint 1's error, {LABELS[CONTROLLERS[0]]}"
    tables = [table("Change of joint 1's error", header, content)]
    return Report(tables, [TitledPicture(caption, _picture(o))], [remark])


def _named(told: dict[str, Plain]) -> str:
    return str(told["robot"]) + (f", in {told['onset']:g} s" if told["onset"] != ONSET else "")


def _picture(o: Outcomes) -> Any:
    figure, (axes,) = panels(1, 3.8)
    found = [(told, result[CONTROLLERS[0]]) for told, result in o.items(accelerated)]
    for (told, change), color in zip(found, FOUR_COLORS, strict=False):
        axes.plot(change["time"], change["change"], color=color, label=_named(told))
    first = found[0][1]
    axes.axhline(first["expected"], color="#7a8699", lw=0.8, ls="--", label="expected without friction")
    axes.axhline(first["ideal"], color="#7a8699", lw=0.8, ls=":", label="missing torque / kp")
    axes.set_xlabel("time since the base drove off [s]")
    axes.set_ylabel("change of joint 1's error [deg]")
    figure.legend(loc="outside upper center", frameon=False, fontsize=8, ncols=3)
    return figure


EXPERIMENT = Experiment(
    "gravity-sustained", "section VII", "Sustained acceleration of the base", __doc__,
    cases, report, minutes=2.0, drawn=0,
)  # fmt: skip
