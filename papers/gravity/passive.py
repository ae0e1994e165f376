"""Passive hold: gravity compensation alone, with the sensed and with the nominal vector, on bases at every angle.

Lewis and Hannaford 2014, section V-A: "Operating with only a DG term and no PD, the robot passively held any new
position ... at all tested base orientations for the DG term (even upside-down), but only at or near horizontal with
the SG term". The simulated RAVEN-II has friction and cables; the same arm as rigid bodies without any friction shows
what gravity compensation does by itself: there is nothing else that holds. That it does not drift proves little by
itself, for a pendulum that stands on its head does not drift either until it is disturbed. So the arm is displaced by
1e-6 rad and m, and has to stay there, and pushed, and has to keep its kinetic energy: under exact compensation every
pose is a neutral equilibrium.

The base is turned about Z0, the axis of joint 1, to either side. Joints are put to the pose by PD and sensed gravity,
then left to gravity compensation alone. On the simulated RAVEN-II gravity is what the accelerometer of figures 9 and 10
says, at 100 Hz with noise, resolution and latency; for the links without friction, where the compensation itself is
asked about and noise alone would set them in motion, it is exact. Joint positions are those that the robot reports.
Drift is the largest distance from where the arm was left; a joint that fell lies at a stop or swings there.

Beyond the paper: the same on figure 10's rocking base, at 1 Hz and at half of it, where friction ratchets; beside the
accelerometer an inertial unit, whose rates tell the torque of turning; three robots.
"""

from collections.abc import Sequence
from copy import deepcopy
from typing import Any

import numpy as np

from catenary import CablePlant, Reference, gravity_torque, load_robot, mass_matrix
from catenary.arrays import Floats
from catenary.control.controllers import HOLDS, make_controller
from catenary.control.loop import GravitySource
from catenary.spatial import LEVEL
from catenary.workflows.gravity_trials import HOLD_START, SimulatedArm, hold_arm, raven_arm, rigid_arm
from papers.experiment import Case, Experiment, Judgement, Outcomes, Report, Result, Run, Scope, TitledTable, run
from papers.figures import COLORS, legend_above, panels
from papers.gravity.raven_base import SHOWN, raven_of_2014, rocking_base, turned_base
from papers.gravity.tracking import gravity_source
from papers.kit import IN_UNITS, UNITS, by_count, by_robot, cells, filled, grid, rows, sample, table

ANGLES_DEG = (-150, -90, -45, -25, -20, -15, -10, -5, 0, 5, 10, 15, 20, 25, 45, 90, 135, 180)
CONTROLLERS = ("dg", "sg")
SECONDS = 10.0
RIGID_SECONDS = 3.0  # without friction an arm falls at once; this is longer than it needs to reach a stop
TICK = 1e-3  # [s]
DISPLACED = 1e-6  # [rad|m]
PUSH = np.array([0.05, 0.02, 0.5])  # [Nm, Nm, N]
PUSHED = 0.05  # [s]
NEUTRAL_SECONDS = 1.0
ROCKED_HZ, ROCKED_SECONDS = (0.5, 1.0), 4.0
FEW_ROBOTS = 3  # that are rocked
ROCKED_BY = {"dg-imu": "inertial unit", "dg": "accelerometer", "sg": "level base"}
HELD = 1.0  # [deg, deg, mm] that an eye would not call drift
FEW_DEG = 10  # "more than a few degrees"
SEEN = 1e-6  # [deg] drift below it has no place on a logarithm's axis


@run(revision=2)
def on_cables(*, seed: int | None, angle_deg: float, seconds: float) -> Result:
    """Hold the simulated RAVEN-II, homed on a tilted base, by gravity compensation alone.

    Returns:
        By controller the largest drift of each joint [deg, deg, mm], and "missing" [Nm, Nm, N], the gravity that SG
        does not hold at the start.
    """
    plant = CablePlant(raven_of_2014(), seed=seed, base=turned_base(angle_deg))
    plant.home()
    drift = {}
    for name in CONTROLLERS:
        own = deepcopy(plant)
        drift[name] = _drift(raven_arm(own), name, seconds, gravity_source("dg", own))
    return drift | {"missing": _missing(angle_deg)}


@run(revision=1)
def as_rigid_bodies(*, angle_deg: float, seconds: float) -> Result:
    """Hold the same arm's links without friction, springs and cables; returns as `on_cables`."""
    model = load_robot("raven2")
    drift = {name: _drift(rigid_arm(model, base=turned_base(angle_deg)), name, seconds) for name in CONTROLLERS}
    return drift | {"missing": _missing(angle_deg)}


@run(revision=1)
def rocked(*, seed: int | None, hz: float, seconds: float) -> Result:
    """Hold the simulated RAVEN-II by gravity compensation alone on figure 10's base, rocked so often [Hz].

    Returns:
        By what tells gravity the largest drift of each joint [deg, deg, mm].
    """
    plant = CablePlant(raven_of_2014(), seed=seed, base=rocking_base(hz=hz))
    plant.home()
    drift = {}
    for name in ROCKED_BY:
        own = deepcopy(plant)
        law = "sg" if name == "sg" else "dg"
        drift[name] = _drift(raven_arm(own), law, seconds, gravity_source(name, own))
    return drift


def _drift(arm: SimulatedArm, name: str, seconds: float, sensed: GravitySource | None = None) -> list[float]:
    held = hold_arm(arm, make_controller(name, arm, among=HOLDS), HOLD_START, seconds, gravity=sensed)
    drift: list[float] = (held.drift * SHOWN).tolist()
    return drift


def _missing(angle_deg: float) -> list[float]:
    model, gravity = load_robot("raven2"), turned_base(angle_deg).sample(np.zeros(1)).gravity[0]
    missing: list[float] = (
        gravity_torque(model, HOLD_START, gravity) - gravity_torque(model, HOLD_START, LEVEL)
    ).tolist()
    return missing


@run(revision=1)
def neutral(*, angle_deg: float, seconds: float) -> Result:
    """Displace the rigid arm a little, then push it, under sensed gravity alone: is its pose a neutral equilibrium?

    Returns:
        "distance" from where it was displaced to, at most, over the displacement; "energy", kinetic, at the end over
        just after the push.
    """
    here = np.array(HOLD_START)
    settled, _ = _left_alone(angle_deg, here, np.zeros(3), seconds)
    moved, _ = _left_alone(angle_deg, here + DISPLACED, np.zeros(3), seconds)
    q, qd = _left_alone(angle_deg, here, PUSH, PUSHED + seconds)
    energy = 0.5 * np.einsum("ti,tij,tj->t", qd, mass_matrix(load_robot("raven2"), q), qd)
    return {
        "distance": float(np.abs(moved - settled - DISPLACED).max() / DISPLACED),
        "energy": float(energy[-1] / energy[round(PUSHED / TICK)]),
    }


def _left_alone(angle_deg: float, start: Floats, push: Floats, seconds: float) -> tuple[Floats, Floats]:
    """Return positions and velocities (T, 3) of the rigid arm from a start at rest, pushed for PUSHED seconds."""
    arm = rigid_arm(load_robot("raven2"), base=turned_base(angle_deg), start=start)
    hold_still = make_controller("dg", arm, among=HOLDS)
    rows = []
    for k in range(round(seconds / TICK) + 1):
        state = arm.plant.measured_js()
        rows.append((state.q, state.qd))
        tau = hold_still.torque(state, Reference(state.q, state.qd, state.qd))
        arm.plant.servo_jf(tau + push if k * TICK < PUSHED else tau)
        arm.plant.wait()
    q, qd = (np.array(column) for column in zip(*rows, strict=True))
    return q, qd


def cases(scope: Scope) -> list[Case]:
    """Return a case per robot and base, and per base those of the links without friction."""
    angles: Sequence[int] = (25,) if scope.quick else ANGLES_DEG
    rates = ROCKED_HZ[1:] if scope.quick else ROCKED_HZ
    whole = (SECONDS, RIGID_SECONDS, NEUTRAL_SECONDS, ROCKED_SECONDS)
    seconds = (0.5, 0.2, 0.2, 0.5) if scope.quick else whole
    return [
        *grid(on_cables, {"seed": scope.robots, "angle_deg": angles}, seconds=seconds[0]),
        *grid(as_rigid_bodies, {"angle_deg": angles}, seconds=seconds[1]),
        *grid(neutral, {"angle_deg": angles}, seconds=seconds[2]),
        *grid(rocked, {"seed": scope.robots[:FEW_ROBOTS], "hz": rates}, seconds=seconds[3]),
    ]


def drifts(o: Outcomes, function: Run, controller: str) -> dict[float, Floats]:
    """Return the largest drift by base [deg], each (robots, 3) [deg, deg, mm]."""
    angles = sorted({args["angle_deg"] for args, _ in o.items(function)})
    return {angle: sample(o, function, controller, angle_deg=angle) for angle in angles}


def report(o: Outcomes) -> Report:
    """Return drift by base with and without friction, how neutral the equilibria are, and drift on a rocking base."""
    neutral_rows = [
        [f"{args['angle_deg']}", f"{result['distance']:.1e}", f"{100.0 * result['energy']:.2f}"]
        for args, result in sorted(o.items(neutral), key=lambda item: item[0]["angle_deg"])
    ]

    def row(hz: float, name: str) -> list[str]:
        drift = sample(o, rocked, name, hz=hz)
        return [f"{hz:g} Hz", ROCKED_BY[name], *cells(drift, 1 if name == "sg" else 3)]

    tables = [
        _drift_table(o, on_cables, f"Simulated RAVEN-II, largest drift in {SECONDS:g} s"),
        _drift_table(o, as_rigid_bodies, f"Its links without friction, largest drift in {RIGID_SECONDS:g} s"),
        table(
            f"Displaced by {DISPLACED:g} rad and m, and pushed: without friction, {NEUTRAL_SECONDS:g} s",
            "base [deg] | went on, over its displacement | kinetic energy kept [%]",
            neutral_rows,
        ),
        table(
            f"Simulated RAVEN-II on the rocking base, largest drift in {ROCKED_SECONDS:g} s",
            ["rocked at", "gravity by", *IN_UNITS],
            rows(row, ROCKED_HZ, ROCKED_BY),
        ),
    ]
    caption = "Largest drift of joint 1 by gravity compensation alone; less than 1e-6 deg is drawn there"
    return Report(filled(tables), {caption: _picture(o)})


def _drift_table(o: Outcomes, function: Run, title: str) -> TitledTable:
    dg, sg = (drifts(o, function, name) for name in CONTROLLERS)
    content = [
        [
            *(f"{angle}", *cells(dg[angle]), *cells(sg[angle], 1)),
            " ".join(f"{torque:+.2f}" for torque in o.of(function, angle_deg=angle)[0]["missing"]),
        ]
        for angle in dg
    ]
    columns = [f"{name.upper()}, {unit}" for name in CONTROLLERS for unit in IN_UNITS]
    return table(title, ["base [deg]", *columns, "SG lacks [Nm Nm N]"], content)


def _picture(o: Outcomes) -> Any:
    figure, both = panels(2, 3.6)
    titles = ("simulated RAVEN-II, every robot", "its links, no friction")
    for axes, function, title in zip(both, (on_cables, as_rigid_bodies), titles, strict=True):
        for name in CONTROLLERS:
            by_angle = drifts(o, function, name)
            for k, drift in enumerate(np.array([each[:, 0] for each in by_angle.values()]).T):
                bold = {"linewidth": 2.0, "label": f"{name.upper()} alone"}
                style = bold if k == 0 else {"linewidth": 0.7, "alpha": 0.5}
                axes.semilogy(list(by_angle), np.maximum(drift, SEEN), "o-", ms=3, color=COLORS[name], **style)
        axes.set_title(title, fontsize=10)
        axes.set_xlabel("base about Z0 [deg]")
    both[0].set_ylabel("largest drift of joint 1 [deg]")
    legend_above(figure, both[0], columns=2)
    return figure


EXPERIMENT = Experiment(
    "gravity-passive", "section V-A", "Passive hold by gravity compensation alone", __doc__, cases, report, minutes=8.0
)


@EXPERIMENT.claim(
    "DG alone holds any pose at every orientation of the base, upside down too",
    "V-A",
    "held, no number",
    f"every joint of every robot stays within {HELD:g} deg and mm for {SECONDS:g} s at every angle; same direction: at "
    "more than half of the angles",
)
def _sensed_holds(o: Outcomes) -> Judgement:
    by_angle = drifts(o, on_cables, "dg")
    largest = by_robot(np.max(list(by_angle.values()), axis=0))  # of each robot's joints over all bases, (robots, 3)
    text = ", ".join(f"J{joint + 1} {largest[:, joint]} {unit}" for joint, unit in enumerate(UNITS))
    measured = f"each robot's largest drift at any angle: {text}; at most {largest[:, 0].max():.2f} deg"
    return by_count([drift.max() < HELD for drift in by_angle.values()], measured)


@EXPERIMENT.claim(
    "SG alone holds only at or near horizontal",
    "V-A",
    "drifts when tipped by more than a few degrees",
    f"on a level base as DG; at every angle from {FEW_DEG} deg to either side some joint of every robot drifts by more "
    f"than {HELD:g} deg or mm; same direction: at more than half of these angles",
    "Where some robots stay, friction holds what SG lacks (last column of the first table); the same links without "
    "friction fall there (second table).",
)
def _nominal_falls(o: Outcomes) -> Judgement:
    by_angle = drifts(o, on_cables, "sg")
    level = [drift.max() < HELD for angle, drift in by_angle.items() if angle == 0]
    # each robot's largest drift of a joint [deg|mm]
    tilted = {angle: by_robot(drift.max(axis=1)) for angle, drift in by_angle.items() if abs(angle) >= FEW_DEG}
    fell = {angle: drift > HELD for angle, drift in tilted.items()}
    texts = [
        f"at {angle} deg {tilted[angle]:.1f} (deg or mm), {int(which.sum())} of {len(which)} robots"
        for angle, which in fell.items()
        if not which.all()
    ]
    least = [drift.min() for angle, drift in tilted.items() if fell[angle].all()]
    if least:
        texts.insert(0, f"every robot drifts at {len(least)} of {len(tilted)} angles, by {min(least):.1f} at least")
    return by_count([*level, *(bool(which.all()) for which in fell.values())], "; ".join(texts))
