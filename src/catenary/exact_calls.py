"""Compiled functions of one signature, called without numba's search for it.

At every call numba finds out which machine code is for arrays like those given; that takes 0.15 us, and 0.04 us more
for each array whose memory it begins to count: more than the arithmetic of most arms. A function made by `exact` takes
arrays of one type and shape. The call's own code looks at them, a dozen comparisons, and memory is not counted.

What it compares are the first fields of NumPy's array object. They are part of its binary interface: extension modules
have them compiled in. All the same they are tried on an array before any code relies on them (`known_layout`); where
they lie elsewhere, arrays are looked at in Python, which takes its time.
"""

import ctypes
import sys
from collections.abc import Callable
from functools import cache, partial
from typing import Any, TypeVar, cast

import numba
import numpy as np
from llvmlite import binding, ir
from numba.core import cgutils
from numba.extending import NativeValue, intrinsic, models, register_model, unbox

Function = TypeVar("Function", bound=Callable[..., object])
HEAD = object.__basicsize__
# offsets of fields, from numpy/arrayobject.h and numpy/ndarraytypes.h
TYPE = HEAD - 8
DATA, DIMENSIONS, SHAPE, DESCRIPTION, FLAGS = (HEAD + k for k in (0, 8, 16, 40, 48))
BYTE_ORDER, TYPE_NUMBER = HEAD + 10, HEAD + 12
ARRAY_TYPE = "catenary_numpy_array_type"  # for the linker of machine code, which may come from the cache
binding.add_symbol(ARRAY_TYPE, id(np.ndarray))
READABLE = 0x0001 | 0x0100  # C contiguous, aligned
WRITABLE = READABLE | 0x0400
NUMBERS: dict[type | None, Any] = {
    None: numba.types.void,
    float: numba.types.float64,
    int: numba.types.int64,
    bool: numba.types.boolean,
}


class Exact(numba.types.Type):  # type: ignore[misc]
    """A NumPy array of one type and shape, contiguous; compiled code sees where it lies, or null if it is another."""

    def __init__(self, dtype: str, shape: tuple[int, ...], *, writable: bool) -> None:
        """Take a NumPy type's name, a shape and whether it is written to."""
        self.dtype, self.shape, self.writable = dtype, shape, writable
        way = "" if known_layout() else ", by address"  # other machine code
        super().__init__(name=f"Exact({dtype}, {shape}, {'written' if writable else 'read'}{way})")

    def address(self, given: object) -> int:
        """Where an array lies; 0 if it is another."""
        if type(given) is not np.ndarray or given.dtype != self.dtype or given.shape != self.shape:
            return 0
        flags = given.flags
        fits = flags.c_contiguous and flags.aligned and (flags.writeable or not self.writable)
        return int(given.ctypes.data) if fits else 0

    @property
    def array(self) -> Any:
        """Numba's type of the array."""
        return numba.types.Array(numba.from_dtype(np.dtype(self.dtype)), len(self.shape), "C")


@register_model(Exact)
class _ExactModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, dmm: Any, kind: Exact) -> None:
        number = dmm.lookup(kind.array.dtype).get_data_type()
        super().__init__(dmm, kind, number.as_pointer())


@unbox(Exact)  # type: ignore[untyped-decorator]
def _unbox_exact(kind: Exact, given: Any, c: Any) -> Any:
    builder, dtype = c.builder, np.dtype(kind.dtype)
    pointer = c.context.get_value_type(kind)
    if not known_layout():
        return NativeValue(builder.inttoptr(c.pyapi.long_as_ulonglong(given), pointer))
    word, address = ir.IntType(64), cgutils.voidptr_t

    def field(of: Any, offset: int, what: Any) -> Any:
        place = builder.gep(builder.bitcast(of, address), [ir.Constant(word, offset)])
        return builder.load(builder.bitcast(place, what.as_pointer()))

    def equals(value: Any, expected: int) -> Any:
        return builder.icmp_unsigned("==", value, ir.Constant(value.type, expected))

    here = cgutils.alloca_once_value(builder, ir.Constant(pointer, None))
    array_type = c.pyapi.get_c_object(ARRAY_TYPE)
    own = builder.ptrtoint(array_type, word)
    with builder.if_then(builder.icmp_unsigned("==", field(given, TYPE, word), own), likely=True):
        size = field(given, DIMENSIONS, ir.IntType(32))
        with builder.if_then(equals(size, len(kind.shape)), likely=True):
            description = field(given, DESCRIPTION, address)
            wanted = WRITABLE if kind.writable else READABLE
            flags = builder.and_(field(given, FLAGS, ir.IntType(32)), ir.Constant(ir.IntType(32), wanted))
            fits = builder.and_(
                equals(flags, wanted), equals(field(description, TYPE_NUMBER, ir.IntType(32)), dtype.num)
            )
            order = field(description, BYTE_ORDER, ir.IntType(8))
            fits = builder.and_(fits, equals(order, ord(dtype.byteorder)))
            shape = field(given, SHAPE, address)
            for k, length in enumerate(kind.shape):
                fits = builder.and_(fits, equals(field(shape, 8 * k, word), length))
            builder.store(builder.select(fits, field(given, DATA, pointer), ir.Constant(pointer, None)), here)
    return NativeValue(builder.load(here))


@intrinsic  # type: ignore[untyped-decorator]
def others(typingctx: Any, arrays: Any) -> Any:
    """Whether any array of a tuple is not of the type and shape that the function takes."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        found = cgutils.false_bit
        for k, kind in enumerate(signature.args[0].types):
            if isinstance(kind, Exact):
                value = builder.extract_value(arguments[0], k)
                found = builder.or_(found, cgutils.is_null(builder, value))
        return found

    return numba.types.boolean(arrays), generate


@intrinsic  # type: ignore[untyped-decorator]
def as_arrays(typingctx: Any, given: Any) -> Any:
    """A tuple of the arrays themselves, for functions that take arrays; none may be null."""
    kinds = [kind.array if isinstance(kind, Exact) else kind for kind in given.types]
    result = numba.types.Tuple(kinds)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        values = []
        for k, kind in enumerate(signature.args[0].types):
            value = builder.extract_value(arguments[0], k)
            if isinstance(kind, Exact):
                value = _array(context, builder, kind, value)
            values.append(value)
        return context.make_tuple(builder, signature.return_type, values)

    return result(given), generate


def _array(context: Any, builder: Any, kind: Exact, data: Any) -> Any:
    from numba.np.arrayobj import populate_array

    size = np.dtype(kind.dtype).itemsize
    steps = [size * int(np.prod(kind.shape[k + 1 :])) for k in range(len(kind.shape))]
    array = context.make_array(kind.array)(context, builder)
    populate_array(
        array,
        data=data,
        shape=[context.get_constant(numba.types.intp, n) for n in kind.shape],
        strides=[context.get_constant(numba.types.intp, step) for step in steps],
        itemsize=context.get_constant(numba.types.intp, size),
        meminfo=None,
    )
    return array._getvalue()


def exact(
    *arguments: Any, result: type | None = None, in_memory: bool = False
) -> Callable[[Function], Function]:
    """Compile a function of one signature, at once, and give what calls it.

    The function gets pointers: `others` says whether an array was another than expected, `as_arrays` gives arrays, and
    code of `straight_line` takes them as they are.

    Args:
        arguments: `Exact`, float, int or bool.
        result: float, int or bool; nothing when None.
        in_memory: Do not cache the machine code.
    """
    kinds = [NUMBERS.get(kind, kind) for kind in arguments]
    signature = NUMBERS[result](*kinds)

    def decorate(function: Function) -> Function:
        made = numba.njit([signature], cache=not in_memory, error_model="numpy")(function)
        call = made.overloads[signature.args].entry_point
        return cast(Function, call if known_layout() else partial(_by_address, call, kinds))

    return decorate


def _by_address(call: Callable[..., Any], kinds: list[Any], *given: Any) -> Any:
    pairs = zip(kinds, given, strict=True)
    return call(*(kind.address(value) if isinstance(kind, Exact) else value for kind, value in pairs))


@cache
def known_layout() -> bool:
    """Whether arrays' fields lie where `exact` looks for them."""
    if sys.implementation.name != "cpython" or ctypes.sizeof(ctypes.c_void_p) != 8:
        return False
    array = np.zeros((2, 3))
    fixed = np.zeros((2, 3))
    fixed.flags.writeable = False

    def field(of: np.ndarray[Any, Any], offset: int, kind: Any) -> int:
        return int(kind.from_address(id(of) + offset).value)

    description = field(array, DESCRIPTION, ctypes.c_uint64)
    return (
        field(array, TYPE, ctypes.c_uint64) == id(np.ndarray)
        and field(array, DATA, ctypes.c_uint64) == array.ctypes.data
        and field(array, DIMENSIONS, ctypes.c_int) == 2
        and description == id(array.dtype)
        and ctypes.c_int.from_address(description + TYPE_NUMBER).value == array.dtype.num
        and ctypes.c_char.from_address(description + BYTE_ORDER).value == b"="
        and field(array, FLAGS, ctypes.c_int) & WRITABLE == WRITABLE
        and field(fixed, FLAGS, ctypes.c_int) & WRITABLE == READABLE
        and field(array.T, FLAGS, ctypes.c_int) & 1 == 0
        and (ctypes.c_int64 * 2).from_address(field(array, SHAPE, ctypes.c_uint64))[:] == [2, 3]
    )
