"""Weights with a prior: against closed forms and independent searches."""

from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import multivariate_normal

from catenary.arrays import Floats
from catenary.calibration.priors.evidence import posterior, rows_per_independent


class Known(NamedTuple):
    log_variances: Floats
    spread: float
    tempering: float


def test_independent_errors_count_one_row_each(rng: np.random.Generator) -> None:
    assert rows_per_independent(rng.normal(size=5000)) == pytest.approx(1.0, abs=0.2)  # noise of the sum


def test_autoregressive_errors_count_as_their_closed_form_says(rng: np.random.Generator) -> None:
    kept, errors = 0.8, np.zeros(60_000)
    for row in range(1, len(errors)):
        errors[row] = kept * errors[row - 1] + rng.normal()
    # (1 + kept) / (1 - kept) = 9, less the tail that is cut where the autocorrelation is below 0.05
    assert rows_per_independent(errors) == pytest.approx(9.0, rel=0.15)


@pytest.mark.parametrize("rows", [2, 3, 10])
def test_errors_of_nothing_and_of_few_rows_count(rows: int) -> None:
    assert rows_per_independent(np.zeros(rows)) == 1.0
    assert 1.0 <= rows_per_independent(np.arange(float(rows))) <= max(1.0, 0.1 * rows)


def test_weights_are_those_at_the_largest_evidence_times_prior(rng: np.random.Generator) -> None:
    Z, classes = rng.normal(size=(60, 4)), np.array([0, 0, 1, 1])
    y = Z @ [1.0, -0.7, 0.05, 0.0] + 0.3 * rng.normal(size=60)
    known = Known(np.array([-1.0, -3.0]), 0.8, 0.0)

    def loss(logs: Floats) -> float:  # the density of y, its weights integrated out, as a normal distribution
        covariance = Z * np.exp(logs[:2])[classes] @ Z.T + np.exp(logs[2]) * np.eye(60)
        away = logs[:2] - known.log_variances
        density = multivariate_normal(np.zeros(60), covariance).logpdf(y)
        return float(0.5 * away @ away / 0.8**2 - density)

    logs = minimize(loss, [-1.0, -3.0, -1.0], method="Nelder-Mead", options={"xatol": 1e-5, "fatol": 1e-8}).x
    precision = Z.T @ Z / np.exp(logs[2]) + np.diag(np.exp(-logs[:2])[classes])
    expected = np.linalg.solve(precision, Z.T @ y / np.exp(logs[2]))
    found = posterior(Z, y, classes, known)
    np.testing.assert_allclose(found.mean, expected, atol=1e-3)  # two searches end where they stop
    np.testing.assert_allclose(found.variance, np.diag(np.linalg.inv(precision)), rtol=2e-2)


def test_a_class_that_the_prior_calls_small_stays_small(rng: np.random.Generator) -> None:
    Z = rng.normal(size=(8, 2))
    y = Z[:, 0] + Z[:, 1]
    found = posterior(Z, y, np.array([0, 1]), Known(np.array([0.0, -12.0]), 0.1, 0.0))
    assert abs(found.mean[1]) < 0.1 < abs(found.mean[0])


def test_many_rows_outweigh_the_prior(rng: np.random.Generator) -> None:
    Z, truth = rng.normal(size=(20_000, 3)), np.array([0.5, -1.0, 2.0])
    y = Z @ truth + 0.1 * rng.normal(size=len(Z))
    found = posterior(Z, y, np.zeros(3, dtype=np.int64), Known(np.array([-6.0]), 1.0, 1.0))
    np.testing.assert_allclose(
        found.mean, truth, atol=0.01
    )  # noise 0.1 over the root of 20,000, and a small pull
