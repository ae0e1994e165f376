"""A robot, its actuation and its calibration model as one C header for the control loop of a real robot.

The header's text is c_header.h, a template. Every rigid quantity in it is a traced line (dynamics/symbolic.py) that
kernels/c99.py writes, and so are friction, rotors, springs and known torques: the law stands in no second place.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from typing import Any

import numpy as np
from jinja2 import Environment
from numpy.typing import NDArray

from catenary.calibration.corrector import Corrector
from catenary.calibration.model import CalibrationModel
from catenary.calibration.model_kinds import MODEL_KINDS
from catenary.control.correction import SLOW_TORQUE_S
from catenary.dynamics import symbolic
from catenary.dynamics.actuation_loads import ActuationLoads, known_loads
from catenary.errors import InputError
from catenary.gravity.compact_regressor import compact_regressor
from catenary.kernels.c99 import c_comment, c_function, c_name, c_sines
from catenary.kernels.c_functions import Functions, Value
from catenary.kernels.tracing import evaluate_line
from catenary.plant import Jointed, joints_text
from catenary.robots.model import RobotModel
from catenary.sensing.tool_compensation import tool_line
from catenary.sensing.wrist_tool import WristTool
from catenary.spatial import LEVEL


@dataclass(frozen=True)
class Header:
    """A header's text, and what it holds."""

    text: str
    functions: tuple[str, ...]
    notes: tuple[str, ...]


def c_header(
    model: RobotModel | None,
    calibration: CalibrationModel | None = None,
    *,
    rate_hz: float = 1000.0,
    loads: ActuationLoads | None = None,
    tool: WristTool | None = None,
) -> Header:
    """Write a robot's law of motion, regressors of gravity and joint correction as one self-contained C99 header.
    No memory is allocated, nothing but math.h is called, and it is valid C++11. Where links have masses but no possible
    inertia the law is that of gravity alone; without a robot, or inertia, the header holds the correction alone.

    Args:
        rate_hz: Of the loop that the correction will run in; matters where it is slower than the training rows.
        loads: Friction, rotors, springs and known torques, which the feedforward then includes; those that the robot
            brings, as an identified one does, when None.
        tool: Behind the force/torque sensor at the robot's wrist.
    """
    known: CalibrationModel | RobotModel | None = model if model is not None else calibration
    if known is None:
        raise InputError("C header: expected a robot, a calibration model, or both; got neither")
    if calibration is not None and calibration.kind in MODEL_KINDS and not MODEL_KINDS[calibration.kind].in_c:
        raise InputError(f"C header: a model of kind {calibration.kind} runs in Python only and has no C export")
    name, notes, functions = c_name("model" if model is None else model.name), list[str](), list[str]()
    values: dict[str, Any] = {"name": name, "known": known, "rate_hz": rate_hz, "what": "Calibration model"}
    if model is not None:
        values["what"] = f"Robot {c_comment(model.name)}"
        if loads is not None:
            model.require_inertia()
        if calibration is None:
            model.require_masses()
        if model.missing_inertia:
            notes.append(
                f'robot "{model.name}": no inertia for {", ".join(model.missing_inertia)}, so without gravity and '
                "regressor; the header holds the correction alone"
            )
        else:
            values |= _gravity(model, name)
            functions += ["gravity", "standard_gravity_regressor", *["compact_regressor"] * ("compact" in values)]
        if model.missing_tensor and not model.missing_inertia:
            notes.append(
                f'robot "{model.name}": no possible inertia for {", ".join(model.missing_tensor)}, so gravity and '
                "its regressors alone, without mass matrix, inverse dynamics and feedforward"
            )
        elif not model.missing_inertia:
            loads = known_loads(model) if loads is None else loads
            values |= _motion(model, values["at"], loads)
            remembers = [
                t for t in (() if loads is None else loads.terms) if t.friction is not None and t.friction.memory
            ]
            for kind in sorted({term.kind for term in remembers}):  # one instant does not know what was before
                friction = f"{kind} friction of {', '.join(term.name for term in remembers if term.kind == kind)}"
                notes.append(f"{friction} is written as in steady sliding, where it is Coulomb friction")
            functions += ["mass_matrix", "holding", "inverse_dynamics"]
            functions += [*(["friction", "drives"] if loads is not None else []), "feedforward"]
        if tool is not None:
            model.require_masses()
            values |= {"tool": tool, "tool_load": tool_line(model, tool)}
            functions += ["tool_load", "without_tool"]
    if calibration is not None:
        values |= _correction(calibration, Corrector(calibration, rate_hz=rate_hz), name, rate_hz)
        functions += ["reset", "correct", "interval"]
        notes += [*_other_joints(known, calibration), *calibration.asked_of_reports]
    environment = Environment(trim_blocks=True, keep_trailing_newline=True)
    environment.filters |= {"comment": c_comment, "values": _values, "joints": _joints}
    environment.globals["function"] = partial(c_function, name)
    template = (files("catenary.workflows") / "c_header.h").read_text(encoding="ascii")
    text = environment.from_string(template).render(values)
    return Header(text, tuple(f"{name}_{function}" for function in functions), tuple(notes))


def _gravity(model: RobotModel, name: str) -> dict[str, Any]:
    """Return the header's lines about gravity, and values to check them by."""
    if not np.isfinite(model.coupling).all() or not np.isfinite(model.offset).all():
        raise InputError(f'robot "{model.name}": its coupling holds NaN or infinity')
    gravity, compact = symbolic.gravity_line(model), compact_regressor(model)
    at: dict[str, Any] = {  # a value for every joint, none of them zero
        array: [0.1 * (step * k % 7 + 1) for k in range(model.n)] for step, array in enumerate(("q", "qd", "qdd"), 1)
    }
    at |= {"gravity": LEVEL.tolist(), "omega": [0.1, 0.2, 0.3], "alpha": [0.3, 0.2, 0.1]}
    return {
        "n": model.n,
        "base": "" if model.base == "base" else f" ({c_comment(model.base)})",
        "links": model.link_names,
        "sines": c_sines(name),
        "gravity": gravity,
        "gravity_there": evaluate_line(gravity, q=at["q"], gravity=at["gravity"]),
        "regressor": symbolic.gravity_regressor_line(model),
        "at": at,
        **({"compact": compact} if compact.labels else {}),
    }


def _motion(model: RobotModel, at: dict[str, Any], loads: ActuationLoads | None) -> dict[str, Any]:
    """Return the header's lines about a motion, which needs moments of inertia, and values to check them by."""
    motion = symbolic.inverse_dynamics_line(model)
    values: dict[str, Any] = {
        "mass": symbolic.mass_matrix_line(model),
        "holding": symbolic.holding_line(model),
        "motion": motion,
        "motion_there": evaluate_line(motion, **at),
        "loads": loads,
    }
    if loads is None:
        return values
    smooth = loads.actuation.coulomb_velocity
    how = "has the sign of the speed, and is none at rest"
    if smooth > 0.0:
        how = f"goes through zero as tanh(speed / {smooth!r})"
    effects = ", ".join(f"{term.kind} {term.name}" for term in loads.terms)
    effects += "".join(f", known torque {known.name}" for known in loads.actuation.known_torques)
    return values | {
        "sliding": f"Coulomb friction {how}",
        "effects": effects,
        "friction": symbolic.friction_line(loads),
        "drives": symbolic.drives_line(loads),
    }


def _correction(model: CalibrationModel, corrector: Corrector, name: str, rate_hz: float) -> dict[str, Any]:
    """Return the header's lines about joint correction, with a tick to check it by."""
    n, features = len(model.joint_names), model.features
    q, signals = np.zeros(n), np.zeros(len(features.signals))
    for column, value in zip(model.groups[0].watched, model.groups[0].valid_range.mean, strict=True):
        if column < len(signals):
            signals[column] = value
    out, inside = np.empty(n), np.empty(n, dtype=bool)
    corrector.reset()
    corrector.correct(q, signals, out, inside)
    corrector.reset()
    named = zip(features.signals, features.units, strict=True)
    return {
        "calibration": model,
        "signals": [f"{c_comment(signal)} [{c_comment(unit)}]" for signal, unit in named],
        "slow": SLOW_TORQUE_S if any(signal.startswith("tau:") for signal in features.signals) else None,
        "tick": {"q": q, "signals": signals, "out": out, "inside": inside.astype(float)},
        "correction": c_correction(name, model, rate_hz),
    }


def _other_joints(robot: Jointed, calibration: CalibrationModel) -> list[str]:
    known = set(zip(robot.joint_names, robot.joint_units, strict=True))
    calibrated = zip(calibration.joint_names, calibration.joint_units, strict=True)
    missing = [joint for joint, unit in calibrated if (joint, unit) not in known]
    if not missing:
        return []
    return [
        f"the calibration model's joints {', '.join(missing)} are not the robot's,  {_joints(robot)}; "
        "both are exported independently"
    ]


def _values(numbers: Iterable[float]) -> str:
    """Write numbers so that reading them gives the same ones."""
    return "(" + ", ".join(f"{number:.17g}" for number in numbers) + ")"


def _joints(of: Jointed) -> str:
    return c_comment(joints_text(of))


# Each compiled function of a tick is translated as it stands, and called with one row; arrays become constants, working
# memory, or the state that the caller keeps. Do not compile with -ffast-math, which takes NaN for a number.
_CORRECTION_HEAD = """\
/* What the correction remembers of earlier ticks. */
typedef struct {{
{fields}
}} PREFIX_state;

/* Forget earlier ticks: another motion begins. To be called once before the first tick. */
static inline void PREFIX_reset(PREFIX_state *state) {{
  static const PREFIX_state empty = {{
{values}
  }};
  *state = empty;
}}

/* Half-widths [rad, m] of the intervals about the calibrated positions of the last tick; NAN where there are none. */
static inline const double *PREFIX_interval(const PREFIX_state *state) {{
  return state->interval;
}}

static inline void PREFIX_correct(PREFIX_state *state, const double *q, const double *signals,
                                    double *q_calibrated, int *inside) {{"""


def c_correction(prefix: str, model: CalibrationModel, rate_hz: float | None = None) -> str:
    """Return C: `PREFIX_correct(state, q, signals, q_calibrated, inside)`, `PREFIX_reset` and `PREFIX_interval`."""
    n, memory = len(model.joint_names), model.features.memory()
    q, signals = np.empty((1, n)), np.empty((1, len(model.features.signals)))
    out, inside = np.empty((1, n)), np.empty((1, n), dtype=bool)
    interval = np.full((1, n), np.nan)
    steps = model.tick_steps(memory, q, signals, out, inside, interval, rate_hz=rate_hz)
    state = memory._asdict() | {"interval": interval}
    names = {id(q): "q", id(signals): "signals", id(out): "q_calibrated", id(inside): "inside"}
    names |= {id(array): f"state->{name}" for name, array in state.items()}
    functions, declared, calls = Functions(), list[str](), list[str]()
    for step in steps:
        arrays = (*step.inputs, *step.outputs)
        for array in arrays:
            if id(array) not in names:
                names[id(array)] = f"a{len(declared)}"
                is_constant = not any(array is output for output in step.outputs)
                declared.append(_declared(names[id(array)], array, is_constant=is_constant))
        arguments = [Value(names[id(array)], _kind(array), tuple(map(str, array.shape))) for array in arrays]
        calls.append(f"  {functions.call(step.function, arguments).text};")
    fields = [f"  double {name}[{max(1, array.size)}];" for name, array in state.items()]
    head = _CORRECTION_HEAD.format(
        fields="\n".join(fields), values=",\n".join(f"    {_items(a)}" for a in state.values())
    )
    return "\n".join([*functions.texts, head, *declared, *calls, "}", ""]).replace("PREFIX", prefix)


def _kind(array: NDArray[Any]) -> str:
    return "double" if array.dtype.kind == "f" else "int"


def _items(array: NDArray[Any]) -> str:
    items = ["NAN" if value != value else repr(value) for value in (array + 0).ravel().tolist()] or ["0"]
    return "{" + ",\n    ".join(", ".join(items[k : k + 8]) for k in range(0, len(items), 8)) + "}"


def _declared(name: str, array: NDArray[Any], *, is_constant: bool) -> str:
    declaration = f"{_kind(array)} {name}[{max(1, array.size)}]"
    return f"  static const {declaration} = {_items(array)};" if is_constant else f"  {declaration};"
