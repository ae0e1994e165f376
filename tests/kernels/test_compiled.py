import ctypes
import math
import subprocess
import sys
from fractions import Fraction

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.kernels.compiled import (
    Compiled,
    address_of,
    array_at,
    borrowed,
    compiled,
    fma,
    in_memory,
    inlined,
    instructions,
)

FACTORS = st.floats(min_value=-1e100, max_value=1e100)


@compiled
def compiled_fma(a: float, b: float, c: float) -> float:
    return fma(a, b, c)


@compiled
def rows(a: np.ndarray, b: np.ndarray, c: np.ndarray, out: np.ndarray) -> None:
    for k in range(len(a)):
        out[k] = fma(a[k], b[k], c[k])


@inlined
def three() -> float:
    return 3.0


@compiled
def unused(x: float) -> float:
    return x + three()


@compiled
def plus_three(x: float) -> float:
    return x + three()


@compiled
def swap_rows(a: np.ndarray) -> None:
    a = borrowed(a)
    for k in range(a.shape[1]):
        a[0, k], a[1, k] = a[1, k], a[0, k]


def double_four(pointer) -> None:
    values = array_at(pointer, 4)
    for k in range(len(values)):
        values[k] *= 2.0


def test_borrowed_arrays_are_the_arrays_and_neither_kept_nor_freed() -> None:
    array = np.arange(8.0).reshape(2, 4)[:, ::2]
    before = sys.getrefcount(array), sys.getrefcount(array.base)
    swap_rows(array)
    assert array.tolist() == [[4.0, 6.0], [0.0, 2.0]]
    assert borrowed(array) is array
    assert (sys.getrefcount(array), sys.getrefcount(array.base)) == before


@settings(deadline=None)  # the first example compiles
@given(FACTORS, FACTORS, FACTORS)
def test_compiled_fma_is_the_exact_result_rounded_once(a: float, b: float, c: float) -> None:
    assert compiled_fma(a, b, c) == float(Fraction(a) * Fraction(b) + Fraction(c))


def test_fma_keeps_what_a_product_rounded_first_would_lose() -> None:
    a = 1.0 + 2.0**-30
    assert a * a - (1.0 + 2.0**-29) == 0.0
    assert compiled_fma(a, a, -(1.0 + 2.0**-29)) == 2.0**-60


def test_fma_of_vectors_has_the_bits_of_single_ones() -> None:
    a, b, c = np.random.default_rng(0).normal(size=(3, 37))
    out = np.empty(37)
    rows(a, b, c, out)
    assert list(out) == [compiled_fma(*numbers) for numbers in zip(a, b, c, strict=True)]


def test_compiled_fma_passes_nan_and_infinity_on() -> None:
    assert math.isnan(compiled_fma(math.nan, 1.0, 1.0))
    assert compiled_fma(math.inf, 1.0, 1.0) == math.inf


def test_a_compiled_function_is_numbas_in_its_own_file_from_its_first_call_on() -> None:
    assert isinstance(unused, Compiled)
    assert unused.__name__ == "unused"
    assert unused(2.0) == 5.0
    assert not isinstance(unused, Compiled)
    assert unused(3.0) == 6.0


def test_compiled_functions_call_those_that_nobody_has_called_yet() -> None:
    @in_memory(compiled)
    def doubled(x: float) -> float:
        return 2.0 * plus_three(x)

    assert doubled(1.0) == 8.0


def test_functions_of_pointers_have_an_address() -> None:
    values = np.arange(4.0)
    run = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(address_of(double_four, "float64"))
    run(values.ctypes.data)
    assert (values == 2.0 * np.arange(4.0)).all()


def test_instructions_are_given_arrays_and_numbers() -> None:
    def write(builder, arguments) -> None:
        numbers, at, small = arguments
        place = builder.gep(numbers, [builder.add(at, small)])
        builder.store(builder.fadd(builder.load(place), builder.load(place)), place)

    code = instructions(write)

    @in_memory(compiled)
    def doubled_at(values: np.ndarray, at: int) -> None:
        code((values, at, np.int8(1)))

    values = np.ones(4)
    doubled_at(values, 1)
    assert list(values) == [1.0, 1.0, 2.0, 1.0]


def test_importing_compiled_functions_does_not_import_numba() -> None:
    code = (
        "import sys, catenary.gravity.torque, catenary.dynamics.mass_matrix, catenary.control.limits\n"
        "assert 'numba' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
