"""Ticks of a calibration model as Python calls them: machine code for all models, behind a call for one's own arrays.

A tick is compiled once for all models (tick.py); what numba does at each call to find that out takes longer than most
ticks. Here the sizes of a model's arrays are known: the call looks at them and passes their addresses on.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

from catenary.array_layout import ArrayKind, known_layout
from catenary.arrays import Floats
from catenary.calibration.kernels import Integers
from catenary.calibration.tick import JOINTS, ROBOT_JOINTS, SIGNALS, tick, tick_state
from catenary.compiled import address_of, array_at
from catenary.llvm_calls import Write, compile_call, load_call

NO_END = 2**40  # of arrays whose sizes no one asks for
POINTERS = ("int64", "float64", "float64", "float64", "float64", "boolean")


def tick_call(layout: Integers, memory: Floats) -> Callable[..., None]:
    """Give `call(q, signals, out, inside)`: `tick` of a model. Any other arrays raise InputError."""
    n, size = int(layout[JOINTS]), int(layout[SIGNALS])
    return _call(_tick_address(), layout, memory, (n, size), n)


def tick_state_call(layout: Integers, memory: Floats) -> Callable[..., None]:
    """Give `call(q, qd, tau, out, inside)`: `tick_state` of a model and a robot. Any other arrays raise InputError."""
    size = int(layout[ROBOT_JOINTS])
    return _call(_tick_state_address(), layout, memory, (size, size, size), size)


def _call(
    address: int, layout: Integers, memory: Floats, inputs: tuple[int, ...], outputs: int
) -> Callable[..., None]:
    kinds = [ArrayKind("float64", (size,), writable=False) for size in inputs]
    kinds += [ArrayKind(dtype, (outputs,), writable=True) for dtype in ("float64", "bool")]
    words = address, layout.ctypes.data, memory.ctypes.data
    code = _code(tuple(kinds), known_layout())
    return load_call(code, kinds, "corrector: another array than expected", words, kept=(layout, memory))


@cache
def _code(kinds: tuple[ArrayKind, ...], _: bool) -> bytes:
    return compile_call(kinds, _passing_on())


def _passing_on() -> Write:
    """Write a call of the machine code at word 0, with words 1 and 2 and the arrays."""
    from llvmlite import ir

    from catenary.llvm_code import ADDRESS

    def write(builder: Any, data: list[Any], word: Callable[[int], Any]) -> None:
        given = [builder.inttoptr(word(k), ADDRESS) for k in (1, 2)]
        given += [builder.bitcast(array, ADDRESS) for array in data]
        kind = ir.FunctionType(ir.VoidType(), [ADDRESS] * len(given)).as_pointer()
        builder.call(builder.inttoptr(word(0), kind), given)

    return write


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
