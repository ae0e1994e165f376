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
from papers.experiment import Result, run

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
