"""Calls a compiled function on fixed arrays: checked once, then without arguments, for whatever runs in a loop.

numba looks at every argument of every call, which takes longer than the arithmetic of most arms. `bind` looks at the
arrays once. What it returns is a builtin function of CPython without arguments; its `self` is a capsule around
[code, None, addresses and sizes of the arrays], and its own machine code is a dozen instructions that pass these on.
Nothing but Python's public C interface is used, so it works wherever numba does.
"""

import ctypes
import inspect
import sys
from collections.abc import Callable, Sequence
from functools import cache, partial
from hashlib import sha256
from itertools import combinations, product
from pathlib import Path
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.errors import InputError
from catenary.kernels.compiled import Compiled, load_module, start_numba

_BLOCK_ROWS = 250  # at once; of some hundred columns more would not stay in the cache
_METH_NOARGS = 0x0004  # methodobject.h
_CODE, _NONE, _ARGUMENTS = range(3)  # places in the block
_NUMBER_TYPES = tuple(map(np.dtype, (np.float64, np.int64, np.uint8, np.bool_)))
_code: dict[tuple[FunctionType, str], Any] = {}  # by function and types of arrays


def bind(
    function: Callable[..., None], inputs: Sequence[NDArray[Any]], outputs: Sequence[NDArray[Any]]
) -> Callable[[], None]:
    """Return a function without arguments that runs `function(*inputs, *outputs)` on these very arrays.

    It keeps the arrays alive, and holds Python's lock while it runs. It costs some 0.01 us more than a builtin function
    that does nothing.

    Args:
        function: `@compiled`; it must not raise: no caller would receive the exception.
        inputs: Arrays that are only read.
        outputs: Arrays that are written, and overlap no other.

    Raises:
        InputError: No compiled function, or arrays that are not C-contiguous, of float64, int64, uint8 or bool, or of
            structured types with fields of these (an array in a field cannot be of bool, which numba does not know).
    """
    if not isinstance(function, Compiled) and not hasattr(function, "py_func"):
        raise InputError(f"bind: expected a @compiled function, got {function!r}")
    arrays = [*inputs, *outputs]
    _check(list(inspect.signature(function).parameters), inputs, outputs)
    sizes = [size for array in arrays for size in array.shape]
    words = [_code_of(function, arrays), id(None), *(array.ctypes.data for array in arrays), *sizes]
    block = (ctypes.c_int64 * len(words))(*words)
    name = str(getattr(function, "__name__", "bound")).encode()
    method = _Method(name, _passing_on(len(words) - _ARGUMENTS)[1], _METH_NOARGS, None)
    capsule = _new_capsule(ctypes.addressof(block), None, None)
    return _new_function(method, capsule, _Home(__name__, arrays, block, method))


class _Method(ctypes.Structure):
    """PyMethodDef."""

    _fields_ = (("name", ctypes.c_char_p), ("code", ctypes.c_void_p), ("flags", ctypes.c_int), ("doc", ctypes.c_char_p))


class _Home(str):
    """The `__module__` of a bound function, which also holds what the function needs."""

    kept: tuple[object, ...]

    def __new__(cls, name: str, *kept: object) -> "_Home":
        home = super().__new__(cls, name)
        home.kept = kept
        return home


_new_capsule = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)(
    ("PyCapsule_New", ctypes.pythonapi)
)
_new_function = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.POINTER(_Method), ctypes.py_object, ctypes.py_object)(
    ("PyCFunction_NewEx", ctypes.pythonapi)
)


def _check(names: Sequence[str], inputs: Sequence[NDArray[Any]], outputs: Sequence[NDArray[Any]]) -> None:
    if len(names) != len(inputs) + len(outputs):
        raise InputError(
            f"bind: expected {len(names)} arrays ({', '.join(names)}), "
            f"got {len(inputs)} inputs and {len(outputs)} outputs"
        )
    for name, array in zip(names, [*inputs, *outputs], strict=True):
        if not isinstance(array, np.ndarray):
            raise InputError(f"{name}: expected a NumPy array, got {type(array).__name__}")
        requirements = {
            "float64, int64, uint8, bool, or named fields of these (arrays in fields: not of bool), in the machine's "
            f"byte order, got {array.dtype}": _is_known(array.dtype),
            f"a C-contiguous array, got shape {array.shape} with strides {array.strides}": array.flags.c_contiguous,
            f"an aligned array, got {array.dtype} at an odd address": array.flags.aligned,
        }
        for requirement, holds in requirements.items():
            if not holds:
                raise InputError(f"{name}: expected {requirement}")
    written = list(zip(names[len(inputs) :], outputs, strict=True))
    for name, array in written:
        if not array.flags.writeable:
            raise InputError(f"{name}: expected an output that can be written, got a read-only array")
    read = zip(names, inputs, strict=False)
    for (name, array), (other, taken) in [*product(written, read), *combinations(written, 2)]:
        if np.may_share_memory(array, taken):  # contiguous: their bounds say it all
            raise InputError(f"{name}: expected memory of its own, got an array that overlaps {other}")


def _is_known(dtype: np.dtype[Any]) -> bool:
    if dtype.names is not None:
        return all(_is_known(dtype[name]) for name in dtype.names)
    if dtype.subdtype is not None:
        return dtype.base != np.bool_ and _is_known(dtype.base)
    return dtype in _NUMBER_TYPES


def _code_of(function: Callable[..., None], arrays: Sequence[NDArray[Any]]) -> int:
    """Compile, or find compiled, a C function of the arrays' addresses and sizes, and return its address."""
    numba = start_numba()
    plain = inspect.unwrap(function)
    assert isinstance(plain, FunctionType)
    kinds = [numba.from_dtype(array.dtype) for array in arrays]
    dimensions = sum(array.ndim for array in arrays)
    signature = numba.types.void(*map(numba.types.CPointer, kinds), *[numba.types.intp] * dimensions)
    key = plain, str((signature, [array.ndim for array in arrays]))
    if key not in _code:
        source, kept = _source(plain, arrays, str(signature))
        names: dict[str, Any] = {"function": function, "carray": numba.carray}
        if kept:
            module = load_module(f"bind-{plain.__name__}", source, names)
            call, kept = module.call, module.__file__ is not None
        else:
            exec(source, names)
            call = names["call"]
        _code[key] = numba.cfunc(signature, cache=kept, error_model="numpy")(call)
    return int(_code[key].address)


def _source(plain: FunctionType, arrays: Sequence[NDArray[Any]], signature: str) -> tuple[str, bool]:
    """Write the C function in Python; also return whether its machine code may be found by this text."""
    sizes = [[f"n{i}_{k}" for k in range(array.ndim)] for i, array in enumerate(arrays)]
    names = ", ".join([*(f"a{i}" for i in range(len(arrays))), *(size for of in sizes for size in of)])
    views = (f"carray(a{i}, ({''.join(f'{size}, ' for size in of)}))" for i, of in enumerate(sizes))
    # numba does not see that a function which is called has changed
    digest = _digest_of(plain)
    head = f"# {plain.__module__}.{plain.__qualname__}, {digest}: {signature}\ndef call({names}):\n"
    return f"{head}    function({', '.join(views)})\n", digest is not None


def _digest_of(function: FunctionType) -> str | None:
    """Digest the source files of a function and of all that it calls by name; None where one is in no file."""
    named = getattr(sys.modules.get(function.__module__), function.__name__, None)
    if named is None or inspect.unwrap(named) is not function:
        return None  # another function could come to have its name
    packages = {name.partition(".")[0] for name in (function.__module__, __name__)}
    called: dict[FunctionType, Path] = {}
    waiting: list[object] = [function]
    while waiting:
        here = waiting.pop()
        here = inspect.unwrap(here) if callable(here) else None
        if not isinstance(here, FunctionType) or here in called:
            continue
        if here.__module__.partition(".")[0] in packages:  # other libraries do not change between releases
            called[here] = Path(here.__code__.co_filename)
            waiting += [here.__globals__.get(name) for name in here.__code__.co_names]
    try:
        texts = [path.read_bytes() for path in sorted(set(called.values()))]
    except OSError:
        return None
    return sha256(b"".join(texts)).hexdigest()[:32]


@cache
def _passing_on(count: int) -> tuple[Any, int]:
    """Compile `PyObject *call(PyObject *capsule, PyObject *)` for so many 64-bit words; return its address."""
    from llvmlite import binding, ir

    word, address = ir.IntType(64), ir.IntType(8).as_pointer()
    module = ir.Module(name="bind")
    module.triple = binding.get_process_triple()
    get_pointer = ir.Function(module, ir.FunctionType(address, [address, address]), "PyCapsule_GetPointer")
    count_up = ir.Function(module, ir.FunctionType(ir.VoidType(), [address]), "Py_IncRef")
    function = ir.Function(module, ir.FunctionType(address, [address, address]), "call")
    builder = ir.IRBuilder(function.append_basic_block())
    pointer = builder.call(get_pointer, [function.args[0], ir.Constant(address, None)])
    block = builder.bitcast(pointer, word.as_pointer())
    words = [builder.load(builder.gep(block, [word(k)])) for k in range(_ARGUMENTS + count)]
    kind = ir.FunctionType(ir.VoidType(), [word] * count).as_pointer()
    builder.call(builder.inttoptr(words[_CODE], kind), words[_ARGUMENTS:])
    none = builder.inttoptr(words[_NONE], address)
    builder.call(count_up, [none])
    builder.ret(none)

    for name in ("PyCapsule_GetPointer", "Py_IncRef"):
        place = ctypes.cast(getattr(ctypes.pythonapi, name), ctypes.c_void_p).value
        assert place is not None
        binding.add_symbol(name, place)
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    machine = binding.Target.from_default_triple().create_target_machine(opt=3)
    engine = binding.create_mcjit_compiler(binding.parse_assembly(str(module)), machine)
    engine.finalize_object()
    return engine, int(engine.get_function_address("call"))


class Step(NamedTuple):
    """A function and the arrays that it runs on: `function(*inputs, *outputs)`."""

    function: Callable[..., None]
    inputs: tuple[NDArray[Any], ...]  # read only
    outputs: tuple[NDArray[Any], ...]  # written, or read and written
    is_compiled: bool = True  # else it is Python, as an estimator's, and runs nowhere else


def run(steps: Sequence[Step]) -> None:
    """Run steps one after the other."""
    for step in steps:
        step.function(*step.inputs, *step.outputs)


def bound(steps: Sequence[Step]) -> Callable[[], None]:
    """Return a call without arguments that runs steps on their arrays, which are checked once, now."""
    calls = [
        bind(*step[:3]) if step.is_compiled else partial(step.function, *step.inputs, *step.outputs) for step in steps
    ]

    def tick() -> None:
        for call in calls:
            call()

    return tick


def blocks(rows: int) -> list[slice]:
    """Return consecutive slices of rows, short enough that arrays between two steps stay in the processor's cache."""
    return [slice(first, min(first + _BLOCK_ROWS, rows)) for first in range(0, rows, _BLOCK_ROWS)]
