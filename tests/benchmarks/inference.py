"""One sample through calibration models, beside other libraries on one thread.

The others compute the bare predictor. `Corrector` also checks sizes and the valid range, adds the correction to the
positions and falls back to the fixed offset.
"""

import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from sklearn.linear_model import LinearRegression
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from catenary import Corrector
from catenary.arrays import Floats
from catenary.calibration.model import CalibrationModel
from catenary.calibration.predictors import Expansion, Network
from tests.benchmarks.measure import Call, Table, Tables, report, side_by_side
from tests.oracles.calibration_models import random_model, random_network, random_predictor

Fitted = Expansion | Network
Predict = Callable[[], Floats]  # outputs (N, m) for rows that were given


def peers(predictor: Fitted, X: Floats) -> dict[str, Predict]:
    """Return the same predictor in each library, on one thread, for rows X (N, F)."""
    return {"scikit-learn": sklearn_call(predictor, X)}


def sklearn_call(predictor: Fitted, X: Floats) -> Predict:
    """Predict with the estimator that a user would have; a network's outputs stay unscaled."""
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(50, X.shape[1]))
    if isinstance(predictor, Network):
        hidden = tuple(len(bias) for bias in predictor.biases[:-1])
        regressor = MLPRegressor(hidden_layer_sizes=hidden, activation="tanh", max_iter=1)
        outputs = len(predictor.biases[-1])
    else:
        regressor = LinearRegression()
        outputs = len(predictor.bias)
    steps: list[Any] = [StandardScaler(), regressor]
    if isinstance(predictor, Expansion):
        of_second_order = [StandardScaler(), PolynomialFeatures(2, include_bias=False)]
        steps = [*(of_second_order if len(predictor.terms.pairs) else []), regressor]
    estimator = make_pipeline(*steps) if len(steps) > 1 else regressor
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # one iteration does not converge: the weights are replaced
        estimator.fit(rows, rng.normal(size=(50, outputs)))
    if len(steps) > 1:
        scaling = predictor if isinstance(predictor, Network) else predictor.terms
        steps[0].mean_ = scaling.mean if isinstance(scaling, Network) else scaling.middle
        steps[0].scale_ = scaling.scale
    if isinstance(predictor, Network):
        regressor.coefs_, regressor.intercepts_ = list(predictor.weights), list(predictor.biases)
        return lambda: estimator.predict(X) * predictor.out_scale + predictor.out_mean
    regressor.coef_, regressor.intercept_ = predictor.weights.T, predictor.bias
    return partial(estimator.predict, X)


INPUTS, JOINTS = 16, 3
ROUNDS, CALLS = 5, 1000  # scikit-learn takes a hundred times as long as we


def model_of(predictor: Fitted, rng: np.random.Generator) -> CalibrationModel:
    """Return a model of three joints that takes positions and torques of eight."""
    wide = random_model("linear", rng.normal(size=(2000, INPUTS)), rng, joints=8, torques=8)
    group = replace(wide.groups[0], joints=tuple(range(JOINTS)), predictor=predictor)
    names, units, offset = (part[:JOINTS] for part in (wide.joint_names, wide.joint_units, wide.offset))
    largest = np.full(JOINTS, 1e3)  # bounds nothing, as in the other libraries
    return replace(wide, joint_names=names, joint_units=units, offset=offset, groups=(group,), largest=largest)


def one_sample(predictor: Fitted, x: Floats, rng: np.random.Generator) -> Table:
    """Time a tick of Corrector beside one row in the other libraries."""
    model = model_of(predictor, rng)
    corrector = Corrector(model)
    q, out, inside = np.zeros(JOINTS), np.empty(JOINTS), np.empty(JOINTS, dtype=bool)
    corrector.correct(q, x, out, inside)
    assert inside.all()
    contenders: dict[str, Call] = {
        "Corrector.bind": corrector.bind(q, x, out, inside),
        "Corrector.correct": partial(corrector.correct, q, x, out, inside),
    }
    others = peers(predictor, x[None, :])
    _check(others, out[None, :])
    return side_by_side(contenders | others, calls=CALLS, rounds=ROUNDS)


def _check(others: dict[str, Call], expected: Floats) -> None:
    for name, call in others.items():
        np.testing.assert_allclose(call(), expected, rtol=1e-9, atol=1e-9, err_msg=name)


def tables() -> Tables:
    """Compare every predictor."""
    rng = np.random.default_rng(0)
    predictors = {
        f"network {INPUTS}-100-100-{JOINTS}, tanh": random_network((INPUTS, 100, 100, JOINTS), "tanh", rng),
        f"polynomial {INPUTS}-{JOINTS}": random_predictor("quadratic", INPUTS, JOINTS, rng),
        f"linear {INPUTS}-{JOINTS}": random_predictor("linear", INPUTS, JOINTS, rng),
    }
    return {name: one_sample(predictor, 0.1 * rng.normal(size=INPUTS), rng) for name, predictor in predictors.items()}


if __name__ == "__main__":
    report(tables, __doc__)
