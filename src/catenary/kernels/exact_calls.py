"""Compiled functions of one signature, called without numba's search for it.

At every call numba finds out which machine code is for arrays like those given; that takes 0.15 us, and 0.04 us more
for each array whose memory it begins to count: more than the arithmetic of most arms. A function made by `exact` takes
arrays of one type and shape. The call's own code looks at them (array_layout.py), a dozen comparisons, and memory is
not counted.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar, cast

import numba
import numpy as np
from llvmlite import binding, ir
from numba.core import cgutils
from numba.extending import NativeValue, intrinsic, models, register_model, unbox

from catenary.kernels.array_layout import ArrayKind, known_layout
from catenary.kernels.compiled import start_numba
from catenary.kernels.llvm_code import WORD, data_of

Function = TypeVar("Function", bound=Callable[..., object])
ARRAY_TYPE = "catenary_numpy_array_type"  # for the linker of machine code, which may come from the cache
binding.add_symbol(ARRAY_TYPE, id(np.ndarray))
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
        self.dtype, self.shape = dtype, shape
        self.kind = ArrayKind(dtype, shape, writable)
        way = "" if known_layout() else ", by address"  # other machine code
        super().__init__(name=f"Exact({dtype}, {shape}, {'written' if writable else 'read'}{way})")

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
    builder, pointer = c.builder, c.context.get_value_type(kind)
    if not known_layout():
        return NativeValue(builder.inttoptr(c.pyapi.long_as_ulonglong(given), pointer))
    array_type = builder.ptrtoint(c.pyapi.get_c_object(ARRAY_TYPE), WORD)
    other, done = builder.append_basic_block(), builder.append_basic_block()
    data = data_of(builder, given, kind.kind, array_type, pointer.pointee, other)
    found = builder.block
    builder.branch(done)
    builder.position_at_end(other)
    builder.branch(done)
    builder.position_at_end(done)
    here = builder.phi(pointer)
    here.add_incoming(data, found)
    here.add_incoming(ir.Constant(pointer, None), other)
    return NativeValue(here)


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

    The function gets pointers: `others` says whether an array was another than expected, `as_arrays` gives arrays.

    Args:
        arguments: `Exact`, float, int or bool.
        result: float, int or bool; nothing when None.
        in_memory: Do not cache the machine code.
    """
    kinds = [NUMBERS.get(kind, kind) for kind in arguments]
    signature = NUMBERS[result](*kinds)

    def decorate(function: Function) -> Function:
        made = start_numba().njit([signature], cache=not in_memory, error_model="numpy")(function)
        call = made.overloads[signature.args].entry_point
        return cast(Function, call if known_layout() else partial(_by_address, call, kinds))

    return decorate


def _by_address(call: Callable[..., Any], kinds: list[Any], *given: Any) -> Any:
    pairs = zip(kinds, given, strict=True)
    return call(*(kind.kind.address(value) if isinstance(kind, Exact) else value for kind, value in pairs))
