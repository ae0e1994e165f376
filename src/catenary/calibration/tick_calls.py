"""Ticks of a calibration model as Python calls them: machine code for all models, behind a call for one's own arrays.

A tick is compiled once for all models (tick.py); what numba does at each call to find that out takes longer than most
ticks. Here the sizes of a model's arrays are known: the call looks at them and passes their addresses on.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats
from catenary.calibration.kernels import Integers
from catenary.calibration.tick import JOINTS, ROBOT_JOINTS, SIGNALS, tick, tick_state
from catenary.errors import InputError
from catenary.kernels.array_layout import ArrayKind
from catenary.kernels.compiled import address_of, array_at
from catenary.kernels.llvm_calls import call_with

NO_END = 2**40  # of arrays whose sizes no one asks for
POINTERS = ("int64", "float64", "float64", "float64", "float64", "bool")


def tick_call(layout: Integers, memory: Floats) -> Callable[..., None]:
    """Give `call(q, signals, out, inside)`: `tick` of a model.

    Arrays of another type or layout are copied. Those of another size raise InputError.
    """
    n, size = int(layout[JOINTS]), int(layout[SIGNALS])
    expected = f"expected q_nominal ({n},), signals ({size},), out ({n},), inside ({n},), got"
    return _call(_tick_address(), tick, layout, memory, (n, size, n), expected)


def tick_state_call(layout: Integers, memory: Floats) -> Callable[..., None]:
    """Give `call(q, qd, tau, out, inside)`: `tick_state` of a model and a robot; arrays as `tick_call` takes them."""
    size = int(layout[ROBOT_JOINTS])
    expected = "q, qd, tau, out and inside are not of the robot that it was prepared for:"
    return _call(_tick_state_address(), tick_state, layout, memory, (size,) * 4, expected)


def _call(
    address: int,
    function: Callable[..., bool],
    layout: Integers,
    memory: Floats,
    sizes: tuple[int, ...],
    expected: str,
) -> Callable[..., None]:
    """Give a call of the machine code at an address, and of the function for arrays of another type or layout."""
    sizes = (*sizes, sizes[-1])  # as many flags as positions
    types = ["float64"] * (len(sizes) - 1) + ["bool"]
    kinds = [
        ArrayKind(dtype, (size,), writable=k >= len(sizes) - 2)
        for k, (dtype, size) in enumerate(zip(types, sizes, strict=True))
    ]

    def by_copies(*arrays: ArrayLike) -> None:
        given = [np.shape(array) for array in arrays]
        if given != [kind.shape for kind in kinds]:
            raise InputError(f"corrector: {expected} {', '.join(map(str, given))}")
        *inputs, out, inside = arrays
        copies = [np.ascontiguousarray(array, dtype=float) for array in inputs]
        result, flags = np.empty(kinds[-2].shape), np.empty(kinds[-1].shape, dtype=bool)
        function(layout, memory, *copies, result, flags)
        out[:], inside[:] = result, flags  # type: ignore[index]

    return call_with(address, (layout, memory), kinds, by_copies)


@cache
def _tick_address() -> int:
    return address_of(_tick_at, *POINTERS)


@cache
def _tick_state_address() -> int:
    return address_of(_tick_state_at, "int64", "float64", *POINTERS[1:])


def _tick_at(layout: Any, memory: Any, q: Any, signals: Any, out: Any, inside: Any) -> None:
    whole = array_at(layout, NO_END)
    n, size = whole[JOINTS], whole[SIGNALS]
    tick(
        whole,
        array_at(memory, NO_END),
        array_at(q, n),
        array_at(signals, size),
        array_at(out, n),
        array_at(inside, n),
    )


def _tick_state_at(layout: Any, memory: Any, q: Any, qd: Any, tau: Any, out: Any, inside: Any) -> None:
    whole = array_at(layout, NO_END)
    n = whole[ROBOT_JOINTS]
    tick_state(
        whole,
        array_at(memory, NO_END),
        array_at(q, n),
        array_at(qd, n),
        array_at(tau, n),
        array_at(out, n),
        array_at(inside, n),
    )
