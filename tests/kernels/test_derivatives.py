import math

import pytest
from numpy.testing import assert_allclose

from catenary.errors import InputError
from catenary.kernels.derivatives import derivative_line
from catenary.kernels.tracing import Trace, evaluate_line


def test_derivatives_follow_sums_products_and_angles() -> None:
    trace = Trace()
    x, y = trace.inputs("x", 2), trace.inputs("y", 1)
    sine, cosine = trace.sine_cosine(x[0] * 2.0 + 0.3)
    line = trace.line([sine * x[1] - y[0] * 3.0, -(cosine * cosine * y[0]), 7.0, x[1] + 1.0])
    a, b, c = 0.4, -1.2, 2.5
    s, k = math.sin(2 * a + 0.3), math.cos(2 * a + 0.3)
    expected = [2 * k * b, s, 4 * k * s * c, 0.0, 0.0, 0.0, 0.0, 1.0]
    assert_allclose(evaluate_line(derivative_line(line, ["x"]), x=[a, b], y=[c]), expected, atol=1e-15)
    assert_allclose(evaluate_line(derivative_line(line, ["y"]), x=[a, b], y=[c]), [-3.0, -k * k, 0.0, 0.0], atol=1e-15)


def test_friction_is_not_differentiated() -> None:
    trace = Trace()
    with pytest.raises(InputError, match="tanh: is not differentiated"):
        derivative_line(trace.line([trace.apply("tanh", trace.inputs("x", 1)[0])]), ["x"])
