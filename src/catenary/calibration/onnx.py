"""A calibration model as an ONNX graph, for programs that run no Python: one step of it, its memory in and out.

The graph computes in float64, like the model: its valid range has narrow bands along directions that hardly moved,
which float32 cannot resolve. Corrections equal the model's to rounding; rows on the very edge of the range may fall on
its other side.
"""

from collections.abc import Callable, Sequence
from functools import reduce
from math import inf
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary import __version__
from catenary.arrays import Floats
from catenary.calibration.arithmetic import Step
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


def to_onnx(model: CalibrationModel, card: Card) -> Any:
    """Return a model as an onnx.ModelProto: one step, for one row or many independent ones, all float64.

    Inputs are `signals` (rows, S) in the order of `model.features.signals`; `q_nominal` (rows, n) [rad|m] where the
    model gives positions or knows joint limits; and `midline` (rows, M, 4), `play` (rows, K), `friction` (rows, L) of
    models with such memory, NaN before the first step. Outputs are `correction`, `inside`, `interval` (rows, n), and
    the memory to be given next, `play_next` and so on. Stepped, the graph gives what `Corrector` gives, but for leaps
    of a joint, which its play states follow: keep them out (spike_filter.py). The metadata `catenary` names signals,
    units and joints as JSON; `card` is the model card.
    """
    onnx = _import_onnx()
    n, features = len(model.joint_names), model.features
    graph = _Graph(onnx)
    graph.input("signals", len(features.signals), text=", ".join(features.signals))
    if model.target == "position" or model.limits is not None:
        graph.input("q_nominal", n, text=f"positions of {', '.join(model.joint_names)}")
    X, q = np.empty((1, len(features.names))), np.empty((1, n))
    graph.names |= {id(X): _features(graph, features), id(q): "q_nominal"}
    interval = None if model.intervals is None else np.empty((1, n))
    wanted = ("correction", "inside") if interval is None else ("correction", "inside", "interval")
    parts_of: dict[str, list[str]] = {name: [] for name in wanted}
    for step in model.steps(X, q, np.empty((1, n)), np.empty((1, n), dtype=bool), interval):
        if step.function.__name__ == "choose":
            correction, inside = _choice(graph, step, model)
            parts_of["correction"].append(correction)
            parts_of["inside"].append(inside)
        elif step.function.__name__ == "widen":
            parts_of["interval"].append(_half_widths(graph, step, parts_of["inside"][-1]))
        else:
            graph.names[id(step.outputs[0])] = _written(graph, step)
    order = np.argsort([j for group in model.groups for j in group.joints])
    for name, parts in parts_of.items():
        together = graph.add("Concat", *parts, axis=1)
        graph.add("Gather", together, graph.constant(order), axis=1, name=name)
    graph.output("correction", n, text="to be added to q_nominal, in rad and m")
    graph.output("inside", n, boolean=True, text="whether each joint is in the model's valid range")
    if model.intervals is not None:
        held = f"{100.0 * model.intervals.level:g} % of errors"
        graph.output("interval", n, text=f"half-width that is to hold {held}, in rad and m")
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


class _Graph:
    """An ONNX graph under construction; methods that add a node return the name of its output tensor."""

    def __init__(self, onnx: ModuleType) -> None:
        self.onnx = onnx
        self.nodes: list[Any] = []
        self.count = 0  # of names
        self.constants: list[Any] = []
        self.inputs: list[Any] = []
        self.outputs: list[Any] = []
        self.names: dict[int, str] = {}  # of tensors, by the id of the array that stands for it in a step

    def add(self, operator: str, *inputs: str, name: str | None = None, **attributes: Any) -> str:
        output = name or self.name(operator.lower())
        node = self.onnx.helper.make_node(operator, list(inputs), [output], name=output, **attributes)
        self.nodes.append(node)
        return output

    def name(self, what: str) -> str:
        self.count += 1
        return f"{what}_{self.count - 1}"

    def loop(
        self, times: str, carried: Sequence[str], body: Callable[[str, list[str]], tuple[str | None, list[str]]]
    ) -> list[str]:
        """Return what `body` makes of carried float64 tensors, `times` (int64) times or until its claim is false.

        The body takes the number of the step and the tensors; it returns the claim, None for always, and them anew.
        """
        helper, kinds = self.onnx.helper, self.onnx.TensorProto
        outside, self.nodes = self.nodes, []
        step, go = self.name("step"), self.name("go")
        inside = [self.name("carried") for _ in carried]
        claim, made = body(step, inside)
        made = [self.add("Identity", each) for each in made]
        claim = self.add("Identity", go) if claim is None else claim
        scalars = [
            helper.make_tensor_value_info(name, kind, [])
            for name, kind in ((step, kinds.INT64), (go, kinds.BOOL), (claim, kinds.BOOL))
        ]
        given, left = ([helper.make_tensor_value_info(n, kinds.DOUBLE, None) for n in each] for each in (inside, made))
        graph = helper.make_graph(self.nodes, self.name("body"), [*scalars[:2], *given], [scalars[2], *left])
        self.nodes = outside
        results = [self.name("looped") for _ in carried]
        always = self.constant(np.array(True))
        self.nodes.append(helper.make_node("Loop", [times, always, *carried], results, name=results[0], body=graph))
        return results

    def constant(self, values: Any) -> str:
        name = f"constant_{len(self.constants)}"
        self.constants.append(self.onnx.numpy_helper.from_array(np.asarray(values, order="C"), name))
        return name

    def input(self, name: str, *shape: int, text: str) -> str:
        self.inputs.append(self._tensor(name, self.onnx.TensorProto.DOUBLE, shape, text))
        return name

    def output(self, name: str, *shape: int, text: str, boolean: bool = False) -> None:
        kind = self.onnx.TensorProto.BOOL if boolean else self.onnx.TensorProto.DOUBLE
        self.outputs.append(self._tensor(name, kind, shape, text))

    def _tensor(self, name: str, kind: int, shape: tuple[int, ...], text: str) -> Any:
        return self.onnx.helper.make_tensor_value_info(name, kind, ["rows", *shape], doc_string=text)

    def take(self, x: str, columns: Any, axis: int = 1) -> str:
        return self.add("Gather", x, self.constant(np.asarray(columns, dtype=np.int64)), axis=axis)

    def finite(self, x: str) -> str:
        return self.add("Less", self.add("Abs", x), self.constant(np.array(inf)))  # never true for NaN

    def all(self, claims: str) -> str:
        """Return whether all claims of a row hold: (rows, F) to (rows, 1)."""
        wrong = self.add("Cast", self.add("Not", claims), to=self.onnx.TensorProto.INT32)
        count = self.add("ReduceSum", wrong, self.constant(np.array([1])), keepdims=1)
        return self.add("Equal", count, self.constant(np.array(0, dtype=np.int32)))

    def tensor(self, array: NDArray[Any]) -> str:
        """Return the tensor that an array of a step is: one that was written before, or a constant."""
        if id(array) not in self.names:
            self.names[id(array)] = self.constant(array)
        return self.names[id(array)]

    def model(self, metadata: dict[str, str]) -> Any:
        helper = self.onnx.helper
        graph = helper.make_graph(self.nodes, "calibration", self.inputs, self.outputs, self.constants)
        about = {"producer_name": "catenary", "producer_version": __version__, "ir_version": IR_VERSION}
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], **about)
        helper.set_model_props(model, metadata)
        return model


def _features(graph: _Graph, features: FeatureSet) -> str:
    """Return all features (rows, F) in the order of FeatureSet, and carry the memory on."""
    parts = ["signals"]
    if features.midlines:
        parts.append(_midlines(graph, features))
    if features.play:
        names, width = zip(*features.play, strict=True)
        half = graph.constant(np.array(width))
        graph.input("play", len(width), text=f"play states of {', '.join(names)}; NaN before the first step")
        x = graph.take("signals", [features.signals.index(name) for name in names])
        begun = graph.add("Where", graph.finite("play"), "play", x)
        low, high = graph.add("Sub", x, half), graph.add("Add", x, half)
        moved = graph.add("Min", graph.add("Max", begun, low), high)
        graph.add("Where", graph.finite(x), moved, "play", name="play_next")
        graph.output("play_next", len(width), text="to be given as `play` at the next step")
        parts.append(graph.add("Sub", "play_next", x))
    if features.friction is not None:
        parts.append(_lags(graph, features, features.friction))
    return graph.add("Concat", *parts, axis=1)


def _midlines(graph: _Graph, features: FeatureSet) -> str:
    """Return the midlines as features (rows, M), and carry them on: `follow_midlines`."""
    names, positions, radii, travels = zip(*features.midlines, strict=True)
    add, number = graph.add, graph.constant
    text = f"position before, stop, means forwards and backwards, of {', '.join(names)}; NaN before the first step"
    graph.input("midline", len(names), STATES, text=text)
    x, s = (graph.take("signals", [features.signals.index(name) for name in each]) for each in (positions, names))
    before, stop, up, down = (
        add("Gather", "midline", number(np.array(k, dtype=np.int64)), axis=2) for k in range(STATES)
    )
    zero, first = number(np.array(0.0)), add("IsNaN", before)
    moved = add("Where", first, zero, add("Sub", x, before))
    radius, edge = number(np.array(radii)), number(FULL * np.array(radii))
    stop_now = add("Add", add("Where", first, zero, stop), moved)
    stop_now = add("Min", add("Max", stop_now, add("Neg", radius)), radius)
    travel = add("Div", add("Abs", moved), number(np.array(travels)))
    share = add("Sub", number(np.array(1.0)), add("Exp", add("Neg", travel)))
    sides = (add("GreaterOrEqual", stop_now, edge), add("LessOrEqual", stop_now, add("Neg", edge)))
    means = []
    for reached, mean in zip(sides, (up, down), strict=True):
        later = add("Add", mean, add("Mul", share, add("Sub", s, mean)))
        means.append(add("Where", reached, add("Where", add("IsNaN", mean), s, later), mean))
    axis = number(np.array([2]))
    together = add("Concat", *(add("Unsqueeze", each, axis) for each in (x, stop_now, *means)), axis=2)
    known = add("Unsqueeze", add("And", graph.finite(x), graph.finite(s)), axis)
    add("Where", known, together, "midline", name="midline_next")
    graph.output("midline_next", len(names), STATES, text="to be given as `midline` at the next step")
    both = add("ReduceSum", graph.take("midline_next", [2, 3], axis=2), number(np.array([2])), keepdims=0)
    return add("Mul", both, number(np.array(0.5)))


def _lags(graph: _Graph, features: FeatureSet, states: FrictionStates) -> str:
    """Return the friction states as features (rows, C n), and carry them on: `rub`, operation by operation."""
    known, add = states.constants, graph.add
    (n, m), systems = known.lever.shape, len(known.thresholds)
    number = graph.constant
    text = f"positions before, then forces, of {', '.join(states.positions)}; NaN before the first step"
    graph.input("friction", states.size, text=text)
    x = graph.take("signals", [features.signals.index(name) for name in states.positions])
    finite = graph.all(graph.finite(x))
    fresh = add("IsNaN", graph.take("friction", [0]))
    zero, one = number(np.array(0.0)), number(np.array(1.0))
    moved = add("Sub", x, add("Where", fresh, x, graph.take("friction", np.arange(n))))
    moved = add("Where", finite, moved, zero)
    share = add("ReduceMax", add("Div", add("Abs", moved), number(known.longest)), axes=[1], keepdims=1)
    whole = add("Min", add("Max", share, one), number(np.array(1e6)))
    whole = add("Floor", add("Add", whole, number(np.array(0.999999))))
    parts = add("Where", add("Greater", share, zero), whole, zero)
    steps = add("Reshape", add("ReduceMax", parts, keepdims=0), number(np.zeros(0, dtype=np.int64)))

    def along(matrix: Floats) -> list[list[str]]:
        own = [graph.take(moved, [j]) for j in range(n)]
        return [[add("Div", add("Mul", own[j], number(row[j])), parts) for j in range(n)] for row in matrix]

    def in_turn(operator: str, first: str, others: Sequence[str]) -> str:
        return reduce(lambda left, right: add(operator, left, right), others, first)

    drive, hold = along(known.directions), along(known.hold)
    mutual = [[number(each) for each in row] for row in known.mutual]
    most = [number(known.thresholds[:, k]) for k in range(m)]
    least = [number(-known.thresholds[:, k]) for k in range(m)]

    def bounded(k: int, force: str) -> str:
        return add("Min", add("Max", force, least[k]), most[k])

    def part(step: str, forces: list[str]) -> tuple[None, list[str]]:
        slip = [
            in_turn("Add", drive[k][0], [*drive[k][1:], *(add("Mul", mutual[k][i], forces[i]) for i in range(m))])
            for k in range(m)
        ]
        s = [bounded(k, in_turn("Add", forces[k], hold[k])) for k in range(m)]
        for k in range(m):
            slip = [add("Sub", slip[i], add("Mul", mutual[i][k], s[k])) for i in range(m)]
        settled = graph.loop(number(np.array(SWEEPS)), [*s, *slip], sweep)
        unfinished = add("Less", add("Cast", step, to=graph.onnx.TensorProto.DOUBLE), parts)
        return None, [add("Where", unfinished, settled[k], forces[k]) for k in range(m)]

    def sweep(_: str, state: list[str]) -> tuple[str, list[str]]:
        s, slip, moving = state[:m], state[m:], []
        for k in range(m):
            allowed = bounded(k, add("Add", s[k], add("Div", slip[k], mutual[k][k])))
            change = add("Sub", allowed, s[k])
            moving.append(add("ReduceMax", add("Abs", change), keepdims=0))
            s = [*s[:k], allowed, *s[k + 1 :]]
            slip = [add("Sub", slip[i], add("Mul", mutual[i][k], change)) for i in range(m)]
        return add("Greater", in_turn("Max", moving[0], moving[1:]), zero), [*s, *slip]

    begun = add("Where", fresh, zero, graph.take("friction", np.arange(n, states.size)))
    by_element = [graph.take(begun, np.arange(systems) * m + k) for k in range(m)]
    forces = graph.loop(add("Cast", steps, to=graph.onnx.TensorProto.INT64), by_element, part)
    axis = number(np.array([2]))
    flat = number(np.array([-1, systems * m]))
    together = add("Reshape", add("Concat", *(add("Unsqueeze", each, axis) for each in forces), axis=2), flat)
    add("Where", finite, add("Concat", x, together, axis=1), "friction", name="friction_next")
    graph.output("friction_next", states.size, text="to be given as `friction` at the next step")
    lags = [
        in_turn("Sub", zero, [add("Mul", number(known.lever[j, k]), forces[k]) for k in range(m)]) for j in range(n)
    ]
    flat = number(np.array([-1, systems * n]))
    together = add("Reshape", add("Concat", *(add("Unsqueeze", each, axis) for each in lags), axis=2), flat)
    return add("Where", finite, together, number(np.array(np.nan)))


def _written(graph: _Graph, step: Step) -> str:
    """Write a step of arithmetic.py for any number of rows; return the tensor that its output then is."""
    given, add = [graph.tensor(array) for array in step.inputs], graph.add
    before = graph.names.get(id(step.outputs[0]), "")  # what a step in place goes on from
    match step.function.__name__:
        case "take":
            return add("Gather", *given, axis=1)
        case "standardise":
            return add("Div", add("Sub", *given[:2]), given[2])
        case "rescale":
            return add("Add", add("Mul", *given[:2]), given[2])
        case "dense":
            return add("Gemm", *given)
        case "monomials":
            i, j = np.triu_indices(step.inputs[0].shape[1])
            products = add("Mul", graph.take(given[0], i), graph.take(given[0], j))
            return add("Concat", given[0], products, axis=1)
        case "tanh":
            return add("Tanh", before)
        case "logistic":
            return add("Sigmoid", before)
        case "repeat":
            return given[0]  # the same numbers for all rows
        case "total":
            return add("Add", *given)
        case "finite":
            return graph.all(graph.finite(given[0]))
        case "between":
            above, below = add("GreaterOrEqual", *given[:2]), add("LessOrEqual", given[0], given[2])
            return add("And", before, graph.all(add("And", above, below)))
        case "distance":
            return _distance(graph, step, before)
        case "errors_of_positions":
            return add("Sub", before, add("Gather", *given, axis=1))
        case name:
            raise InputError(f"model: its step {name} has no ONNX graph")


def _choice(graph: _Graph, step: Step, model: CalibrationModel) -> tuple[str, str]:
    """Write the last step of a group; return corrections and flags of its joints, (rows, m) each."""
    prediction, known, q, joints, offset, reach, lower, upper = step.inputs
    add, error = graph.add, graph.tensor(prediction)
    believed = add("LessOrEqual", add("Abs", error), graph.constant(reach[None, joints]))
    inside = add("And", graph.tensor(known), believed)
    if model.target == "position" or model.limits is not None:
        reported = graph.take(graph.tensor(q), joints)
        position = add("Add", reported, error)
        for operator, limit in (("GreaterOrEqual", lower), ("LessOrEqual", upper)):
            inside = add("And", inside, add(operator, position, graph.constant(limit[None, joints])))
        inside = add("And", inside, graph.finite(reported))
    return add("Where", inside, error, graph.constant(offset[joints])), inside


def _distance(graph: _Graph, step: Step, before: str) -> str:
    """Write how far from the middle of a box each row is, (rows, 1), or of the boxes before; see intervals.py."""
    X, lower, upper, farthest = step.inputs
    if not len(lower):
        return before
    reach, add = 0.5 * (upper - lower), graph.add
    away = add("Abs", add("Sub", graph.tensor(X), graph.constant(lower + reach)))
    times = add("Div", away, graph.constant(reach))
    known = add("Where", add("IsNaN", times), graph.constant(np.zeros(1)), times)
    largest = add("ReduceMax", add("Min", known, graph.constant(farthest)), axes=[1], keepdims=1)
    return add("Max", before, largest)


def _half_widths(graph: _Graph, step: Step, inside: str) -> str:
    """Write the half-widths of a group's joints, (rows, m), from its flags."""
    far, _, _, _, joints, near, edge, reach = step.inputs
    add, at, at_edge = graph.add, graph.tensor(far), graph.constant(edge[None, joints])
    seen, full = (graph.constant(np.array([[each]])) for each in reach.tolist())
    share = add("Div", add("Sub", at, seen), graph.constant(np.array([[max(reach[1] - reach[0], 1e-300)]])))
    grown = add("Mul", graph.constant((edge - near)[None, joints]), share)
    margin = add(
        "Where", add("GreaterOrEqual", at, full), at_edge, add("Add", graph.constant(near[None, joints]), grown)
    )
    within = add("Where", add("LessOrEqual", at, seen), graph.constant(near[None, joints]), margin)
    beyond = add("Mul", at_edge, add("Max", at, graph.constant(np.ones((1, 1)))))
    return add("Where", inside, within, beyond)
