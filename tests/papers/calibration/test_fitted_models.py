"""Models of the calibration paper's experiments: sizes, errors of joints and tip, features, and the rows they learn from."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import MotionLog
from catenary.calibration.dataset import calibration_data
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.fit_rows import choose_inputs
from catenary.calibration.neural import PAPER
from catenary.calibration.predictors import Network, fit_polynomial
from catenary.calibration.recordings import Recordings
from catenary.dynamics.kinematics import jacobian
from catenary.robots.catalog import load_robot
from papers.calibration import ablation, dvrk, published
from papers.calibration.figure_8 import principal, sizes
from papers.calibration.inputs import SIXTEEN
from papers.calibration.peer_hours import PEERS, peer_hours
from papers.calibration.peers.rows import rows_of_log
from papers.calibration.recordings import METHODS, fitted, network_model, rows_of, unguarded
from papers.calibration.six_hours import tip_rmse
from recordings import recording as made


def a_log(rng: np.random.Generator, rows: int = 200) -> MotionLog:
    q = rng.uniform([0.4, 1.0, 0.33], [1.0, 1.9, 0.42], (rows, 3))
    tau = rng.normal(size=(rows, 3))
    tools = ("roll", "wrist", "jaw1", "jaw2", "unused")
    signals = {f"q:{tool}": rng.normal(0.0, 0.3, rows) for tool in tools} | {
        f"tau:{tool}": rng.normal(size=rows) for tool in tools
    }
    return MotionLog(
        name="made up",
        joint_names=("shoulder", "elbow", "insertion"),
        joint_units=("rad", "rad", "m"),
        q_nominal=q,
        q_encoder=q + 0.01 * tau + 0.02,
        ok=np.ones(rows, dtype=bool),
        tau=tau,
        signals=signals,
        signal_units=dict.fromkeys(signals, "rad"),
    )


def test_tip_error_of_small_joint_errors_is_that_of_the_jacobian(rng: np.random.Generator) -> None:
    log = a_log(rng)
    left = 1e-6 * rng.normal(size=(len(log), 3))
    jaws = (log.signals["q:jaw2"] - log.signals["q:jaw1"]) / 2.0
    q = np.column_stack([np.asarray(log.q_encoder), log.signals["q:roll"], log.signals["q:wrist"], jaws])
    moved = np.einsum("nij,nj->ni", jacobian(load_robot("raven2_full"), q)[:, :3, :3], left)
    # reported rounded to 1e-6 mm
    assert_allclose(tip_rmse(log, left)[:3], 1e3 * np.sqrt(np.mean(moved**2, axis=0)), atol=2e-6)
    x, y, z, distance = tip_rmse(log, 1e3 * left)
    assert_allclose(distance, np.sqrt(x**2 + y**2 + z**2), rtol=1e-4)


def test_networks_have_the_papers_sizes() -> None:
    assert sizes() == published.PARAMETERS


@pytest.mark.slow
def test_all_peers_are_tested_in_every_hour() -> None:
    found = peer_hours(None, [0], "1/2", 0.02, [2], 60.0)
    assert set(found) == {*PEERS, "identified"}
    for peer in PEERS:
        assert len(found[peer]) == 6
        x, y, z, distance = found[peer][0]["tip"]
        assert distance == pytest.approx(np.sqrt(x**2 + y**2 + z**2), abs=1e-5)
        assert found[peer][0]["errors"][1] < 7.5  # what homing leaves of joint 2's offset is learned [deg]


def test_polynomial_in_principal_axes_is_that_of_inputs_that_depend_on_each_other(rng: np.random.Generator) -> None:
    train, test = (rows_of(fitted([log], METHODS["linear"]), log) for log in (a_log(rng), a_log(rng)))
    mixed = rng.normal(size=(4, train.X.shape[1]))  # rank 4, as q and tau of a clean robot
    train = replace(train, X=train.X[:, :4] @ mixed)
    mean, scale, axes = principal(train)
    assert axes.shape == (mixed.shape[1], 4)
    small = fit_polynomial((train.X - mean) / scale @ axes, train.error)
    # all 16 inputs have 152 terms, of which the data determine 14
    whole = fit_polynomial(train.X, train.error)
    X = test.X[:, :4] @ mixed
    assert_allclose(small.predict((X - mean) / scale @ axes), whole.predict(X), atol=1e-8)


def test_a_network_of_the_presets_settings_is_the_presets(rng: np.random.Generator) -> None:
    log = a_log(rng)
    preset = fitted([log], FitOptions(kind="neural", preset="paper", inputs=SIXTEEN, seed=3))
    ours = network_model([log], PAPER, inputs=SIXTEEN, seed=3)
    assert_allclose(ours.calibrate(log), preset.calibrate(log), atol=1e-12)
    predictor = ours.groups[0].predictor
    assert isinstance(predictor, Network)
    assert sum(each.size for each in (*predictor.weights, *predictor.biases)) == published.PARAMETERS["network of 16"]


def test_shuffling_hurts_by_what_a_model_makes_of_a_signal_and_no_other_joint() -> None:
    rng = np.random.default_rng(0)
    q, told = rng.uniform(-1.0, 1.0, (4000, 3)), rng.uniform(-1.0, 1.0, 4000)
    truth = q.copy()
    truth[:, 2] += 0.001 * told  # [m] on the third joint alone
    log = MotionLog(
        "made up", ("shoulder", "elbow", "insertion"), ("rad", "rad", "m"), q, np.ones(4000, bool), truth,
        signals={"x": told}, signal_units={"x": "rad"},
    )  # fmt: skip
    model = fitted([log], FitOptions("linear", inputs=("q", "x")))
    assert_allclose(ablation.errors_left(model, log), 0.0, atol=1e-9)
    shuffled = ablation.errors_left(model, log, shuffle="x")
    # two independent uniform variables: 1 mm times sqrt(2 / 3)
    assert_allclose(shuffled, [0.0, 0.0, np.sqrt(2.0 / 3.0)], atol=0.03)


@pytest.mark.parametrize("recording", dvrk.RECORDINGS)
def test_models_of_ours_and_peers_learn_from_the_same_rows_and_are_tested_on_the_same(recording: str) -> None:
    rng = np.random.default_rng(3)
    ok = rng.random(501) > 0.1
    units = ("rad", "rad", "m", "rad", "rad", "rad")
    log = made(rng, 501, units, error=lambda q: np.deg2rad(2.0) * rng.normal(size=q.shape), ok=ok)
    limit = dvrk._limit(recording)
    for options in dvrk.KINDS.values():
        inputs = choose_inputs(Recordings.of([log]), options, held_out=dvrk.HELD_OUT)
        ours = calibration_data([log], inputs.features, max_error=limit).split_by_time(dvrk.HELD_OUT)
        for rows, peers in zip(ours, dvrk.parted(rows_of_log(log, ("q",)), limit), strict=True):
            assert log.time is not None
            np.testing.assert_array_equal(rows.time, log.time[peers])


@pytest.mark.parametrize("kind", ["linear", "polynomial"])
def test_an_unguarded_model_is_its_predictor_wherever_it_is_asked(kind: str) -> None:
    rng = np.random.default_rng(0)
    train, moved = log_of(0.0, rng), log_of(5.0, rng)
    noisy = replace(train, q_encoder=train.q_encoder + 0.01 * rng.standard_normal((500, 3)))
    for log in (train, noisy):
        model = fitted([log], FitOptions(kind, inputs=("q", "q:roll")))
        X = model.features.matrix(moved)
        assert not model.inside(X).any()
        free = unguarded(model)
        assert free.inside(X).all()
        assert_allclose(free.correction(X, moved.q_nominal), model.groups[0].predictor.predict(X), atol=1e-12)
        assert np.abs(model.calibrate(moved) - free.calibrate(moved)).max() > 0.01
    linear = unguarded(fitted([train], FitOptions("linear", inputs=("q", "q:roll"))))
    assert_allclose(linear.calibrate(moved), 1.1 * moved.q_nominal, atol=1e-12)  # the error is linear in q


def log_of(tool: float, rng: np.random.Generator) -> MotionLog:
    q = rng.uniform(-1.0, 1.0, (500, 3))
    signals = {f"q:{joint}": tool + 0.01 * rng.standard_normal(500) for joint in ("roll", "wrist", "jaw1", "jaw2")}
    return MotionLog(
        "made up", ("shoulder", "elbow", "insertion"), ("rad", "rad", "m"), q, np.ones(500, bool), 1.1 * q,
        signals=signals, signal_units=dict.fromkeys(signals, "rad"),
    )  # fmt: skip
