"""Faults of the gravity sensor in mid-motion: how far does one move the arm, and what does a person read?

The simulated RAVEN-II on a tilted base follows a motion with PD+DG; its inertial unit fails for a while. The measure is
the largest distance between the true joint positions of this run and of the same run without the fault, over the fault
and the time after it. With the fallback `stop` the loop ends and the robot is held and paused: the measure is then how
far its joints go from where they were when it was stopped.

Gains are the robot's own, 454 Nm/rad on joint 1: a vector that is wrong by delta moves joint 1 by delta g / kp at most,
and so the fallback `static` on a base at 20 degrees moves it by a quarter of a degree. On softer gains all of it is
larger in proportion. The sensor has noise, resolution and latency of the MPU-6050's class.

Run it with `make gravity-figures`; it writes gravity_faults.json and .html and prints the table.
"""

from collections.abc import Sequence
from copy import deepcopy
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catenary import CablePlant, FixedBase, random_sinusoids, run_loop
from catenary.arrays import Floats
from catenary.control.loop import Tick
from catenary.control.report import GravityReport, LoopReport
from catenary.errors import SensorError
from catenary.reports.page import Block, Picture, Table, Text, picture
from catenary.sensing.fallback import FALLBACKS
from catenary.sensing.imu import SensedGravity
from catenary.sensing.mailbox import Mailbox
from catenary.simulation.sensors import FAULT_KINDS, InjectedFault, SimulatedSensor
from catenary.trajectories.in_turn import Rest
from catenary.trajectories.smoothed_path import SmoothedPath
from catenary.workflows.gravity.controllers import make_controller
from catenary.workflows.gravity.motions import RAVEN_START
from catenary.workflows.gravity.simulated_arm import raven_arm
from catenary.workflows.gravity.track import with_approach
from papers.arguments import folder_argument
from papers.figures import panels
from papers.gravity.raven_base import SHOWN, turned_base
from papers.results import shown, write_results

BASE_DEG = 20.0  # about Z0
WARM, BEGIN, LASTS, SECONDS = 0.8, 0.5, 1.0, 2.0  # [s] sensor before the motion, fault in the motion, motion
AFTER_STOP = 0.5  # [s] watched
LIMIT_DEG = 0.5  # of a joint, because of a fault
# turning points of the motion about RAVEN_START, and its speeds [rad, rad, m]
HALF, SPEED = np.array([0.25, 0.25, 0.03]), np.array([0.35, 0.35, 0.05])


class Outcome(NamedTuple):
    """What one fault did under one fallback."""

    fault: str
    fallback: str
    moved: tuple[float, ...]  # (n,) because of it, at most [deg, deg, mm]
    statuses: tuple[str, ...]  # that gravity had, in the order of their first tick
    faults: tuple[str, ...]  # that were named
    messages: tuple[str, ...]
    stopped: bool


class Start(NamedTuple):
    """An arm where the motion begins, the same for every run."""

    plant: CablePlant
    base: FixedBase
    motion_seed: int


def ready(*, seed: int | None = None, base_deg: float = BASE_DEG, motion_seed: int = 0) -> Start:
    """Home a robot on a tilted base and bring it to the motion's start."""
    base = turned_base(base_deg)
    plant = CablePlant(seed=seed, base=base)
    plant.home()
    arm = raven_arm(plant)
    begin = _motion(motion_seed, SECONDS)(0.0).q
    way, _ = with_approach(arm, Rest(begin, 0.0), 0.5)
    run_loop(arm.plant, make_controller("dg", arm), way, limits=arm.limits())
    return Start(plant, base, motion_seed)


def run(start: Start, fault: str | None, fallback: str) -> tuple[Floats, GravityReport, bool]:
    """Follow the motion, with a fault or none: true positions (T, 3), the report, whether it was stopped."""
    plant = deepcopy(start.plant)
    arm = raven_arm(plant)
    faults = [] if fault is None else [InjectedFault(fault, plant.time + WARM + BEGIN, LASTS)]
    mailbox = Mailbox()
    sensor = SimulatedSensor(start.base, mailbox, faults=faults, seed=1, start=plant.time)
    source = SensedGravity(mailbox, sensor.model.mounting, fallback=fallback, feed=sensor.advance)
    controller = make_controller("dg", arm)
    here = _motion(start.motion_seed, SECONDS)(0.0).q
    # the sensor is met, and eased in, before the motion: not what is looked at
    run_loop(arm.plant, controller, Rest(here, WARM), limits=arm.limits(), gravity=source)
    true: list[Floats] = []

    def observe(tick: Tick) -> None:
        true.append(arm.q_true())

    stopped = False
    loop = partial(run_loop, arm.plant, controller, _motion(start.motion_seed, SECONDS))
    try:
        report = loop(limits=arm.limits(), gravity=source, observers=[observe])
    except SensorError as error:
        report = error.loop_report  # type: ignore[attr-defined]
        stopped = True
        for _ in range(round(AFTER_STOP / arm.plant.period)):
            arm.plant.wait()
            true.append(arm.q_true())
    return np.array(true), _gravity(report), stopped


def outcome(start: Start, fault: str, fallback: str, healthy: Floats) -> Outcome:
    """Run with a fault, and compare with the run without it (T, 3)."""
    true, report, stopped = run(start, fault, fallback)
    if stopped:
        held = true[-round(AFTER_STOP * 1000) - 1 :]
        off = np.abs(held - held[0])
        ran = true[: len(true) - len(held) + 1]
        off = np.concatenate([off, np.abs(ran - healthy[: len(ran)])])
    else:
        off = np.abs(true - healthy)
    moved = (off.max(axis=0) * SHOWN).tolist()
    return Outcome(
        fault,
        fallback,
        tuple(moved),
        tuple(report.ticks),
        tuple(report.faults),
        report.messages,
        stopped,
    )


def outcomes(
    start: Start, kinds: Sequence[str] = FAULT_KINDS, fallbacks: Sequence[str] = FALLBACKS
) -> list[Outcome]:
    """Run every fault under every fallback."""
    healthy, _, _ = run(start, None, "fade")
    return [outcome(start, kind, fallback, healthy) for fallback in fallbacks for kind in kinds]


def _gravity(report: LoopReport) -> GravityReport:
    if report.gravity is None:
        raise AssertionError("the loop was given a source of gravity")
    return report.gravity


def _motion(seed: int, seconds: float) -> SmoothedPath:
    middle = np.array(RAVEN_START)
    return random_sinusoids(
        np.random.default_rng(seed),
        seconds,
        lower=middle - HALF,
        upper=middle + HALF,
        turning_band=0.2 * HALF,
        slowest=0.5 * SPEED,
        fastest=SPEED,
        turn_time=0.3,
    )


def fault_table(rows: Sequence[Outcome]) -> Table:
    """Return for each fault how far it moved the arm under each fallback, and how it was named."""
    table = []
    fallbacks = list(dict.fromkeys(row.fallback for row in rows))
    for kind in dict.fromkeys(row.fault for row in rows):
        of = [row for row in rows if row.fault == kind]
        cells = []
        for name in fallbacks:
            row = next(r for r in of if r.fallback == name)
            mark = ", stopped" if row.stopped else ""
            cells.append(f"{max(row.moved[:2]):.3f} deg {row.moved[2]:.3f} mm{mark}")
        named = dict.fromkeys(name for row in of for name in row.faults)
        seen = max((row.statuses for row in of if not row.stopped), key=len, default=("stop",))
        table.append([kind, ", ".join(named) or "-", " ".join(seen), *cells])
    return Table(["sensor", "named", "gravity was", *fallbacks], table)


def message_table(rows: Sequence[Outcome]) -> Table:
    """Return the message of each fault that was named."""
    said = {name: text for row in rows for name, text in zip(row.faults, row.messages, strict=True)}
    return Table(["fault", "message"], [[name, text] for name, text in said.items()])


def figure(rows: Sequence[Outcome]) -> Picture:
    """Draw how far each fault moved joint 1 or 2, by fallback."""
    kinds = list(dict.fromkeys(row.fault for row in rows))
    drawn, (axes,) = panels(1, 0.28 * len(kinds) + 1.0)
    colors = {"hold": "#4b6b94", "fade": "#d9622b", "static": "#1c2430", "stop": "#2f8f6b"}
    for name in dict.fromkeys(row.fallback for row in rows):
        of = [row for row in rows if row.fallback == name]
        axes.plot(
            [max(row.moved[:2]) for row in of],
            [kinds.index(row.fault) for row in of],
            "o",
            color=colors[name],
            label=name,
        )
    axes.axvline(LIMIT_DEG, color="#b8c0cc", linewidth=1.0)
    axes.set_yticks(range(len(kinds)), kinds, fontsize=8)
    axes.invert_yaxis()
    axes.set_xlim(left=0.0)
    axes.set_xlabel("largest motion of joint 1 or 2 because of the fault [deg]")
    axes.legend(frameon=False, fontsize=8)
    return picture(drawn, f"Motion because of a sensor's fault, by fallback; the line is {LIMIT_DEG:g} deg.")


def main(
    folder: Path, kinds: Sequence[str] = FAULT_KINDS, fallbacks: Sequence[str] = FALLBACKS
) -> list[Outcome]:
    """Run every fault under every fallback, print the table, write gravity_faults.json and .html."""
    start = ready()
    rows = outcomes(start, kinds, fallbacks)
    blocks: list[Block] = [figure(rows)]
    blocks += shown("Largest motion because of a fault", fault_table(rows))
    blocks += shown("What is said", message_table(rows))
    blocks.append(
        Text(
            f"The base stands at {BASE_DEG:g} deg about Z0, the arm is in motion with PD+DG and the robot's own gains; "
            f"the fault lasts {LASTS:g} s. Angles are of joint 1 or 2, whichever moved more; distances of joint 3."
        )
    )
    write_results(
        folder,
        "gravity_faults",
        "Faults of the gravity sensor in mid-motion, simulated",
        "What the arm does while its sensor of gravity fails, against the same motion without the fault.",
        blocks,
        configuration={
            "robot": "nominal",
            "base_deg": BASE_DEG,
            "kp": raven_arm(start.plant).gains.kp.tolist(),
            "fault_seconds": LASTS,
            "motion_seed": start.motion_seed,
            "sensor_seed": 1,
            "kinds": list(kinds),
            "fallbacks": list(fallbacks),
        },
        results=[row._asdict() for row in rows],
    )
    return rows


if __name__ == "__main__":
    main(folder_argument(__doc__))
