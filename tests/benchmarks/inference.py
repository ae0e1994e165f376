"""One sample through a calibration model: Corrector beside onnxruntime and scikit-learn.

Corrector does more than the others: it checks sizes and the valid range and adds the correction to the positions.
"""

import time
import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import onnx
import onnxruntime
from onnx import TensorProto, helper, numpy_helper
from sklearn.linear_model import LinearRegression
from sklearn.neural_network import MLPRegressor
from tests.benchmarks.measure import Call, side_by_side, tell
from tests.oracles.calibration_models import random_model, random_network

from catenary.arrays import Floats
from catenary.calibration.corrector import Corrector
from catenary.calibration.kernels import predict_rows
from catenary.calibration.linear import Linear
from catenary.calibration.model import CalibrationModel, Predictor
from catenary.calibration.neural import Network

INPUTS, JOINTS = 16, 3


def model_of(predictor: Predictor, rng: np.random.Generator) -> CalibrationModel:
    """A model of three joints that takes positions and torques of eight."""
    wide = random_model("linear", rng.normal(size=(2000, INPUTS)), rng, joints=8, torques=8)
    group = replace(wide.groups[0], joints=tuple(range(JOINTS)), predictor=predictor)
    return replace(
        wide,
        joint_names=wide.joint_names[:JOINTS],
        joint_units=wide.joint_units[:JOINTS],
        offset=wide.offset[:JOINTS],
        groups=(group,),
    )


def corrector_call(predictor: Predictor, x: Floats, rng: np.random.Generator) -> tuple[Call, Floats]:
    """One tick, and what it gave."""
    corrector = Corrector(model_of(predictor, rng))
    q, out, inside = np.zeros(JOINTS), np.empty(JOINTS), np.empty(JOINTS, dtype=bool)
    corrector.correct(q, x, out, inside)
    assert inside.all()
    return (lambda: corrector.correct(q, x, out, inside)), out.copy()


def onnx_call(
    nodes: Sequence[onnx.NodeProto], arrays: dict[str, Floats], x: Floats, dtype: type
) -> tuple[Call, Floats]:
    """A graph from `x` to `y` run by onnxruntime on one thread."""
    kind = TensorProto.FLOAT if dtype is np.float32 else TensorProto.DOUBLE
    graph = helper.make_graph(
        list(nodes),
        "model",
        [helper.make_tensor_value_info("x", kind, [1, INPUTS])],
        [helper.make_tensor_value_info("y", kind, [1, JOINTS])],
        [numpy_helper.from_array(values.astype(dtype), name) for name, values in arrays.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = onnxruntime.InferenceSession(model.SerializeToString(), options, ["CPUExecutionProvider"])
    feed, names = {"x": x[None, :].astype(dtype)}, ["y"]
    return (lambda: session.run(names, feed)), session.run(names, feed)[0][0]


def network_nodes(network: Network) -> tuple[list[onnx.NodeProto], dict[str, Floats]]:
    """Standardise, layers, scale back."""
    nodes = [helper.make_node("Sub", ["x", "mean"], ["c"]), helper.make_node("Div", ["c", "scale"], ["h0"])]
    arrays = {"mean": network.mean, "scale": network.scale}
    for k, (W, b) in enumerate(zip(network.weights, network.biases, strict=True)):
        arrays |= {f"W{k}": W, f"b{k}": b}
        nodes.append(helper.make_node("Gemm", [f"h{k}", f"W{k}", f"b{k}"], [f"z{k}"]))
        if k < len(network.weights) - 1:
            nodes.append(helper.make_node("Tanh", [f"z{k}"], [f"h{k + 1}"]))
    arrays |= {"out_scale": network.out_scale, "out_mean": network.out_mean}
    nodes.append(helper.make_node("Mul", [f"z{len(network.weights) - 1}", "out_scale"], ["s"]))
    nodes.append(helper.make_node("Add", ["s", "out_mean"], ["y"]))
    return nodes, arrays


def sklearn_network(network: Network) -> MLPRegressor:
    """The layers alone: scaling, which scikit-learn would take another call for, is left out."""
    rng = np.random.default_rng(0)
    regressor = MLPRegressor(hidden_layer_sizes=(100, 100), activation="tanh", max_iter=1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        regressor.fit(rng.normal(size=(50, INPUTS)), rng.normal(size=(50, JOINTS)))
    regressor.coefs_, regressor.intercepts_ = list(network.weights), list(network.biases)
    return regressor


def main() -> None:
    """Compare, and tell."""
    rng = np.random.default_rng(0)
    x = 0.1 * rng.normal(size=INPUTS)
    row = x[None, :].copy()

    network = random_network((INPUTS, 100, 100, JOINTS), "tanh", rng)
    corrector, expected = corrector_call(network, x, rng)
    contenders: dict[str, Call] = {"Corrector": corrector}
    nodes, arrays = network_nodes(network)
    for dtype in (np.float32, np.float64):
        contenders[f"onnxruntime {dtype.__name__}"], given = onnx_call(nodes, arrays, x, dtype)
        np.testing.assert_allclose(given, expected, atol=1e-4 if dtype is np.float32 else 1e-11)
    regressor = sklearn_network(network)
    contenders["scikit-learn MLPRegressor"] = lambda: regressor.predict(row)
    tables = {f"network {INPUTS}-100-100-{JOINTS}, tanh": side_by_side(contenders)}

    weights, bias = rng.normal(size=(INPUTS, JOINTS)), rng.normal(size=JOINTS)
    corrector, expected = corrector_call(Linear(weights, bias), x, rng)
    contenders = {"Corrector": corrector}
    nodes, arrays = [helper.make_node("Gemm", ["x", "W", "b"], ["y"])], {"W": weights, "b": bias}
    for dtype in (np.float32, np.float64):
        contenders[f"onnxruntime {dtype.__name__}"], given = onnx_call(nodes, arrays, x, dtype)
        np.testing.assert_allclose(given, expected, atol=1e-4 if dtype is np.float32 else 1e-11)
    linear = LinearRegression().fit(rng.normal(size=(50, INPUTS)), rng.normal(size=(50, JOINTS)))
    linear.coef_, linear.intercept_ = weights.T, bias
    np.testing.assert_allclose(linear.predict(row)[0], expected, atol=1e-11)
    contenders["scikit-learn LinearRegression"] = lambda: linear.predict(row)
    tables[f"linear {INPUTS}-{JOINTS}"] = side_by_side(contenders)

    batch = random_network((48, 100, 100, 6), "tanh", rng)
    packed, X = batch.pack(), rng.normal(size=(10_000, 48))
    predict_rows(packed, X)
    seconds = min(_seconds(lambda: predict_rows(packed, X)) for _ in range(5))
    tables["batch of 10 000 rows through 48-100-100-6"] = {"predict_rows": {"cpu_s": seconds}}
    tell(tables)


def _seconds(call: Call) -> float:
    begin = time.thread_time()
    call()
    return time.thread_time() - begin


if __name__ == "__main__":
    main()
