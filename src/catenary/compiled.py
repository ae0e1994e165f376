"""The one place that asks numba for anything.

`inlined` functions stay plain Python that runs on any numbers (floats, symbols) and may be called from
compiled ones. `compiled` functions are machine code, built on first use and cached on disk. `straight_line` takes
operations one by one, where there are hundreds: numba's compiler thinks for 2 ms about each sum in a function's text.
"""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar, cast

import numba
from llvmlite import ir
from numba.extending import intrinsic, register_jitable

Function = TypeVar("Function", bound=Callable[..., object])
Operation = tuple[str, int, float | int]


def inlined(function: Function) -> Function:
    """Let compiled functions call this plain Python function."""
    return cast(Function, register_jitable(function))


def compiled(function: Function) -> Function:
    """Compile a function on first use; it neither holds the Python lock nor checks array bounds."""
    # fastmath stays off: results must not depend on the machine that compiled them
    return cast(Function, numba.njit(cache=True, nogil=True, error_model="numpy")(function))


def compiled_quick(function: Function) -> Function:
    """Compile a function that takes well under a microsecond: it keeps the Python lock, which costs 0.1 us to give."""
    return cast(Function, numba.njit(cache=True, error_model="numpy")(function))


def in_memory(decorator: Callable[[Function], Function]) -> Callable[[Function], Function]:
    """Give `compiled` or `compiled_quick` for code that lies in no file, for this process alone."""
    nogil = decorator is compiled
    return lambda function: cast(Function, numba.njit(nogil=nogil, error_model="numpy")(function))


def straight_line(
    operations: Sequence[Operation],
    stores: Sequence[tuple[int, int, int, int]],
    sine_cosine: Callable[[float], tuple[float, float]],
) -> Any:
    """Make `code(arrays, k)`, to be called in compiled functions: operations without branches, on float64.

    Args:
        operations: Kind, a, b; each gives a number, the sines two (sine at its own place, cosine by "cos").
            "in": element b + k of array a. "+", "-", "*": of the numbers of operations a and b. "+k", "*k": of a and
            the constant b. "sin", "cos": of a.
        stores: Array, element, sign and operation of each result; a constant is an operation "k", 0, value.
        sine_cosine: An `inlined` function.
    """

    @intrinsic  # type: ignore[untyped-decorator]
    def code(typingctx: Any, arrays: Any, k: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            kinds = signature.args[0].types
            data = [
                context.make_array(kind)(context, builder, builder.extract_value(arguments[0], i)).data
                for i, kind in enumerate(kinds)
            ]
            number = ir.DoubleType()
            pair = numba.types.UniTuple(numba.types.float64, 2)(numba.types.float64)

            def place(array: int, element: int) -> Any:
                index = builder.add(arguments[1], ir.Constant(ir.IntType(64), element))
                return builder.gep(data[array], [index])

            values: list[Any] = []
            angles: dict[int, Any] = {}
            for kind, a, b in operations:
                if kind == "in":
                    value = builder.load(place(a, int(b)))
                elif kind == "k":
                    value = ir.Constant(number, float(b))
                elif kind in ("sin", "cos"):
                    if a not in angles:
                        angles[a] = context.compile_internal(builder, sine_cosine, pair, [values[a]])
                    value = builder.extract_value(angles[a], 0 if kind == "sin" else 1)
                else:
                    other = ir.Constant(number, float(b)) if kind.endswith("k") else values[int(b)]
                    does = {"+": builder.fadd, "-": builder.fsub, "*": builder.fmul}[kind[0]]
                    value = does(values[a], other)
                values.append(value)
            for array, element, sign, operation in stores:
                value = values[operation] if sign > 0 else builder.fneg(values[operation])
                builder.store(value, place(array, element))
            return context.get_dummy_value()

        return numba.types.void(arrays, numba.types.int64), generate

    return code
