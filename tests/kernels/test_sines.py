import math
from fractions import Fraction

from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.kernels.sines import HALF_PI, LARGEST_ANGLE_RAD, small_sine_cosine


@given(st.floats(-LARGEST_ANGLE_RAD, LARGEST_ANGLE_RAD))
def test_sines_are_those_of_the_c_library(x: float) -> None:
    # both are within some 1.5e-16 of the true value
    assert_allclose(small_sine_cosine(x), (math.sin(x), math.cos(x)), rtol=0.0, atol=3e-16)


@given(st.integers(-60_000, 60_000), st.floats(-1e-3, 1e-3))
def test_sines_near_quarter_turns_keep_their_relative_accuracy(quarters: int, beside: float) -> None:
    x = quarters * (math.pi / 2) + beside
    for ours, theirs in zip(small_sine_cosine(x), (math.sin(x), math.cos(x)), strict=True):
        assert_allclose(ours, theirs, rtol=1e-13, atol=1e-19)  # x is rounded the same for both


def test_parts_of_half_pi_leave_products_with_whole_numbers_exact() -> None:
    most = int(LARGEST_ANGLE_RAD / HALF_PI[0]) + 1
    for part in HALF_PI[:2]:
        assert Fraction(part * most) == Fraction(part) * most
    # pi/2 to 40 digits
    whole = Fraction("1.570796326794896619231321691639751442099")
    assert abs(sum(Fraction(part) for part in HALF_PI) - whole) < Fraction("1e-30")
