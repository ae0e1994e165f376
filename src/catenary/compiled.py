"""The one place that asks numba for anything.

`inlined` functions stay plain Python that runs on any numbers (floats, symbols) and may be called from
compiled ones. `compiled` functions are machine code, built on first use and cached on disk.
"""

from collections.abc import Callable
from typing import TypeVar, cast

import numba
from numba.extending import register_jitable

Function = TypeVar("Function", bound=Callable[..., object])


def inlined(function: Function) -> Function:
    """Let compiled functions call this plain Python function."""
    return cast(Function, register_jitable(function))


def compiled(function: Function) -> Function:
    """Compile a function on first use; it neither holds the Python lock nor checks array bounds."""
    # fastmath stays off: results must not depend on the machine that compiled them
    return cast(Function, numba.njit(cache=True, nogil=True, error_model="numpy")(function))
