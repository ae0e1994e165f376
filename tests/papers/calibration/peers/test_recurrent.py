import numpy as np

from papers.calibration.peers.recurrent import Lstm, fit_recurrent, sequence_places
from papers.calibration.peers.rows import Rows


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
