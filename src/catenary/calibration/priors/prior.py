"""Priors: how much each class of features weighs in a joint's error, learnt on many simulated robots.

A class is what a feature tells (position, torque, or a play state by its width as a share of the joint's range) and
whether it is of the joint itself or of another one. In units of the training data's spread these weights are alike on
very different arms, so that a prior learnt on simulated ones tells a real one's fit where to begin. It is a table of a
few numbers, `data/NAME.json`; `make prior` (papers/prior/learn.py) makes it anew from seeds.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import as_file, files
from typing import Annotated

import numpy as np
from pydantic import Field

from catenary.arrays import Floats
from catenary.calibration.features import FeatureSet
from catenary.calibration.kernels import Integers
from catenary.calibration.predictors import Linear
from catenary.calibration.priors.evidence import posterior
from catenary.calibration.valid_range import standardisation
from catenary.config import Settings, load_json
from catenary.errors import InputError

PRIORS = ("simulated",)
QUANTITIES = ("q", "tau")
Finite = Annotated[float, Field(ge=-50.0, le=50.0)]


class Prior(Settings):
    """Logarithms of the variances of weights, of the joint's own features and of other joints'."""

    name: str
    robots: int  # simulated, that it was learnt on
    seed: int  # of the first of them
    play_shares: Annotated[tuple[Annotated[float, Field(gt=0.0, lt=1.0)], ...], Field(max_length=100)]
    spread: Annotated[float, Field(gt=0.0, le=10.0)]  # standard deviation of a robot's logarithms about these
    tempering: Annotated[float, Field(ge=0.0, le=1.0)]  # see evidence.py
    own: dict[str, Finite]  # q, tau, play 0.01 ...: natural logarithm
    other: dict[str, Finite]

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of what features tell."""
        return ("q", "tau", *(f"play {share:g}" for share in self.play_shares))

    @property
    def log_variances(self) -> Floats:
        """Of own features by class, then of other joints', (C,)."""
        return np.array([table[name] for table in (self.own, self.other) for name in self.classes])


@cache
def load_prior(name: str) -> Prior:
    """Load a prior of the package by its name.

    Raises:
        InputError: There is no such prior.
        ConfigError: Its file is damaged.
    """
    if name not in PRIORS:
        raise InputError(f'prior "{name}": expected {" or ".join(PRIORS)}')
    with as_file(files("catenary.calibration.priors") / "data" / f"{name}.json") as path:
        return load_json(path, Prior)


@dataclass(frozen=True)
class PriorOfFeatures:
    """A prior beside the features of a fit: which class each feature belongs to."""

    prior: Prior
    quantity: Integers  # (F,) index into the prior's classes
    joint: tuple[str, ...]  # (F,) whose position, torque or play state the feature is

    def of_columns(self, columns: Integers) -> "PriorOfFeatures":
        """Return the prior of some of the features."""
        return PriorOfFeatures(self.prior, self.quantity[columns], tuple(self.joint[c] for c in columns))

    def classes_of(self, joint: str) -> Integers:
        """Return the class of each feature in the eyes of a joint, (F,): its own come first."""
        others = np.array([owner != joint for owner in self.joint], dtype=np.int64)
        return np.asarray(self.quantity + others * len(self.prior.classes))

    def fit(self, X: Floats, Y: Floats, joints: Sequence[str]) -> Linear:
        """Fit Y (N, m), errors of the given joints, as a linear function of the features X (N, F)."""
        mean, scale = standardisation(X)
        middle, spread = standardisation(Y)
        Z, weights = (X - mean) / scale, np.empty((X.shape[1], len(joints)))
        for k, joint in enumerate(joints):
            y = (Y[:, k] - middle[k]) / spread[k]
            weights[:, k] = posterior(Z, y, self.classes_of(joint), self.prior).mean
        weights *= spread / scale[:, None]
        return Linear(weights, middle - mean @ weights)


def prior_of_features(prior: Prior, features: FeatureSet, X: Floats) -> PriorOfFeatures:
    """Return a prior beside features.

    Args:
        prior: What is known of their weights.
        features: Of the fit.
        X: (N, F) rows of training, whose ranges the play states' widths are shares of.

    Raises:
        InputError: The prior knows nothing of a feature: only of positions, torques and play states.
    """
    ranges = {signal: float(np.ptp(X[:, k])) for k, signal in enumerate(features.signals)}
    owners, quantities = [], []
    if features.history or any(signal.partition(":")[0] not in QUANTITIES for signal in features.signals):
        raise InputError(
            f'prior "{prior.name}": knows positions, torques and play states; the inputs are '
            f"{', '.join(features.names)}"
        )
    for signal in features.signals:
        quantity, _, owner = signal.partition(":")
        owners.append(owner)
        quantities.append(prior.classes.index(quantity))
    known = np.log(prior.play_shares)
    for signal, width in features.play:
        share = np.log(width / max(ranges[signal], width))
        owners.append(signal.partition(":")[2])
        quantities.append(len(prior.classes) - len(known) + int(np.argmin(np.abs(known - share))))
    return PriorOfFeatures(prior, np.array(quantities, dtype=np.int64), tuple(owners))
