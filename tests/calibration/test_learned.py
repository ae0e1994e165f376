"""The learner on arms whose truth is known: what it explains, what it leaves out, what failed measurements do to it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import CablePlant, random_sinusoids, record_simulated, zigzag
from catenary.calibration.calibration import fit as fit_calibration
from catenary.calibration.dataset import calibration_data
from catenary.calibration.feature_terms import Terms
from catenary.calibration.learned import GROUPS
from catenary.calibration.model import CalibrationModel
from catenary.calibration.predictors import Expansion
from drawn_arms import baselines
from hysteretic_arm import play
from oracles.calibration_models import expanded, random_expansion
from recordings import fitted, recording


def errors_of(model: CalibrationModel, log) -> np.ndarray:
    data = calibration_data([log], model.features)
    return np.sqrt(np.mean((data.error - model.correction(data.X, data.q_nominal)) ** 2, axis=0))


def test_terms_are_those_of_numpy_also_far_outside() -> None:
    rng = np.random.default_rng(0)
    terms: Terms = random_expansion(8, 1, rng).terms
    X = rng.normal(size=(200, 8)) * 10.0 ** rng.uniform(-3, 2, (200, 1))
    assert_allclose(terms.of(X), expanded(terms, X), rtol=1e-12, atol=2e-13)


def test_slack_is_explained_from_positions_alone() -> None:
    slack = np.array([0.02, 0.005, 0.001])
    log = recording(np.random.default_rng(0), rows=2000)
    lag = np.column_stack([play(q, r) for q, r in zip(log.q_nominal.T, slack, strict=True)]) - log.q_nominal
    model = fitted(replace(log, q_encoder=log.q_nominal + lag), kind="learned")
    other = recording(np.random.default_rng(1), rows=2000)
    lag = np.column_stack([play(q, r) for q, r in zip(other.q_nominal.T, slack, strict=True)]) - other.q_nominal
    left = errors_of(model, replace(other, q_encoder=other.q_nominal + lag))
    assert (left < 0.3 * lag.std(axis=0)).all()


def test_what_explains_nothing_is_left_out() -> None:
    """An error of noise alone: all groups but signals get large penalties, and little of the noise is learnt."""
    rng = np.random.default_rng(0)
    log = recording(rng, rows=3000, error=lambda q: 1e-3 * rng.normal(size=q.shape) + 0.01)
    model = fitted(log, kind="learned")
    predictor = model.groups[0].predictor
    assert isinstance(predictor, Expansion)
    assert predictor.penalties.shape == (3, len(GROUPS))
    assert (predictor.penalties[:, 1:7] == 1e9).all()
    data = calibration_data([log], model.features)
    correction = model.correction(data.X, data.q_nominal)
    assert (correction.std(axis=0) < 2e-4).all()
    assert_allclose(correction.mean(axis=0), 0.01, atol=1e-4)


def test_failed_measurements_hardly_move_it_and_good_rows_count_in_full() -> None:
    rng = np.random.default_rng(0)
    log = recording(rng, rows=3000, error=lambda q: 0.02 * q**2 + 1e-4 * rng.normal(size=q.shape))
    sound = fitted(log, kind="learned")
    failed = np.array(log.q_encoder)
    failed[::100] += rng.normal(size=(30, 3))
    spoilt = fitted(replace(log, q_encoder=failed), kind="learned")
    assert (errors_of(spoilt, log) < 1.3 * errors_of(sound, log)).all()
    assert (errors_of(sound, log) < 2e-4).all()


def test_zeros_of_recordings_are_not_learnt_as_what_their_motions_differ_by() -> None:
    logs = []
    for k, zero in enumerate((-0.02, 0.0, 0.02)):
        log = recording(np.random.default_rng(k), rows=600, error=lambda q, zero=zero: 0.03 * q + zero)
        moved = 0.1 * k  # each about a centre of its own
        logs.append(replace(log, q_nominal=log.q_nominal + moved, q_encoder=log.q_encoder + moved))
    model = fitted(*logs, kind="learned")
    q = np.tile(np.linspace(-0.5, 0.5, 50)[:, None], (1, 3)) * [1.0, 1.0, 0.1]
    slope = model.calibrate(replace(logs[1].part(0, 50), q_nominal=q + 0.1)) - q
    assert np.polyfit(q[:, 0], slope[:, 0], 1)[0] - 1.0 + 1.0 == pytest.approx(0.03, abs=0.02)


@pytest.mark.slow
def test_a_simulated_raven_is_learnt_from_minutes_better_than_by_an_afternoons_ridge_regression() -> None:
    """Of a zig-zag and of two minutes at random, on other random motion; play states as wide as the motion lost."""
    ratios = []
    for seed in (1, 3):
        rng, arm = np.random.default_rng(100 + seed), CablePlant(seed=seed)
        arm.home()
        zigzagged, random, other = (
            record_simulated(arm, motion, name, rng)
            for name, motion in (
                ("zigzag", zigzag("J2-J3", [0.5])),
                ("random", random_sinusoids(rng, 120.0)),
                ("other", random_sinusoids(rng, 120.0)),
            )
        )
        assert other.q_encoder is not None
        for log in (zigzagged, random):
            wanted = other.q_encoder - other.q_nominal
            corrections = (
                fit_calibration(log, folds=0).predict(other) - other.q_nominal,
                baselines.fit([log], "ridge with direction")(other),
            )
            own, ridge = (np.sqrt(np.mean((wanted - each) ** 2, axis=0)) for each in corrections)
            ratios.append(own / ridge)
    assert np.exp(np.log(ratios).mean()) < 0.9
    assert np.max(ratios) < 1.8
