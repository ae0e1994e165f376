"""Linear regression whose weights have a prior: a variance for each class of features, adapted by the evidence.

Bayesian linear regression y = Z w + noise, w_k ~ N(0, v_c(k)), on standardised features and outputs. How much each
class of features weighs, v_c, is itself drawn about what a prior says of it: ln v_c ~ N(m_c, spread^2). It and the
noise are taken where the evidence times their density is largest [type II maximum likelihood; MacKay 1992], and the
weights then are their posterior mean: a ridge regression with a penalty for each class. Errors of neighbouring rows
resemble each other; rows count as many as are independent, by their errors' integrated autocorrelation [Sokal 1997].
"""

from typing import NamedTuple, Protocol

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from catenary.arrays import Floats
from catenary.calibration.kernels import Integers

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


class Classes(Protocol):
    """What is known of the weights beforehand."""

    @property
    def log_variances(self) -> Floats:
        """(C,) natural logarithms of the classes' variances."""

    @property
    def spread(self) -> float:
        """Standard deviation of these logarithms."""

    @property
    def tempering(self) -> float:
        """Power of the rows per independent one that rows are divided by; 0 takes all as independent."""


class Posterior(NamedTuple):
    """What is known of the weights afterwards."""

    mean: Floats  # (F,)
    variance: Floats  # (F,)


def posterior(Z: Floats, y: Floats, classes: Integers, prior: Classes) -> Posterior:
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
