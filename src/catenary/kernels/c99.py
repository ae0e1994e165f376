"""Writes lines of operations as C99, which is C++ too: no memory, no library but math.h."""

import re

from catenary.kernels import sines
from catenary.kernels.tracing import ANGLES, FUNCTIONS, Line, needed, step_name, widths_of


def c_sines(prefix: str) -> str:
    """Write `PREFIX_sines(count, x, sine, cosine)`: the arithmetic of sines.py, to the bit.

    A compiler must not fuse its products and sums (-ffp-contract=off) for the bits to agree; the values do anyhow.
    """
    half_pi = [repr(part) for part in sines.HALF_PI]
    s = [_number(value) for value in sines.SINE]
    c = [_number(value) for value in sines.COSINE]
    up = repr(sines.ROUNDER)
    return f"""\
/* Sines and cosines of x [rad], within 2e-16; see W. Cody, W. Waite 1980 and fdlibm (Sun Microsystems 1993). */
static inline void {prefix}_small_sine_cosine(double x, double *sine, double *cosine) {{
  const double quarter = (x * {sines.TWO_OVER_PI!r} + {up}) - {up};
  const double r = ((x - quarter * {half_pi[0]}) - quarter * {half_pi[1]}) - quarter * {half_pi[2]};
  const double z = r * r;
  const double p = {s[1]} + z * ({s[2]} + z * ({s[3]} + z * ({s[4]} + z * {s[5]})));
  const double s = r + r * z * ({s[0]} + z * p);
  const double t = z * ({c[0]} + z * ({c[1]} + z * ({c[2]} + z * ({c[3]} + z * ({c[4]} + z * {c[5]})))));
  const double w = 1.0 - 0.5 * z;
  const double c = w + (((1.0 - w) - 0.5 * z) + z * t);
  const double half = ((0.5 * quarter - 0.25) + {up}) - {up};
  const double odd = quarter - 2.0 * half;
  const double turn = ((0.5 * half - 0.25) + {up}) - {up};
  const double sign = 1.0 - 2.0 * (half - 2.0 * turn);
  const double even = 1.0 - odd;
  *sine = sign * (even * s + odd * c);
  *cosine = sign * (even * c - odd * s);
}}

static inline void {prefix}_sines(int count, const double *x, double *sine, double *cosine) {{
  int i, small = 1;
  for (i = 0; i < count; ++i) small &= fabs(x[i]) <= {sines.LARGEST_ANGLE_RAD!r};
  if (small) {{
    for (i = 0; i < count; ++i) {prefix}_small_sine_cosine(x[i], sine + i, cosine + i);
    return;
  }}
  for (i = 0; i < count; ++i) {{
    if (fabs(x[i]) <= {sines.LARGEST_ANGLE_RAD!r}) {{
      {prefix}_small_sine_cosine(x[i], sine + i, cosine + i);
    }} else {{
      sine[i] = sin(x[i]);
      cosine[i] = cos(x[i]);
    }}
  }}
}}
"""


_OF_THE_BASE = ("omega", "alpha")  # zero where they are NULL: a base that does not turn


def c_function(prefix: str, name: str, line: Line) -> str:
    """Return the C function of a line, `PREFIX_NAME(INPUT..., out)`, which needs `c_sines(prefix)` before it.

    Args:
        prefix: Beginning of all names.
        line: Straight-line program; `out` is none of its inputs. Rates of a base may be NULL in C: at rest.
    """
    arrays = tuple(widths_of(line))
    arguments = ", ".join([*(f"const double *{array}" for array in arrays), "double *out"])
    text = [f"static inline void {prefix}_{name}({arguments}) {{"]
    if rates := [array for array in arrays if array in _OF_THE_BASE]:
        text += ["  static const double still[3] = {0.0, 0.0, 0.0};", *(f"  if (!{a}) {a} = still;" for a in rates)]
    angles = sorted({step.a for step in line.steps if step.kind in ANGLES})
    before = needed(line, angles, stop=())
    text += [_statement(line, number) for number in before]
    if angles:
        text += [
            f"  const double x[{len(angles)}] = {{{', '.join(step_name(line, angle) for angle in angles)}}};",
            f"  double sine[{len(angles)}], cosine[{len(angles)}];",
            f"  {prefix}_sines({len(angles)}, x, sine, cosine);",
        ]
    for number, step in enumerate(line.steps):
        if step.kind in ANGLES:
            whole = "sine" if step.kind == "sin" else "cosine"
            text.append(f"  const double {step_name(line, number)} = {whole}[{angles.index(step.a)}];")
        elif number not in before:
            text.append(_statement(line, number))
    results = [repr(r) if isinstance(r, float) else "-" * (r[0] < 0) + step_name(line, r[1]) for r in line.results]
    used = {line.inputs[step.a][0] for step in line.steps if step.kind == "in"}
    text += [f"  (void){array};" for array in arrays if array not in used]
    text += [f"  out[{k}] = {result};" for k, result in enumerate(results)]
    return "\n".join([*text, "}", ""])


def _statement(line: Line, number: int) -> str:
    step = line.steps[number]
    if step.kind == "in":
        array, index = line.inputs[step.a]
        return f"  const double t{number} = {array}[{index}];"
    a = step_name(line, step.a)
    if step.kind in FUNCTIONS:
        written = {"sign": f"{a} > 0.0 ? 1.0 : {a} < 0.0 ? -1.0 : {a}", "inverse": f"1.0 / {a}", "abs": f"fabs({a})"}
        return f"  const double t{number} = {written.get(step.kind, f'{step.kind}({a})')};"
    b = _number(step.b) if step.kind.endswith("k") else step_name(line, int(step.b))
    return f"  const double t{number} = {a} {step.kind[0]} {b};"


def _number(value: float) -> str:
    return repr(value) if value >= 0.0 else f"({value!r})"


def c_name(text: str) -> str:
    """Turn a robot's name into one for C: letters, digits, underscores."""
    name = re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_").lower()
    return name if name[:1].isalpha() else f"robot_{name}".rstrip("_")


def c_comment(text: str) -> str:
    """Keep a name from a file from ending the comment that it stands in."""
    return re.sub(r"[^A-Za-z0-9 _.,:()\[\]+-]", "?", text)
