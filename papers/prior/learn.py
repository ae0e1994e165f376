"""Learn the prior of the package on simulated arms, from seeds: `make prior`; it rewrites data/simulated.json.

Each arm gives the first part of a recording, of a length of its own; its first and last joint are fitted with the prior
so far, and a class's variance becomes the mean square of its weights, posterior uncertainty included
[expectation-maximisation over arms; Dempster et al. 1977], a few times over. How far an arm may depart from that
(`spread`) and how much correlated rows count (`tempering`) are choices of this file; the error on what follows
in the recordings of other arms, beside ridge regression, is printed.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.dataset import CalibrationData, calibration_data
from catenary.calibration.feature_prior import Prior, PriorOfFeatures, posterior, prior_of_features
from catenary.calibration.fit_options import MEMORY_RIDGE, PLAY_SHARES, FitOptions
from catenary.calibration.fit_rows import choose_inputs
from catenary.calibration.predictors import fit_linear
from catenary.calibration.valid_range import standardisation
from papers.prior.arms import drawn_arm

ARMS, SEED = 300, 1000
UNSEEN = 60  # further arms, to test on
ROWS, TEST = 1200, 0.2
SHORTEST, LONGEST = 0.05, 0.6  # of a recording that is learnt from
WITH_TORQUE = 0.35  # of the arms
ROUNDS = 4
START = -4.0  # logarithm of every variance
LEAST = 1e-6  # variance
SPREAD, TEMPERING = 1.0, 1.0


class Arm(NamedTuple):
    """The first part of a recording, and what follows."""

    train: CalibrationData
    test: CalibrationData


def arm(seed: int) -> Arm:
    """Return an arm by its seed."""
    rng = np.random.default_rng(seed)
    share = np.exp(rng.uniform(np.log(SHORTEST), np.log(LONGEST)))
    torque = rng.random() < WITH_TORQUE
    log = drawn_arm(rng, ROWS)
    options = FitOptions(inputs=("q", "tau") if torque else ("q",), play=None if torque else PLAY_SHARES)
    inputs = choose_inputs([log], options, held_out=1.0 - share)
    rows = calibration_data([log], inputs.features)
    return Arm(rows.rows(rows.position < share), rows.rows(rows.position >= 1.0 - TEST))


def learn(arms: Sequence[Arm], prior: Prior) -> Prior:
    """Return a prior after one round over arms."""
    count = len(prior.classes)
    squares, number = np.zeros(2 * count), np.zeros(2 * count)
    for train, _ in arms:
        of_features = prior_of_features(prior, train.features, train.X)
        mean, scale = standardisation(train.X)
        middle, spread = standardisation(train.error)
        for j in (0, len(train.joint_names) - 1):
            classes = of_features.classes_of(train.joint_names[j])
            y = (train.error[:, j] - middle[j]) / spread[j]
            found = posterior((train.X - mean) / scale, y, classes, prior)
            np.add.at(squares, classes, found.mean**2 + found.variance)
            np.add.at(number, classes, 1.0)
    logs = np.log(np.maximum(squares / np.maximum(number, 1.0), LEAST)).round(3)
    return prior.model_copy(
        update={
            "own": dict(zip(prior.classes, logs[:count].tolist(), strict=True)),
            "other": dict(zip(prior.classes, logs[count:].tolist(), strict=True)),
        }
    )


def first_prior(arms: int = ARMS, seed: int = SEED) -> Prior:
    """Return a prior that knows nothing yet."""
    names = ("q", "tau", *(f"play {share:g}" for share in PLAY_SHARES))
    return Prior(
        name="simulated",
        robots=arms,
        seed=seed,
        play_shares=PLAY_SHARES,
        spread=SPREAD,
        tempering=TEMPERING,
        own=dict.fromkeys(names, START),
        other=dict.fromkeys(names, START),
    )


def over_ridge(arms: Sequence[Arm], prior: Prior) -> Floats:
    """Return the error with a prior over that of ridge regression on what follows, for two joints of every arm."""
    found = []
    for train, test in arms:
        of_features: PriorOfFeatures = prior_of_features(prior, train.features, train.X)
        joints = [0, len(train.joint_names) - 1]
        names = [train.joint_names[j] for j in joints]
        Y, Y_test = train.error[:, joints], test.error[:, joints]
        fits = (of_features.fit(train.X, Y, names), fit_linear(train.X, Y, ridge=MEMORY_RIDGE))
        with_prior, ridge = (np.mean((each.predict(test.X) - Y_test) ** 2, axis=0) for each in fits)
        found.append(np.sqrt(with_prior / ridge))
    return np.concatenate(found)


def main(arguments: Sequence[str] | None = None) -> None:
    """Learn the prior and write it."""
    made = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    made.add_argument("out", type=Path, help="file to write")
    made.add_argument("--arms", type=int, default=ARMS, help="that it is learnt on")
    made.add_argument("--rounds", type=int, default=ROUNDS, help="over them")
    made.add_argument("--unseen", type=int, default=UNSEEN, help="further arms that it is tested on")
    told = made.parse_args(arguments)
    arms = [arm(SEED + k) for k in range(told.arms)]
    prior = first_prior(told.arms)
    for number in range(told.rounds):
        prior = learn(arms, prior)
        print(f"round {number + 1} of {told.rounds}", flush=True)
    told.out.write_text(json.dumps(prior.model_dump(), indent=2) + "\n", encoding="utf-8")
    over = over_ridge([arm(SEED + told.arms + k) for k in range(told.unseen)], prior)
    mean = np.exp(np.log(over).mean())
    print(f"{told.out}: {mean:.3f} times the error of ridge regression on {told.unseen} further arms")


if __name__ == "__main__":
    main()
