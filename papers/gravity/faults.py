"""Faults of the gravity sensor in mid-motion: how far does one move the arm, and what does a person read?

A RAVEN-II on a base at 20 degrees follows a motion with PD+DG; its inertial unit fails for a while. The measure is
the largest distance between the true joint positions of this run and of the same run without the fault, over the fault
and the time after it. With the fallback `stop` the loop ends and the robot is held and paused: the measure is then how
far its joints go from where they were when it was stopped.

Gains are the robot's own, 454 Nm/rad on joint 1: a vector that is wrong by delta moves joint 1 by delta g / kp at most,
and so the fallback `static` on a base at 20 degrees moves it by a quarter of a degree. On softer gains all of it is
larger in proportion. The sensor has noise, resolution and latency of the MPU-6050's class. The paper says nothing of
sensors that fail: none of this is a claim of its own.
"""

from collections.abc import Sequence
from copy import deepcopy
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from catenary import CablePlant, FixedBase, random_sinusoids, run_loop
from catenary.arrays import Floats
from catenary.control.controllers import make_controller
from catenary.control.loop import Tick
from catenary.control.loop_report import GravityReport, LoopReport
from catenary.errors import SensorError
from catenary.sensing.fallback_kinds import FALLBACKS
from catenary.sensing.gravity_vector import Mailbox
from catenary.sensing.imu import SensedGravity
from catenary.simulation.sensors import FAULT_KINDS, InjectedFault, SimulatedSensor
from catenary.trajectories.reference import Rest
from catenary.trajectories.smoothed_path import SmoothedPath
from catenary.workflows.gravity_trials import RAVEN_START, raven_arm, with_approach
from papers.experiment import Case, Experiment, Outcomes, Report, Result, Scope, run
from papers.figures import panels
from papers.gravity.raven_base import SHOWN, raven_of_2014, turned_base
from papers.kit import by_robot, grid, sample, table

BASE_DEG = 20.0  # about Z0
WARM, BEGIN, LASTS, SECONDS = 0.8, 0.5, 1.0, 2.0  # [s] sensor before the motion, fault in the motion, motion
AFTER_STOP = 0.5  # [s] watched
LIMIT_DEG = 0.5  # of a joint, because of a fault
COLORS = {"hold": "#4b6b94", "fade": "#d9622b", "static": "#1c2430", "stop": "#2f8f6b"}
# turning points of the motion about RAVEN_START, and its speeds [rad, rad, m]
HALF, SPEED = np.array([0.25, 0.25, 0.03]), np.array([0.35, 0.35, 0.05])


class Moved(NamedTuple):
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
    plant = CablePlant(raven_of_2014(), seed=seed, base=base)
    plant.home()
    arm = raven_arm(plant)
    begin = _motion(motion_seed, SECONDS)(0.0).q
    way, _ = with_approach(arm, Rest(begin, 0.0), 0.5)
    run_loop(arm.plant, make_controller("dg", arm), way, limits=arm.limits())
    return Start(plant, base, motion_seed)


def follow(start: Start, fault: str | None, fallback: str) -> tuple[Floats, GravityReport, bool]:
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


def outcome(start: Start, fault: str, fallback: str, healthy: Floats) -> Moved:
    """Run with a fault, and compare with the run without it (T, 3)."""
    true, report, stopped = follow(start, fault, fallback)
    if stopped:
        held = true[-round(AFTER_STOP * 1000) - 1 :]
        off = np.abs(held - held[0])
        ran = true[: len(true) - len(held) + 1]
        off = np.concatenate([off, np.abs(ran - healthy[: len(ran)])])
    else:
        off = np.abs(true - healthy)
    moved = (off.max(axis=0) * SHOWN).tolist()
    return Moved(fault, fallback, tuple(moved), tuple(report.ticks), tuple(report.faults), report.messages, stopped)


@run(revision=1)
def break_sensor(seed: int | None, fallback: str, kinds: Sequence[str]) -> Result:
    """Break the sensor of a robot in motion in every way, under one fallback.

    Returns:
        For each kind: how far joints moved because of it [deg, deg, mm], what gravity was, and what was said.
    """
    start = ready(seed=seed)
    healthy, _, _ = follow(start, None, fallback)
    return {kind: outcome(start, kind, fallback, healthy)._asdict() for kind in kinds}


def cases(scope: Scope) -> list[Case]:
    """Return a case for every robot and fallback."""
    if scope.quick:
        return [break_sensor.case(seed=None, fallback="fade", kinds=["drop_out"])]
    return grid(break_sensor, {"seed": scope.robots, "fallback": tuple(FALLBACKS)}, kinds=FAULT_KINDS)


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


def moved(o: Outcomes, kind: str, fallback: str) -> Floats:
    """Return how far a fault moved the joints under a fallback, (robots, 3) [deg, deg, mm]."""
    return sample(o, break_sensor, kind, "moved", fallback=fallback)


def turned(o: Outcomes, kind: str, fallback: str) -> Floats:
    """Return how far a fault moved joint 1 or 2, robot by robot [deg]."""
    return by_robot(moved(o, kind, fallback)[:, :2].max(axis=1))


def _shown(o: Outcomes) -> tuple[list[str], list[str]]:
    """Return kinds and fallbacks of which there are results."""
    names = [name for name in FALLBACKS if o.of(break_sensor, fallback=name)]
    return [kind for kind in FAULT_KINDS if any(kind in one for one in o.of(break_sensor))], names


def _fault_row(o: Outcomes, kind: str) -> list[str]:
    """Return how a fault was named, and how far it moved the arm under each fallback."""
    of = [one[kind] for one in o.of(break_sensor) if kind in one]
    texts = []
    for name in _shown(o)[1]:
        stops = any(one["stopped"] for one in of if one["fallback"] == name)
        end = ", stopped" if stops else ""
        texts.append(f"{turned(o, kind, name)} deg, {moved(o, kind, name)[:, 2]} mm{end}")
    named = dict.fromkeys(name for one in of for name in one["faults"])
    seen = max((one["statuses"] for one in of if not one["stopped"]), key=len, default=["stop"])
    return [kind, ", ".join(named) or "-", " ".join(seen), *texts]


def _largest_row(o: Outcomes, name: str) -> list[str]:
    """Return the fault that moved joint 1 or 2 most under a fallback, and the next."""
    kinds, _ = _shown(o)
    largest = {kind: float(turned(o, kind, name).max()) for kind in kinds}
    order = sorted(kinds, key=largest.__getitem__, reverse=True)
    first = [f"{largest[kind]:.3f} deg, {kind}" for kind in order[:2]]
    slid = max(float(moved(o, kind, name)[:, 2].max()) for kind in kinds)
    return [name, *first, *["-"] * (2 - len(first)), f"{slid:.3f} mm"]


def picture(o: Outcomes) -> Any:
    """Draw how far each fault moved joint 1 or 2, robot by robot, by fallback."""
    kinds, fallbacks = _shown(o)
    drawn, (axes,) = panels(1, 0.28 * len(kinds) + 1.2)
    for k, name in enumerate(fallbacks):
        points = [(each, i + 0.18 * (k - 1.5)) for i, kind in enumerate(kinds) for each in turned(o, kind, name)]
        axes.plot(*zip(*points, strict=True), "o", ms=4, color=COLORS[name], label=name)
    axes.axvline(LIMIT_DEG, color="#b8c0cc", linewidth=1.0)
    axes.set_yticks(range(len(kinds)), kinds, fontsize=8)
    axes.invert_yaxis()
    axes.set_xlim(left=0.0)
    axes.set_xlabel("largest motion of joint 1 or 2 because of the fault [deg]")
    drawn.legend(frameon=False, fontsize=8, ncols=4, loc="outside lower center")
    return drawn


def report(o: Outcomes) -> Report:
    """Return the largest motions, all of them, what was said, and the picture."""
    kinds, names = _shown(o)
    every = [one for result in o.of(break_sensor) for one in result.values()]
    unnamed = [kind for kind in kinds if not any(one["faults"] for one in every if one["fault"] == kind)]
    messages = {name: text for one in every for name, text in zip(one["faults"], one["messages"], strict=True)}
    worst = max(float(turned(o, kind, name).max()) for kind in kinds for name in names)
    tables = [
        table(
            "Largest motion because of any fault, by fallback, of all robots",
            "fallback | joint 1 or 2, at most | next | joint 3, at most",
            [_largest_row(o, name) for name in names],
        ),
        table(
            "Largest motion because of a fault, mean and spread over robots",
            ["sensor", "named", "gravity was", *names],
            [_fault_row(o, kind) for kind in kinds],
        ),
        table("What is said", "fault | message", list(messages.items())),
    ]
    caption = f"Motion because of a sensor's fault, by fallback; dots are robots, the line is {LIMIT_DEG:g} deg"
    remark = (
        f"{len(kinds)} faults of {LASTS:g} s, under {len(names)} fallbacks. The largest motion of joint 1 or 2 is "
        f"{worst:.3f} deg, {'more' if worst > LIMIT_DEG else 'less'} than {LIMIT_DEG:g} deg. Not named in the report: "
        f"{', '.join(unnamed) or 'none'}."
    )
    return Report(tables, {caption: picture(o)}, [remark])


EXPERIMENT = Experiment(
    "gravity-faults", "beyond the paper", "Faults of the gravity sensor in mid-motion", __doc__,
    cases, report, minutes=3.0, drawn=2,
)  # fmt: skip
