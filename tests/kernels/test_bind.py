"""A compiled function bound to fixed arrays: what it computes, what it keeps, what it refuses."""

import gc
import sys
import weakref
from collections.abc import Callable
from itertools import repeat
from typing import Any

import numpy as np
import pytest

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.kernels.bind import bind
from catenary.kernels.compiled import compiled

TOOL = [("mass", np.float64), ("com", np.float64, 3)]
MOTION = [("time", np.float64), ("q", np.float64, 3), ("gains", np.float64, (2, 3)), ("ticks", np.int64)]
STATE = np.dtype([*MOTION, ("on", np.bool_), ("flags", np.uint8, 2), ("tool", TOOL)], align=True)


@compiled
def add(a: Floats, b: Floats, out: Floats) -> None:
    for i in range(len(out)):
        out[i] = a[i] + b[i]


@compiled
def shapes(scalar: Any, flags: Any, cube: Any, counts: Any, out: Any) -> None:
    out[0] = cube.shape[0] + 10 * cube.shape[1] + 100 * cube.shape[2]
    out[1] = cube[1, 2, 3] + scalar[()]
    counts[0] += 1
    flags[1] = not flags[1]


@compiled
def step(given: Any, state: Any) -> None:
    new, old = state[0], given[0]
    new.time = old.time + 1.0
    new.ticks += 1
    for i in range(3):
        new.q[i] = old.gains[1, i] * old.q[i] + old.tool.com[i] * old.tool.mass
    new.on, new.flags[1] = old.flags[1] == 1, old.on


def three() -> tuple[Floats, Floats, Floats]:
    return np.array([1.0, 2.0, 3.0]), np.array([10.0, 20.0, 30.0]), np.zeros(3)


def test_each_call_runs_on_what_the_arrays_hold_then() -> None:
    a, b, out = three()
    call = bind(add, [a, b], [out])
    assert not out.any()  # binding runs nothing
    assert call() is None  # type: ignore[func-returns-value]
    np.testing.assert_array_equal(out, a + b)
    a[1] = -5.0
    call()
    np.testing.assert_array_equal(out, a + b)
    with pytest.raises(TypeError):
        call(a)  # type: ignore[call-arg]


def test_arrays_of_any_dimension_and_of_flags_and_counts() -> None:
    scalar, flags, counts = np.array(0.5), np.array([True, False]), np.array([7])
    cube, out = np.arange(24.0).reshape(2, 3, 4), np.zeros(2)
    bind(shapes, [scalar], [flags, cube, counts, out])()
    np.testing.assert_array_equal(out, [432.0, 23.5])
    assert flags.tolist() == [True, True]
    assert counts.tolist() == [8]


def test_structured_arrays_with_named_fields() -> None:
    given, state = np.zeros(1, STATE), np.zeros(1, STATE)
    given["time"], given["q"], given["gains"][0, 1] = 2.0, [1.0, 2.0, 3.0], [2.0, 3.0, 4.0]
    given["tool"]["mass"], given["tool"]["com"], given["on"] = 2.0, [0.1, 0.2, 0.3], True
    call = bind(step, [given], [state])
    call()
    call()
    assert (state["time"][0], state["ticks"][0]) == (3.0, 2)
    np.testing.assert_allclose(state["q"][0], [2.2, 6.4, 12.6], rtol=1e-15)  # rounding
    assert not state["on"][0]
    assert state["flags"][0].tolist() == [0, 1]


def test_the_arrays_live_exactly_as_long_as_the_function() -> None:
    a, b, out = three()
    call, alive = bind(add, [a, b], [out]), [weakref.ref(array) for array in (a, b, out)]
    del a, b, out
    gc.collect()
    noise = [np.full(3, np.nan) for _ in range(1000)]  # would take memory that was given back
    call()
    result = alive[2]()
    assert result is not None
    np.testing.assert_array_equal(result, [11.0, 22.0, 33.0])
    del call, result, noise
    gc.collect()
    assert [ref() for ref in alive] == [None] * 3


@pytest.mark.parametrize("calls", [100_000, pytest.param(10_000_000, marks=pytest.mark.slow)])
def test_many_calls_leak_nothing(calls: int) -> None:
    resource = pytest.importorskip("resource", reason="memory is asked for as Unix has it")
    a, b, out = three()
    call = bind(add, [a, b], [out])
    call()
    before = [sys.getrefcount(x) for x in (a, b, out, None, call)]
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in repeat(None, calls):
        call()
    after = [sys.getrefcount(x) for x in (a, b, out, None, call)]
    assert np.abs(np.subtract(after, before)).max() < 100  # None is counted by others too
    assert after[:3] == before[:3]
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory < 1000  # [KiB]


def unaligned() -> Floats:
    return np.zeros(25, np.uint8)[1:].view(np.float64)


def read_only() -> Floats:
    out = np.zeros(3)
    out.flags.writeable = False
    return out


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (lambda a, b, out: ([a, [1.0, 2.0, 3.0]], [out]), "b: expected a NumPy array, got list"),
        (lambda a, b, out: ([a.astype(np.float32), b], [out]), "a: expected float64, .*got float32"),
        (lambda a, b, out: ([a.astype(">f8"), b], [out]), "a: expected .*byte order, got >f8"),
        (lambda a, b, out: ([a.astype(object), b], [out]), "a: expected float64, .*got object"),
        (lambda a, b, out: ([np.zeros(3, [("x", "f4")]), b], [out]), "a: expected .*got .*'<f4'"),
        (lambda a, b, out: ([np.zeros(3, [("x", "?", 2)]), b], [out]), "a: expected .*not of bool"),
        (lambda a, b, out: ([a, np.zeros((3, 2))[:, 0]], [out]), r"b: expected a C-contiguous .*\(16,\)"),
        (lambda a, b, out: ([a, np.zeros((2, 3)).T], [out]), "b: expected a C-contiguous"),
        (lambda a, b, out: ([a, unaligned()], [out]), "b: expected an aligned array"),
        (lambda a, b, out: ([a, b], [read_only()]), "out: expected an output that can be written"),
        (lambda a, b, out: ([a, b], [a]), "out: expected memory of its own, got .*overlaps a"),
        (lambda a, b, out: ([a, b[:2]], [b[1:]]), "out: expected memory of its own, got .*overlaps b"),
        (lambda a, b, out: ([a], [out[:2], out[1:]]), "b: expected memory of its own, got .*overlaps out"),
        (lambda a, b, out: ([a, b], []), r"expected 3 arrays \(a, b, out\), got 2 inputs and 0 outputs"),
    ],
)
def test_other_arrays_are_refused(given: Callable[..., Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        bind(add, *given(*three()))


def test_inputs_may_be_read_only_and_overlap_one_another() -> None:
    a, _, out = three()
    a.flags.writeable = False
    bind(add, [a, a], [out])()
    np.testing.assert_array_equal(out, 2.0 * a)


def test_only_compiled_functions_are_bound() -> None:
    with pytest.raises(InputError, match="expected a @compiled function"):
        bind(lambda out: None, [], [np.zeros(1)])


def test_functions_without_a_name_of_their_own_are_not_confused() -> None:
    def scaled(factor: float) -> Callable[..., None]:
        @compiled
        def scale(out: Floats) -> None:
            out[0] = factor * out[0]

        return scale

    out = np.ones(1)
    bind(scaled(2.0), [], [out])()
    bind(scaled(3.0), [], [out])()
    assert out[0] == 6.0
