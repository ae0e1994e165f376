"""A line's partial derivatives as another line: forward differentiation, operation by operation."""

from collections.abc import Sequence

from catenary.errors import InputError
from catenary.kernels.tracing import FUNCTIONS, Line, Term, Trace, widths_of

_Slopes = dict[tuple[str, int], Term]  # by input: the derivatives that are not zero


def derivative_line(line: Line, by: Sequence[str]) -> Line:
    """Return the partial derivatives of a line's results by elements of its inputs, as a line of the same inputs.

    Args:
        line: Straight-line program of m results.
        by: Names of input arrays, of k elements in all.

    Returns:
        A line of m k results, row by row.
    """
    trace, widths = Trace(), widths_of(line)
    arrays = {name: trace.inputs(name, width) for name, width in widths.items()}
    by_what = [(name, i) for name in by for i in range(widths[name])]
    values: list[Term] = []
    slopes: list[_Slopes] = []
    for kind, a, b in line.steps:
        if kind == "in":
            name, index = line.inputs[a]
            values.append(arrays[name][index])
            slopes.append({(name, index): 1.0} if name in by else {})
        elif kind in ("sin", "cos"):
            sine, cosine = trace.sine_cosine(values[a])
            values.append(sine if kind == "sin" else cosine)
            turned = cosine if kind == "sin" else -sine
            slopes.append({key: slope * turned for key, slope in slopes[a].items()})
        elif kind in FUNCTIONS:
            raise InputError(f"{kind}: is not differentiated")
        else:
            x, dx = values[a], slopes[a]
            y, dy = (b, {}) if kind.endswith("k") else (values[int(b)], slopes[int(b)])
            values.append(x * y if "*" in kind else x - y if kind == "-" else x + y)
            u, v = (y, x) if "*" in kind else (1.0, -1.0 if kind == "-" else 1.0)  # what each slope is multiplied by
            slopes.append({key: dx.get(key, 0.0) * u + dy.get(key, 0.0) * v for key in dx | dy})
    found: list[Term] = []
    for result in line.results:
        sign, slope = (0.0, {}) if isinstance(result, float) else (result[0], slopes[result[1]])
        found += [slope.get(key, 0.0) * sign for key in by_what]
    return trace.line(found)
