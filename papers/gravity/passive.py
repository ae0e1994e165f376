"""Passive hold: gravity compensation alone, with the sensed and with the nominal vector, on bases at every angle.

Lewis and Hannaford 2014, section V-A: "Operating with only a DG term and no PD, the robot passively held any new
position ... at all tested base orientations for the DG term (even upside-down), but only at or near horizontal with
the SG term". The simulated RAVEN-II has friction and cables; the same arm as rigid bodies without any friction shows
what gravity compensation does by itself: there is nothing else that holds. That it does not drift proves little by
itself, for a pendulum that stands on its head does not drift either until it is disturbed. So the arm is displaced by
1e-6 rad and m, and has to stay there, and pushed, and has to keep its kinetic energy: under exact compensation every
pose is a neutral equilibrium.

The base is turned about Z0, the axis of joint 1. Ideal sensors. Run it with `make gravity-figures`; it writes
gravity_passive.json and .html and prints the tables.
"""

import sys
from collections.abc import Sequence
from copy import deepcopy
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary import CablePlant, Reference, gravity_torque, load_robot, mass_matrix
from catenary.arrays import Floats
from catenary.reports.page import Block, Picture, Table, Text, picture
from catenary.spatial import LEVEL
from catenary.workflows.gravity.controllers import make_hold
from catenary.workflows.gravity.hold import hold
from catenary.workflows.gravity.motions import HOLD_START
from catenary.workflows.gravity.simulated_arm import SimulatedArm, raven_arm, rigid_arm
from papers.arguments import folder_argument
from papers.figures import COLORS, panels
from papers.gravity.raven_base import SHOWN, turned_base
from papers.results import shown, write_results

ANGLES_DEG = (0, 5, 10, 15, 25, 45, 90, 135, 180)
CONTROLLERS = ("dg", "sg")
SECONDS = 10.0
RIGID_SECONDS = 3.0  # without friction an arm falls at once; this is longer than it needs to reach a stop
TICK = 1e-3  # [s]
DISPLACED = 1e-6  # [rad|m]
PUSH = np.array([0.05, 0.02, 0.5])  # [Nm, Nm, N]
PUSHED = 0.05  # [s]
NEUTRAL_SECONDS = 1.0


class Held(NamedTuple):
    """How far each joint was from where it began, at most, and what the compensation lacked there."""

    plant: str  # "cables" or "rigid"
    angle_deg: int
    controller: str
    drift: tuple[float, ...]  # (n,) [deg, deg, mm]
    missing: tuple[float, ...]  # (n,) [Nm, Nm, N] gravity that the compensation does not hold, at the start


def on_cables(angle_deg: int, *, seed: int | None = None, seconds: float = SECONDS) -> list[Held]:
    """Hold the simulated RAVEN-II, homed on a tilted base, by gravity compensation alone."""
    base = turned_base(angle_deg)
    plant = CablePlant(seed=seed, base=base)
    plant.home()
    return [
        _held("cables", raven_arm(deepcopy(plant)), angle_deg, name, HOLD_START, seconds)
        for name in CONTROLLERS
    ]


def as_rigid_bodies(angle_deg: int, *, seconds: float = RIGID_SECONDS) -> list[Held]:
    """Hold the same arm's links without friction, springs and cables."""
    model = load_robot("raven2")
    return [
        _held("rigid", rigid_arm(model, base=turned_base(angle_deg)), angle_deg, name, HOLD_START, seconds)
        for name in CONTROLLERS
    ]


def _held(kind: str, arm: SimulatedArm, angle_deg: int, name: str, q: ArrayLike, seconds: float) -> Held:
    held = hold(arm, make_hold(name, arm), q, seconds)
    missing: Floats = np.zeros(arm.model.n)
    if name == "sg":
        gravity = turned_base(angle_deg).sample(np.zeros(1)).gravity[0]
        missing = gravity_torque(arm.model, q, gravity) - gravity_torque(arm.model, q, LEVEL)
    drift = (held.drift * SHOWN).tolist()
    return Held(kind, angle_deg, name, tuple(drift), tuple(missing.tolist()))


class Neutral(NamedTuple):
    """An arm of rigid bodies without friction under sensed gravity alone: is its pose a neutral equilibrium?"""

    angle_deg: int
    distance: float  # from where it was displaced to, at most, over the displacement
    energy: float  # kinetic, at the end over just after a push


def neutral(angle_deg: int, *, seconds: float = NEUTRAL_SECONDS) -> Neutral:
    """Displace the arm a little, then push it, on a base turned about Z0."""
    here = np.array(HOLD_START)
    rest, _ = _left_alone(angle_deg, here, np.zeros(3), seconds)
    moved, _ = _left_alone(angle_deg, here + DISPLACED, np.zeros(3), seconds)
    distance = float(np.abs(moved - rest - DISPLACED).max() / DISPLACED)
    q, qd = _left_alone(angle_deg, here, PUSH, PUSHED + seconds)
    energy = 0.5 * np.einsum("ti,tij,tj->t", qd, mass_matrix(load_robot("raven2"), q), qd)
    return Neutral(angle_deg, distance, float(energy[-1] / energy[round(PUSHED / TICK)]))


def _left_alone(angle_deg: int, start: Floats, push: Floats, seconds: float) -> tuple[Floats, Floats]:
    """Return positions and velocities (T, 3) of the rigid arm from a start at rest, pushed for PUSHED seconds."""
    arm = rigid_arm(load_robot("raven2"), base=turned_base(angle_deg), start=start)
    hold_still = make_hold("dg", arm)
    rows = []
    for k in range(round(seconds / TICK) + 1):
        state = arm.plant.measured_js()
        rows.append((state.q, state.qd))
        tau = hold_still.torque(state, Reference(state.q, state.qd, state.qd))
        arm.plant.servo_jf(tau + push if k * TICK < PUSHED else tau)
        arm.plant.wait()
    q, qd = (np.array(column) for column in zip(*rows, strict=True))
    return q, qd


def neutral_table(rows: Sequence[Neutral]) -> Table:
    """Return how far each base angle is from a neutral equilibrium."""
    return Table(
        ["base [deg]", "went on from there [of 1e-6 rad|m]", "kinetic energy kept [%]"],
        [[f"{row.angle_deg}", f"{row.distance:.1e}", f"{100.0 * row.energy:.2f}"] for row in rows],
    )


def drift_table(rows: Sequence[Held], kind: str) -> Table:
    """Return the largest drift of every joint for each base angle, with DG and SG, and the torque that SG lacks."""
    table = []
    for angle in dict.fromkeys(row.angle_deg for row in rows if row.plant == kind):
        dg, sg = (
            next(r for r in rows if (r.plant, r.angle_deg, r.controller) == (kind, angle, name))
            for name in CONTROLLERS
        )
        table.append(
            [f"{angle}"]
            + [" ".join(f"{d:.3f}" for d in row.drift) for row in (dg, sg)]
            + [" ".join(f"{t:+.2f}" for t in sg.missing)]
        )
    return Table(
        ["base [deg]", "DG: J1 J2 J3 [deg deg mm]", "SG: J1 J2 J3 [deg deg mm]", "SG lacks [Nm Nm N]"], table
    )


def figure(rows: Sequence[Held]) -> Picture:
    """Draw the drift of joint 1 over the base's angle."""
    kinds = list(dict.fromkeys(row.plant for row in rows))
    drawn, parts = panels(len(kinds), 3.2)
    for axes, kind in zip(parts, kinds, strict=True):
        for name in CONTROLLERS:
            of = [row for row in rows if (row.plant, row.controller) == (kind, name)]
            # a drift of nothing at all has no place on a logarithm's axis
            axes.semilogy(
                [row.angle_deg for row in of],
                [max(row.drift[0], 1e-6) for row in of],
                "o-",
                color=COLORS[name],
                label=f"{name.upper()} alone",
            )
        axes.set_title({"cables": "simulated RAVEN-II", "rigid": "its links, no friction"}[kind], fontsize=10)
        axes.set_xlabel("base about Z0 [deg]")
    drawn.axes[0].set_ylabel("largest drift of joint 1 [deg]")
    drawn.axes[0].legend(frameon=False, fontsize=8)
    return picture(drawn, "Gravity compensation alone; drift below 0.000001 deg is drawn there.")


def main(
    folder: Path,
    angles: tuple[int, ...] = ANGLES_DEG,
    *,
    seconds: float = SECONDS,
    rigid_seconds: float = RIGID_SECONDS,
) -> list[Held]:
    """Hold at all angles, print the tables, write gravity_passive.json and .html."""
    rows: list[Held] = []
    equilibria = [neutral(angle) for angle in angles]
    for angle in angles:
        rows += on_cables(angle, seconds=seconds)
        rows += as_rigid_bodies(angle, seconds=rigid_seconds)
        print(f"  base at {angle} deg: done", file=sys.stderr, flush=True)
    blocks: list[Block] = [figure(rows)]
    blocks += shown(f"Simulated RAVEN-II, {seconds:g} s", drift_table(rows, "cables"))
    blocks += shown(f"Its links without friction, {rigid_seconds:g} s", drift_table(rows, "rigid"))
    blocks += shown(
        f"Displaced, and pushed: without friction, {NEUTRAL_SECONDS:g} s", neutral_table(equilibria)
    )
    blocks.append(
        Text(
            "Joints are put to the pose by PD and sensed gravity, then left to gravity compensation alone. Numbers are "
            "the largest distance from where it began; a joint that fell lies at a stop or swings there."
        )
    )
    write_results(
        folder,
        "gravity_passive",
        "Passive hold on a tilted base, simulated",
        "Gravity compensation without any PD; section V-A of Lewis and Hannaford 2014.",
        blocks,
        configuration={
            "robot": "nominal",
            "base_angles_deg": list(angles),
            "pose": list(HOLD_START),
            "seconds": seconds,
            "rigid_seconds": rigid_seconds,
        },
        results={
            "held": [row._asdict() for row in rows],
            "neutral": [row._asdict() for row in equilibria],
        },
    )
    return rows


if __name__ == "__main__":
    main(folder_argument(__doc__))
