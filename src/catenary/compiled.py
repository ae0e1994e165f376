"""The one place that asks numba for anything.

`inlined` functions stay plain Python that runs on any numbers (floats, symbols) and may be called from
compiled ones. `compiled` functions are machine code, built on first use and cached on disk.
"""

from collections.abc import Callable
from fractions import Fraction
from typing import Any, TypeVar, cast

import numba
from numba.extending import intrinsic, overload, register_jitable

Function = TypeVar("Function", bound=Callable[..., object])


def inlined(function: Function) -> Function:
    """Let compiled functions call this plain Python function."""
    return cast(Function, register_jitable(function))


def compiled(function: Function) -> Function:
    """Compile a function on first use; it neither holds the Python lock nor checks array bounds."""
    # fastmath stays off: results must not depend on the machine that compiled them
    return cast(Function, numba.njit(cache=True, nogil=True, error_model="numpy")(function))


def fma(a: float, b: float, c: float) -> float:
    """Give a * b + c of finite numbers, rounded once.

    Compiled, it is one instruction of the processor, or the C library's function, many times slower, where it has
    none (x86 before 2013): the bits are the same everywhere. Compilers never make one of a product and a sum by
    themselves here.
    """
    return float(Fraction(a) * Fraction(b) + Fraction(c))


@intrinsic  # type: ignore[untyped-decorator]  # numba has no types
def _fma(_: Any, a: Any, b: Any, c: Any) -> Any:
    def instruction(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    real = numba.types.float64
    return (real(real, real, real), instruction) if (a, b, c) == (real, real, real) else None


@overload(fma, strict=False)  # type: ignore[untyped-decorator]  # annotated on one side only
def _compiled_fma(a: Any, b: Any, c: Any) -> Any:
    return lambda a, b, c: _fma(a, b, c)
