"""Networks: gradients, steps and training, against finite differences and independent libraries."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from sklearn.neural_network import MLPRegressor

from catenary.calibration import neural
from catenary.calibration.neural import PAPER, NetworkSettings, Penalties, TrainedNetwork, fit_neural, logistic_units
from catenary.calibration.predictors import Network
from papers.calibration.figure_8 import PAPER_LARGER

SMALL = NetworkSettings((8,), 1e-4, 1e-2, 64, 20)
SHORT = pytest.mark.parametrize("settings", [replace(PAPER, epochs=5)], ids=["paper"])


def problem(rows: int, outputs: int = 2, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    X = rng.uniform(-1.0, 1.0, size=(rows, 2)) * [3.0, 0.1] + [1.0, 0.5]
    waves = [np.sin(X[:, 0] + k) * (1.0 + 5.0 * X[:, 1]) for k in range(outputs)]
    return X, 0.02 * np.column_stack(waves) + 0.3


def train(X: np.ndarray, Y: np.ndarray, settings: NetworkSettings, **options: Any) -> Network:
    return fit_neural(X, Y, settings, **({"seed": 0} | options))


class Spy(TrainedNetwork):
    """Writes down every step; those of rate zero move nothing."""

    steps: list[dict[str, Any]]

    def gradient(self, X: np.ndarray, Y: np.ndarray, l2: float, *others: Any) -> list[np.ndarray]:
        self.steps.append({"X": X, "rows": len(X), "l2": l2})
        return super().gradient(X, Y, l2, *others)

    def step(self, gradient: Any, learning_rate: float) -> None:
        self.steps[-1]["rate"] = learning_rate
        super().step(gradient, learning_rate)


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    written: list[dict[str, Any]] = []
    monkeypatch.setattr(Spy, "steps", written, raising=False)
    monkeypatch.setattr(neural, "TrainedNetwork", Spy)
    return written


def in_double_precision(network: TrainedNetwork) -> TrainedNetwork:
    network.weights = [W.astype(np.float64) for W in network.weights]
    network.biases = [b.astype(np.float64) for b in network.biases]
    return network


def assert_slopes_of(
    loss: Callable[[], float], network: TrainedNetwork, gradient: list[np.ndarray], outputs: int
) -> None:
    """Compare a gradient, which is of the loss times outputs / 2, with central differences."""
    h = 1e-6  # far below every weight's magnitude, where an L1 term has a slope
    for values, slopes in zip((*network.weights, *network.biases), gradient, strict=True):
        for place in np.ndindex(values.shape):
            kept = values[place]
            values[place] = kept + h
            above = loss()
            values[place] = kept - h
            slope = (above - loss()) / (2.0 * h)
            values[place] = kept
            # the activations that are trained with are right to 3e-7
            assert slopes[place] == pytest.approx(0.5 * outputs * slope, abs=1e-6)


@pytest.mark.parametrize(
    "others",
    [Penalties(), Penalties(0.02, 0.03, 0.04), Penalties(0.02, 0.03, 0.04, output=False)],
    ids=["l2", "all", "hidden"],
)
def test_gradient_is_that_of_keras_loss(others: Penalties) -> None:
    rng = np.random.default_rng(0)
    rows, outputs, l2 = 11, 2, 0.05
    X, Y = rng.normal(size=(rows, 4)), rng.normal(size=(rows, outputs))
    network = in_double_precision(TrainedNetwork((4, 6, 5, outputs), 1))

    def loss() -> float:
        layer, activity = X, 0.0
        for weights, bias in zip(network.weights[:-1], network.biases[:-1], strict=True):
            layer = layer @ weights + bias
            layer = 1.0 / (1.0 + np.exp(-layer))
            activity += np.sum(layer**2) / rows
        errors = layer @ network.weights[-1] + network.biases[-1] - Y
        held = slice(None if others.output else -1)
        penalty = sum(l2 * np.sum(W**2) + others.l1 * np.sum(np.abs(W)) for W in network.weights[held])
        penalty += others.bias_l2 * sum(np.sum(b**2) for b in network.biases[held])
        return float(np.mean(errors**2) + penalty + others.activity_l2 * activity)

    assert_slopes_of(loss, network, network.gradient(X, Y, l2, others), outputs)


def test_larger_network_of_the_paper_has_its_size_and_penalties(steps: list[dict[str, Any]]) -> None:
    X, Y = problem(300, outputs=3)
    X = np.hstack([X, np.random.default_rng(0).normal(size=(300, 136))])
    network = train(X, Y, replace(PAPER_LARGER, epochs=1))
    # section II-H: 138 inputs, 600-500-400 units, 3 outputs
    assert sum(each.size for each in (*network.weights, *network.biases)) == 585_503
    assert {s["l2"] for s in steps} == {1e-4}
    assert PAPER_LARGER.penalties == Penalties(l1=1e-5, bias_l2=1e-4, activity_l2=1e-5, output=False)


@pytest.mark.parametrize("outputs", [1, 3])
def test_steps_are_those_of_scikit_learns_adam(outputs: int) -> None:
    X, Y = (values.astype(np.float32) for values in problem(64, outputs))
    theirs = MLPRegressor(hidden_layer_sizes=(7, 5), activation="logistic", alpha=0.3 * 32 * outputs, batch_size=32,
                          learning_rate_init=0.01, shuffle=False, random_state=5)  # fmt: skip
    ours = TrainedNetwork((2, 7, 5, outputs), 5)
    for k in range(40):
        part = slice(32 * (k % 2), 32 * (k % 2) + 32)
        theirs.partial_fit(X[part], Y[part].squeeze())
        ours.step(ours.gradient(X[part], Y[part], 0.3), 0.01)
    for values, expected in zip((*ours.weights, *ours.biases), (*theirs.coefs_, *theirs.intercepts_), strict=True):
        # the activations are ours, and round otherwise than NumPy's and SciPy's
        assert_allclose(values, expected, rtol=1e-4, atol=1e-6)


def test_paper_network_is_trained_as_the_paper_states(steps: list[dict[str, Any]]) -> None:
    network = train(*problem(2500, outputs=3), replace(PAPER, epochs=2))
    assert [s["rows"] for s in steps] == [1024, 1024, 452] * 2
    assert {s["l2"] for s in steps} == {5e-4}
    assert {s["rate"] for s in steps} == {1e-3}
    assert [W.shape for W in network.weights] == [(2, 100), (100, 100), (100, 3)]
    assert (PAPER.epochs, network.activation) == (200, "logistic")


@SHORT
def test_scale_and_origin_of_inputs_and_outputs_do_not_matter(settings: NetworkSettings) -> None:
    X, Y = problem(300)
    metres = train(X, Y, settings).predict(X)
    millimetres = train(1000.0 * X + 50.0, 1000.0 * Y - 3.0, settings).predict(1000.0 * X + 50.0)
    # training runs in single precision
    assert_allclose((millimetres + 3.0) / 1000.0, metres, atol=1e-4 * float(Y.std()))


FAR = np.array([-np.inf, -3e38, -90.0, -8.0, 8.0, 90.0, 3e38, np.inf])
POINTS = np.concatenate([FAR, np.linspace(-20.0, 20.0, 40_001), np.geomspace(1e-30, 1.0, 500)])


def logistic(x: np.ndarray) -> np.ndarray:
    return 0.5 + 0.5 * np.tanh(0.5 * x)


def test_units_give_their_function_wherever_they_are_asked() -> None:
    layer = POINTS.astype(np.float32)[:, None]
    expected = logistic(layer.astype(np.float64))
    logistic_units(layer, np.zeros(1, np.float32))
    assert_allclose(layer, expected, rtol=0.0, atol=3e-7)
