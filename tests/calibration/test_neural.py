import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from sklearn.neural_network import MLPRegressor

from catenary.calibration import neural
from catenary.calibration.neural import BEST, PAPER, NetworkSettings, fit_neural, sklearn_alpha
from catenary.calibration.predictors import Network

SMALL = NetworkSettings((8,), "tanh", 1e-4, 1e-2, 64, 20)
SHORT = pytest.mark.parametrize(
    "settings", [replace(PAPER, epochs=5), replace(BEST, epochs=5, l2=1e-3)], ids=["paper", "best"]
)


def problem(rows: int, outputs: int = 2, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    X = rng.uniform(-1.0, 1.0, size=(rows, 2)) * [3.0, 0.1] + [1.0, 0.5]
    waves = [np.sin(X[:, 0] + k) * (1.0 + 5.0 * X[:, 1]) for k in range(outputs)]
    return X, 0.02 * np.column_stack(waves) + 0.3


def train(
    X: np.ndarray, Y: np.ndarray, settings: NetworkSettings, *, late: Any = None, **options: Any
) -> Network:
    late = np.zeros(len(X), dtype=bool) if late is None else late
    return fit_neural(X, Y, settings, **({"seed": 0} | options), late=late)


class Spy(MLPRegressor):
    """Writes down every step."""

    steps: list[dict[str, Any]]
    most = 10_000  # steps that are taken; later ones are written down alone

    def partial_fit(self, X: np.ndarray, y: np.ndarray) -> "Spy":
        before = [W.copy() for W in self.coefs_] if hasattr(self, "coefs_") else None
        if len(self.steps) < self.most:
            super().partial_fit(X, y)
        self.steps.append(
            {
                "rows": len(X),
                "alpha": self.alpha,
                "settings": self.get_params(),
                "X": X.copy(),
                "moved": None
                if before is None
                else max(float(np.abs(W - V).max()) for W, V in zip(self.coefs_, before, strict=True)),
            }
        )
        return self


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    written: list[dict[str, Any]] = []
    monkeypatch.setattr(Spy, "steps", written, raising=False)
    monkeypatch.setattr(neural, "MLPRegressor", Spy)
    return written


def keras_loss(
    weights: list[np.ndarray], biases: list[np.ndarray], X: np.ndarray, Y: np.ndarray, l2: float
) -> float:
    """Mean over rows and outputs of the squared error, and l2 times the sum of squared kernels."""
    layer = X
    for k, (W, b) in enumerate(zip(weights, biases, strict=True)):
        layer = layer @ W + b
        if k < len(weights) - 1:
            layer = 1.0 / (1.0 + np.exp(-layer))
    return float(np.mean((layer - Y) ** 2) + l2 * sum(np.sum(W**2) for W in weights))


@pytest.mark.parametrize("outputs", [1, 3])
@pytest.mark.parametrize("rows", [32, 7])
def test_step_of_scikit_learn_goes_down_the_gradient_of_keras_loss(outputs: int, rows: int) -> None:
    rng = np.random.default_rng(0)
    X, Y = rng.normal(size=(rows, 4)), rng.normal(size=(rows, outputs))
    l2 = 0.05  # large enough for the penalty to turn the step
    regressor = MLPRegressor(
        hidden_layer_sizes=(6, 5),
        activation="logistic",
        solver="sgd",
        momentum=0.0,
        learning_rate_init=1.0,
        shuffle=False,
        batch_size=rows,
        alpha=sklearn_alpha(l2, rows, outputs),
        random_state=1,
    )
    target = Y[:, 0] if outputs == 1 else Y
    regressor.partial_fit(X, target)  # the weights exist after a first step
    weights = [W.copy() for W in regressor.coefs_]
    biases = [b.copy() for b in regressor.intercepts_]
    regressor.partial_fit(X, target)
    step = [new - old for new, old in zip(regressor.coefs_, weights, strict=True)]
    step += [new - old for new, old in zip(regressor.intercepts_, biases, strict=True)]

    h, slope = 1e-6, []
    for values in (*weights, *biases):
        for place in np.ndindex(values.shape):
            kept = values[place]
            values[place] = kept + h
            above = keras_loss(weights, biases, X, Y, l2)
            values[place] = kept - h
            slope.append((above - keras_loss(weights, biases, X, Y, l2)) / (2.0 * h))
            values[place] = kept
    # scikit-learn minimises half the squared error, summed over outputs
    assert_allclose(np.concatenate([s.ravel() for s in step]), -0.5 * outputs * np.array(slope), atol=1e-8)


def test_paper_preset_is_what_the_paper_states() -> None:
    assert NetworkSettings((100, 100), "logistic", 5e-4, 1e-3, 1024, 200) == PAPER
    assert (PAPER.cosine, PAPER.skip_ridge) == (False, None)


def test_paper_network_is_trained_as_the_paper_states(
    steps: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Spy, "most", 3)
    X, Y = problem(2500, outputs=3)
    train(X, Y, PAPER)
    assert [s["rows"] for s in steps] == [1024, 1024, 452] * 200
    assert {s["alpha"] for s in steps} == {5e-4 * 1024 * 3, 5e-4 * 452 * 3}
    given = steps[-1]["settings"]
    expected = {
        "hidden_layer_sizes": (100, 100),
        "activation": "logistic",
        "solver": "adam",
        "learning_rate_init": 1e-3,
        "beta_1": 0.9,
        "beta_2": 0.999,
    }
    assert {key: given[key] for key in expected} == expected


def test_every_epoch_takes_every_row_once_in_another_order(steps: list[dict[str, Any]]) -> None:
    X, Y = problem(100)
    train(X, Y, SMALL)
    first, second = (np.vstack([s["X"] for s in steps[k : k + 2]])[:, 0] for k in (0, 2))
    assert_array_equal(np.sort(first), np.sort(second))
    assert (first != second).any()


@pytest.mark.parametrize(
    ("rows", "batch", "steps_of_an_epoch"), [(100, 64, 2), (64, 64, 1), (10, 64, 1), (129, 64, 3)]
)
def test_number_of_steps_is_epochs_times_batches(
    steps: list[dict[str, Any]], rows: int, batch: int, steps_of_an_epoch: int
) -> None:
    train(*problem(rows), replace(SMALL, batch=batch, epochs=4))
    assert len(steps) == 4 * steps_of_an_epoch


def test_training_does_not_stop_early_where_nothing_can_be_learned(steps: list[dict[str, Any]]) -> None:
    X, _ = problem(50)
    train(X, np.random.default_rng(1).normal(size=(50, 1)), replace(SMALL, epochs=150))
    assert len(steps) == 150


def test_learning_rate_of_best_falls_along_half_a_cosine(steps: list[dict[str, Any]]) -> None:
    X, Y = problem(600)
    train(X, Y, replace(BEST, l2=1e-3))
    share = np.arange(1, len(steps)) / len(steps)
    rate = BEST.learning_rate * 0.5 * (1.0 + np.cos(np.pi * share))
    moved = np.array([s["moved"] for s in steps[1:]])
    # Adam moves no weight by more than (1 - 0.9) / sqrt(1 - 0.999) = 3.2 rates; 1e-7: single precision
    assert np.all(moved <= 3.2 * rate + 1e-7)
    assert moved[-1] < 0.01 * moved[0]


def test_learning_rate_without_schedule_stays(steps: list[dict[str, Any]]) -> None:
    train(*problem(600), replace(BEST, l2=1e-3, cosine=False))
    assert steps[-1]["moved"] > 0.01 * steps[1]["moved"]


def test_penalty_is_chosen_on_late_rows_that_the_trials_never_see(steps: list[dict[str, Any]]) -> None:
    X, Y = problem(100)
    late = np.arange(100) >= 80
    train(X, Y, replace(SMALL, l2=(1e-4, 1e-2, 1.0), epochs=1), late=late)
    rows = [s["rows"] for s in steps]
    assert rows == [64, 16, 64, 16, 64, 16, 64, 36]


def test_penalty_that_does_best_on_late_rows_is_taken(steps: list[dict[str, Any]]) -> None:
    X, Y = problem(400)
    candidates = (10.0, 1e-5, 1.0)  # two of them leave no network at all
    train(X, Y, replace(SMALL, l2=candidates, epochs=25), late=np.arange(400) >= 320)
    assert steps[-1]["alpha"] == pytest.approx(1e-5 * steps[-1]["rows"] * 2)


@pytest.mark.parametrize("late", [False, True])
def test_without_rows_to_choose_on_the_first_penalty_is_taken(
    steps: list[dict[str, Any]], late: bool
) -> None:
    train(*problem(64), replace(SMALL, l2=(0.5, 0.1), epochs=1), late=np.full(64, late))
    assert [s["alpha"] for s in steps] == [0.5 * 64 * 2]


def test_another_seed_gives_another_network() -> None:
    X, Y = problem(300)
    assert (train(X, Y, SMALL, seed=1).weights[0] != train(X, Y, SMALL, seed=2).weights[0]).any()


def test_training_leaves_the_global_random_state_alone() -> None:
    np.random.seed(0)  # noqa: NPY002
    expected = np.random.get_state()[1].copy()  # noqa: NPY002
    train(*problem(100), SMALL)
    assert_array_equal(np.random.get_state()[1], expected)  # noqa: NPY002


@pytest.mark.parametrize("outputs", [1, 3])
@pytest.mark.parametrize(
    "settings", [replace(PAPER, epochs=15), replace(BEST, epochs=15)], ids=["paper", "best"]
)
def test_training_warns_of_nothing(settings: NetworkSettings, outputs: int) -> None:
    X, Y = problem(100, outputs)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        train(X, Y, settings, late=np.arange(100) >= 80)


def test_best_network_learns_a_smooth_function() -> None:
    X, Y = problem(1200)
    settings = replace(BEST, l2=(1e-4, 1e-2))
    network = train(X[:800], Y[:800], settings, late=np.arange(800) >= 640)
    left = network.predict(X[800:]) - Y[800:]
    assert np.all(left.std(axis=0) < 0.15 * Y.std(axis=0))


@pytest.mark.slow
def test_paper_network_learns_more_than_a_linear_model() -> None:
    X, Y = problem(2400)
    A = np.column_stack([X, np.ones(len(X))])
    linear = A[2000:] @ np.linalg.lstsq(A[:2000], Y[:2000], rcond=None)[0]
    network = train(X[:2000], Y[:2000], replace(PAPER, batch=64, l2=1e-5)).predict(X[2000:])
    assert np.all((network - Y[2000:]).std(axis=0) < 0.5 * (linear - Y[2000:]).std(axis=0))


@SHORT
def test_scale_and_origin_of_inputs_and_outputs_do_not_matter(settings: NetworkSettings) -> None:
    X, Y = problem(300)
    metres = train(X, Y, settings).predict(X)
    millimetres = train(1000.0 * X + 50.0, 1000.0 * Y - 3.0, settings).predict(1000.0 * X + 50.0)
    # training runs in single precision
    assert_allclose((millimetres + 3.0) / 1000.0, metres, atol=1e-4 * float(Y.std()))


@SHORT
def test_input_that_never_moved_gives_finite_numbers(settings: NetworkSettings) -> None:
    X, Y = problem(300)
    still = np.column_stack([X, np.full(300, 0.1)])
    assert np.isfinite(train(still, Y, settings).predict(still)).all()


@SHORT
def test_output_that_never_moved_gets_no_ripple(settings: NetworkSettings) -> None:
    X, Y = problem(300)
    network = train(X, np.column_stack([Y, np.full(300, 0.02)]), settings)
    assert_allclose(network.predict(X)[:, -1], 0.02, atol=1e-12)  # rounding of the linear model


@pytest.mark.parametrize("activation", ["tanh", "logistic"])
def test_prediction_is_that_of_scikit_learns_network(activation: Any) -> None:
    rng = np.random.default_rng(3)
    X, Y = rng.normal(size=(50, 3)), rng.normal(size=(50, 2))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        theirs = MLPRegressor(
            hidden_layer_sizes=(7, 5), activation=activation, max_iter=5, random_state=0
        ).fit(X, Y)
    network = Network(
        np.zeros(3),
        np.ones(3),
        tuple(theirs.coefs_),
        tuple(theirs.intercepts_),
        activation,
        np.zeros(2),
        np.ones(2),
    )
    assert_allclose(network.predict(X), theirs.predict(X), rtol=1e-10)


@pytest.mark.filterwarnings("error")
def test_logistic_unit_does_not_overflow_far_from_zero() -> None:
    network = Network(
        np.zeros(1),
        np.ones(1),
        (np.array([[1.0]]), np.array([[1.0]])),
        (np.zeros(1), np.zeros(1)),
        "logistic",
        np.zeros(1),
        np.ones(1),
    )
    assert_array_equal(network.predict(np.array([[-1e6], [0.0], [1e6]])), [[0.0], [0.5], [1.0]])


def test_progress_rises_to_one() -> None:
    told: list[float] = []
    X, Y = problem(100)
    train(X, Y, replace(SMALL, l2=(1e-4, 1e-2), epochs=5), late=np.arange(100) >= 80, progress=told.append)
    assert told == sorted(told)
    # five epochs for each of two candidates, then five for the network
    assert (len(told), told[-1]) == (15, 1.0)


def test_interrupt_within_a_step_ends_the_training(monkeypatch: pytest.MonkeyPatch) -> None:
    class Interrupted(MLPRegressor):
        def _backprop(self, *_: Any) -> None:
            raise KeyboardInterrupt

    monkeypatch.setattr(neural, "MLPRegressor", Interrupted)
    with pytest.raises(KeyboardInterrupt):
        train(*problem(100), SMALL)
