"""Writes a calibration model as C99, which is C++ too: what `Corrector` does in a tick, without memory of its own.

Each step of the tick becomes a call of a C function of the same name as the one in arithmetic.py, for one row; arrays
become constants, working memory, or the state that the caller keeps. The C compiler must not be told -ffast-math, which
takes NaN for a number. Results agree with Python's to rounding.
"""

import inspect
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.calibration.arithmetic import Step
from catenary.calibration.midline import FULL, STATES
from catenary.calibration.model import CalibrationModel
from catenary.calibration.spike_filter import CONFIRM, FADE, FAST, SEVERAL
from catenary.errors import InputError
from catenary.transmission.coupled_friction import SWEEPS


def _each(array: str, statement: str) -> str:
    return f"int k;\nfor (k = 0; k < {array}_size; ++k) {statement}"


# by name of the compiled function, in terms of its arguments; X_size is the length of X
BODIES = {
    "take": _each("columns", "Y[k] = X[columns[k]];"),
    "standardise": _each("mean", "Z[k] = (X[k] - mean[k]) / scale[k];"),
    "rescale": _each("mean", "Y[k] = Z[k] * scale[k] + mean[k];"),
    "dense": """\
int i, k;
for (k = 0; k < bias_size; ++k) Y[k] = bias[k];
for (i = 0; i < X_size; ++i)
  for (k = 0; k < bias_size; ++k) Y[k] += X[i] * weights[i * bias_size + k];""",
    "monomials": """\
int i, j, at = Z_size;
for (i = 0; i < Z_size; ++i) P[i] = Z[i];
for (i = 0; i < Z_size; ++i)
  for (j = i; j < Z_size; ++j) P[at++] = Z[i] * Z[j];""",
    "tanh": """\
int k;
for (k = 0; k < Z_size; ++k) {
  const double e = PREFIX_expm1(2.0 * (Z[k] < -20.0 ? -20.0 : Z[k] > 20.0 ? 20.0 : Z[k]));
  Z[k] = e / (e + 2.0);
}""",
    "logistic": """\
int k;
for (k = 0; k < Z_size; ++k) {
  const double e = PREFIX_expm1(Z[k] < -40.0 ? -40.0 : Z[k] > 40.0 ? 40.0 : Z[k]);
  Z[k] = (e + 1.0) / (e + 2.0);
}""",
    "repeat": _each("value", "Y[k] = value[k];"),
    "total": _each("A", "Y[k] = A[k] + B[k];"),
    "finite": "inside[0] = 1;\n{\n" + _each("X", "inside[0] &= PREFIX_is_finite(X[k]);") + "\n}",
    "between": _each("X", "inside[0] &= X[k] >= lower[k] && X[k] <= upper[k];"),
    "errors_of_positions": _each("joints", "prediction[k] -= q[joints[k]];"),
    "choose": """\
int k;
for (k = 0; k < joints_size; ++k) {
  const int joint = joints[k];
  const double error = prediction[k], position = q[joint] + error;
  const int trusted = known[0] && PREFIX_is_finite(q[joint]) && fabs(error) <= reach[joint] &&
                      lower[joint] <= position && position <= upper[joint];
  correction[joint] = trusted ? prediction[k] : offset[joint];
  inside[joint] = trusted;
}""",
    "distance": """\
int k;
for (k = 0; k < lower_size; ++k) {
  const double reach = 0.5 * (upper[k] - lower[k]);
  const double away = fabs(X[k] - (lower[k] + reach));
  if (away > far[0] * reach) far[0] = away < farthest[0] * reach ? away / reach : farthest[0];
}""",
    "widen": """\
int k;
for (k = 0; k < joints_size; ++k) {
  const int joint = joints[k];
  if (!inside[joint] || leaping[0])
    interval[joint] = PREFIX_is_finite(q[joint]) ? edge[joint] * (far[0] > 1.0 ? far[0] : 1.0) : NAN;
  else if (far[0] <= reach[0])
    interval[joint] = near[joint];
  else if (far[0] >= reach[1])
    interval[joint] = edge[joint];
  else
    interval[joint] = near[joint] + (edge[joint] - near[joint]) * ((far[0] - reach[0]) / (reach[1] - reach[0]));
}""",
    "find_leaps": """\
double fast = 0.0;
int j;
leaping[0] = 0;
for (j = 0; j < joints_size; ++j) {
  const double q = signals[joints[j]];
  double *of = seen + 3 * j, step;
  course[j] = PREFIX_AWAY;
  of[2] += room[0];
  if (!PREFIX_is_finite(q)) continue;
  step = fabs(q - of[0]);
  if (step > limits[j] * of[2]) {
    of[1] += 1.0;
    if (of[1] < CONFIRM) {
      leaping[0] = 1;
      continue;
    }
    course[j] = PREFIX_ON;
  } else {
    course[j] = of[1] > 0.0 ? PREFIX_BACK : PREFIX_ON;
    rejected[j] += of[1];
  }
  if (step > FAST * limits[j] * of[2]) fast = 1.0;
  of[0] = q;
  of[1] = of[2] = 0.0;
}
strange[0] = FADE * strange[0] + fast;
if (strange[0] >= SEVERAL) {
  leaping[0] = 1;
  for (j = 0; j < joints_size; ++j) {
    const double q = signals[joints[j]];
    course[j] = PREFIX_ANOTHER;
    if (!PREFIX_is_finite(q)) continue;
    seen[3 * j] = q;
    seen[3 * j + 1] = seen[3 * j + 2] = 0.0;
  }
}""".replace("CONFIRM", str(CONFIRM))
    .replace("FAST", str(FAST))
    .replace("FADE", str(FADE))
    .replace("SEVERAL", str(SEVERAL)),
    "gather": """\
int k, at = signals_size;
for (k = 0; k < signals_size; ++k) X[k] = signals[k];
for (k = 0; k < owners_size; ++k) {
  const double position = signals[played[owners[k]]];
  const int what = course[owners[k]];
  if (PREFIX_is_finite(position)) {
    const double before = what == PREFIX_BACK ? kept[k] : play[k];
    followed[k] = PREFIX_after(followed[k], position, widths[k]);
    play[k] = what == PREFIX_ANOTHER ? followed[k] : PREFIX_after(before, position, widths[k]);
    if (what != PREFIX_AWAY) kept[k] = play[k];
  }
  X[skipped[0] + at++] = play[k] - position;
}""",
    "follow_midlines": """\
int i;
for (i = 0; i < sources_size; ++i) {
  const double x = signals[places[i]], s = signals[sources[i]];
  double *const of = midline + STATES * i;
  if (PREFIX_is_finite(x) && PREFIX_is_finite(s) && course[owners[i]] != PREFIX_AWAY) {
    const int first = of[0] != of[0];
    const double moved = first ? 0.0 : x - of[0], radius = radii[i];
    const double far = (first ? 0.0 : of[1]) + moved, stop = far < -radius ? -radius : far > radius ? radius : far;
    const int side = stop >= FULL * radius ? 2 : stop <= -FULL * radius ? 3 : 0;
    of[0] = x;
    of[1] = stop;
    if (side > 0) {
      const double travel = fabs(moved) / travels[i];
      const double share = -PREFIX_expm1(-(travel < 40.0 ? travel : 40.0));
      of[side] = of[side] != of[side] ? s : of[side] + share * (s - of[side]);
    }
  }
  X[at[0] + i] = 0.5 * (of[2] + of[3]);
}""".replace("FULL", str(FULL)).replace("STATES", str(STATES)),
    "rub": """\
const int n = places_size, m = slip_size, systems = thresholds_size / slip_size, size = n + systems * m;
int finite = 1, away = 0, back = 0, another = 0, c, j, k, version;
for (j = 0; j < n; ++j) {
  const int what = course[owners[j]];
  position[j] = signals[places[j]];
  if (!PREFIX_is_finite(position[j])) finite = 0;
  if (what == PREFIX_AWAY) away = 1;
  if (what == PREFIX_BACK) back = 1;
  if (what == PREFIX_ANOTHER) another = 1;
}
for (version = 2; finite && version >= 0; version -= 2) {
  double *const state = friction + version * size;
  int parts;
  double share = 0.0;
  if (version == 0 && another) {
    for (k = 0; k < size; ++k) state[k] = friction[2 * size + k];
    break;
  }
  if (version == 0 && back)
    for (k = 0; k < size; ++k) state[k] = friction[size + k];
  if (state[0] != state[0])
    for (k = 0; k < size; ++k) state[k] = k < n ? position[k] : 0.0;
  for (j = 0; j < n; ++j) {
    moved[j] = position[j] - state[j];
    state[j] = position[j];
    if (fabs(moved[j]) / longest[j] > share) share = fabs(moved[j]) / longest[j];
  }
  parts = share > 0.0 ? (int)((share < 1.0 ? 1.0 : share < 1e6 ? share : 1e6) + 0.999999) : 0;
  for (c = 0; c < systems; ++c)
    PREFIX_drag(n, m, parts, moved, directions, mutual, hold, thresholds + c * m, state + n + c * m, slip);
}
if (finite && !away)
  for (k = 0; k < size; ++k) friction[size + k] = friction[k];
for (c = 0; c < systems; ++c)
  for (j = 0; j < n; ++j) {
    double lag = finite ? 0.0 : NAN;
    for (k = 0; k < m; ++k) lag -= lever[j * m + k] * friction[n + c * m + k];
    X[at[0] + c * n + j] = lag;
  }""",
}
HELPERS = """\
static inline int PREFIX_is_finite(double x) {
  return x - x == 0.0;
}

/* What a row is to a joint: its motion goes on; perhaps a spike; back from one; part of another motion. */
enum { PREFIX_ON, PREFIX_AWAY, PREFIX_BACK, PREFIX_ANOTHER };

/* A play state after its position moved; NAN, before the first, becomes that position. */
static inline double PREFIX_after(double state, double position, double width) {
  const double y = state == state ? state : position, low = position - width, high = position + width;
  return y < low ? low : y > high ? high : y;
}

/* Friction forces after motors moved along a line: coupled_friction.py's drag, cable_friction.py's coulomb_coupled. */
static inline void PREFIX_drag(int n, int m, int parts, const double *moved, const double *directions,
                               const double *mutual, const double *hold, const double *most, double *forces,
                               double *slip) {
  int part, sweep, settled, i, j, k;
  for (part = 0; part < parts; ++part) {
    for (k = 0; k < m; ++k) {
      slip[k] = 0.0;
      for (j = 0; j < n; ++j) slip[k] = slip[k] + directions[k * n + j] * moved[j] / parts;
      for (i = 0; i < m; ++i) slip[k] = slip[k] + mutual[k * m + i] * forces[i];
    }
    for (k = 0; k < m; ++k)
      for (j = 0; j < n; ++j) forces[k] = forces[k] + hold[k * n + j] * moved[j] / parts;
    for (k = 0; k < m; ++k) {
      forces[k] = forces[k] < -most[k] ? -most[k] : forces[k] > most[k] ? most[k] : forces[k];
      for (i = 0; i < m; ++i) slip[i] = slip[i] - mutual[i * m + k] * forces[k];
    }
    for (sweep = 0, settled = 0; sweep < SWEEPS && !settled; ++sweep) {
      settled = 1;
      for (k = 0; k < m; ++k) {
        const double wanted = forces[k] + slip[k] / mutual[k * m + k];
        const double allowed = wanted < -most[k] ? -most[k] : wanted > most[k] ? most[k] : wanted;
        const double change = allowed - forces[k];
        if (change == 0.0) continue;
        settled = 0;
        forces[k] = allowed;
        for (i = 0; i < m; ++i) slip[i] = slip[i] - mutual[i * m + k] * change;
      }
    }
  }
}

/* exp(v) - 1 for |v| <= 40 */
static inline double PREFIX_expm1(double v) {
  const double t = v * 0.015625;
  double e = 1.0 / 40320.0 + t * (1.0 / 362880.0);
  int i;
  e = 1.0 / 720.0 + t * (1.0 / 5040.0 + t * e);
  e = 1.0 / 24.0 + t * (1.0 / 120.0 + t * e);
  e = t * (1.0 + t * (0.5 + t * (1.0 / 6.0 + t * e)));
  for (i = 0; i < 6; ++i) e = e * (2.0 + e);
  return e;
}
""".replace("SWEEPS", str(SWEEPS))
STATE = """\
/* What the correction remembers of earlier ticks. */
typedef struct {{
  double play[{play}];
  double kept[{kept}]; /* play states before a leap */
  double followed[{followed}]; /* play states that followed every position */
  double midline[{midline}]; /* of each midline: position before, stop, means forwards and backwards */
  double friction[{friction}]; /* friction states: now, before a leap, and of every position */
  double seen[{seen}];
  double strange[1]; /* steps of another motion than that of training, as far as they are remembered */
  double rejected[{rejected}]; /* rows that were spikes, of the joints that play states follow */
  double interval[{interval}]; /* half-widths about the calibrated positions of the last tick */
}} PREFIX_state;

/* Forget earlier ticks: another motion begins. To be called once before the first tick. */
static inline void PREFIX_reset(PREFIX_state *state) {{
  int i;
  for (i = 0; i < {play}; ++i) state->play[i] = state->kept[i] = state->followed[i] = NAN;
  for (i = 0; i < {midline}; ++i) state->midline[i] = NAN;
  for (i = 0; i < {friction}; ++i) state->friction[i] = NAN;
  for (i = 0; i < {seen}; ++i) state->seen[i] = i % 3 ? 0.0 : NAN;
  state->strange[0] = 0.0;
  for (i = 0; i < {rejected}; ++i) state->rejected[i] = 0.0;
  for (i = 0; i < {interval}; ++i) state->interval[i] = NAN;
}}

/* Half-widths [rad, m] of the intervals about the calibrated positions of the last tick; NAN where there are none. */
static inline const double *PREFIX_interval(const PREFIX_state *state) {{
  return state->interval;
}}
"""
CORRECT = """\
static inline void PREFIX_correct(PREFIX_state *state, const double *q, const double *signals,
                                    double *q_calibrated, int *inside) {"""


def c_correction(prefix: str, model: CalibrationModel, rate_hz: float | None = None) -> str:
    """Return C that defines `PREFIX_correct(state, q, signals, q_calibrated, inside)` and `PREFIX_reset(state)`.

    `PREFIX_interval(state)` gives the half-widths of the last tick's intervals.
    """
    n, memory = len(model.joint_names), model.features.memory()
    q, signals = np.empty((1, n)), np.empty((1, len(model.features.signals)))
    out, inside = np.empty((1, n)), np.empty((1, n), dtype=bool)
    interval = np.empty((1, n))
    steps = model.tick_steps(memory, q, signals, out, inside, interval, rate_hz=rate_hz)
    names = {id(q): "q", id(signals): "signals", id(out): "q_calibrated", id(inside): "inside"}
    names[id(interval)] = "state->interval"
    names |= {id(array): f"state->{name}" for name, array in memory._asdict().items()}
    declared: list[str] = []
    calls: list[str] = []
    for step in steps:
        for array in (*step.inputs, *step.outputs):
            if id(array) not in names:
                names[id(array)] = f"a{len(declared)}"
                written = any(array is output for output in step.outputs)
                declared.append(_declared(names[id(array)], array, constant=not written))
        calls.append(_call(step, names))
    functions = {step.function.__name__: _function(step) for step in steps}
    sizes = {name: max(1, array.size) for name, array in memory._asdict().items()} | {"interval": n}
    state = STATE.format(**sizes)
    text = [HELPERS, *functions.values(), state, CORRECT, *declared, *calls, "}", ""]
    return "\n".join(text).replace("PREFIX", prefix)


def _function(step: Step) -> str:
    """Return the C function of a step's name, for one row."""
    arguments = []
    for argument, array, has_size in _arguments(step):
        read_only = "const " if any(array is each for each in step.inputs) else ""
        arguments.append(f"{read_only}{_kind(array)} *{argument}")
        arguments += [f"int {argument}_size"] * has_size
    name, lines = step.function.__name__, BODIES[step.function.__name__].replace("\n", "\n  ")
    return f"static inline void PREFIX_{name}({', '.join(arguments)}) {{\n  {lines}\n}}\n"


def _call(step: Step, names: dict[int, str]) -> str:
    arguments = []
    for _, array, has_size in _arguments(step):
        arguments += [names[id(array)], *([str(array.size)] * has_size)]
    return f"  PREFIX_{step.function.__name__}({', '.join(arguments)});"


def _arguments(step: Step) -> list[tuple[str, NDArray[Any], bool]]:
    """Return name and array of each argument, and whether its size is an argument too."""
    name = step.function.__name__
    if name not in BODIES:
        raise InputError(f"model: its step {name} cannot be written as C")
    names = inspect.signature(step.function).parameters
    arrays = zip(names, (*step.inputs, *step.outputs), strict=True)
    return [(argument, array, f"{argument}_size" in BODIES[name]) for argument, array in arrays]


def _kind(array: NDArray[Any]) -> str:
    return "double" if array.dtype.kind == "f" else "int"


def _declared(name: str, array: NDArray[Any], *, constant: bool) -> str:
    """Return the declaration of a constant, or of working memory."""
    size = max(1, array.size)
    if not constant:
        return f"  {_kind(array)} {name}[{size}];"
    items = ["NAN" if value != value else repr(value) for value in (array + 0).ravel().tolist()] or ["0"]
    rows = [", ".join(items[k : k + 8]) for k in range(0, len(items), 8)]
    return f"  static const {_kind(array)} {name}[{size}] = {{\n    " + ",\n    ".join(rows) + "};"
