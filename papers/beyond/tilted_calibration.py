"""Calibration on tilted and rocking bases.

Cables stretch by what they carry, and what gravity asks of them changes with the base. A robot is homed once, on a
level base; then its base is tilted about Z0, joint 1's axis, as in the gravity paper's experiments, or across it, or
rocked about Z0 at 1 Hz. Models are trained level, on one tilt, or on several (1/2 at 20 deg about Z0, 1/3 at 20 deg
across, 1/4 level: the same minutes), and tested by 20 minutes of random motion on every base. Inputs are the paper's
16, or these and the gravity model's torque at the reported positions under the sensed gravity. Networks are asked
wherever the robot is, as linear models are and the paper's were; the learner, of the nominal robot, takes no tool's
positions and torques, and keeps to its valid range.
"""

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np

from catenary import CablePlant, MotionLog, gravity_torque, load_robot, random_sinusoids, record_simulated, zigzag
from catenary.arrays import Floats
from catenary.calibration.fit_options import FitOptions
from catenary.errors import InputError
from catenary.simulation.base_motion import BaseSamples, FixedBase, MovingBase, imu_reading
from catenary.workflows.project.calibrate import POSITIONING_INPUTS
from papers.calibration.homings import outside
from papers.calibration.inputs import SIXTEEN
from papers.calibration.recordings import START, TEST_SECONDS, baselines, draws, fitted, mean, rmse, rows_of, unguarded
from papers.experiment import NOMINAL, Case, Experiment, Outcomes, Report, Result, Robot, Scope, run
from papers.figures import legend_below, log_scale, panels
from papers.gravity.raven_base import rocking_base, turned_base
from papers.kit import IN_UNITS, Missing, by_robot, joint_tables, rows

LEVEL_BASE = "level"
ROCKING = "rocking 10-20°"
# turned about Z0, joint 1's axis, or across it, about the base's x
BASES: Mapping[str, MovingBase] = {
    LEVEL_BASE: FixedBase(),
    "20° about Z0": turned_base(20.0),
    "20° across": FixedBase(float(np.deg2rad(20.0))),
    "-20° across": FixedBase(float(np.deg2rad(-20.0))),
    ROCKING: rocking_base(),
}
AXES = ("shoulder", "elbow", "insertion")
GRAVITY = tuple(f"gravity:{axis}" for axis in AXES)  # the model's torque at q_nominal [Nm, Nm, N]
DIFFERENCE = tuple(f"beyond gravity:{axis}" for axis in AXES)  # the robot's torque less that
SETTLING = 2.0  # [s] on a base that was set, longer than the simulation looks ahead
NETWORKS = 2
# the base and the sparsity of every part of a training
Part = tuple[str, float]
LEVEL, TILTED, SEVERAL = "level", "20° about Z0", "several tilts"
TRAININGS: dict[str, tuple[Part, ...]] = {
    LEVEL: tuple((LEVEL_BASE, s) for s in (1 / 2, 1 / 3, 1 / 4)),
    TILTED: tuple((TILTED, s) for s in (1 / 2, 1 / 3, 1 / 4)),
    SEVERAL: ((TILTED, 1 / 2), ("20° across", 1 / 3), (LEVEL_BASE, 1 / 4)),
}
PAPERS, WITH_GRAVITY, LESS_GRAVITY = "16 inputs", "16 and gravity", "torque less gravity"
INPUTS: dict[str, tuple[str, ...]] = {
    PAPERS: SIXTEEN,
    WITH_GRAVITY: (*SIXTEEN, *GRAVITY),
    LESS_GRAVITY: ("q", *DIFFERENCE, *(f"tau:{tool}" for tool in ("roll", "wrist", "jaw1", "jaw2", "unused"))),
}
# of the learner, which leaves the tool's out
OWN_INPUTS: dict[str, tuple[str, ...]] = {
    PAPERS: POSITIONING_INPUTS,
    WITH_GRAVITY: (*POSITIONING_INPUTS, *GRAVITY),
    LESS_GRAVITY: (*POSITIONING_INPUTS[:3], *DIFFERENCE),
}
LEARNER, PAPERS_KINDS = "learner", ("linear", "network")
MODELS_TOLD = {"linear": "linear model", "network": "network", LEARNER: "learner"}
KINDS = {
    "linear": FitOptions(kind="linear"),
    "network": FitOptions(kind="neural", preset="paper"),
    LEARNER: FitOptions(),
}
COLORS = {PAPERS: "#d9622b", WITH_GRAVITY: "#2f8f6b"}
SHOWN = (PAPERS, WITH_GRAVITY)
SHAPES = {LEVEL: "o", TILTED: "s", SEVERAL: "^"}


@dataclass
class SetBase:
    """A base that somebody sets: what stands in `now` holds within a second."""

    now: MovingBase = field(default_factory=FixedBase)

    def sample(self, times: Floats) -> BaseSamples:
        """Return the motion at times (N,) [s], one row for each."""
        gravity, motion = self.now.sample(times)
        rows = len(times)
        return BaseSamples(np.broadcast_to(gravity, (rows, 3)).copy(), np.broadcast_to(motion, (rows, 3, 3)).copy())


def homed_level(seed: int | None, *, substeps: int = 1) -> tuple[CablePlant, SetBase]:
    """Return a robot homed on a level base, and its base."""
    base = SetBase()
    plant = CablePlant(seed=seed, start=START, base=base, substeps=substeps)
    plant.home()
    return plant, base


def put_on(robot: tuple[CablePlant, SetBase], set_to: MovingBase) -> CablePlant:
    """Return a copy of a robot that stands on another base, at rest and not homed anew."""
    plant, base = deepcopy(robot)
    base.now = set_to
    plant.run(np.full((round(SETTLING / plant.period), len(plant.joint_names)), np.nan))
    return plant


def with_gravity(log: MotionLog, base: MovingBase, start: float) -> MotionLog:
    """Return a recording, begun at `start` [s] since power-on, with the gravity model's GRAVITY and DIFFERENCE."""
    if log.time is None or log.tau is None:
        raise InputError(f'recording "{log.name}": has no time or no torques')
    samples = base.sample(start + log.time)
    sensed: Floats = -imu_reading(samples)[0]
    torque = gravity_torque(load_robot("raven2"), log.q_nominal, np.broadcast_to(sensed, (len(log), 3)).copy())
    signals = dict(zip((*GRAVITY, *DIFFERENCE), (*torque.T, *(log.tau - torque).T), strict=True))
    units = dict.fromkeys(signals, "Nm") | dict.fromkeys((GRAVITY[2], DIFFERENCE[2]), "N")
    return replace(log, signals={**log.signals, **signals}, signal_units={**log.signal_units, **units})


@run(revision=1)
def base_errors(
    seed: int | None,
    training: Sequence[Sequence[Any]],
    inputs: Sequence[str],
    networks: Sequence[int],
    bases: Sequence[str],
    test_seconds: float,
    kinds: Sequence[str] = PAPERS_KINDS,
) -> Result:
    """Train on some bases and test on others; return RMSE on J1 [deg], J2 [deg], J3 [mm] by base and model.

    Returns:
        By base: errors by model; with the linear one also `raw`, `fixed offset`, and the share of rows `outside` its
        valid range.
    """
    robot = homed_level(seed)
    train = []
    for number, (base, sparsity) in enumerate(training):
        plant, path = put_on(robot, BASES[base]), zigzag("J2-J3", (sparsity,))
        log = record_simulated(plant, path, "zigzag", draws(seed, number))
        train.append(with_gravity(log, BASES[base], plant.time - path.duration))
    models = {
        name: [fitted(train, replace(options, inputs=tuple(inputs), seed=network)) for network in seeds]
        for name, options in ((name, KINDS[name]) for name in kinds)
        for seeds in ([networks] if options.kind == "neural" else [(0,)])
        if seeds
    }
    reached: dict[str, dict[str, Any]] = {}
    for base in bases:
        plant, rng = put_on(robot, BASES[base]), draws(seed, 50)
        motion = random_sinusoids(rng, test_seconds)
        log = with_gravity(record_simulated(plant, motion, "random", rng), BASES[base], plant.time - test_seconds)
        reached[base] = {
            name: mean([rmse(model if name == LEARNER else unguarded(model), rows_of(model, log)) for model in trained])
            for name, trained in models.items()
        }
        for model in models.get("linear", ()):
            reached[base] |= baselines(model, rows_of(model, log)) | {"outside": outside(model, log)}
    return reached


def cases_of(seed: Robot, training: str, inputs: str, scope: Scope, bases: Sequence[str] = tuple(BASES)) -> list[Case]:
    """Return the cases of a robot, a training and inputs by their names; the nominal robot's learner has its own."""
    parts, seconds = TRAININGS[training], TEST_SECONDS
    if scope.quick:
        parts, seconds = tuple((base, 1.0) for base, _ in parts[:2]), 20.0
    asked = {"seed": seed, "training": parts, "bases": bases, "test_seconds": seconds}
    networks = () if scope.quick else (0,)
    learner = base_errors.case(inputs=OWN_INPUTS[inputs], networks=(), kinds=(LEARNER,), **asked)
    return [base_errors.case(inputs=INPUTS[inputs], networks=networks, **asked), *[learner] * (seed is NOMINAL)]


def cases(scope: Scope) -> list[Case]:
    """Return a case for every robot, training and inputs."""
    trainings = [LEVEL] if scope.quick else list(TRAININGS)
    return [case for each in product(scope.robots, trainings, SHOWN) for case in cases_of(*each, scope)]


def errors(o: Outcomes, training: str, inputs: str, base: str, model: str) -> Floats:
    """Return RMSE (robots, 3) of a model on a base."""
    of_robots = [
        result[base][model]
        for arguments, result in o.items(base_errors, inputs=list((OWN_INPUTS if model == LEARNER else INPUTS)[inputs]))
        if _is(arguments["training"], training) and model in result.get(base, {})
    ]
    if not of_robots:
        raise Missing(f"{training}, {inputs}, {model}, {base}")
    return by_robot(of_robots)


def _is(parts: Sequence[Sequence[Any]], training: str) -> bool:
    return [base for base, _ in parts] == [base for base, _ in TRAININGS[training]][: len(parts)]


def report(o: Outcomes) -> Report:
    """Return a table per joint and the picture."""

    def content(j: int) -> list[list[str]]:
        def row(training: str, kind: tuple[str, str]) -> list[str]:
            inputs, model = kind
            offset = model == "fixed offset"
            columns = (errors(o, training, PAPERS if offset else inputs, base, model)[:, j] for base in BASES)
            return [training, inputs, model, *(f"{each}" for each in columns)]

        return rows(row, TRAININGS, [*product(SHOWN, KINDS), ("-", "fixed offset")])

    title = "{}, RMSE by the base of the test"
    caption = (
        "RMSE by the base of the test; circles trained level, squares at 20° about Z0, triangles on several tilts; "
        "mean over robots, filled the network, empty the linear model, with a thick edge the learner"
    )
    tables = joint_tables(title, ["trained", "inputs", "model", *BASES], content)
    return Report(tables, {caption: _picture(o)}, _remarks(o))


def joints(*errors: Floats) -> str:
    """Return what bases and robots have in the mean, J1/J2/J3."""
    return "/".join(f"{value:.3f}" for value in np.concatenate(errors).mean(axis=0))


def _remarks(o: Outcomes) -> list[str]:
    tilted = [base for base in BASES if base != LEVEL_BASE]

    def remark(model: str) -> list[str]:
        parts = [
            joints(*(errors(o, training, inputs, base, model) for base in tilted))
            for training, inputs in product((LEVEL, SEVERAL), SHOWN)
        ]
        return [
            f"A {MODELS_TOLD[model]} calibrated level errs by {joints(errors(o, LEVEL, PAPERS, LEVEL_BASE, model))} "
            f"(J1 deg/J2 deg/J3 mm) there and by {parts[0]} on tilted and rocking bases, by {parts[1]} with the "
            f"gravity model's torque as an input; calibrated on several tilts in the same minutes, by {parts[2]} and "
            f"{parts[3]}."
        ]

    level = [result for of, result in o.items(base_errors, inputs=list(SIXTEEN)) if _is(of["training"], LEVEL)]
    remarks = [cell for (cell,) in rows(remark, KINDS)]
    if level:
        shares = (f"{base} {100.0 * np.mean([one[base]['outside'] for one in level]):.0f} %" for base in BASES)
        remarks.append(f"Rows outside the valid range of a model of 16 inputs trained level: {', '.join(shares)}.")
    return remarks


def _picture(o: Outcomes) -> Any:
    figure, axes = panels(3, 3.8)
    places = {each: k for k, each in enumerate(product(TRAININGS, SHOWN))}
    for j, panel in enumerate(axes):
        for (training, inputs), model, (b, base) in product(places, KINDS, enumerate(BASES)):
            try:
                reached = errors(o, training, inputs, base, model)[:, j].mean()
            except Missing:
                continue
            t, i = divmod(places[training, inputs], len(SHOWN))
            panel.plot(
                b + 0.22 * (t - 1) + 0.08 * (i - 0.5), reached, SHAPES[training], color=COLORS[inputs], ms=5,
                markerfacecolor=COLORS[inputs] if model == "network" else "white",
                markeredgewidth=2.0 if model == LEARNER else 0.8,
                label=f"{training}, {inputs}" if (b, model) == (0, "network") else None,
            )  # fmt: skip
        panel.set_xticks(range(len(BASES)), BASES, rotation=35, fontsize=8, ha="right")
        log_scale(panel)
        panel.set_title(IN_UNITS[j], fontsize=10)
    legend_below(figure, axes[0], columns=3)
    return figure


EXPERIMENT = Experiment(
    "beyond-tilted-calibration", "beyond II-G", "Calibration on tilted and rocking bases", __doc__,
    cases, report, minutes=31.0,
)  # fmt: skip
