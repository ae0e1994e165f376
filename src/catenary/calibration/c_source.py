"""Writes a calibration model as C99, which is C++ too: what `Corrector` does in a tick, without memory of its own."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from catenary.calibration.model import CalibrationModel, JointGroup
from catenary.calibration.predictors import Constant, Linear, Network, Predictor, Quadratic
from catenary.errors import InputError


def c_correction(prefix: str, model: CalibrationModel, decimation: int) -> str:
    """Write `PREFIX_correct(state, q, signals, q_calibrated, inside)` and `PREFIX_reset(state)`.

    Args:
        prefix: Begins every name.
        model: The model.
        decimation: Ticks between the previous positions that it takes; see `Corrector`.

    Raises:
        InputError: A predictor of a kind that has no C.
    """
    features, n = model.features, len(model.joint_names)
    positions = [features.signals.index(name) for name in features.positions]
    played = [(features.signals.index(name), width) for name, width in features.play]
    ticks = features.history * decimation
    S, F, P = len(features.signals), len(features.names), len(positions)
    text = [
        _functions(prefix),
        "/* What the correction remembers of earlier ticks. */",
        "typedef struct {",
        f"  int now; /* of {max(1, ticks)} rows of the ring */",
        f"  double ring[{max(1, ticks * P)}];",
        f"  double play[{max(1, len(played))}];",
        f"}} {prefix}_state;",
        "",
        "/* Forget earlier ticks: another motion begins. To be called once before the first tick. */",
        f"static inline void {prefix}_reset({prefix}_state *state) {{",
        "  int i;",
        "  state->now = 0;",
        f"  for (i = 0; i < {max(1, ticks * P)}; ++i) state->ring[i] = NAN;",
        f"  for (i = 0; i < {max(1, len(played))}; ++i) state->play[i] = NAN;",
        "}",
        "",
    ]
    for k, group in enumerate(model.groups):
        text += _group(prefix, k, group)
    text += [
        f"static inline void {prefix}_correct({prefix}_state *state, const double *q, const double *signals,",
        "                                    double *q_calibrated, int *inside) {",
        _array("offset", model.offset),
        f"  double x[{F}], y[{n}];",
        f"  int i, at = {S}, known;",
        f"  for (i = 0; i < {S}; ++i) x[i] = signals[i];",
    ]
    if ticks > 0:
        text += [
            _array("position", positions, "int"),
            f"  for (i = 1; i <= {features.history}; ++i) {{",
            f"    int row = state->now - i * {decimation}, j;",
            f"    if (row < 0) row += {ticks};",
            f"    for (j = 0; j < {P}; ++j) x[at++] = state->ring[row * {P} + j];",
            "  }",
            f"  for (i = 0; i < {P}; ++i) state->ring[state->now * {P} + i] = signals[position[i]];",
            f"  state->now = state->now + 1 < {ticks} ? state->now + 1 : 0;",
        ]
    if played:
        text += [
            _array("played", [signal for signal, _ in played], "int"),
            _array("width", [width for _, width in played]),
            f"  for (i = 0; i < {len(played)}; ++i) {{",
            "    const double value = signals[played[i]];",
            f"    if ({prefix}_finite(value)) {{",
            "      double y_play = state->play[i];",
            "      if (y_play != y_play) y_play = value;",
            "      if (y_play < value - width[i]) y_play = value - width[i];",
            "      if (y_play > value + width[i]) y_play = value + width[i];",
            "      state->play[i] = y_play;",
            "    }",
            "    x[at++] = state->play[i] - value;",
            "  }",
        ]
    text.append("  (void)at;\n  (void)state;")
    for k, group in enumerate(model.groups):
        text += [
            f"  known = {prefix}_group{k}(x, y);",
            _array(f"joint{k}", group.joints, "int"),
            f"  for (i = 0; i < {len(group.joints)}; ++i) {{",
            f"    const int j = joint{k}[i];",
            f"    const int here = known && {prefix}_finite(q[j]);",
            f"    q_calibrated[j] = q[j] + (here ? y[i]{' - q[j]' if model.target == 'position' else ''} : offset[j]);",
            "    inside[j] = here;",
            "  }",
        ]
    return "\n".join([*text, "}", ""])


def _functions(prefix: str) -> str:
    """Write what groups use: no -ffast-math, which takes NaN for a number."""
    return f"""\
static inline int {prefix}_finite(double x) {{
  return x - x == 0.0;
}}

/* out = bias + x @ weights, weights (inputs, outputs) row by row; bias NULL: added to out. */
static inline void {prefix}_dense(int inputs, int outputs, const double *x, const double *weights,
                                  const double *bias, double *out) {{
  int i, k;
  if (bias)
    for (k = 0; k < outputs; ++k) out[k] = bias[k];
  for (i = 0; i < inputs; ++i)
    for (k = 0; k < outputs; ++k) out[k] += x[i] * weights[i * outputs + k];
}}

/* exp(v) - 1 for |v| <= 40 */
static inline double {prefix}_expm1(double v) {{
  const double t = v * 0.015625;
  double e = 1.0 / 40320.0 + t * (1.0 / 362880.0);
  int i;
  e = 1.0 / 720.0 + t * (1.0 / 5040.0 + t * e);
  e = 1.0 / 24.0 + t * (1.0 / 120.0 + t * e);
  e = t * (1.0 + t * (0.5 + t * (1.0 / 6.0 + t * e)));
  for (i = 0; i < 6; ++i) e = e * (2.0 + e);
  return e;
}}

static inline double {prefix}_tanh(double v) {{
  const double e = {prefix}_expm1(2.0 * (v < -20.0 ? -20.0 : v > 20.0 ? 20.0 : v));
  return e / (e + 2.0);
}}

static inline double {prefix}_logistic(double v) {{
  const double e = {prefix}_expm1(v < -40.0 ? -40.0 : v > 40.0 ? 40.0 : v);
  return (e + 1.0) / (e + 2.0);
}}
"""


def _group(prefix: str, k: int, group: JointGroup) -> list[str]:
    """Write `PREFIX_groupK(x, y)`: whether features x are inside the valid range, and then the prediction y."""
    valid, watched, inputs = group.valid_range, len(group.watched), len(group.columns)
    return [
        f"static inline int {prefix}_group{k}(const double *x, double *y) {{",
        _array("column", group.columns, "int"),
        _array("watched", group.watched, "int"),
        _array("lower", valid.lower),
        _array("upper", valid.upper),
        _array("mean", valid.mean),
        _array("axes", valid.axes),
        _array("axis_lower", valid.axis_lower),
        _array("axis_upper", valid.axis_upper),
        f"  double taken[{max(1, inputs)}], away[{max(1, watched)}], along[{max(1, watched)}];",
        "  int i;",
        f"  for (i = 0; i < {inputs}; ++i) {{",
        "    taken[i] = x[column[i]];",
        f"    if (!{prefix}_finite(taken[i])) return 0;",
        "  }",
        f"  for (i = 0; i < {watched}; ++i) {{",
        "    const double value = x[watched[i]];",
        "    if (!(value >= lower[i] && value <= upper[i])) return 0;",
        "    away[i] = value - mean[i];",
        "    along[i] = 0.0;",
        "  }",
        f"  {prefix}_dense({watched}, {watched}, away, axes, NULL, along);",
        f"  for (i = 0; i < {watched}; ++i)",
        "    if (!(along[i] >= axis_lower[i] && along[i] <= axis_upper[i])) return 0;",
        *_predictor(prefix, group.predictor, inputs),
        "  (void)taken;",
        "  return 1;",
        "}",
        "",
    ]


def _predictor(prefix: str, predictor: Predictor, inputs: int) -> list[str]:
    if isinstance(predictor, Constant):
        return [
            _array("value", predictor.value),
            f"  for (i = 0; i < {len(predictor.value)}; ++i) y[i] = value[i];",
        ]
    if isinstance(predictor, Linear):
        return _linear(prefix, predictor, inputs)
    if isinstance(predictor, Quadratic):
        m = len(predictor.bias)
        return [
            *_standardised(predictor.mean, predictor.scale, inputs),
            _array("linear", predictor.linear),
            _array("quadratic", predictor.quadratic),
            _array("bias", predictor.bias),
            f"  {prefix}_dense({inputs}, {m}, z, linear, bias, y);",
            "  {",
            "    int j, k, pair = 0;",
            f"    for (i = 0; i < {inputs}; ++i)",
            f"      for (j = i; j < {inputs}; ++j, ++pair)",
            f"        for (k = 0; k < {m}; ++k) y[k] += z[i] * z[j] * quadratic[pair * {m} + k];",
            "  }",
        ]
    if isinstance(predictor, Network):
        return _network(prefix, predictor, inputs)
    raise InputError(f"model: a predictor of kind {type(predictor).__name__} cannot be written as C")


def _linear(prefix: str, linear: Linear, inputs: int) -> list[str]:
    return [
        _array("weights", linear.weights),
        _array("bias", linear.bias),
        f"  {prefix}_dense({inputs}, {len(linear.bias)}, taken, weights, bias, y);",
    ]


def _network(prefix: str, network: Network, inputs: int) -> list[str]:
    widths = [len(bias) for bias in network.biases]
    text = [
        *_standardised(network.mean, network.scale, inputs),
        f"  double first[{max(widths)}], second[{max(widths)}];",
    ]
    below, above, width = "z", "first", inputs
    for k, (W, b) in enumerate(zip(network.weights, network.biases, strict=True)):
        text += [
            _array(f"weights{k}", W),
            _array(f"bias{k}", b),
            f"  {prefix}_dense({width}, {len(b)}, {below}, weights{k}, bias{k}, {above});",
        ]
        if k < len(widths) - 1:
            text.append(
                f"  for (i = 0; i < {len(b)}; ++i) {above}[i] = {prefix}_{network.activation}({above}[i]);"
            )
        below, above, width = above, "second" if above == "first" else "first", len(b)
    text += ["  (void)second;", _array("out_mean", network.out_mean), _array("out_scale", network.out_scale)]
    m = widths[-1]
    if network.skip is not None:
        text += _linear(prefix, network.skip, inputs)
        text.append(f"  for (i = 0; i < {m}; ++i) y[i] += {below}[i] * out_scale[i] + out_mean[i];")
    else:
        text.append(f"  for (i = 0; i < {m}; ++i) y[i] = {below}[i] * out_scale[i] + out_mean[i];")
    return text


def _standardised(mean: ArrayLike, scale: ArrayLike, inputs: int) -> list[str]:
    return [
        _array("in_mean", mean),
        _array("in_scale", scale),
        f"  double z[{max(1, inputs)}];",
        f"  for (i = 0; i < {inputs}; ++i) z[i] = (taken[i] - in_mean[i]) / in_scale[i];",
    ]


def _array(name: str, values: ArrayLike | Sequence[int], kind: str = "double") -> str:
    flat = np.asarray(values, dtype=float if kind == "double" else int).ravel()
    if kind == "double" and not np.isfinite(flat).all():
        raise InputError(f"model: {name} holds NaN or infinity")
    items = [repr(value) for value in flat.tolist()] or ["0"]
    rows = [", ".join(items[k : k + 8]) for k in range(0, len(items), 8)]
    return f"  static const {kind} {name}[{len(items)}] = {{\n    " + ",\n    ".join(rows) + "};"
