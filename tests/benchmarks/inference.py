"""One sample through calibration models, beside other libraries on one thread.

The others compute the bare predictor. `Corrector` also checks sizes and the valid range, adds the correction to the
positions and, like the exported graph, falls back to the fixed offset.
"""

import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper
from sklearn.linear_model import LinearRegression
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from catenary import Corrector
from catenary.arrays import Floats
from catenary.calibration.model import CalibrationModel
from catenary.calibration.onnx import to_onnx
from catenary.calibration.predictors import Linear, Network, Quadratic
from tests.benchmarks.measure import Call, Table, Tables, report, side_by_side
from tests.oracles.calibration_models import random_model, random_network, random_predictor

Fitted = Linear | Quadratic | Network
Predict = Callable[[], Floats]  # outputs (N, m) for rows that were given


def peers(predictor: Fitted, X: Floats) -> dict[str, Predict]:
    """Return the same predictor in each library, on one thread, for rows X (N, F)."""
    return {
        "onnxruntime, float32": onnx_call(predictor, X, np.float32),
        "onnxruntime, float64": onnx_call(predictor, X, np.float64),
        "scikit-learn": sklearn_call(predictor, X),
    }


def session_call(session: onnxruntime.InferenceSession, name: str, feed: dict[str, Floats]) -> Predict:
    """Run a graph for one of its outputs."""
    return lambda: session.run([name], feed)[0]


def session_of(model: onnx.ModelProto) -> onnxruntime.InferenceSession:
    """Load a graph to run on one thread."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    return onnxruntime.InferenceSession(model.SerializeToString(), options, ["CPUExecutionProvider"])


def onnx_call(predictor: Fitted, X: Floats, dtype: type) -> Predict:
    """Run the bare predictor, without valid range, as the plainest graph; catenary's own export holds more."""
    nodes: list[onnx.NodeProto] = []
    arrays: list[onnx.TensorProto] = []

    def constant(values: Floats) -> str:
        name = f"a{len(arrays)}"
        kept = values if values.dtype == np.int64 else values.astype(dtype)
        arrays.append(numpy_helper.from_array(np.ascontiguousarray(kept), name))
        return name

    def add(operator: str, *inputs: str, **attributes: int) -> str:
        nodes.append(helper.make_node(operator, list(inputs), [f"t{len(nodes)}"], **attributes))
        return str(nodes[-1].output[0])

    def gemm(x: str, weights: Floats, bias: Floats) -> str:
        return add("Gemm", x, constant(weights), constant(bias))

    if isinstance(predictor, Linear):
        gemm("x", predictor.weights, predictor.bias)
    else:
        z = add("Div", add("Sub", "x", constant(predictor.mean)), constant(predictor.scale))
        if isinstance(predictor, Quadratic):
            i, j = (constant(part) for part in np.triu_indices(X.shape[1]))
            products = add("Mul", add("Gather", z, i, axis=1), add("Gather", z, j, axis=1))
            weights = np.vstack([predictor.linear, predictor.quadratic])
            gemm(add("Concat", z, products, axis=1), weights, predictor.bias)
        else:
            for W, b in zip(predictor.weights[:-1], predictor.biases[:-1], strict=True):
                z = add("Tanh", gemm(z, W, b))
            z = gemm(z, predictor.weights[-1], predictor.biases[-1])
            add("Add", add("Mul", z, constant(predictor.out_scale)), constant(predictor.out_mean))
    kind = TensorProto.FLOAT if dtype is np.float32 else TensorProto.DOUBLE
    name = nodes[-1].output[0]
    taken = helper.make_tensor_value_info("x", kind, ["rows", X.shape[1]])
    given = helper.make_tensor_value_info(name, kind, ["rows", None])
    graph = helper.make_graph(nodes, "predictor", [taken], [given], arrays)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    return session_call(session_of(model), name, {"x": X.astype(dtype)})


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
    steps = {
        Linear: [regressor],
        Quadratic: [StandardScaler(), PolynomialFeatures(2, include_bias=False), regressor],
        Network: [StandardScaler(), regressor],
    }[type(predictor)]
    estimator = make_pipeline(*steps) if len(steps) > 1 else regressor
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # one iteration does not converge: the weights are replaced
        estimator.fit(rows, rng.normal(size=(50, outputs)))
    if not isinstance(predictor, Linear):
        steps[0].mean_, steps[0].scale_ = predictor.mean, predictor.scale
    if isinstance(predictor, Network):
        regressor.coefs_, regressor.intercepts_ = list(predictor.weights), list(predictor.biases)
        return lambda: estimator.predict(X) * predictor.out_scale + predictor.out_mean
    linear = isinstance(predictor, Linear)
    weights = predictor.weights if linear else np.vstack([predictor.linear, predictor.quadratic])
    regressor.coef_, regressor.intercept_ = weights.T, predictor.bias
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
    session = session_of(to_onnx(model, {}))
    others["exported graph, onnxruntime"] = session_call(session, "correction", {"signals": x[None, :]})
    _check(others, out[None, :])
    return side_by_side(contenders | others, calls=CALLS, rounds=ROUNDS)


def _check(others: dict[str, Call], expected: Floats) -> None:
    for name, call in others.items():
        exact = {"rtol": 1e-9, "atol": 1e-9}
        rough = {"rtol": 1e-3, "atol": 1e-3}  # sums of a hundred and fifty terms of order one in float32
        np.testing.assert_allclose(call(), expected, **(rough if "float32" in name else exact), err_msg=name)


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
