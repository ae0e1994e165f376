"""Model evidence of a recording under a hypothesis, in closed form from the columns' Gram matrices.

The model is a Gaussian regression with Gaussian priors; the noise per joint is found by three EM steps under an
inverse-gamma prior (MacKay, Information theory, inference and learning algorithms, 2003, ch. 28; Bishop, Pattern
recognition and machine learning, 2006, sec. 3.5). Correlated rows count as N / c rows, with c the autocorrelation time
of the widest fit times 1 + (relative residual / .04)^2, as more rows do not reduce the few per cent of model error.

Friction dissipates power: the evidence includes the ratio of posterior to prior probability that it does, per joint.

A gain g of a joint multiplies its torque by 1/g: the Gram matrix is unchanged, and the density gets the Jacobian
N log |1/g|. The gain is not a regression column of measured torques, which would explain themselves.
"""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np
from scipy.linalg import lapack
from scipy.special import log_ndtr

from catenary.arrays import Floats
from catenary.dynamics.torque_regressor import PER_LINK
from catenary.identification.explanations.priors import Belief, belief_of_file
from catenary.identification.explanations.regressor_columns import (
    Added,
    Beside,
    Rows,
    Supposed,
    nothing_supposed,
    side_by_side,
)
from catenary.identification.samples import Samples
from catenary.robots.model import RobotModel

Found = TypeVar("Found")
_ROWS = 240
_KNOWN_STD = 1e-4  # standard deviation of the factor, 1, on known torques
_COARSE = 0.04  # relative error of every model's torque
_NOISE_SHARE, _NOISE_DEGREES = 0.03, 4.0  # inverse-gamma prior of the noise: share of the torque, degrees of freedom
_FIRST_NOISE, _LEAST_NOISE = 4.0, 0.3  # multiples of that noise: initial, least
_LEAST_INDEPENDENT = 12  # least number of independent rows of a recording
_EM_STEPS = 3
_DRIVING_LOG = -10.0  # log probability that friction seems to drive a joint, from model error
_KEPT_GRAMS, _KEPT_COLUMNS = 400, 4
_LARGEST_LAG = 60  # rows


class Extra(NamedTuple):
    """An additional column (N, n) with its prior."""

    column: Floats
    mean: float
    std: float


@dataclass(frozen=True)
class Fit:
    """Posterior of all columns' parameters, the links' first, and residual of the torques."""

    log_evidence: float
    beta: Floats  # (p,)
    covariance: Floats  # (p, p)
    relative: Floats  # (n,) RMS of the residual over that of the torque
    weight: Floats  # (n,) of a row: 1 / (variance times the correlated rows that count as one)
    implausible: float  # squared Mahalanobis distance of the links' parameters from the file's, per parameter


def _key(supposed: Supposed) -> tuple[object, ...]:
    """Return the parts of a supposition that determine its columns."""
    return *supposed.motion, supposed.added, supposed.torque_order


def _kept(cache: dict[object, Found], key: object, make: Callable[[], Found], limit: int = _KEPT_COLUMNS) -> Found:
    """Return the value of a key, made once; the oldest go where there are more."""
    if key not in cache:
        cache[key] = make()
        if len(cache) > limit:
            del cache[next(iter(cache))]
    return cache[key]


class _Gram(NamedTuple):
    XX: Floats  # (n, p, p)
    beside: Beside
    own: int  # columns of the robot file's actuation


class Evidence:
    """Evidence of one recording for hypotheses about it."""

    def __init__(
        self,
        model: RobotModel,
        samples: Samples,
        belief: Belief | None = None,
        rows: int = _ROWS,
        noise: Floats | None = None,
    ) -> None:
        """Set up the evidence of a recording, under a belief about the arm (its file's masses if None).

        noise (n,) is the standard deviation of independent torques [Nm or N], if known.
        """
        self.belief = belief_of_file(model) if belief is None else belief
        self.model, self.rows = model, Rows(model, samples, rows, identified=self.belief.identified)
        self.plain = nothing_supposed(model.n)
        self._shown_by: dict[object, tuple[_Gram, Floats, Floats]] = {}  # of columns and torques
        self._grams: dict[object, tuple[_Gram, Floats]] = {}
        self._beside: dict[object, tuple[Floats, Beside, int]] = {}
        self._brakes: dict[object, float] = {}
        self._priors: dict[object, tuple[Floats, Floats, Floats, float]] = {}
        self._links: dict[object, Floats] = {}
        self.noise = noise
        self.correlated = np.ones(model.n)  # rows that count as one, by joint
        if noise is None:
            self.correlated = self._correlation()

    def believing(self, belief: Belief) -> "Evidence":
        """Return the evidence of the same recording under another belief about the arm."""
        other = copy(self)
        other.belief, other._priors, other._brakes = belief, {}, {}
        return other

    def log(self, supposed: Supposed, which: int, extra: Sequence[Extra] = ()) -> float:
        """Return the log evidence under one of the belief's spreads."""
        return self._solved(supposed, which, extra)[0]

    def fit(self, supposed: Supposed, which: int, extra: Sequence[Extra] = ()) -> Fit:
        """Return the posterior under one of the belief's spreads."""
        value, beta, covariance, rss, scaled_size, weight = self._solved(supposed, which, extra)
        mean, precision, _, _ = self._prior(which, supposed.loads)
        off = (beta - self._mean(mean, len(beta)))[: self.shown]
        distance = float(off @ precision[: self.shown, : self.shown] @ off)
        relative = np.sqrt(np.maximum(rss, 0.0) / len(self.rows)) / scaled_size
        return Fit(value, beta, covariance, relative, weight, distance / (PER_LINK * len(self.belief.links)))

    def over_spreads(self, supposed: Supposed) -> tuple[float, int]:
        """Return the log evidence over all spreads of the belief, and the index of the likeliest."""
        logs = [self.log(supposed, k) + weight for k, weight in enumerate(self.belief.log_weights)]
        return float(np.logaddexp.reduce(logs)), int(np.argmax(logs))

    @property
    def shown(self) -> int:
        """Number of the links' columns."""
        return self.rows.shown.shape[1]

    def columns(self, supposed: Supposed) -> tuple[Floats, Beside, int]:
        """Return the regressor (N, n, p), the prior of columns other than the links', and the count of file's terms."""
        links = _kept(self._links, supposed.motion, lambda: self.rows.links(supposed) @ self.rows.shown)
        key = _key(supposed)
        if not supposed.added and not self.rows.has_springs:  # as zeros and gravity change links' columns alone
            key = supposed.signs, supposed.position_order, supposed.shared, supposed.torque_order, supposed.derived
        terms, prior, own = _kept(self._beside, key, lambda: self.rows.beside(supposed))
        known, n = self.rows.known, self.model.n
        if not known.any():
            return side_by_side([links, terms]), prior, own
        prior = prior.and_columns([1.0] * n, [_KNOWN_STD] * n)
        return side_by_side([links, terms, known[:, :, None] * np.eye(n)]), prior, own

    def _gram(self, supposed: Supposed, extra: Sequence[Extra]) -> tuple[_Gram, Floats, Floats]:
        """Return the Gram matrix of the columns, their products with torques (n, p), and the torques' squares (n,)."""
        key = _key(supposed)

        def shown() -> tuple[_Gram, Floats, Floats]:
            joint_columns = partial(self._joint_columns, supposed, extra)
            gram, by_joint = joint_columns() if extra else _kept(self._grams, key, joint_columns)
            y = self.rows.torques(supposed).T
            return gram, (y[:, None] @ by_joint)[:, 0], np.sum(y**2, axis=1)

        return shown() if extra else _kept(self._shown_by, (key, supposed.late, supposed.turned), shown, _KEPT_GRAMS)

    def _joint_columns(self, supposed: Supposed, extra: Sequence[Extra]) -> tuple[_Gram, Floats]:
        """Return the Gram matrix of the columns, and them by joint (n, N, p)."""
        X, prior, own = self.columns(supposed)
        if extra:
            X = side_by_side([X, np.stack([term.column for term in extra], axis=2)])
            prior = prior.and_columns([term.mean for term in extra], [term.std for term in extra])
        by_joint = np.ascontiguousarray(X.transpose(1, 0, 2))
        return _Gram(by_joint.transpose(0, 2, 1) @ by_joint, prior, own), by_joint

    def _prior(self, which: int, loads: tuple[int, ...]) -> tuple[Floats, Floats, Floats, float]:
        """Return mean, precision, variances and log determinant of the covariance of the belief's parameters."""
        if (which, loads) not in self._priors:
            onto = self.onto
            reduced = onto.T @ self.belief.covariances[which] @ onto
            scale = np.sqrt(np.diag(reduced))
            correlation = reduced / np.outer(scale, scale) + 1e-10 * np.eye(len(scale))
            log_determinant = float(np.linalg.slogdet(correlation)[1]) + 2.0 * float(np.log(scale).sum())
            precision, variances = np.linalg.inv(correlation) / np.outer(scale, scale), scale**2
            for link, load in (*self.belief.bodies, *((link, self.belief.load) for link in loads)):
                # by Woodbury's identity: a body's large covariance would lose the arm's small ones to rounding
                W = onto[self.belief.own(link)].T @ load
                S = np.eye(W.shape[1]) + W.T @ precision @ W
                log_determinant += float(np.linalg.slogdet(S)[1])
                precision = precision - precision @ W @ np.linalg.solve(S, W.T @ precision)
                variances = variances + np.sum(W**2, axis=1)
            self._priors[which, loads] = onto.T @ self.belief.mean, precision, variances, log_determinant
        return self._priors[which, loads]

    @property
    def onto(self) -> Floats:
        """Combinations (k, m) of the belief's parameters that torques can show."""
        V, size = self.rows.shown, len(self.belief.mean)
        (k, r) = V.shape
        matrix = np.eye(size, r + size - k, r - k)
        matrix[:k] = np.hstack([V, np.zeros((k, size - k))])
        return matrix

    def precision(self, which: int) -> Floats:
        """Return the inverse covariance (m, m) of the belief's parameters that torques can show."""
        return self._prior(which, ())[1]

    def body(
        self, link: int, load: Floats, fit: Fit, which: int = 0, loads: tuple[int, ...] = ()
    ) -> tuple[Floats, Floats]:
        """Return the posterior mean (m,) and covariance of a body's numbers on a link; see `Belief.carrying`.

        Args:
            link, load: The link that carries the body, and (10, m) of the belief.
            fit, which, loads: Fit of the recording, index of the belief's spread, links supposed to carry a load.
        """
        mean, precision, _, _ = self._prior(which, loads)
        W, k = self.onto[self.belief.own(link)].T @ load, len(mean)
        gain = W.T @ precision
        return gain @ (fit.beta[:k] - mean), np.eye(W.shape[1]) - gain @ W + gain @ fit.covariance[:k, :k] @ gain.T

    def looked(self, supposed: Supposed, which: int) -> Callable[[Added], float]:
        """Return a function that estimates, from one fit, the evidence gained by an added cause [nats]."""
        fit, X = self.fit(supposed, which), self.columns(supposed)[0]
        left = self.rows.torques(supposed) / supposed.gains - X @ fit.beta
        counted = len(self.rows) / self.correlated[list(supposed.torque_order)]
        weighted = X * fit.weight[:, None]

        def gain(one: Added) -> float:
            Z = self.rows.added(one, supposed) * one.sizes
            crossed = np.tensordot(weighted, Z, ((0, 1), (0, 1)))
            own = Z - X @ (fit.covariance @ crossed)  # part that the fit cannot explain
            whole = np.eye(Z.shape[2]) + np.tensordot(Z * fit.weight[:, None], own, ((0, 1), (0, 1)))
            number = np.linalg.solve(whole, np.tensordot(Z, left * fit.weight, ((0, 1), (0, 1))))
            ratio = np.mean(left**2, axis=0) / np.mean((left - own @ number) ** 2, axis=0)
            return 0.5 * float(counted @ np.log(ratio)) - 0.5 * float(np.linalg.slogdet(whole)[1] + number @ number)

        return gain

    def added(self, fit: Fit, added: Added) -> Floats:
        """Return the torques (N, n) of the last added cause in a fit."""
        end = len(fit.beta) - self.model.n * bool(self.rows.known.any())
        return self.rows.added(added, self.plain) @ fit.beta[end - len(added.sizes) : end]

    @staticmethod
    def _mean(first: Floats, count: int) -> Floats:
        return np.concatenate([first, np.zeros(max(0, count - len(first)))])[:count]

    def _solved(
        self, supposed: Supposed, which: int, extra: Sequence[Extra]
    ) -> tuple[float, Floats, Floats, Floats, Floats, Floats]:
        """Return log evidence, posterior mean and covariance, residual squares (n,), torque sizes and weights (n,)."""
        gram, Xy, yy = self._gram(supposed, extra)
        order, x = list(supposed.torque_order), 1.0 / np.array(supposed.gains)
        mean, precision, own_variances, log_determinant = self._prior(which, supposed.loads)
        skip = gram.own if len(mean) > self.shown else 0  # terms that the belief already contains
        joint = gram.beside.joint[skip:]
        scale = np.where(joint >= 0, np.abs(x)[joint], 1.0)
        std = gram.beside.std[skip:] * scale
        M = np.concatenate([mean, gram.beside.mean[skip:] * scale])
        b, p = len(mean), len(M)
        K = np.zeros((p, p))
        K[:b, :b] = precision
        K[range(b, p), range(b, p)] = 1.0 / std**2
        log_determinant += 2.0 * float(np.log(std).sum())
        variances = np.concatenate([own_variances, std**2])
        N = len(self.rows)
        counted, size = N / self.correlated[order], self.rows.size[order] * np.abs(x)
        least = _NOISE_SHARE * size
        variance, steps = (_FIRST_NOISE * least) ** 2, _EM_STEPS
        if self.noise is not None:
            variance, steps = (self.noise[order] * x) ** 2, 1
        XX, Xy, yy, KM = gram.XX, Xy * x[:, None], yy * x**2, K @ M
        for step in range(steps):
            w = counted / N / variance
            A, right = K + np.tensordot(w, XX, 1), KM + w @ Xy
            d = 1.0 / np.sqrt(np.diag(A))
            A *= d[:, None] * d
            A.flat[:: p + 1] += 1e-12
            L = lapack.dpotrf(A, lower=1, clean=1)[0]
            inverse = lapack.dtrtri(L, lower=1)[0] * d
            C = inverse.T @ inverse
            beta = C @ right
            XXb = XX @ beta
            rss = yy - 2.0 * Xy @ beta + XXb @ beta
            if step < steps - 1:
                unsure = XX.reshape(len(XX), -1) @ C.ravel()
                spread = counted / N * (np.maximum(rss, 0.0) + unsure) + _NOISE_DEGREES * least**2
                variance = np.maximum(spread / (counted + _NOISE_DEGREES), (_LEAST_NOISE * least) ** 2)
        value = -0.5 * np.sum(counted * np.log(2.0 * np.pi * variance)) - 0.5 * w @ yy + 0.5 * right @ beta
        value -= 0.5 * (M @ KM + log_determinant) + float(np.log(np.diag(L)).sum() - np.log(d).sum())
        value += float(np.sum(counted * np.log(np.abs(x))))
        prior = partial(self._braking, gram.beside, M, np.diag(variances))  # independent of gains
        before = _kept(self._brakes, (*_key(supposed), which), prior, _KEPT_GRAMS)
        value += self._braking(gram.beside, beta, C) - before
        if self.noise is None:
            value -= 0.5 * _NOISE_DEGREES * float(np.sum(np.log(variance / least**2) + least**2 / variance))
        return float(value), beta, C, rss, size, w

    def _braking(self, prior: Beside, mean: Floats, covariance: Floats) -> float:
        """Return the sum over joints of the log probability that friction dissipates power."""
        tail = len(mean) - len(prior.power)
        powers = np.where(prior.joint == np.arange(self.model.n)[:, None], prior.power, 0.0)
        powers = powers[powers.any(axis=1)]
        stds = np.sqrt(np.sum(powers @ covariance[tail:, tail:] * powers, axis=1))
        return float(np.sum(np.logaddexp(log_ndtr(powers @ mean[tail:] / stds), _DRIVING_LOG)))

    def _correlation(self) -> Floats:
        """Return the number of correlated rows (n,) that count as one, from the residual of the widest fit."""
        widest = len(self.belief.covariances) - 1
        fit = self.fit(self.plain, widest)
        X = self.columns(self.plain)[0]
        left = self.rows.torques(self.plain) - X @ fit.beta
        left = left - left.mean(axis=0)
        lags = range(min(_LARGEST_LAG, len(left) // 3))
        products = np.array([np.sum(left[k:] * left[: len(left) - k], axis=0) for k in lags])
        shares = (products / (np.sum(left**2, axis=0) + 1e-300)).T
        times = []
        for share in shares:
            ends = np.flatnonzero(share < 0.05)
            times.append(1.0 + 2.0 * float(share[1 : ends[0] if len(ends) else None].sum()))
        self.rows.carried = X[:, :, : self.shown] @ fit.beta[: self.shown]
        for kept in (self._shown_by, self._grams, self._beside, self._brakes):
            kept.clear()
        coarse = np.array(times) * (1.0 + (fit.relative / _COARSE) ** 2)
        return np.clip(coarse, 1.0, max(1.0, len(left) / _LEAST_INDEPENDENT))
