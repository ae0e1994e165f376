"""The one place that asks numba for anything, but for calls of compiled code that must be quick (exact_calls.py).

`inlined` functions stay plain Python that runs on any numbers (floats, symbols) and may be called from
compiled ones. `compiled` functions are machine code, built on first use and cached on disk.

numba takes half a second to import, and as long again to make ready. That is done when a compiled function is first
called, so programs that call none start without it.
"""

from collections.abc import Callable
from fractions import Fraction
from functools import cache, update_wrapper
from types import ModuleType
from typing import Any, TypeVar, cast

import numpy as np

Function = TypeVar("Function", bound=Callable[..., object])
Array = TypeVar("Array")
_inlined: list[Callable[..., object]] = []
_addressed: list[Any] = []  # machine code that somebody holds the address of


def inlined(function: Function) -> Function:
    """Let compiled functions call this plain Python function."""
    _inlined.append(function)
    return function


def compiled(function: Function) -> Function:
    """Compile a function on first use; it neither holds the Python lock nor checks array bounds."""
    # fastmath stays off: results must not depend on the machine that compiled them
    return cast(Function, Compiled(function, cache=True, nogil=True))


def compiled_quick(function: Function) -> Function:
    """Compile a function that takes well under a microsecond: it keeps the Python lock, which costs 0.1 us to give."""
    return cast(Function, Compiled(function, cache=True))


def in_memory(decorator: Callable[[Function], Function]) -> Callable[[Function], Function]:
    """Give `compiled` or `compiled_quick` for code that lies in no file, for this process alone."""
    return lambda function: cast(Function, Compiled(function, nogil=decorator is compiled))


class Compiled:
    """A function that numba compiles when it is first called, from Python or from another compiled function."""

    def __init__(self, function: Callable[..., object], **options: bool) -> None:
        """Take the function, and how numba is to compile it."""
        self._function, self._options = function, options
        self._code: Any = None
        update_wrapper(self, function)

    @property
    def code(self) -> Any:
        """What numba made of it: calls of this cost 0.05 us less."""
        if self._code is None:
            self._code = start_numba().njit(error_model="numpy", **self._options)(self._function)
            # functions of its own file look its name up at every call: they call numba's from now on
            names = self._function.__globals__
            if names.get(self._function.__name__) is self:
                names[self._function.__name__] = self._code
        return self._code

    def __call__(self, *arguments: object) -> Any:
        """Run it."""
        return self.code(*arguments)

    @property
    def _numba_type_(self) -> Any:
        return self.code._numba_type_


def start_numba() -> ModuleType:
    """Import numba, knowing the functions that compiled ones may call."""
    numba = _import_numba()
    while _inlined:
        numba.extending.register_jitable(_inlined.pop())
    return numba


@cache
def _import_numba() -> ModuleType:
    import numba
    import numba.extending

    @numba.extending.intrinsic  # type: ignore[untyped-decorator]  # numba has no types
    def instruction(_: Any, a: Any, b: Any, c: Any) -> Any:
        def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            return builder.fma(*arguments)

        real = numba.types.float64
        return (real(real, real, real), generate) if (a, b, c) == (real, real, real) else None

    @numba.extending.overload(fma, strict=False)  # type: ignore[untyped-decorator]  # annotated on one side only
    def compiled_fma(a: Any, b: Any, c: Any) -> Any:
        return lambda a, b, c: instruction(a, b, c)

    @numba.extending.overload(array_at, strict=False)  # type: ignore[untyped-decorator]
    def compiled_array_at(pointer: Any, size: Any) -> Any:
        return lambda pointer, size: numba.carray(pointer, size)

    @numba.extending.intrinsic  # type: ignore[untyped-decorator]
    def uncounted(_: Any, array: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            view = context.make_array(signature.return_type)(context, builder, arguments[0])
            for owner in ("meminfo", "parent"):
                setattr(view, owner, getattr(view, owner).type(None))
            return view._getvalue()

        return array(array), generate

    @numba.extending.overload(borrowed, strict=False)  # type: ignore[untyped-decorator]
    def compiled_borrowed(array: Any) -> Any:
        return lambda array: uncounted(array)

    whole, word = numba.types.int32, numba.types.intp
    send = numba.types.ExternalFunction("send", word(whole, word, word, whole))

    @numba.extending.overload(send_bytes, strict=False)  # type: ignore[untyped-decorator]
    def compiled_send(socket: Any, address: Any, size: Any) -> Any:
        return lambda socket, address, size: send(socket, address, size, 0)

    return cast(ModuleType, numba)


def borrowed(array: Array) -> Array:
    """Give an array that the caller keeps for as long as it is used: compiled, its memory is not counted.

    Counting costs 10 ns for each array of each call, more than the sums of a linear model.
    """
    return array


def send_bytes(socket: int, address: int, size: int) -> int:
    """Give bytes at an address to an open socket: the C library's `send`, for compiled functions.

    Returns:
        How many it took; -1 for an error, or where the socket does not wait and takes none now.
    """
    raise TypeError("addresses are for compiled functions")


def array_at(pointer: Any, size: int | tuple[int, ...]) -> Any:
    """Give the array of a size or shape at a pointer; for compiled functions that `address_of` compiles."""
    raise TypeError("pointers are for compiled functions")


def address_of(function: Callable[..., None], *pointers: str, in_memory: bool = False) -> int:
    """Compile a function of pointers, and give where its machine code lies: a function of C's.

    Args:
        function: What to compile; it must not raise. It takes the arrays by `array_at`.
        pointers: NumPy's names of the types that its arguments point to.
        in_memory: Do not cache the machine code on disk.
    """
    numba = start_numba()
    kinds = [numba.types.CPointer(numba.from_dtype(np.dtype(name))) for name in pointers]
    compile_for = numba.cfunc(numba.types.void(*kinds), cache=not in_memory, error_model="numpy")
    made = compile_for(function)
    _addressed.append(made)
    return int(made.address)


def instructions(write: Callable[[Any, list[Any]], None]) -> Any:
    """Make `code(arguments)`, to be called in compiled functions with a tuple of arrays and whole numbers.

    Args:
        write: Writes LLVM's instructions with a builder; it is given where the arrays' numbers begin, and the numbers.
    """
    numba = start_numba()

    @numba.extending.intrinsic  # type: ignore[untyped-decorator]
    def code(typingctx: Any, arguments: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            values = []
            for i, kind in enumerate(signature.args[0].types):
                value = builder.extract_value(given[0], i)
                if isinstance(kind, numba.types.Array):
                    value = context.make_array(kind)(context, builder, value).data
                elif isinstance(kind, numba.types.Integer):
                    value = context.cast(builder, value, kind, numba.types.int64)
                values.append(value)
            write(builder, values)
            return context.get_dummy_value()

        return numba.types.void(arguments), generate

    return code


def fma(a: float, b: float, c: float) -> float:
    """Give a * b + c of finite numbers, rounded once.

    Compiled, it is one instruction of the processor, or the C library's function, many times slower, where it has
    none (x86 before 2013): the bits are the same everywhere. Compilers never make one of a product and a sum by
    themselves here.
    """
    return float(Fraction(a) * Fraction(b) + Fraction(c))
