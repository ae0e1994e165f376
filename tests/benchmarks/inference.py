"""One sample, a thousand and thirty thousand through calibration models, beside other libraries on one thread.

The others compute the bare predictor. `Corrector` also checks sizes and the valid range, adds the correction to the
positions and, like the exported graph, falls back to the fixed offset.
"""

from dataclasses import replace
from functools import partial

import numpy as np

from catenary import Corrector
from catenary.arrays import Floats
from catenary.calibration.model import CalibrationModel
from catenary.calibration.onnx import to_onnx
from tests.benchmarks.inference_peers import Fitted, peers, session_call, session_of
from tests.benchmarks.measure import Call, Table, Tables, report, side_by_side
from tests.oracles.calibration_models import random_model, random_network, random_predictor

INPUTS, JOINTS = 16, 3
ROUNDS, CALLS = 5, 1000  # scikit-learn takes a hundred times as long as we
BATCHES = {1000: 5, 30_000: 1}  # rows, and calls in a round


def model_of(predictor: Fitted, rng: np.random.Generator) -> CalibrationModel:
    """Return a model of three joints that takes positions and torques of eight."""
    wide = random_model("linear", rng.normal(size=(2000, INPUTS)), rng, joints=8, torques=8)
    group = replace(wide.groups[0], joints=tuple(range(JOINTS)), predictor=predictor)
    names, units, offset = (part[:JOINTS] for part in (wide.joint_names, wide.joint_units, wide.offset))
    return replace(wide, joint_names=names, joint_units=units, offset=offset, groups=(group,))


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
    session = session_of(to_onnx(model, {}))
    others["exported graph, onnxruntime"] = session_call(session, "correction", {"signals": x[None, :]})
    _check(others, out[None, :])
    return side_by_side(contenders | others, calls=CALLS, rounds=ROUNDS)


def many_samples(predictor: Fitted, X: Floats, calls: int, rng: np.random.Generator) -> Table:
    """Time a batch through the predictor alone, through a whole Corrector, and in the other libraries."""
    corrector, q = Corrector(model_of(predictor, rng)), np.zeros((len(X), JOINTS))
    others = peers(predictor, X)
    _check(others, predictor.predict(X))
    contenders: dict[str, Call] = {"predictor alone": partial(predictor.predict, X)}
    contenders["Corrector.run"] = partial(corrector.run, q, X)
    return side_by_side(contenders | others, calls=calls, rounds=ROUNDS)


def _check(others: dict[str, Call], expected: Floats) -> None:
    for name, call in others.items():
        exact = {"rtol": 1e-9, "atol": 1e-9}
        rough = {"rtol": 1e-3, "atol": 1e-3}  # sums of a hundred and fifty terms of order one in float32
        np.testing.assert_allclose(call(), expected, **(rough if "float32" in name else exact), err_msg=name)


def tables() -> Tables:
    """Compare every predictor, one sample and batches."""
    rng = np.random.default_rng(0)
    predictors = {
        f"network {INPUTS}-100-100-{JOINTS}, tanh": random_network((INPUTS, 100, 100, JOINTS), "tanh", rng),
        f"polynomial {INPUTS}-{JOINTS}": random_predictor("quadratic", INPUTS, JOINTS, rng),
        f"linear {INPUTS}-{JOINTS}": random_predictor("linear", INPUTS, JOINTS, rng),
    }
    found = {}
    for name, predictor in predictors.items():
        found[f"{name}: one sample"] = one_sample(predictor, 0.1 * rng.normal(size=INPUTS), rng)
        for rows, calls in BATCHES.items():
            X = 0.1 * rng.normal(size=(rows, INPUTS))
            found[f"{name}: {rows} rows"] = many_samples(predictor, X, calls, rng)
    return found


if __name__ == "__main__":
    report(tables, __doc__)
