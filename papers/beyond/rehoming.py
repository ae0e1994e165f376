"""Homing again, explained and cured.

Why: J1, J2 and J3 run towards their stops together. Where joint 2 is there first, its motor goes on by the nominal
coupling while joint 1's motor turns: by the coupling's error, which is small, while joint 1 moves, and by the whole
coupling while joint 1's cable is wound up at its own stop, which moves no joint. So its registration shifts by a step,
which goes where the cable of joint 1 is stiff.
Homings from 40 drawn poses of the test motions' box show the shift against how far joint 1 still went.

Cures, each through 20 minutes of random motion before, between and after five homings, begun where the arm stands or,
at worst, from the corner of the box from which joint 2 is first by most. Go to the home pose first, from which joint 1
is always at its stop before joint 2 (`move_to`, then home). Home twice, as every homing ends at the home pose, and a
robot just switched on can do no other. Take the new registration back, as encoders count on through a homing and their
offsets are in raven_state. Give a model the elbow's offset as an input, after training in three parts with homings from
the corner and from the home pose between them.

Models are the linear one, the paper's network and the learner, on positions and torques of the positioning
joints: the tool's positions, which homing moves too, are figure 9's matter.
"""

import itertools
from collections.abc import Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np

from catenary import CablePlant, MotionLog
from catenary.arrays import Floats
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.model import CalibrationModel
from catenary.workflows.project.calibrate import POSITIONING_INPUTS
from catenary.workflows.robot.motion import move_to
from papers.beyond.registration import AXES, ELBOW_FIRST, HOME_POSE, OFFSETS, carried_back, registration, registrations
from papers.calibration import recordings
from papers.calibration.homings import Between, home_here, random_tests
from papers.experiment import NOMINAL, Case, Experiment, Outcomes, Report, Result, Scope, run
from papers.figures import legend_below, log_scale, panels
from papers.kit import Missing, by_robot, grid, rows, table, unless_missing

HOMINGS = 5
POSES = 40
FIRST_BY = 0.5  # [deg] that joint 1 still goes where joint 2 was first at its stop
NETWORKS = 2
HERE, CORNER, FIRST, TWICE = "where it stands", "the box's corner", "the home pose", "twice"
ORDERS = (HERE, CORNER, FIRST, TWICE)
HARMFUL = (HERE, CORNER)
NOTHING, BACK, PARTED, OFFSET = "-", "registration taken back", "two homings seen", "elbow's offset as input"
CURES = (NOTHING, BACK, PARTED, OFFSET)
SHOWN = [*((order, NOTHING) for order in ORDERS), *((order, cure) for order in HARMFUL for cure in CURES[1:])]
MODELS = {
    "linear": FitOptions(kind="linear", inputs=POSITIONING_INPUTS),
    "network": FitOptions(kind="neural", preset="paper", inputs=POSITIONING_INPUTS),
    "learner": FitOptions(inputs=POSITIONING_INPUTS),
}
DRAWN = {
    (HERE, NOTHING): "#8a94a3",
    (CORNER, NOTHING): "#d9622b",
    (FIRST, NOTHING): "#2f8f6b",
    (TWICE, NOTHING): "#1c2430",
    (CORNER, BACK): "#4b6b94",
    (CORNER, OFFSET): "#c9a227",
}


def home_from(pose: Floats) -> Between:
    """Return what goes to a pose (3,) [rad, rad, m], then homes."""

    def between(plant: CablePlant) -> None:
        move_to(plant, pose, joints=AXES)
        plant.home()

    return between


def home_twice(plant: CablePlant) -> None:
    """Home, and home again from the home pose."""
    plant.home()
    plant.home()


HOW: dict[str, Between] = {
    HERE: home_here,
    CORNER: home_from(ELBOW_FIRST),
    FIRST: home_from(HOME_POSE),
    TWICE: home_twice,
}


@run(revision=2)
def order_errors(
    seed: int | None,
    order: str,
    networks: Sequence[int],
    sparsities: Sequence[float],
    homings: int,
    test_seconds: float,
) -> Result:
    """Train on all zig-zags before the first of five homings in an order; test after each.

    Returns:
        By cure and model: RMSE after 0, 1 ... homings on J1 [deg], J2 [deg], J3 [mm]; from where the arm stands and
        from the corner also with every registration taken back to that of the training.
    """
    plant = recordings.homed(seed)
    if order not in HARMFUL:
        HOW[order](plant)
    train = [recordings.calibration_log(plant, recordings.draws(seed, 0), sparsities=sparsities)]
    before = registration(plant)
    tests = random_tests(plant, seed, range(homings + 1), test_seconds, HOW[order], columns=("encoffsets",))
    models = _fitted(train, networks, MODELS)
    reached = {NOTHING: _errors(models, tests)}
    if order in HARMFUL:
        reached[BACK] = _errors(models, [carried_back(log, plant.firmware, before) for log in tests])
    return reached


@run(revision=2)
def offset_errors(
    seed: int | None, networks: Sequence[int], sparsities: Sequence[float], homings: int, test_seconds: float
) -> Result:
    """Train on zig-zags with homings from the corner and from the home pose between them, then home on and test.

    Returns:
        By where the tested homings begin, cure and model, as `order_errors`: without and with the elbow's offset.
    """
    plant, train = recordings.homed(seed), []
    between = itertools.cycle([HOW[CORNER], HOW[FIRST]])
    for number, sparsity in enumerate(sparsities):
        if number:
            next(between)(plant)
        log = recordings.calibration_log(
            plant, recordings.draws(seed, 0, number), sparsities=(sparsity,), columns=("encoffsets",)
        )
        train.append(log)
    taking = {name: replace(o, inputs=(*POSITIONING_INPUTS, OFFSETS[1])) for name, o in MODELS.items()}
    models = {PARTED: _fitted(train, networks, MODELS), OFFSET: _fitted(train, networks, taking)}
    reached = {}
    for order in HARMFUL:
        tests = random_tests(
            deepcopy(plant), seed, range(homings + 1), test_seconds, HOW[order], columns=("encoffsets",)
        )
        reached[order] = {cure: _errors(each, tests) for cure, each in models.items()}
    return reached


Fitted = Mapping[str, Sequence[CalibrationModel]]  # trainings by model


def _fitted(train: Sequence[MotionLog], networks: Sequence[int], options: Mapping[str, FitOptions]) -> Fitted:
    return {
        name: [recordings.unguarded(recordings.fitted(train, replace(one, seed=seed))) for seed in seeds]
        for name, one in options.items()
        if (seeds := networks if one.kind == "neural" else (0,))
    }


def _errors(models: Fitted, tests: Sequence[MotionLog]) -> dict[str, list[list[float]]]:
    reached = {}
    for name, trained in models.items():
        rows = [recordings.rows_of(trained[0], log) for log in tests]
        reached[name] = [recordings.mean([recordings.rmse(model, each) for model in trained]) for each in rows]
    return reached


def cases(scope: Scope) -> list[Case]:
    """Return a case for every robot and order, one with homings in training, and one of registrations."""
    poses, sparsities, homings, seconds = (
        (2, (1.0, 1.0), 1, 20.0) if scope.quick else (POSES, recordings.SPARSITIES, HOMINGS, recordings.TEST_SECONDS)
    )
    networks = () if scope.quick else (0,)
    arguments = {"networks": networks, "sparsities": sparsities, "homings": homings, "test_seconds": seconds}
    return [
        case
        for seed in scope.robots
        for case in (
            registrations.case(seed=seed, poses=poses),
            *grid(order_errors, {"order": ORDERS}, seed=seed, **arguments),
            offset_errors.case(seed=seed, **arguments),
        )
    ]


def errors(o: Outcomes, order: str, cure: str, model: str) -> Floats:
    """Return the RMSE of joint 2 after 0, 1 ... homings in an order, with a cure, (robots, 1 + homings)."""
    every = [*o.of(order_errors, order=order), *(result.get(order, {}) for result in o.of(offset_errors))]
    by_homing = [result[cure][model] for result in every if model in result.get(cure, {})]
    if not by_homing:
        raise Missing(f"{order}, {cure}, {model}")
    return by_robot(by_homing)[..., 1]


def report(o: Outcomes) -> Report:
    """Return the mechanism, the cures, and what they come to in a sentence."""
    count = max((len(next(iter(one[NOTHING].values()))) - 1 for one in o.of(order_errors)), default=0)

    def cure(way: tuple[str, str], model: str) -> list[str]:
        reached = errors(o, *way, model)
        after = reached[:, 1:]
        numbers = (f"{each}" for each in (reached[:, 0], after[:, -1], after.mean(axis=1)))
        return [*way, model, *numbers, f"{after.max():.3f}"]

    mechanism = (
        "robot | coupling error [deg/deg] | J2 first | step [deg] | R² | shift, SD [deg] | shift, most | J2 left its "
        "stop by at most [deg]"
    )
    header = f"homing from | cure | model | before | after {count} | mean after | greatest"
    caption = (
        "Left: joint 2 of the nominal robot at its stop; dotted, when joint 1 meets its own. Middle: 40 homings of "
        "every robot. Right: linear model, mean over robots"
    )
    return Report(
        [
            table("Joint 2's registration by where homing begins", mechanism, _mechanism(o)),
            table("J2 [deg], RMSE after homings, spread over robots", header, rows(cure, SHOWN, MODELS)),
        ],
        {caption: _picture(o)},
        _remarks(o),
    )


def _fit(result: Result) -> tuple[float, float]:
    """Return the step of shifts where joint 2 was first [deg], and R^2 of it and of the coupling's error."""
    shift, travel = np.array(result["shift"]), np.array(result["travel"])
    first, residual = travel > FIRST_BY, shift - result["coupling_error"] * travel
    if first.all() or not first.any():
        return float("nan"), float("nan")
    step = residual[first].mean() - residual[~first].mean()
    return float(step), float(1.0 - (residual - step * first).var() / shift.var())


def _mechanism(o: Outcomes) -> list[list[str]]:
    content = []
    for arguments, result in o.items(registrations):
        step, share = _fit(result)
        shift, first = np.array(result["shift"]), np.array(result["travel"]) > FIRST_BY
        content.append([
            *("nominal" if arguments["seed"] is NOMINAL else f"{arguments['seed']}", f"{result['coupling_error']:.4f}"),
            *(f"{int(first.sum())} of {len(first)}", f"{step:.3f}", f"{share:.3f}"),
            *(f"{shift.std():.3f}", f"{np.abs(shift).max():.3f}", f"{max(result['left']):.3f}"),
        ])  # fmt: skip
    return content


@unless_missing
def _remarks(o: Outcomes) -> str:
    corner, first, back = (errors(o, *each, "linear") for each in ((CORNER, NOTHING), (FIRST, NOTHING), (CORNER, BACK)))
    explained = 100.0 * np.mean([_fit(result)[1] for result in o.of(registrations)])
    of_corner, of_first, of_back = (
        f"{each[:, 1:].mean():.3f} (at worst {each[:, 1:].max():.3f}) deg" for each in (corner, first, back)
    )
    return (
        f"The linear model's error on joint 2, {corner[:, 0].mean():.3f} deg after calibration, becomes {of_corner} "
        f"when the arm is homed from the corner of its box, {of_first} when it is homed from the home pose, and "
        f"{of_back} when the registration from the corner is taken back; a step where joint 2 is first, and the "
        f"coupling's error times joint 1's way, explain {explained:.0f} % of the variance of joint 2's registration."
    )


def _picture(o: Outcomes) -> Any:
    figure, (homing, mechanism, cured) = panels(3, 3.4)
    for arguments, result in o.items(registrations):
        if arguments["seed"] is NOMINAL:
            _draw_homings(homing, result["traces"])
        mechanism.plot(result["travel"], result["shift"], "o", ms=3, alpha=0.7)
    mechanism.set_xlabel("way of J1 after J2 met its stop [deg]", fontsize=8)
    mechanism.set_title("shift of J2's registration [deg]", fontsize=10)
    for (order, cure), color in DRAWN.items():
        label = (f"from {order}" if order != TWICE else order) + ("" if cure == NOTHING else f", {cure}")
        with suppress(Missing):
            reached = errors(o, order, cure, "linear").mean(axis=0)
            cured.plot(reached, "o-" if cure == NOTHING else "s--", ms=3, color=color, label=label)
    log_scale(cured)
    cured.set_xlabel("homings", fontsize=8)
    cured.set_title("RMSE of J2 [deg], linear", fontsize=10)
    legend_below(figure, cured, columns=3)
    return figure


def _draw_homings(panel: Any, traces: dict[str, Any]) -> None:
    for (name, trace), color in zip(traces.items(), ("#2f8f6b", "#d9622b"), strict=True):
        panel.plot(np.array(trace["time"]), trace["true"], color=color, label=f"from the {name}")
        panel.axvline(trace["shoulder_s"], color=color, linestyle=":", linewidth=1)
    panel.set_ylim(-1.5, 0.8)
    panel.legend(loc="upper left", frameon=False, fontsize=7)
    panel.set_xlabel("s", fontsize=8)
    panel.set_title("J2 against its stop [deg]", fontsize=10)


EXPERIMENT = Experiment(
    "beyond-rehoming", "beyond figure 9", "Homing again, explained and cured", __doc__, cases, report, minutes=43.0
)
