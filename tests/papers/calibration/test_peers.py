"""Other methods beside the calibration paper's: the recurrent network, the process, the forest, and elastic joints' filter."""

import numpy as np
import pytest

from catenary import MotionLog
from catenary.calibration.neural import NetworkSettings
from papers.calibration.peers.gaussian_process import fit_gaussian_process
from papers.calibration.peers.recurrent import Lstm, fit_recurrent, sequence_places
from papers.calibration.peers.rows import Rows, rows_of_log
from papers.calibration.peers.two_phase import fit_two_phase


def test_the_gradient_is_that_of_finite_differences() -> None:
    rng = np.random.default_rng(0)
    network = Lstm.drawn(3, 4, 2, rng, np.float64)
    X, Y = rng.normal(size=(5, 4, 3)), rng.normal(size=(5, 2))
    for values, slopes in zip(network.parameters, network.gradient(X, Y), strict=True):
        for place in np.ndindex(values.shape):
            kept, loss = values[place], []
            for step in (1e-6, -1e-6):
                values[place] = kept + step
                loss.append(np.mean((network.outputs(X) - Y) ** 2))
            values[place] = kept
            # central difference, h = 1e-6
            np.testing.assert_allclose(slopes[place], (loss[0] - loss[1]) / 2e-6, atol=1e-8)


def test_a_unit_without_recurrence_is_one_of_closed_form() -> None:
    # gates wide open and the forget gate shut: h = tanh(tanh(x))
    network = Lstm(np.zeros((2, 4)), np.array([50.0, -50.0, 50.0, 0.0]), np.ones((1, 1)), np.zeros(1))
    network.W[0, 3] = 1.0
    X = np.array([[[0.3], [-0.7]]])
    np.testing.assert_allclose(network.outputs(X), np.tanh(np.tanh([[-0.7]])), rtol=1e-12)


def test_what_lies_before_a_motion_is_its_first_row() -> None:
    first, last = np.array([0, 0, 4]), np.array([1, 3, 5])
    np.testing.assert_array_equal(sequence_places(first, last, 2, 1), [[0, 0, 1], [1, 2, 3], [4, 4, 5]])
    np.testing.assert_array_equal(sequence_places(first, last, 1, 3), [[0, 1], [0, 3], [4, 5]])


def test_it_learns_what_only_the_previous_command_tells() -> None:
    rng = np.random.default_rng(1)
    commands = rng.normal(size=(1200, 1))
    error = 0.01 * np.vstack(([[0.0]], np.sign(np.diff(commands, axis=0))))
    late = np.arange(1200) >= 1000
    rows = Rows(commands, np.zeros_like(commands), error, ~late, np.zeros(1200, dtype=np.int64))
    model = fit_recurrent(rows, seed=0, units=16, previous=1, iterations=400)
    left = (rows.error - model.correction(rows))[late]
    assert np.sqrt(np.mean(left**2)) < 0.5 * np.sqrt(np.mean(rows.error[late] ** 2))


@pytest.fixture(scope="module")
def rows() -> Rows:
    """Errors of two joints: one follows a position and the sign of the velocity, one a step in the position."""
    t = np.linspace(0.0, 60.0, 1500)
    q = np.column_stack((np.sin(t), np.cos(1.3 * t)))
    velocity = np.column_stack((np.cos(t), -1.3 * np.sin(1.3 * t)))
    error = np.column_stack((0.02 * q[:, 0] + 0.01 * np.tanh(5.0 * velocity[:, 0]), 1e-4 * (q[:, 1] > 0.3)))
    return Rows(q, velocity, error, np.arange(1500) < 1000, np.zeros(1500, dtype=np.int64))


def rmse(rows: Rows, correction: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean((rows.error - correction)[~rows.known] ** 2, axis=0))


def test_the_process_uses_the_velocity(rows: Rows) -> None:
    told = rmse(rows, fit_gaussian_process(rows, seed=0, carried=150, chosen=60).correction(rows))
    untold = Rows(rows.inputs, np.zeros_like(rows.velocity), rows.error, rows.known, rows.first)
    blind = rmse(rows, fit_gaussian_process(untold, seed=0, carried=150, chosen=60).correction(untold))
    assert told[0] < 0.3 * blind[0]


def test_the_forest_learns_what_the_network_leaves(rows: Rows) -> None:
    # a network that has hardly been trained knows the mean
    model = fit_two_phase(rows, seed=0, settings=NetworkSettings((4,), 0.0, 1e-3, 1024, 1), trees=10)
    coarse, both = rmse(rows, model.network.predict(rows.inputs)), rmse(rows, model.correction(rows))
    assert (both < 0.85 * coarse).all()  # metres and radians alike; the rest of the first is its velocity's


def test_a_log_becomes_rows_motion_by_motion() -> None:
    q = np.array([[0.0], [1.0], [3.0], [10.0], [11.0]])
    log = MotionLog(
        "two motions",
        ("a",),
        ("rad",),
        q,
        np.array([True, True, False, True, True]),
        q_encoder=q + 0.5,
        time=np.array([0.0, 0.5, 1.0, 0.0, 0.5]),
    )
    rows = rows_of_log(log, ("q",))
    np.testing.assert_array_equal(rows.inputs, q)
    np.testing.assert_allclose(rows.velocity[:, 0], [0.0, 2.0, 4.0, 0.0, 2.0])
    np.testing.assert_array_equal(rows.first, [0, 0, 0, 3, 3])
    np.testing.assert_allclose(rows.error[:, 0], [0.5, 0.5, 0.0, 0.5, 0.5])
    np.testing.assert_array_equal(rows.known, log.ok)
