"""Sine and cosine together, in plain arithmetic: the same bits one at a time and in blocks, in Python's kernels and C.

The C library's take 10 ns each, one number at a time. These are sums and products without a branch, so a compiler
runs them on as many numbers at once as the processor holds.

The angle less the nearest multiple of pi/2 (W. Cody, W. Waite, Software manual for the elementary functions, 1980,
chapter 8; pi/2 in three parts of 33 bits, so that products with the multiple are exact) goes into the polynomials
of fdlibm (Sun Microsystems 1993, k_sin.c and k_cos.c). Within 2e-16 of the true values up to LARGEST_ANGLE_RAD.
"""

from catenary.kernels.compiled import inlined

LARGEST_ANGLE_RAD = 1e5  # [rad] beyond it the C library takes over: 16 000 turns
TWO_OVER_PI = 6.36619772367581382433e-01
HALF_PI = (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21)
ROUNDER = 6755399441055744.0  # 1.5 * 2^52: x + ROUNDER - ROUNDER is x, rounded to a whole number
SINE = (
    -1.66666666666666324348e-01,
    8.33333333332248946124e-03,
    -1.98412698298579493134e-04,
    2.75573137070700676789e-06,
    -2.50507602534068634195e-08,
    1.58969099521155010221e-10,
)
COSINE = (
    4.16666666666666019037e-02,
    -1.38888888888741095749e-03,
    2.48015872894767294178e-05,
    -2.75573143513906633035e-07,
    2.08757232129817482790e-09,
    -1.13596475577881948265e-11,
)


@inlined
def small_sine_cosine(x: float) -> tuple[float, float]:
    """Return sine and cosine of an angle within LARGEST_ANGLE_RAD [rad]: + - * alone, so it runs on many at once."""
    quarter = (x * TWO_OVER_PI + ROUNDER) - ROUNDER
    r = ((x - quarter * HALF_PI[0]) - quarter * HALF_PI[1]) - quarter * HALF_PI[2]
    z = r * r
    p = SINE[1] + z * (SINE[2] + z * (SINE[3] + z * (SINE[4] + z * SINE[5])))
    s = r + r * z * (SINE[0] + z * p)
    p = z * (COSINE[0] + z * (COSINE[1] + z * (COSINE[2] + z * (COSINE[3] + z * (COSINE[4] + z * COSINE[5])))))
    w = 1.0 - 0.5 * z
    c = w + (((1.0 - w) - 0.5 * z) + z * p)
    # whole halves of the turn: (quarter - 1/2) / 2, rounded, is the floor of quarter / 2
    half = ((0.5 * quarter - 0.25) + ROUNDER) - ROUNDER
    odd = quarter - 2.0 * half
    turn = ((0.5 * half - 0.25) + ROUNDER) - ROUNDER
    sign = 1.0 - 2.0 * (half - 2.0 * turn)
    even = 1.0 - odd  # one of them is 1, the other 0: a choice by arithmetic, for several numbers at once
    return sign * (even * s + odd * c), sign * (even * c - odd * s)
