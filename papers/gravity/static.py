"""Figures 7 and 8 of the gravity paper on simulated robots: static poses along joint 1 on a tilted base.

Lewis and Hannaford 2014, section IV-B: "Each controller was used to maintain a static pose at increments along the
range of the first joint", base angles about the Z0 axis. PD alone, PD+SG and PD+DG with the robot's own gains.

Choices where the paper is silent:
- Positions are those that the robot reports, at its motors, uncalibrated, as the paper's were; so is the error.
- How the arm comes to a pose decides what friction leaves to the PD term, so both ways are shown. "placed": it is put
  there, passively held by sensed gravity, and the controller takes over with the setpoint where the arm stands, as the
  robot's software does on each change of mode. "driven": the controller itself drives it there, from below, at
  0.2 rad/s; the PD term then keeps up to the whole friction.
- Joints 2 and 3 stand at home, 90 deg and 0.40 m.

Run it with `make gravity-static`; it writes gravity_static.json and gravity_static.html and prints the tables.
"""

import sys
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from catenary import CablePlant, run_loop
from catenary.arrays import Floats
from catenary.control.controller import SplitController
from catenary.control.loop import Tick
from catenary.control.measures import pd_share
from catenary.reports.page import Block, Picture, Table, Text, picture
from catenary.trajectories.in_turn import Rest
from catenary.workflows.gravity.controllers import make_controller, make_hold
from catenary.workflows.gravity.simulated_arm import SimulatedArm, raven_arm
from catenary.workflows.gravity.track import with_approach
from papers.arguments import folder_and_robots
from papers.figures import COLORS, LABELS, panels
from papers.gravity.raven_base import SHOWN, turned_base
from papers.results import shown, spread, write_files

Approach = Literal["placed", "driven"]
APPROACHES: tuple[Approach, ...] = ("placed", "driven")
ANGLES_DEG = (0, 5, 10, 15, 20, 25)  # about Z0; the paper's text says 0 to 20, its figure 7 shows 25
POSES_DEG = (5.0, 21.0, 37.0, 53.0, 69.0, 85.0)  # of joint 1
HOME = (np.pi / 2, 0.40)  # joints 2 and 3 [rad, m]
CONTROLLERS = ("pd", "sg", "dg")
ROBOTS: tuple[int | None, ...] = (None, 1, 2, 3, 4, 5)  # None is the nominal one
SETTLE = 1.0  # [s] at a pose before it counts
RELEASE = 0.3  # [s] passively held before a controller takes over
WATCHED = 0.5  # [s] that count


@dataclass(frozen=True)
class Static:
    """What one controller did at K poses; means over the watched time."""

    error: Floats  # (K, n) desired minus reported [rad|m]
    feedback: Floats  # (K, n) PD term [Nm|N]
    torque: Floats  # (K, n) [Nm|N]

    @property
    def rms_error(self) -> Floats:
        """RMS error over the poses, (n,) [rad|m]."""
        return _rms(self.error)

    @property
    def share(self) -> Floats:
        """RMS of the PD term over RMS of the torque, (n,)."""
        return pd_share(_rms(self.feedback), _rms(self.torque))


def static_poses(
    seed: int | None,
    angle_deg: float,
    approach: Approach,
    *,
    poses_deg: tuple[float, ...] = POSES_DEG,
    controllers: tuple[str, ...] = CONTROLLERS,
) -> dict[str, Static]:
    """Hold joint 1 at each pose with each controller, on a base turned about Z0 from power-on.

    Args:
        seed: Of the robot; the nominal one when None.
        angle_deg: Of the base about Z0 [deg].
        approach: How the arm comes to the poses.
        poses_deg: Of joint 1, in their order [deg].
        controllers: By name.
    """
    plant = CablePlant(seed=seed, base=turned_base(angle_deg))
    plant.home()
    if approach == "placed":
        return _placed(raven_arm(plant), plant, poses_deg, controllers)
    results = {}
    for name in controllers:
        arm = raven_arm(deepcopy(plant))
        controller = make_controller(name, arm)
        rows = [_stand(arm, controller, _pose(deg), move=True) for deg in poses_deg]
        results[name] = _static(rows)
    return results


def _placed(
    arm: SimulatedArm, plant: CablePlant, poses_deg: tuple[float, ...], controllers: tuple[str, ...]
) -> dict[str, Static]:
    rows: dict[str, list[tuple[Floats, Floats, Floats]]] = {name: [] for name in controllers}
    placing, free = make_controller("dg", arm), make_hold("dg", arm)
    for deg in poses_deg:
        limits = arm.limits()
        whole, _ = with_approach(arm, Rest(_pose(deg), 0.0), SETTLE)
        run_loop(arm.plant, placing, whole, limits=limits)
        run_loop(arm.plant, free, Rest(_pose(deg), RELEASE), limits=limits)
        for name in controllers:  # each finds the arm as it was placed
            twin = raven_arm(deepcopy(plant))
            here = twin.plant.measured_js().q
            rows[name].append(_stand(twin, make_controller(name, twin), here, move=False))
    return {name: _static(values) for name, values in rows.items()}


def _stand(
    arm: SimulatedArm, controller: SplitController, q: Floats, *, move: bool
) -> tuple[Floats, Floats, Floats]:
    """Stand at q, after going there or at once; return means of error, PD term and torque."""
    rest = Rest(q, SETTLE + WATCHED)
    whole, begin = with_approach(arm, rest, 0.0) if move else (rest, 0.0)
    seen: list[tuple[Floats, Floats, Floats]] = []

    def observe(tick: Tick) -> None:
        if tick.time >= begin + SETTLE - 1e-9 and tick.tau is not None:
            seen.append((tick.reference.q - tick.state.q, controller.feedback.copy(), tick.tau))

    run_loop(arm.plant, controller, whole, limits=arm.limits(), observers=[observe])
    error, feedback, torque = (np.mean(column, axis=0) for column in zip(*seen, strict=True))
    return error, feedback, torque


def _pose(deg: float) -> Floats:
    return np.array([np.deg2rad(deg), *HOME])


def _static(rows: list[tuple[Floats, Floats, Floats]]) -> Static:
    return Static(*(np.array(column) for column in zip(*rows, strict=True)))


def _rms(rows: Floats) -> Floats:
    rms: Floats = np.sqrt(np.mean(rows**2, axis=0))
    return rms


Results = dict[tuple[int | None, Approach, int], dict[str, Static]]  # per robot, approach and base angle


def share_table(results: Results, approach: Approach, joint: int) -> Table:
    """Return the PD share of a joint in percent: the nominal robot, and mean and spread over the drawn ones."""
    seeds, angles = _seeds(results), _angles(results)
    header = ["base [deg]"]
    for name in CONTROLLERS[1:]:
        header += [f"{LABELS[name]} [%] nominal", f"{len(seeds) - 1} robots"]
    rows = []
    for angle in angles:
        cells = [f"{angle}"]
        for name in CONTROLLERS[1:]:
            values = [100.0 * results[seed, approach, angle][name].share[joint] for seed in seeds]
            cells += [f"{values[0]:.1f}", spread(values[1:])]
        rows.append(cells)
    return Table(header, rows)


def error_table(results: Results, approach: Approach) -> Table:
    """Return the RMS error of every joint of the nominal robot, in deg and mm."""
    header = ["base [deg]"] + [f"{LABELS[c]} J1 J2 J3 [deg deg mm]" for c in CONTROLLERS]
    rows = []
    for angle in _angles(results):
        cells = [f"{angle}"]
        for name in CONTROLLERS:
            error = results[_seeds(results)[0], approach, angle][name].rms_error
            cells.append(" ".join(f"{e:.3f}" for e in error * SHOWN))
        rows.append(cells)
    return Table(header, rows)


def figure_7(results: Results, poses_deg: tuple[float, ...]) -> Picture:
    """Draw joint 1's gravity terms against the torque of PD alone, at the first and last base angle (nominal robot)."""
    figure, both = panels(2, 3.2, sharey=True)
    angles = _angles(results)
    for axes, angle in zip(both, (angles[0], angles[-1]), strict=True):
        result = results[_seeds(results)[0], "driven", angle]
        held = result["pd"].torque[:, 0]
        axes.plot(poses_deg, held, "o-", color=COLORS["pd"], label="PD alone: its torque")
        for name in ("sg", "dg"):
            term = result[name].torque[:, 0] - result[name].feedback[:, 0]
            axes.plot(poses_deg, term, "o-", color=COLORS[name], label=f"{LABELS[name]}: gravity term")
        axes.set_title(f"base at {angle} deg", fontsize=10)
        axes.set_xlabel("joint 1 [deg]")
    figure.axes[0].set_ylabel("torque of joint 1 [Nm]")
    figure.axes[0].legend(frameon=False, fontsize=8)
    return picture(
        figure, "As figure 7: calculated gravity terms beside what a PD controller holds with (driven)."
    )


def figure_8(results: Results) -> Picture:
    """Draw the PD share of joint 1 over the base's angle, for both ways of coming to a pose and all robots."""
    figure, both = panels(2, 3.2, sharey=True)
    angles = _angles(results)
    for axes, approach in zip(both, APPROACHES, strict=True):
        for name in ("sg", "dg"):
            for k, seed in enumerate(_seeds(results)):
                share = [100.0 * results[seed, approach, angle][name].share[0] for angle in angles]
                style = (
                    {"linewidth": 2.0, "label": LABELS[name]} if k == 0 else {"linewidth": 0.7, "alpha": 0.6}
                )
                axes.plot(angles, share, "o-", color=COLORS[name], markersize=3, **style)
        axes.set_title(approach, fontsize=10)
        axes.set_xlabel("base about Z0 [deg]")
        axes.set_ylim(bottom=0.0)
    figure.axes[0].set_ylabel("PD share of joint 1 [%]")
    figure.axes[0].legend(frameon=False, fontsize=8)
    return picture(
        figure, "As figure 8: RMS of the PD term over RMS of the torque; the nominal robot in bold."
    )


def _seeds(results: Results) -> list[int | None]:
    return list(dict.fromkeys(seed for seed, _, _ in results))


def _angles(results: Results) -> list[int]:
    return list(dict.fromkeys(angle for _, _, angle in results))


def main(
    folder: Path,
    robots: tuple[int | None, ...] = ROBOTS,
    angles: tuple[int, ...] = ANGLES_DEG,
    poses_deg: tuple[float, ...] = POSES_DEG,
) -> Results:
    """Run all robots at all angles, print the tables, write gravity_static.json and gravity_static.html."""
    folder.mkdir(parents=True, exist_ok=True)
    results: Results = {}
    for seed in robots:
        for approach in APPROACHES:
            for angle in angles:
                results[seed, approach, angle] = static_poses(seed, angle, approach, poses_deg=poses_deg)
            print(f"  robot {seed}, {approach}: done", file=sys.stderr, flush=True)
    blocks: list[Block] = [figure_7(results, poses_deg), figure_8(results)]
    for approach in APPROACHES:
        for joint in range(3):
            title = f"PD share of joint {joint + 1}, {approach}"
            blocks += shown(title, share_table(results, approach, joint))
        title = f"RMS error, nominal robot, {approach}"
        blocks += shown(title, error_table(results, approach))
    blocks.append(
        Text(
            "Simulated robots. Positions are those that the robot reports, uncalibrated. Placed: put at the pose, and "
            "held from where it stands. Driven: by the controller itself, from below; friction stays in the PD term."
        )
    )
    rows = [
        {
            "seed": seed,
            "approach": approach,
            "base_deg": angle,
            "controller": name,
            "pd_share_percent": (100.0 * static.share).tolist(),
            "rms_error": (static.rms_error * SHOWN).tolist(),
            "feedback": static.feedback.tolist(),
            "torque": static.torque.tolist(),
        }
        for (seed, approach, angle), by_name in results.items()
        for name, static in by_name.items()
    ]
    write_files(
        folder,
        "gravity_static",
        "Static poses on a tilted base, simulated",
        "PD, PD+SG and PD+DG; figures 7 and 8 of Lewis and Hannaford 2014.",
        blocks,
        {"poses_deg": poses_deg, "results": rows},
    )
    return results


if __name__ == "__main__":
    main(*folder_and_robots(__doc__, ROBOTS))
