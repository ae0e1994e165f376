"""The robot's own gravity compensation against PD+SG and PD+DG: static poses on bases turned about Z0.

Not in the gravity paper. The public firmware compensates gravity by itself: by the vector of a level base, at
9.80 m/s2, each joint's torque to its own motor without the cables' coupling. Here it holds static poses as figure 8
of the paper has them, five ways:

- firmware: its PD alone, which is what the simulated robot does unless told otherwise;
- own, level: with its own compensation, as it comes;
- own, told: the same, with gravity as the tilted base has it written into `grav_dir`, in whole cm/s2;
- PD+SG, PD+DG: ours, with the same gains at the joints, sent as joint torques through the coupling.

Each drives joint 1 from below to six poses at 0.2 rad/s, joints 2 and 3 at home, and stands there; errors are desired
minus reported positions, means of the last half second, RMS over the poses. What friction holds, no law feels.
"""

from collections.abc import Sequence
from copy import deepcopy
from typing import Any

import numpy as np

from catenary import CablePlant
from catenary.arrays import Floats
from catenary.control.controllers import make_controller
from catenary.simulation.firmware import NOMINAL_GRAV_DIR, grav_dir_of
from catenary.trajectories.reference import Rest
from catenary.workflows.gravity_trials import raven_arm, with_approach
from papers.experiment import Case, Experiment, Outcomes, Report, Result, Scope, run
from papers.figures import panels
from papers.gravity.raven_base import SHOWN, raven_of_2014, turned_base
from papers.gravity.static_poses import ANGLES_DEG, POSES_DEG, QUICK_POSES_DEG, SETTLE, WATCHED, pose, stand
from papers.kit import IN_UNITS, grid, rows, sample, table

PD, LEVEL, TOLD, SG, DG = "firmware", "own, level", "own, told", "PD+SG", "PD+DG"
LAWS = (PD, LEVEL, TOLD, SG, DG)
LAW_COLORS = dict(zip(LAWS, ("#1c2430", "#c9a227", "#8a5a9e", "#4b6b94", "#d9622b"), strict=True))


@run(revision=1)
def held(*, seed: int | None, angle_deg: float, poses_deg: Sequence[float]) -> Result:
    """Hold joint 1 at each pose by every law, each on a robot just homed on a base turned about Z0.

    Args:
        angle_deg: Of the base [deg].
        poses_deg: Of joint 1, in their order [deg].

    Returns:
        By law, the RMS error of each joint over the poses [deg, deg, mm].
    """
    errors = {}
    for grav_dir in (None, NOMINAL_GRAV_DIR):
        plant = CablePlant(raven_of_2014(), seed=seed, base=turned_base(angle_deg), grav_dir=grav_dir)
        plant.home()
        if grav_dir is None:
            errors[PD] = _firmware(deepcopy(plant), poses_deg)
            errors[SG] = _ours("sg", deepcopy(plant), poses_deg)
            errors[DG] = _ours("dg", plant, poses_deg)
        else:
            informed = deepcopy(plant)
            informed.grav_dir = grav_dir_of(informed.measured_js().gravity)
            errors[LEVEL] = _firmware(plant, poses_deg)
            errors[TOLD] = _firmware(informed, poses_deg)
    return {law: (np.sqrt(np.mean(errors[law] ** 2, axis=0)) * SHOWN).tolist() for law in LAWS}


def _firmware(plant: CablePlant, poses_deg: Sequence[float]) -> Floats:
    """Return the errors (K, 3) [rad, rad, m] of the firmware's own control."""
    rows = []
    for deg in poses_deg:
        whole, _ = with_approach(raven_arm(plant), Rest(pose(deg), SETTLE + WATCHED), 0.0)
        times = plant.period * np.arange(round(whole.duration / plant.period))
        setpoints = np.full((len(times), 7), np.nan)
        setpoints[:, :3] = whole.sample(times)[0]
        log = plant.run(setpoints)
        last = slice(-round(WATCHED / plant.period), None)
        rows.append((pose(deg) - log.joint[last, :3]).mean(axis=0))
    return np.array(rows)


def _ours(name: str, plant: CablePlant, poses_deg: Sequence[float]) -> Floats:
    """Return the errors (K, 3) [rad, rad, m] of a controller that commands joint torques."""
    arm = raven_arm(plant)
    controller = make_controller(name, arm)
    return np.array([stand(arm, controller, pose(deg), move=True).error for deg in poses_deg])


def cases(scope: Scope) -> list[Case]:
    """Return a case per robot and base."""
    angles, poses = (ANGLES_DEG[::5], QUICK_POSES_DEG) if scope.quick else (ANGLES_DEG, POSES_DEG)
    return grid(held, {"seed": scope.robots, "angle_deg": angles}, poses_deg=list(poses))


def report(o: Outcomes) -> Report:
    """Return the errors by base, joint and law: a row per base and joint, a column per law."""
    angles = sorted({args["angle_deg"] for args, _ in o.items(held)})

    def row(angle: float, joint: int) -> list[str]:
        errors = (sample(o, held, law, angle_deg=angle)[:, joint] for law in LAWS)
        return [f"{angle} deg, {IN_UNITS[joint]}", *(f"{each}" for each in errors)]

    title = "RMS error over the poses, mean and spread over robots"
    caption = "RMS error of joints 1 and 2 over the base's angle; every robot a line, the nominal one in bold"
    worst = {law: sample(o, held, law, angle_deg=angles[-1])[:, 0].mean() for law in LAWS}
    remark = (
        f"On a base turned by {angles[-1]} deg joint 1 is off by {worst[LEVEL]:.3f} deg with the robot's own "
        f"compensation as it comes, by {worst[TOLD]:.3f} deg once it is told where gravity is, by {worst[DG]:.3f} deg "
        "with PD+DG."
    )
    tables = [table(title, ["base, joint", *LAWS], rows(row, angles, range(3)))]
    return Report(tables, {caption: _picture(o, angles)}, [remark])


def _picture(o: Outcomes, angles: Sequence[float]) -> Any:
    figure, both = panels(2, 3.4)
    seeds = list(dict.fromkeys(args["seed"] for args, _ in o.items(held)))
    for joint, axes in enumerate(both):
        for law in LAWS:
            for k, seed in enumerate(seeds):
                by_angle = {args["angle_deg"]: result[law][joint] for args, result in o.items(held, seed=seed)}
                style = {"linewidth": 2.0, "label": law} if k == 0 else {"linewidth": 0.7, "alpha": 0.5}
                values = [by_angle.get(angle, np.nan) for angle in angles]
                axes.plot(angles, values, "o-", color=LAW_COLORS[law], markersize=3, **style)
        axes.set_title(f"joint {joint + 1}", fontsize=10)
        axes.set_xlabel("base about Z0 [deg]")
        axes.set_ylim(bottom=0.0)
    both[0].set_ylabel("RMS error [deg]")
    figure.legend(*both[0].get_legend_handles_labels(), loc="outside upper center", ncols=len(LAWS), frameon=False)
    return figure


EXPERIMENT = Experiment(
    "gravity-own-compensation", "beyond", "The robot's own gravity compensation, PD+SG and PD+DG", __doc__,
    cases, report, minutes=6.0,
)  # fmt: skip
