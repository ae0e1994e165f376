import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.kernels.tracing import Symbol, Term, Trace, evaluate_line

CONSTANTS = (-2.0, -1.0, -0.5, 0.0, 0.3, 1.0, 3.0)
leaves = st.one_of(st.sampled_from(CONSTANTS), st.sampled_from("xyz"))
expressions = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.tuples(st.sampled_from("+-*"), inner, inner),
        st.tuples(st.sampled_from(("neg", "sin", "cos", "quarter")), inner),
    ),
    max_leaves=25,
)
values = st.floats(-3.0, 3.0).filter(lambda v: v == 0.0 or abs(v) > 1e-3)


def build(expression, x, sine_cosine):
    """Work an expression out on numbers or symbols."""
    if isinstance(expression, float):
        return expression
    if isinstance(expression, str):
        return x["xyz".index(expression)]
    kind, *parts = expression
    a = build(parts[0], x, sine_cosine)
    if kind == "neg":
        return -a
    if kind in ("sin", "cos"):
        return sine_cosine(a)[kind == "cos"]
    if kind == "quarter":
        return sine_cosine(a + 0.5 * math.pi)[0]
    b = build(parts[1], x, sine_cosine)
    return a + b if kind == "+" else a - b if kind == "-" else a * b


def traced(expression) -> tuple[Trace, Term]:
    trace = Trace()
    return trace, build(expression, trace.inputs("x", 3), trace.sine_cosine)


def size_of(expression, x) -> float:
    """Bound on how large what occurs in an expression can be: rounding is in proportion to it."""
    if isinstance(expression, float):
        return abs(expression)
    if isinstance(expression, str):
        return abs(x["xyz".index(expression)])
    kind, *parts = expression
    sizes = [size_of(part, x) for part in parts]
    if kind == "*":
        return sizes[0] * sizes[1]
    return sum(sizes) + 2.0 if kind in ("sin", "cos", "quarter") else sum(sizes)


@given(expressions, st.tuples(values, values, values))
@settings(max_examples=500, deadline=None)
def test_a_trace_gives_what_the_expression_gives(expression, x) -> None:
    trace, term = traced(expression)
    expected = build(expression, x, lambda a: (math.sin(a), math.cos(a)))
    given_ = evaluate_line(trace.line([term]), x=x)[0]
    # sums are reordered: some 25 roundings of what may be nested in sines of large arguments
    assert_allclose(given_, expected, rtol=0.0, atol=1e-12 * (1.0 + size_of(expression, x)))


@given(expressions)
@settings(max_examples=200, deadline=None)
def test_an_expression_twice_costs_nothing_more_and_less_itself_is_zero(expression) -> None:
    trace = Trace()
    x = trace.inputs("x", 3)
    once = build(expression, x, trace.sine_cosine)
    twice = build(expression, x, trace.sine_cosine)
    assert len(trace.line([once, twice]).steps) == len(trace.line([once]).steps)
    assert once - twice == 0.0
    if isinstance(once, Symbol):
        back = -(-once)  # noqa: B002
        assert (back.step, back.sign) == (once.step, once.sign)


@given(expressions, expressions)
@settings(max_examples=200, deadline=None)
def test_sums_and_products_commute(left, right) -> None:
    trace = Trace()
    x = trace.inputs("x", 3)
    a, b = build(left, x, trace.sine_cosine), build(right, x, trace.sine_cosine)
    for one, other in ((a + b, b + a), (a * b, b * a), (a - b, -(b - a))):
        if isinstance(one, Symbol):
            assert (one.step, one.sign) == (other.step, other.sign)
        else:
            assert one == other


def operations(build_one) -> int:
    trace = Trace()
    return trace.line([build_one(*trace.inputs("x", 3))]).operations


@pytest.mark.parametrize(
    ("build_one", "count"),
    [
        (lambda x, y, z: x * 0.0 + y, 0),
        (lambda x, y, z: x * 1.0, 0),
        (lambda x, y, z: x + 0.0, 0),
        (lambda x, y, z: -(-x), 0),  # noqa: B002
        (lambda x, y, z: (x + 1.0) + 2.0, 1),
        (lambda x, y, z: 2.0 * (3.0 * x), 1),
        (lambda x, y, z: 2.0 * (x + 1.0) + 3.0, 2),
        (lambda x, y, z: x * y + y * x - 2.0 * (x * y), 0),
        (lambda x, y, z: (-x) * (-y), 1),
        (lambda x, y, z: np.float64(2.0) * x, 1),
    ],
)
def test_operations_that_change_nothing_are_left_out(build_one, count: int) -> None:
    if build_one(2.0, 3.0, 4.0) == 0.0:
        trace = Trace()
        assert build_one(*trace.inputs("x", 3)) == 0.0
    else:
        assert operations(build_one) == count


@pytest.mark.parametrize("quarters", range(-5, 6))
def test_quarter_turns_are_exact(quarters: int) -> None:
    trace = Trace()
    x = trace.inputs("x", 1)[0]
    line = trace.line(trace.sine_cosine(x + quarters * math.pi / 2))
    assert line.operations == 0
    assert_allclose(
        evaluate_line(line, x=[0.7]),
        [math.sin(0.7 + quarters * math.pi / 2), math.cos(0.7 + quarters * math.pi / 2)],
        atol=1e-15,
    )
    assert trace.sine_cosine(quarters * math.pi / 2) == tuple(
        round(f(quarters * math.pi / 2)) for f in (math.sin, math.cos)
    )


def test_nan_reaches_what_depends_on_it_and_nothing_else() -> None:
    trace = Trace()
    x, y, _ = trace.inputs("x", 3)
    line = trace.line([x * y + 1.0, 0.0 * x + y])
    assert np.isnan(evaluate_line(line, x=[np.nan, 2.0, 0.0])).tolist() == [True, False]
