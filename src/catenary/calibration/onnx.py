"""A calibration model as an ONNX graph, for programs that run no Python: one step of it, its memory in and out.

The graph computes in float64, like the model: its valid range has narrow bands along directions that hardly moved,
which float32 cannot resolve. Corrections equal the model's to rounding; rows on the very edge of the range may fall on
its other side.
"""

from collections.abc import Callable, Sequence
from functools import reduce
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from catenary import __version__
from catenary.arrays import Floats
from catenary.calibration.features import FeatureSet
from catenary.calibration.friction_states import FrictionStates
from catenary.calibration.midline import FULL, STATES
from catenary.calibration.model import CalibrationModel, Card
from catenary.errors import InputError, imported
from catenary.files import json_text, write_atomically
from catenary.transmission.cable_friction import SWEEPS

FORMAT = "catenary.onnx.1"
OPSET = 17  # all operators that occur have float64 kernels in runtimes since 2022
IR_VERSION = 8  # the file format that came with this opset
OPERATORS = {
    np.add: "Add", np.subtract: "Sub", np.multiply: "Mul", np.divide: "Div", np.negative: "Neg", np.absolute: "Abs",
    np.minimum: "Min", np.maximum: "Max", np.floor: "Floor", np.exp: "Exp", np.tanh: "Tanh", np.isnan: "IsNaN",
    np.less: "Less", np.less_equal: "LessOrEqual", np.greater: "Greater", np.greater_equal: "GreaterOrEqual",
    np.equal: "Equal", np.bitwise_and: "And", np.invert: "Not",
}  # fmt: skip


def to_onnx(model: CalibrationModel, card: Card) -> Any:
    """Return a model as an onnx.ModelProto: one step, for one row or many independent ones, all float64.

    Inputs are `signals` (rows, S) in the order of `model.features.signals`; `q_nominal` (rows, n) [rad|m] where the
    model gives positions or knows joint limits; and `midline` (rows, M, 4), `play` (rows, K), `friction` (rows, L) of
    models with such memory, NaN before the first step. Outputs are `correction`, `inside`, `interval` (rows, n), and
    the memory to be given next, `play_next` and so on. Stepped, the graph gives what `Corrector` gives, but for leaps
    of a joint, which its play states follow: keep them out (spike_filter.py). The metadata `catenary` names signals,
    units and joints as JSON; `card` is the model card.
    """
    n, features = len(model.joint_names), model.features
    graph = _Graph(_import_onnx())
    signals = graph.input("signals", len(features.signals), text=", ".join(features.signals))
    X, q = np.empty((1, len(features.names))), np.empty((1, n))
    if takes_q := model.target == "position" or model.limits is not None:
        graph.tensors[id(q)] = graph.input("q_nominal", n, text=f"positions of {', '.join(model.joint_names)}")
    graph.tensors[id(X)] = _features(graph, signals, features)
    interval = None if model.intervals is None else np.empty((1, n))
    parts: dict[str, list[Any]] = {"correction": [], "inside": [], "interval": []}
    for step in model.steps(X, q, np.empty((1, n)), np.empty((1, n), dtype=bool), interval):
        given = [graph.tensors.get(id(array), array) for array in step.inputs]
        match step.function.__name__:
            case "choose":
                correction, inside = _choice(graph, given, takes_q=takes_q)
                parts["correction"].append(correction)
                parts["inside"].append(inside)
            case "widen":
                parts["interval"].append(_half_widths(graph, given, parts["inside"][-1]))
            case name if name in STEPS:
                given += [step.inputs[0].shape[1]] if name == "monomials" else []
                before = graph.tensors.get(id(step.outputs[0]))  # what a step in place goes on from
                graph.tensors[id(step.outputs[0])] = STEPS[name](graph, before, *given)
            case name:
                raise InputError(f"model: its step {name} has no ONNX graph")
    told = {
        "correction": "to be added to q_nominal, in rad and m",
        "inside": "whether each joint is in the model's valid range",
    }
    if model.intervals is not None:
        told["interval"] = f"half-width that is to hold {100.0 * model.intervals.level:g} % of errors, in rad and m"
    order = np.argsort([j for group in model.groups for j in group.joints])
    for name, text in told.items():
        together = graph.add("Gather", graph.joined(parts[name]), order, axis=1, name=name)
        graph.output(together, n, text=text, boolean=name == "inside")
    about = {
        "format": FORMAT,
        "kind": model.kind,
        "joint_names": model.joint_names,
        "joint_units": model.joint_units,
        "signals": features.signals,
        "signal_units": features.units,
        "target": model.target,
        "midlines": [{"signal": name, "position": position} for name, position, _, _ in features.midlines],
        "play": [{"position": name, "half_width": width} for name, width in features.play],
        "friction": None if features.friction is None else {"positions": features.friction.positions},
    }
    return graph.model({"catenary": json_text(about), "card": json_text(card)})


def save_onnx(model: CalibrationModel, card: Card, path: Path) -> Any:
    """Write `to_onnx` to a file, checked, whole or not at all; give the onnx.ModelProto."""
    made = to_onnx(model, card)
    _import_onnx().checker.check_model(made, full_check=True)
    write_atomically(path, made.SerializeToString(deterministic=True))
    return made


def _import_onnx() -> Any:
    return imported("onnx", "ONNX files are written by the package onnx, which is not installed", "onnx")


class _Tensor(NDArrayOperatorsMixin):
    """A tensor of a graph: NumPy's operators and functions of it, of OPERATORS, become nodes."""

    def __init__(self, graph: "_Graph", name: str) -> None:
        self.graph, self.name = graph, name

    def __array_ufunc__(self, function: np.ufunc, method: str, *given: Any) -> Any:
        return self.graph.add(OPERATORS[function], *given)

    def take(self, columns: Any, axis: int = 1) -> Any:
        return self.graph.add("Gather", self, np.asarray(columns, dtype=np.int64), axis=axis)


class _Graph:
    """An ONNX graph under construction; what is no tensor in a node becomes a constant."""

    def __init__(self, onnx: ModuleType) -> None:
        self.onnx, self.kinds = onnx, onnx.TensorProto
        self.nodes: list[Any] = []
        self.count = 0  # of names
        self.constants: dict[tuple[str, tuple[int, ...], bytes], Any] = {}
        self.inputs: list[Any] = []
        self.outputs: list[Any] = []
        self.tensors: dict[int, Any] = {}  # by the id of the array that stands for each in a step

    def add(self, operator: str, *given: Any, name: str | None = None, **attributes: Any) -> Any:
        output = name or self.name(operator.lower())
        names = [each.name if isinstance(each, _Tensor) else self.constant(each) for each in given]
        self.nodes.append(self.onnx.helper.make_node(operator, names, [output], name=output, **attributes))
        return _Tensor(self, output)

    def name(self, what: str) -> str:
        self.count += 1
        return f"{what}_{self.count - 1}"

    def constant(self, values: Any) -> str:
        values = np.asarray(values, order="C")
        key = values.dtype.str, values.shape, values.tobytes()
        if key not in self.constants:
            self.constants[key] = self.onnx.numpy_helper.from_array(values, f"constant_{len(self.constants)}")
        return str(self.constants[key].name)

    def input(self, name: str, *shape: int, text: str) -> Any:
        self.inputs.append(self._described(name, self.kinds.DOUBLE, shape, text))
        return _Tensor(self, name)

    def output(self, tensor: Any, *shape: int, text: str, boolean: bool = False) -> None:
        kind = self.kinds.BOOL if boolean else self.kinds.DOUBLE
        self.outputs.append(self._described(tensor.name, kind, shape, text))

    def _described(self, name: str, kind: int, shape: tuple[int, ...], text: str) -> Any:
        return self.onnx.helper.make_tensor_value_info(name, kind, ["rows", *shape], doc_string=text)

    def loop(self, times: Any, carried: Sequence[Any], body: Callable[..., tuple[Any, list[Any]]]) -> list[Any]:
        """Return what `body` makes of carried float64 tensors, `times` (int64) times or until its claim is false.

        The body takes the number of the step and the tensors; it returns the claim, None for always, and them anew.
        """
        info, kinds = self.onnx.helper.make_tensor_value_info, self.kinds
        outside, self.nodes = self.nodes, []
        step, go, *inside = (_Tensor(self, self.name(what)) for what in ("step", "go", *["carried"] * len(carried)))
        claim, made = body(step, inside)
        made = [self.add("Identity", each) for each in made]
        claim = self.add("Identity", go) if claim is None else claim
        given = [info(step.name, kinds.INT64, []), info(go.name, kinds.BOOL, [])]
        given += [info(each.name, kinds.DOUBLE, None) for each in inside]
        left = [info(claim.name, kinds.BOOL, []), *(info(each.name, kinds.DOUBLE, None) for each in made)]
        graph = self.onnx.helper.make_graph(self.nodes, self.name("body"), given, left)
        self.nodes = outside
        results = [self.name("looped") for _ in carried]
        names = [self.constant(np.int64(times)) if isinstance(times, int) else times.name, self.constant(True)]
        names += [each.name for each in carried]
        self.nodes.append(self.onnx.helper.make_node("Loop", names, results, name=results[0], body=graph))
        return [_Tensor(self, name) for name in results]

    def where(self, claim: Any, one: Any, other: Any, **name: str) -> Any:
        return self.add("Where", claim, one, other, **name)

    def joined(self, parts: Sequence[Any], axis: int = 1) -> Any:
        return self.add("Concat", *parts, axis=axis)

    def stacked(self, parts: Sequence[Any]) -> Any:
        """Return tensors (rows, k) side by side along a third axis."""
        return self.joined([self.add("Unsqueeze", each, np.array([2])) for each in parts], axis=2)

    def all(self, claims: Any) -> Any:
        """Return whether all claims of a row hold: (rows, F) to (rows, 1)."""
        wrong = self.add("Cast", ~claims, to=self.kinds.INT32)
        return self.add("ReduceSum", wrong, np.array([1]), keepdims=1) == np.array(0, dtype=np.int32)

    def model(self, metadata: dict[str, str]) -> Any:
        helper = self.onnx.helper
        graph = helper.make_graph(self.nodes, "calibration", self.inputs, self.outputs, [*self.constants.values()])
        about = {"producer_name": "catenary", "producer_version": __version__, "ir_version": IR_VERSION}
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], **about)
        helper.set_model_props(model, metadata)
        return model


def _finite(x: Any) -> Any:
    return abs(x) < np.inf  # never true for NaN


def _features(graph: _Graph, signals: Any, features: FeatureSet) -> Any:
    """Return all features (rows, F) in the order of FeatureSet, and carry the memory on."""
    parts = [signals]
    if features.midlines:
        parts.append(_midlines(graph, signals, features))
    if features.play:
        names, width = zip(*features.play, strict=True)
        play = graph.input("play", len(width), text=f"play states of {', '.join(names)}; NaN before the first step")
        x = signals.take([features.signals.index(name) for name in names])
        moved = np.minimum(np.maximum(graph.where(_finite(play), play, x), x - width), x + width)
        play = graph.where(_finite(x), moved, play, name="play_next")
        graph.output(play, len(width), text="to be given as `play` at the next step")
        parts.append(play - x)
    if features.friction is not None:
        parts.append(_lags(graph, signals, features, features.friction))
    return graph.joined(parts)


def _midlines(graph: _Graph, signals: Any, features: FeatureSet) -> Any:
    """Return the midlines as features (rows, M), and carry them on: `follow_midlines`."""
    names, positions, *widths = zip(*features.midlines, strict=True)
    radius, travel = map(np.array, widths)
    text = f"position before, stop, means forwards and backwards, of {', '.join(names)}; NaN before the first step"
    midline = graph.input("midline", len(names), STATES, text=text)
    x, s = (signals.take([features.signals.index(name) for name in each]) for each in (positions, names))
    before, stop, *means = (midline.take(k, axis=2) for k in range(STATES))
    first = np.isnan(before)
    moved = graph.where(first, 0.0, x - before)
    stop = np.minimum(np.maximum(graph.where(first, 0.0, stop) + moved, -radius), radius)
    share = 1.0 - np.exp(-(abs(moved) / travel))
    now = [x, stop]
    for reached, mean in zip((stop >= FULL * radius, stop <= -FULL * radius), means, strict=True):
        now.append(graph.where(reached, graph.where(np.isnan(mean), s, mean + share * (s - mean)), mean))
    known = graph.add("Unsqueeze", _finite(x) & _finite(s), np.array([2]))
    midline = graph.where(known, graph.stacked(now), midline, name="midline_next")
    graph.output(midline, len(names), STATES, text="to be given as `midline` at the next step")
    return 0.5 * graph.add("ReduceSum", midline.take([2, 3], axis=2), np.array([2]), keepdims=0)


def _lags(graph: _Graph, signals: Any, features: FeatureSet, states: FrictionStates) -> Any:
    """Return the friction states as features (rows, C n), and carry them on: `rub`, operation by operation."""
    known = states.constants
    (n, m), systems = known.lever.shape, len(known.thresholds)
    text = f"positions before, then forces, of {', '.join(states.positions)}; NaN before the first step"
    friction = graph.input("friction", states.size, text=text)
    x = signals.take([features.signals.index(name) for name in states.positions])
    finite = graph.all(_finite(x))
    fresh = np.isnan(friction.take([0]))
    moved = graph.where(finite, x - graph.where(fresh, x, friction.take(np.arange(n))), 0.0)
    share = graph.add("ReduceMax", abs(moved) / known.longest, axes=[1], keepdims=1)
    whole = np.floor(np.minimum(np.maximum(share, 1.0), 1e6) + 0.999999)
    parts = graph.where(share > 0.0, whole, 0.0)
    steps = graph.add("Reshape", graph.add("ReduceMax", parts, keepdims=0), np.zeros(0, dtype=np.int64))

    def along(matrix: Floats) -> list[list[Any]]:
        own = [moved.take([j]) for j in range(n)]
        return [[own[j] * row[j] / parts for j in range(n)] for row in matrix]

    drive, hold = along(known.directions), along(known.hold)
    mutual, most = known.mutual, known.thresholds.T

    def part(step: Any, forces: list[Any]) -> tuple[None, list[Any]]:
        slip = [sum((mutual[k, i] * forces[i] for i in range(m)), sum(drive[k][1:], drive[k][0])) for k in range(m)]
        s = [np.minimum(np.maximum(sum(hold[k], forces[k]), -most[k]), most[k]) for k in range(m)]
        for k in range(m):
            slip = [slip[i] - mutual[i, k] * s[k] for i in range(m)]
        settled = graph.loop(SWEEPS, [*s, *slip], sweep)
        unfinished = graph.add("Cast", step, to=graph.kinds.DOUBLE) < parts
        return None, [graph.where(unfinished, settled[k], forces[k]) for k in range(m)]

    def sweep(_: Any, state: list[Any]) -> tuple[Any, list[Any]]:
        s, slip, moving = state[:m], state[m:], []
        for k in range(m):
            allowed = np.minimum(np.maximum(s[k] + slip[k] / mutual[k, k], -most[k]), most[k])
            change = allowed - s[k]
            moving.append(graph.add("ReduceMax", abs(change), keepdims=0))
            s = [*s[:k], allowed, *s[k + 1 :]]
            slip = [slip[i] - mutual[i, k] * change for i in range(m)]
        return reduce(np.maximum, moving) > 0.0, [*s, *slip]

    begun = graph.where(fresh, 0.0, friction.take(np.arange(n, states.size)))
    by_element = [begun.take(np.arange(systems) * m + k) for k in range(m)]
    forces: list[Any] = graph.loop(graph.add("Cast", steps, to=graph.kinds.INT64), by_element, part)
    together = graph.add("Reshape", graph.stacked(forces), np.array([-1, systems * m]))
    friction = graph.where(finite, graph.joined([x, together]), friction, name="friction_next")
    graph.output(friction, states.size, text="to be given as `friction` at the next step")
    lags = [reduce(np.subtract, [known.lever[j, k] * forces[k] for k in range(m)], 0.0) for j in range(n)]
    return graph.where(finite, graph.add("Reshape", graph.stacked(lags), np.array([-1, systems * n])), np.nan)


def _monomials(graph: _Graph, _: Any, z: Any, width: int) -> Any:
    i, j = np.triu_indices(width)
    return graph.joined([z, z.take(i) * z.take(j)])


def _distance(graph: _Graph, before: Any, x: Any, lower: Floats, upper: Floats, farthest: Floats) -> Any:
    """Return how far from the middle of a box each row is, (rows, 1), or of the boxes before; see intervals.py."""
    if not len(lower):
        return before
    reach = 0.5 * (upper - lower)
    times = abs(x - (lower + reach)) / reach
    known = graph.where(np.isnan(times), np.zeros(1), times)
    return np.maximum(before, graph.add("ReduceMax", np.minimum(known, farthest), axes=[1], keepdims=1))


# what the steps of a model write, for any number of rows, from what stood there before and their inputs
STEPS: dict[str, Callable[..., Any]] = {
    "take": lambda graph, _, x, columns: x.take(columns),
    "standardise": lambda graph, _, x, mean, scale: (x - mean) / scale,
    "rescale": lambda graph, _, z, scale, mean: z * scale + mean,
    "dense": lambda graph, _, x, weights, bias: graph.add("Gemm", x, weights, bias),
    "monomials": _monomials,
    "tanh": lambda graph, before: np.tanh(before),
    "logistic": lambda graph, before: graph.add("Sigmoid", before),
    "repeat": lambda graph, _, value: value,  # the same numbers for all rows
    "total": lambda graph, _, a, b: a + b,
    "finite": lambda graph, _, x: graph.all(_finite(x)),
    "between": lambda graph, before, x, low, high: before & graph.all((x >= low) & (x <= high)),
    "distance": _distance,
    "errors_of_positions": lambda graph, before, q, joints: before - q.take(joints),
}


def _choice(graph: _Graph, given: Sequence[Any], *, takes_q: bool) -> tuple[Any, Any]:
    """Return corrections and flags of a group's joints, (rows, m) each."""
    error, known, q, joints, offset, reach, lower, upper = given
    inside = known & (abs(error) <= reach[None, joints])
    if takes_q:
        reported = q.take(joints)
        position = reported + error
        inside = inside & (position >= lower[None, joints]) & (position <= upper[None, joints]) & _finite(reported)
    return graph.where(inside, error, offset[joints]), inside


def _half_widths(graph: _Graph, given: Sequence[Any], inside: Any) -> Any:
    """Return the half-widths of a group's joints, (rows, m), from its flags."""
    far, _, _, _, joints, near, edge, (seen, full) = given
    near, edge = near[None, joints], edge[None, joints]
    grown = near + (edge - near) * ((far - seen) / max(full - seen, 1e-300))
    within = graph.where(far <= seen, near, graph.where(far >= full, edge, grown))
    return graph.where(inside, within, edge * np.maximum(far, 1.0))
