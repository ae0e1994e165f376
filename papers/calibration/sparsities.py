"""A session of independent zig-zags of every sparsity with a test for each, and models of every combination of them.

Peng et al., II-F: five recordings of 1/2, 1/3 and 1/4, three of 1/5 and 1/6, in direction J2-J3, each sparsity followed
by 20 minutes of random motion of its own. All come one after another from one robot, homed once. Combinations no longer
than 1/2 + 1/3 + 1/4 join the first recording of each sparsity, the second of each, and so on, as many as the rarest
has, and are tested on the motion after their finest, which was recorded last.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from catenary import MotionLog
from catenary.arrays import Floats
from catenary.calibration.model import CalibrationModel
from papers.calibration.homings import outside
from papers.calibration.recordings import (
    METHODS,
    NETWORK,
    TEST_SECONDS,
    baselines,
    calibration_log,
    draws,
    fitted,
    homed,
    mean,
    random_log,
    rmse,
    rows_of,
    unguarded,
)
from papers.experiment import Outcomes, Result, run

RECORDINGS = {"1/2": 5, "1/3": 5, "1/4": 5, "1/5": 3, "1/6": 3}
MODELS = (NETWORK, "polynomial", "linear")
OFFSET = "fixed offset"
SHOWN = (*MODELS, OFFSET)
SHORT, LONG = 500.0, 800.0  # [s] below and above which the paper gives means


@dataclass(frozen=True)
class Session:
    """Recordings of one robot."""

    train: Mapping[str, Sequence[MotionLog]]  # by sparsity
    test: Mapping[str, MotionLog]

    def training(self, name: str) -> list[list[MotionLog]]:
        """Return the repetitions of a combination, each the recordings that it joins."""
        return [list(each) for each in zip(*(self.train[part] for part in parts(name)), strict=False)]


def parts(name: str) -> list[str]:
    """Return the sparsities of a combination, "1/2" and "1/3" of "1/2+1/3"."""
    return name.split("+")


def recorded(
    seed: int | None, recordings: Mapping[str, int], finest: str, *, test_seconds: float = TEST_SECONDS
) -> Session:
    """Record a session as far as a sparsity and its test.

    What is recorded does not depend on how far the session goes.

    Args:
        seed: The robot.
        recordings: How many zig-zags of each sparsity.
        finest: Sparsity with which the session ends.
        test_seconds: Length of every test.
    """
    plant = homed(seed)
    train: dict[str, list[MotionLog]] = {}
    test = {}
    for sparsity, count in recordings.items():
        n = int(sparsity.removeprefix("1/"))
        train[sparsity] = [calibration_log(plant, draws(seed, 50, n, k), sparsities=(1.0 / n,)) for k in range(count)]
        test[sparsity] = random_log(plant, draws(seed, 51, n), test_seconds)
        if sparsity == finest:
            break
    return Session(train, test)


@run(revision=1)
def sparsity_errors(
    seed: int | None, name: str, recordings: Mapping[str, int], networks: Sequence[int], test_seconds: float
) -> Result:
    """Fit every model to every repetition of a combination of sparsities, and test it on random motion.

    Args:
        seed: The robot.
        name: Of `SETS`.
        recordings: How many zig-zags of each sparsity.
        networks: Seeds of the network, whose errors are averaged.
        test_seconds: Length of every test.

    Returns:
        `seconds` of a training set; `outside`, the share of test rows outside the linear model's valid range, in which
        it is asked all the same; and by method, for every repetition, RMSE on J1 [deg], J2 [deg], J3 [mm].
    """
    finest = parts(name)[-1]
    session = recorded(seed, recordings, finest, test_seconds=test_seconds)
    found: dict[str, Any] = {method: [] for method in SHOWN}
    for training in session.training(name):
        models: list[CalibrationModel] = []
        for method in MODELS:
            seeds = networks if method == NETWORK else (0,)
            models = [fitted(training, replace(METHODS[method], seed=each)) for each in seeds]
            rows = rows_of(models[0], session.test[finest])
            found[method].append(mean([rmse(unguarded(model), rows) for model in models]))
        found[OFFSET].append(baselines(models[0], rows)[OFFSET])
        found["outside"] = outside(models[0], session.test[finest])
        found["seconds"] = round(sum(_seconds(log) for log in training), 1)
    return found


def _seconds(log: MotionLog) -> float:
    time = np.asarray(log.time)
    return float(time[-1] - time[0])


def combinations(outcomes: Outcomes) -> dict[str, float]:
    """Return how long every combination that has run takes to record [s], the shortest first."""
    seconds: dict[str, list[float]] = {}
    for told, result in outcomes.items(sparsity_errors):
        seconds.setdefault(told["name"], []).append(result["seconds"])
    return dict(sorted(((name, float(np.mean(each))) for name, each in seconds.items()), key=lambda one: one[1]))


def repetitions(outcomes: Outcomes, name: str, method: str) -> Floats:
    """Return the RMSE (robots, repetitions, 3) of a method trained with a combination."""
    return np.array([result[method] for result in outcomes.of(sparsity_errors, name=name)])


def middle(outcomes: Outcomes, name: str, method: str) -> Floats:
    """Return the RMSE (3,) of a method trained with a combination, mean over robots and repetitions."""
    return np.asarray(repetitions(outcomes, name, method).mean(axis=(0, 1)))


def deviation(outcomes: Outcomes, name: str, method: str) -> Floats:
    """Return the standard deviation (3,) over repetitions, mean over robots."""
    return np.asarray(deviations(outcomes, name, method).mean(axis=0))


def by_robot(outcomes: Outcomes, names: Sequence[str], method: str) -> Floats:
    """Return the RMSE (robots, 3) of a method, mean over combinations and their repetitions."""
    return np.asarray(np.mean([repetitions(outcomes, name, method).mean(axis=1) for name in names], axis=0))


def deviations(outcomes: Outcomes, name: str, method: str) -> Floats:
    """Return the standard deviation (robots, 3) over repetitions."""
    return np.asarray(repetitions(outcomes, name, method).std(axis=1, ddof=1))


def short_and_long(outcomes: Outcomes) -> tuple[list[str], list[str]]:
    """Return the combinations below 500 s and those above 800 s, each the shortest first."""
    seconds = combinations(outcomes)
    return [n for n, time in seconds.items() if time < SHORT], [n for n, time in seconds.items() if time > LONG]
