"""Homing again: test motions with homings between them, and models as the paper ran them, without a valid range.

Figure 9 and the experiment that explains it use these (Peng et al., II-I).
"""

from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import replace
from typing import Any

import numpy as np

from catenary import CablePlant, MotionLog
from catenary.arrays import Floats
from catenary.calibration.evaluate import evaluate
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.model import CalibrationModel
from catenary.workflows.project.calibrate import POSITIONING_INPUTS
from papers.calibration import recordings
from papers.claims import Missing
from papers.experiment import Outcomes, Result, run
from papers.kit import by_robot

TESTS = 900  # number of the first test motion among a robot's draws
Tests = dict[str, list[MotionLog]]  # by chain
Between = Callable[[CablePlant], None]  # what is done to a robot between two test motions
MODELS = (recordings.NETWORK, "linear")
GUARDED = {name: f"{name}, valid range" for name in MODELS}
BASELINE, NONE, ONE = "no homing", "none seen", "one seen"
CHAINS = (BASELINE, NONE, ONE)
POSITIONING = "linear, positioning joints"
METHODS_SHOWN = (*MODELS, *GUARDED.values(), POSITIONING, recordings.BEST)
TOOLS = ("roll", "wrist", "jaw1", "jaw2")


def home_here(plant: CablePlant) -> None:
    """Home from wherever the motion ended, as the robot does."""
    plant.home()


def stay(plant: CablePlant) -> None:
    """Go on without homing."""


def random_tests(
    plant: CablePlant,
    seed: int | None,
    numbers: Sequence[int],
    seconds: float,
    between: Between,
    *,
    columns: Sequence[str] = (),
) -> list[MotionLog]:
    """Record test motions by their numbers, and do something between each two of them.

    A number's motion is the same whatever was done before, so that chains with and without homing can be compared.
    """
    logs = []
    for place, number in enumerate(numbers):
        if place:
            between(plant)
        logs.append(recordings.random_log(plant, recordings.draws(seed, TESTS, number), seconds, columns=columns))
    return logs


@run(revision=1)
def homing_errors(
    seed: int | None,
    seen: int,
    networks: Sequence[int],
    ours: Sequence[int],
    combinations: Sequence[Sequence[Sequence[float]]],
    homings: int,
    test_seconds: float,
) -> Result:
    """Train on both parts of every combination, home again and again, and test after each homing.

    Args:
        seen: Homings between the parts, 0 or 1.
        ours: Seeds of our network, which is fitted to the last combination; none leaves it out.

    Returns:
        By chain of tests and method: for every combination, RMSE after 0, 1 ... homings on J1 [deg], J2 [deg], J3
        [mm]. `outside`: share of test rows beyond the network's valid range.
    """
    plant = recordings.homed(seed)
    first = _part(plant, seed, 0, [before for before, _ in combinations])
    if seen:
        tests: Tests = {ONE: random_tests(plant, seed, [0], test_seconds, home_here)}
        plant.home()
        second = _part(plant, seed, 1, [after for _, after in combinations])
        tests[ONE] += random_tests(plant, seed, range(1, homings + 1), test_seconds, home_here)
    else:
        second = _part(plant, seed, 1, [after for _, after in combinations])
        numbers = range(homings + 1)
        tests = {BASELINE: random_tests(deepcopy(plant), seed, numbers, test_seconds, stay)}
        tests[NONE] = random_tests(plant, seed, numbers, test_seconds, home_here)
    reached: dict[str, dict[str, list[Any]]] = {chain: {"outside": [], "tool": []} for chain in tests}
    for combination in combinations:
        train = [part[s] for part, used in zip((first, second), combination, strict=True) for s in used]
        for name in MODELS:
            models = _trainings(train, recordings.METHODS[name], networks)
            _add(reached, name, [recordings.unguarded(model) for model in models], tests)
            _add(reached, GUARDED[name], models, tests)
        for chain, logs in tests.items():
            reached[chain]["outside"].append([outside(models[0], log) for log in logs])
            reached[chain]["tool"].append([tool_shift(train, log) for log in logs])
        _add(
            reached,
            POSITIONING,
            [recordings.fitted(train, FitOptions(kind="linear", inputs=POSITIONING_INPUTS))],
            tests,
        )
    if ours:
        _add(reached, recordings.BEST, _trainings(train, recordings.METHODS[recordings.BEST], ours), tests)
    return reached


def _part(plant: CablePlant, seed: int | None, number: int, used: Sequence[Sequence[float]]) -> dict[float, MotionLog]:
    sparsities = sorted({sparsity for each in used for sparsity in each}, reverse=True)
    return {
        s: recordings.calibration_log(plant, recordings.draws(seed, number, round(1 / s)), sparsities=(s,))
        for s in sparsities
    }


def _trainings(train: Sequence[MotionLog], options: FitOptions, networks: Sequence[int]) -> list[CalibrationModel]:
    seeds = networks if options.kind == "neural" else (0,)
    return [recordings.fitted(train, replace(options, seed=network)) for network in seeds]


def _add(
    reached: dict[str, dict[str, list[Any]]], method: str, models: Sequence[CalibrationModel], tests: Tests
) -> None:
    for chain, logs in tests.items():
        of_tests = []
        for log in logs:
            rows = recordings.rows_of(models[0], log)
            of_tests.append(recordings.mean([recordings.rmse(model, rows) for model in models]))
        reached[chain].setdefault(method, []).append(of_tests)


def outside(model: CalibrationModel, log: MotionLog) -> float:
    """Return the share of a recording's rows outside a model's valid range."""
    return evaluate(model, recordings.rows_of(model, log)).joints[0].outside_valid_range


def tool_shift(train: Sequence[MotionLog], test: MotionLog) -> float:
    """Return the greatest distance of a tool joint's mean from its mean in training, over its spread there."""
    shifts = []
    for joint in TOOLS:
        before = np.concatenate([log.signals[f"q:{joint}"] for log in train])
        shifts.append(abs(test.signals[f"q:{joint}"].mean() - before.mean()) / before.std())
    return float(max(shifts))


def errors(o: Outcomes, chain: str, method: str) -> Floats:
    """Return RMSE (robots, combinations, 1 + homings, 3) of a method along a chain of tests."""
    found = [result[chain][method] for result in o.of(homing_errors) if method in result.get(chain, {})]
    if not found:
        raise Missing(f"{chain}, {method}")
    return by_robot(found)


def per_robot(o: Outcomes, chain: str, method: str) -> Floats:
    """Return RMSE (robots, 1 + homings, 3) of a method along a chain of tests, the mean over combinations."""
    return by_robot(errors(o, chain, method).mean(axis=1))
