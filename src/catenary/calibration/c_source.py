"""Writes a calibration model as C99, which is C++ too: what `Corrector` does in a tick, without memory of its own.

Each compiled function of the tick is translated as it stands, and called with one row; arrays become constants, working
memory, or the state that the caller keeps. The C compiler must not be told -ffast-math, which takes NaN for a number.
Results agree with Python's to rounding.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.calibration.model import CalibrationModel
from catenary.kernels.c_functions import Functions, Value

_HEAD = """\
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
        given = [Value(names[id(array)], _kind(array), tuple(map(str, array.shape))) for array in arrays]
        calls.append(f"  {functions.call(step.function, given).text};")
    fields = [f"  double {name}[{max(1, array.size)}];" for name, array in state.items()]
    head = _HEAD.format(fields="\n".join(fields), values=",\n".join(f"    {_items(a)}" for a in state.values()))
    return "\n".join([*functions.texts, head, *declared, *calls, "}", ""]).replace("PREFIX", prefix)


def _kind(array: NDArray[Any]) -> str:
    return "double" if array.dtype.kind == "f" else "int"


def _items(array: NDArray[Any]) -> str:
    """Return the initialiser of an array."""
    items = ["NAN" if value != value else repr(value) for value in (array + 0).ravel().tolist()] or ["0"]
    return "{" + ",\n    ".join(", ".join(items[k : k + 8]) for k in range(0, len(items), 8)) + "}"


def _declared(name: str, array: NDArray[Any], *, is_constant: bool) -> str:
    """Return the declaration of a constant, or of working memory."""
    declaration = f"{_kind(array)} {name}[{max(1, array.size)}]"
    return f"  static const {declaration} = {_items(array)};" if is_constant else f"  {declaration};"
