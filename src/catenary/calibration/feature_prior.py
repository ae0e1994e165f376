"""What a fit knows beforehand: how much each class of features weighs in a joint's error, learnt on simulated robots.

A class is what a feature tells (position, torque, or a play state by its width as a share of the joint's range) and
whether it is of the joint itself or of another one. In units of the training data's spread these weights are alike on
very different arms, so that a prior learnt on simulated ones tells a real one's fit where to begin. It is a table of a
few numbers, `data/NAME.json`; `make prior` (papers/prior/learn.py) makes it anew from seeds.

Bayesian linear regression y = Z w + noise, w_k ~ N(0, v_c(k)), on standardised features and outputs. How much each
class of features weighs, v_c, is itself drawn about what a prior says of it: ln v_c ~ N(m_c, spread^2). It and the
noise are taken where the evidence times their density is largest [type II maximum likelihood; MacKay 1992], and the
weights then are their posterior mean: a ridge regression with a penalty for each class. Errors of neighbouring rows
resemble each other; rows count as many as are independent, by their errors' integrated autocorrelation [Sokal 1997].
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import as_file, files
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from catenary.arrays import Floats
from catenary.calibration.arithmetic import Integers
from catenary.calibration.features import FeatureSet
from catenary.calibration.predictors import Linear
from catenary.calibration.valid_range import standardisation
from catenary.config import Settings, load_json
from catenary.errors import InputError

PRIORS = ("simulated",)
QUANTITIES = ("q", "tau")
Finite = Annotated[float, Field(ge=-50.0, le=50.0)]
FIRST_RIDGE = 10.0  # of the regression whose errors tell how many rows are independent
UNCORRELATED = 0.05  # autocorrelation below which the sum ends
LARGEST_SHARE = 0.1  # of the rows that may count as one
NOISE = 0.3  # variance of the noise to start from, as a share of the output's
STEPS = 30  # of the search for the variances
LOG_NOISE = (-14.0, 3.0)
LOG_VARIANCE = (-25.0, 8.0)


def rows_per_independent(errors: Floats) -> float:
    """Return the integrated autocorrelation time of errors (N,), in rows: 1 where they are independent."""
    rows, about = len(errors), errors - errors.mean()
    spectrum = np.abs(np.fft.rfft(about, 2 * rows)) ** 2
    correlation = np.fft.irfft(spectrum)[:rows]
    if not correlation[0] > 0.0:
        return 1.0
    correlation /= correlation[0]
    small = np.flatnonzero(correlation < UNCORRELATED)
    end = int(small[0]) if len(small) else max(1, rows // 3)
    return float(np.clip(1.0 + 2.0 * correlation[1:end].sum(), 1.0, max(1.0, LARGEST_SHARE * rows)))


class Prior(Settings):
    """Logarithms of the variances of weights, of the joint's own features and of other joints'."""

    name: str
    robots: int  # simulated, that it was learnt on
    seed: int  # of the first of them
    play_shares: Annotated[tuple[Annotated[float, Field(gt=0.0, lt=1.0)], ...], Field(max_length=100)]
    spread: Annotated[float, Field(gt=0.0, le=10.0)]  # standard deviation of a robot's logarithms about these
    tempering: Annotated[float, Field(ge=0.0, le=1.0)]  # of rows per independent one; 0 takes all as independent
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


class Posterior(NamedTuple):
    """What is known of the weights afterwards."""

    mean: Floats  # (F,)
    variance: Floats  # (F,)


def posterior(Z: Floats, y: Floats, classes: Integers, prior: Prior) -> Posterior:
    """Return weights of standardised features Z (N, F), of a class each, for a standardised output y (N,)."""
    gram, moment = Z.T @ Z, Z.T @ y
    first = np.linalg.solve(gram + FIRST_RIDGE * np.eye(len(gram)), moment)
    thinned = rows_per_independent(y - Z @ first) ** prior.tempering
    gram, moment, square, rows = gram / thinned, moment / thinned, float(y @ y) / thinned, len(y) / thinned
    present, own = np.unique(classes, return_inverse=True)
    start = np.append(prior.log_variances[present], np.log(NOISE))

    def loss(logs: Floats) -> tuple[float, Floats]:
        noise, deviations = np.exp(logs[-1]), np.exp(0.5 * logs[:-1])[own]
        factor = cho_factor(deviations[:, None] * gram * deviations / noise + np.eye(len(own)), lower=True)
        weights = cho_solve(factor, deviations * moment / noise)  # over their deviations
        covariance = np.diag(cho_solve(factor, np.eye(len(own))))
        w, away = deviations * weights, logs[:-1] - start[:-1]
        fit = square - 2.0 * w @ moment + w @ gram @ w
        value = 0.5 * (rows * logs[-1] + fit / noise + weights @ weights + away @ away / prior.spread**2)
        value += np.log(np.diag(factor[0])).sum()
        slopes = np.append(away / prior.spread**2, 0.5 * (rows - (len(own) - covariance.sum()) - fit / noise))
        np.add.at(slopes, own, 0.5 * (1.0 - covariance - weights**2))
        return float(value), slopes

    bounds = [LOG_VARIANCE] * len(present) + [LOG_NOISE]
    found = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": STEPS}).x
    penalties = np.exp(found[-1] - found[:-1])[own]
    inverse = np.linalg.inv(gram + np.diag(penalties))
    return Posterior(inverse @ moment, np.exp(found[-1]) * np.diag(inverse))


@cache
def load_prior(name: str) -> Prior:
    """Load a prior of the package by its name."""
    if name not in PRIORS:
        raise InputError(f'prior "{name}": expected {" or ".join(PRIORS)}')
    with as_file(files("catenary.calibration") / "data" / f"{name}.json") as path:
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
        X: (N, F) rows of training, whose ranges the play states' widths are shares of.
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
