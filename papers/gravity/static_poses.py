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

from collections.abc import Sequence
from copy import deepcopy
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary import CablePlant, gravity_torque, run_loop
from catenary.arrays import Floats
from catenary.control.loop import GravitySource, Tick
from catenary.control.pd import SplitController
from catenary.spatial import LEVEL
from catenary.trajectories.reference import Rest
from catenary.workflows.gravity.simulated_arm import SimulatedArm, raven_arm
from catenary.workflows.gravity.trials import make_controller, make_hold, with_approach
from papers.experiment import Case, Outcomes, Result, Scope, run
from papers.gravity.raven_base import SHOWN, raven_of_2014, turned_base
from papers.gravity.tracking import gravity_source
from papers.kit import grid

Approach = Literal["placed", "driven"]
DRIVEN: Approach = "driven"
APPROACHES: tuple[Approach, ...] = ("placed", DRIVEN)
ANGLES_DEG = (0, 5, 10, 15, 20, 25)  # about Z0; the paper's text says 0 to 20, its figure 7 shows 25
POSES_DEG = (5.0, 21.0, 37.0, 53.0, 69.0, 85.0)  # of joint 1
QUICK_ANGLES_DEG, QUICK_POSES_DEG = (0, 25), (37.0,)
HOME = (np.pi / 2, 0.40)  # joints 2 and 3 [rad, m]
CONTROLLERS = ("pd", "sg", "dg")
SETTLE = 1.0  # [s] at a pose before it counts
RELEASE = 0.3  # [s] passively held before a controller takes over
WATCHED = 0.5  # [s] that count


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
    placing, free = make_controller("dg", arm), make_hold("dg", arm)
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
    rest = Rest(q, SETTLE + WATCHED)
    whole, begin = with_approach(arm, rest, 0.0) if move else (rest, 0.0)
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
    return sorted({told["angle_deg"] for told, _ in o.items(static)})


def approaches_of(o: Outcomes) -> list[Approach]:
    """Return the ways of coming to the poses that were run."""
    run_so = {told["approach"] for told, _ in o.items(static)}
    return [approach for approach in APPROACHES if approach in run_so]


def rms(rows: ArrayLike) -> Floats:
    """Return the RMS over poses of each joint's values, (3,)."""
    found: Floats = np.sqrt(np.mean(np.square(rows), axis=0))
    return found
