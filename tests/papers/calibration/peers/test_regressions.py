"""The Gaussian process, and the network with its forest; and the rows that all peers take."""

import numpy as np
import pytest

from catenary import MotionLog
from catenary.calibration.neural import NetworkSettings
from papers.calibration.peers.gaussian_process import fit_gaussian_process
from papers.calibration.peers.rows import Rows, rows_of_log
from papers.calibration.peers.two_phase import fit_two_phase


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
    model = fit_two_phase(
        rows, seed=0, settings=NetworkSettings((4,), "logistic", 0.0, 1e-3, 1024, 1), trees=10
    )
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
