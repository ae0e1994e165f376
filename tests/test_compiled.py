import math
from fractions import Fraction

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.compiled import compiled, fma

FACTORS = st.floats(min_value=-1e100, max_value=1e100)


@compiled
def compiled_fma(a: float, b: float, c: float) -> float:
    return fma(a, b, c)


@compiled
def rows(a: np.ndarray, b: np.ndarray, c: np.ndarray, out: np.ndarray) -> None:
    for k in range(len(a)):
        out[k] = fma(a[k], b[k], c[k])


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
