"""A prior of feature classes: weights against closed forms and independent searches, and fits that begin at it."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import multivariate_normal

from catenary.arrays import Floats
from catenary.calibration.dataset import CalibrationData, calibration_data
from catenary.calibration.evaluate import evaluate
from catenary.calibration.feature_prior import PRIORS, load_prior, posterior, prior_of_features, rows_per_independent
from catenary.calibration.fit_options import PLAY_SHARES, FitOptions, FitRun
from catenary.calibration.fit_recordings import fit_logs
from catenary.calibration.fit_rows import choose_inputs, fit
from catenary.errors import InputError
from catenary.plant import MotionLog
from tests.recordings import data_of, fitted, recording, short_training


class Known(NamedTuple):
    log_variances: Floats
    spread: float
    tempering: float


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


fast = pytest.fixture(short_training)


def hysteretic(rng: np.random.Generator, rows: int) -> MotionLog:
    """Joints whose own slack and little else moves them, measured with noise; a prior's guess is right."""

    def error(q: np.ndarray) -> np.ndarray:
        states, found = q[0].copy(), np.empty_like(q)
        for row, position in enumerate(q):
            states = np.clip(states, position - 0.1 * np.ptp(q, axis=0), position + 0.1 * np.ptp(q, axis=0))
            found[row] = states - position
        noise: np.ndarray = 0.3 * found.std(axis=0) * rng.normal(size=q.shape)
        return np.asarray(found + noise)

    return recording(rng, rows=rows, units=("rad",) * 4, error=error)


def parts(log: MotionLog, options: FitOptions, rows: int) -> tuple[CalibrationData, CalibrationData]:
    data = calibration_data([log], choose_inputs([log], options).features)
    index = np.arange(len(data))
    return data.rows(index < rows), data.rows(index >= rows)


def test_the_packages_priors_load_and_say_where_they_are_from() -> None:
    for name in PRIORS:
        prior = load_prior(name)
        assert prior.name == name
        assert prior.robots >= 100
        assert tuple(prior.play_shares) == PLAY_SHARES
        # a joint's own features tell more of its error than others' do
        assert all(prior.own[each] > prior.other[each] for each in prior.classes)


def test_a_strange_name_is_refused_with_the_choices() -> None:
    with pytest.raises(InputError, match="expected simulated"):
        load_prior("dvrk")


def test_every_feature_has_the_class_of_its_quantity_and_owner(rng: np.random.Generator) -> None:
    log = recording(rng, tau=rng.normal(size=(300, 3)))
    data = data_of(log, play=PLAY_SHARES)
    prior = load_prior("simulated")
    of_features = prior_of_features(prior, data.features, data.X)
    names = [*prior.classes, *(f"{name}, other" for name in prior.classes)]
    told = dict(zip(data.features.names, (names[c] for c in of_features.classes_of("J2")), strict=True))
    assert told["q:J2"] == "q"
    assert told["q:J1"] == "q, other"
    assert told["tau:J2"] == "tau"
    widths = [told[name] for name in data.features.names if name.startswith("play(q:J3")]
    assert widths == [f"play {share:g}, other" for share in PLAY_SHARES]


def test_inputs_that_no_simulated_robot_had_are_refused_by_name(rng: np.random.Generator) -> None:
    log = recording(rng, qd=rng.normal(size=(300, 3)))
    with pytest.raises(InputError, match=r"knows positions, torques and play states.*qd:J1"):
        fitted(log, inputs=["q", "qd"], prior="simulated")
    with pytest.raises(InputError, match="knows positions, torques and play states"):
        fitted(log, history=2, prior="simulated")


def test_few_rows_with_a_prior_do_better_than_with_ridge(rng: np.random.Generator) -> None:
    with_prior = FitOptions(kind="linear", play=PLAY_SHARES, prior="simulated")
    train, test = parts(hysteretic(rng, 1500), with_prior, 120)
    inputs = choose_inputs([hysteretic(rng, 50)], with_prior)
    inputs = replace(inputs, features=train.features)
    errors = [
        np.array([joint.rmse for joint in evaluate(fit(train, inputs, each), test).joints])
        for each in (with_prior, replace(with_prior, prior=None))
    ]
    assert errors[0].mean() < 0.95 * errors[1].mean()


@pytest.mark.usefixtures("fast")
def test_a_fit_says_which_joints_began_at_a_prior(rng: np.random.Generator) -> None:
    log = hysteretic(rng, 200)
    run = FitRun(folds=0, accept=("delay",))  # slack in smooth motion looks like a delay
    result = fit_logs([log], FitOptions(kind="neural", prior="simulated"), run)
    assert result.model.priors == ("simulated",) * len(log.joint_names)
    assert all(joint["prior"] == "simulated" for joint in result.card["joints"])
    (sentence,) = [note for note in result.notes if note.startswith("prior simulated")]
    names = ", ".join(log.joint_names)
    assert sentence == f"prior simulated: {names} began at what 300 simulated robots have in common"
    without = fit_logs([log], FitOptions(kind="neural"), run)
    assert without.model.priors == ()
    assert all(joint["prior"] is None for joint in without.card["joints"])
