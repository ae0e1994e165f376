"""A line's partial derivatives as another line: forward differentiation, operation by operation."""

from collections.abc import Sequence

from catenary.errors import InputError
from catenary.kernels.tracing import Line, Term, Trace, widths_of

_Slopes = dict[tuple[str, int], Term]  # by input: the derivatives that are not zero


def derivative_line(line: Line, by: Sequence[str]) -> Line:
    """Return the line, of the same inputs, of the derivatives of each result by the elements of the arrays `by`.

    Row by row: of m results by arrays of k elements in all, m k results.
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
            slopes.append(_scaled(slopes[a], cosine if kind == "sin" else -sine))
        elif kind in ("+k", "*k"):
            values.append(values[a] + b if kind == "+k" else values[a] * b)
            slopes.append(slopes[a] if kind == "+k" else _scaled(slopes[a], b))
        elif kind in ("+", "-", "*"):
            x, y, dx, dy = values[a], values[int(b)], slopes[a], slopes[int(b)]
            values.append(x * y if kind == "*" else x + y if kind == "+" else x - y)
            dx, dy = (_scaled(dx, y), _scaled(dy, x)) if kind == "*" else (dx, dy if kind == "+" else _scaled(dy, -1.0))
            slopes.append(dx | {key: dx[key] + slope if key in dx else slope for key, slope in dy.items()})
        else:
            raise InputError(f"{kind}: is not differentiated")
    found: list[Term] = []
    for result in line.results:
        sign, slope = (0.0, {}) if isinstance(result, float) else (float(result[0]), slopes[result[1]])
        found += [slope[key] * sign if key in slope else 0.0 for key in by_what]
    return trace.line(found)


def _scaled(slopes: _Slopes, factor: Term) -> _Slopes:
    return {key: slope * factor for key, slope in slopes.items()}
