"""Functions of Python's by LLVM alone: machine code that takes NumPy arrays.

What numba would add costs more than the arithmetic of most arms: half a second to import, as long to make ready, and in
every call a search for the code that fits, or a tuple of the arguments. Here the call's own code is written too. It is
a method of CPython's quick calling convention (METH_FASTCALL) that looks at its arrays itself (array_layout.py): where
any is not of the type and shape that it was made for, all of them go to a function of Python's. It looks at no number.

The machine code holds no address of a process: what it needs from this one comes with every call, in an array that is
its `self`. So another process may load it.
"""

import ctypes
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any

import numpy as np
from llvmlite import binding
from numpy.typing import NDArray

from catenary.errors import InputError
from catenary.kernels.array_layout import DATA, ArrayKind, empty_address, known_layout

METH_FASTCALL, METH_KEYWORDS = 0x0080, 0x0002  # methodobject.h
# what is in the array that comes with every call; then a function's own words
ARRAY_TYPE, NONE, OTHERWISE, CALL, COUNT_UP, NUMBERS, EMPTY, WORDS = range(8)
NAME = "into"
Write = Callable[[Any, list[Any], Callable[[int], Any]], None]


class _Method(ctypes.Structure):
    """PyMethodDef."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("code", ctypes.c_void_p),
        ("flags", ctypes.c_int),
        ("doc", ctypes.c_char_p),
    )


class _Given(np.ndarray[Any, Any]):
    """What comes with every call; it keeps what the function needs for as long as there is the function."""

    kept: tuple[object, ...]


def processor() -> str:
    """Tell machine code for one processor, and by one LLVM, from that of others."""
    features = binding.get_host_cpu_features().flatten()
    version = ".".join(map(str, binding.llvm_version_info))
    return f"{binding.get_host_cpu_name()} {features} {binding.get_process_triple()} {version}"


def compile_call(kinds: Sequence[ArrayKind], write: Write, *, gives: bool = False) -> bytes:
    """Compile a function of some arrays: the bytes of an object file.

    Args:
        kinds: The arrays that it takes.
        gives: Whether a call returns the last array, of float64, and makes it where it is lacking.
        write: Writes what it does, given a builder, where the arrays' numbers begin, and a function that gives the
            words of `Machine.call` by their number, as whole numbers.
    """
    machine = _target_machine()
    module = binding.parse_assembly(str(_module(kinds, write, gives)))
    module.verify()
    options = binding.create_pipeline_tuning_options(speed_level=3)
    options.slp_vectorization = True  # a sixth less time for long lines; the bits stay
    builder = binding.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)
    content: bytes = machine.emit_object(module)
    return content


class Machine:
    """Machine code of `compile_call`, loaded."""

    def __init__(self, code: bytes, kinds: Sequence[ArrayKind], *, gives: bool = False) -> None:
        """Load it; kinds of arrays and `gives` as `compile_call` was told."""
        self._kinds, self._gives = tuple(kinds), gives
        self._engine = binding.create_mcjit_compiler(binding.parse_assembly(""), _target_machine())
        self._engine.add_object_file(binding.ObjectFileRef.from_data(code))
        self._engine.finalize_object()
        self._address = self._engine.get_function_address(NAME)

    def call(
        self, otherwise: Callable[..., Any], words: Sequence[int] = (), kept: object = None
    ) -> Callable[..., Any]:
        """Give a function of Python's that runs it on some arrays.

        Args:
            otherwise: Called with any other arguments, and with those that are given by name.
            words: Whole numbers that the machine code takes besides, addresses for instance.
            kept: What must not be freed before the function.
        """
        given = np.zeros(WORDS + len(words), dtype=np.uint64).view(_Given)
        given[WORDS:] = words
        if not known_layout():
            given.kept = self._engine, kept
            return _by_address(self._address, self._kinds, otherwise, given, self._gives)
        api, numbers = ctypes.pythonapi, np.dtype("float64")
        given[[ARRAY_TYPE, NONE, OTHERWISE, NUMBERS]] = id(np.ndarray), id(None), id(otherwise), id(numbers)
        given[EMPTY] = empty_address()
        for place, of_python in ((CALL, api.PyObject_Vectorcall), (COUNT_UP, api.Py_IncRef)):
            given[place] = ctypes.cast(of_python, ctypes.c_void_p).value or 0
        method = _Method(NAME.encode(), self._address, METH_FASTCALL | METH_KEYWORDS, None)
        make = ctypes.PYFUNCTYPE(
            ctypes.py_object, ctypes.POINTER(_Method), ctypes.py_object, ctypes.py_object
        )
        given.kept = self._engine, kept, method, otherwise, numbers
        function: Callable[..., Any] = make(("PyCFunction_NewEx", api))(method, given, __name__)
        return function


def refusing(expected: str) -> Callable[..., None]:
    """Give what raises InputError with a message, for arguments that machine code does not take."""

    def refuse(*_: object) -> None:
        raise InputError(expected)

    return refuse


def call_with(
    address: int,
    own: Sequence[NDArray[Any]],
    kinds: Sequence[ArrayKind],
    otherwise: Callable[..., Any],
    *,
    gives: bool = False,
) -> Callable[..., Any]:
    """Give a function of Python's that runs machine code on arrays of its own and some that it is given.

    Args:
        address: Where the machine code lies, a function of C's that takes where the arrays lie (`compiled.address_of`).
        own: Come first; kept.
        kinds: The arrays that it is given.
        otherwise: Called with any other arguments, and with those that are given by name.
        gives: Whether a call returns the last array, of float64, and makes it where it is lacking.
    """
    words = address, *(array.ctypes.data for array in own)
    machine = _passing_on(len(own), tuple(kinds), gives, known_layout())
    return machine.call(otherwise, words, kept=own)


@cache
def _passing_on(own: int, kinds: tuple[ArrayKind, ...], gives: bool, _: bool) -> Machine:
    """Write a call of the machine code at word 0, with the words behind it and the arrays."""
    from llvmlite import ir

    from catenary.kernels.llvm_code import ADDRESS

    def write(builder: Any, data: list[Any], word: Callable[[int], Any]) -> None:
        given = [builder.inttoptr(word(1 + k), ADDRESS) for k in range(own)]
        given += [builder.bitcast(array, ADDRESS) for array in data]
        kind = ir.FunctionType(ir.VoidType(), [ADDRESS] * len(given)).as_pointer()
        builder.call(builder.inttoptr(word(0), kind), given)

    return Machine(compile_call(kinds, write, gives=gives), kinds, gives=gives)


def _by_address(
    address: int, kinds: Sequence[ArrayKind], otherwise: Callable[..., Any], given: _Given, gives: bool
) -> Callable[..., Any]:
    """Give a function that looks at arrays in Python, and makes them there."""
    run = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.POINTER(ctypes.c_void_p))(address)
    places = ctypes.c_void_p * len(kinds)

    def into(*arrays: object, **named: object) -> Any:
        makes = gives and len(arrays) == len(kinds) - 1
        taken = (*arrays, np.empty(kinds[-1].shape)) if makes else arrays
        addresses = [kind.address(array) for kind, array in zip(kinds, taken, strict=False)]
        if named or len(taken) != len(kinds) or 0 in addresses:
            return otherwise(*arrays, **named)
        run(given.ctypes.data, places(*addresses))
        return taken[-1] if gives else None

    return into


def _target_machine() -> Any:
    """Give a target machine: one for each engine, which frees it."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    return binding.Target.from_triple(binding.get_process_triple()).create_target_machine(
        cpu=binding.get_host_cpu_name(),
        features=binding.get_host_cpu_features().flatten(),
        opt=3,
        reloc="default",
        codemodel="jitdefault",
        jit=True,
    )


def _module(kinds: Sequence[ArrayKind], write: Write, gives: bool) -> Any:
    """Write the function: `PyObject *into(PyObject *self, PyObject *const *arguments, Py_ssize_t count,
    PyObject *names)`.

    Where arrays do not lie as they should, `void into(const uint64_t *given, void *const *data)`.
    """
    from llvmlite import ir

    from catenary.kernels.llvm_code import ADDRESS, WORD

    module = ir.Module(name=NAME)
    module.triple = binding.get_process_triple()
    if known_layout():
        signature = ir.FunctionType(ADDRESS, [ADDRESS, ADDRESS.as_pointer(), WORD, ADDRESS])
        _Text(ir.Function(module, signature, name=NAME), kinds).of_objects(write, gives)
    else:
        signature = ir.FunctionType(ir.VoidType(), [ADDRESS, ADDRESS.as_pointer()])
        _Text(ir.Function(module, signature, name=NAME), kinds).of_addresses(write)
    return module


class _Text:
    """The instructions of one function."""

    def __init__(self, function: Any, kinds: Sequence[ArrayKind]) -> None:
        from llvmlite import ir

        from catenary.kernels import llvm_code  # imported only where code is written

        self.ir, self.code = ir, llvm_code
        self.function, self.kinds = function, kinds
        self.numbers = [llvm_code.number_of(kind.dtype) for kind in kinds]
        self.builder = ir.IRBuilder(function.append_basic_block())
        self.given = function.args[0]  # where the array lies that comes with every call

    def of_addresses(self, write: Write) -> None:
        """Write what takes addresses."""
        data = [
            self.builder.bitcast(self.argument(k), number.as_pointer())
            for k, number in enumerate(self.numbers)
        ]
        write(self.builder, data, self.word)
        self.builder.ret_void()

    def of_objects(self, write: Write, gives: bool) -> None:
        """Write what takes Python's objects, looks at them, and gives one."""
        builder, last = self.builder, len(self.kinds) - 1
        _, arguments, count, names = self.function.args
        self.given = self.code.load_field(builder, self.given, DATA, self.code.ADDRESS)
        body, other = (self.function.append_basic_block(name) for name in ("body", "other"))
        whole = fits = builder.icmp_signed("==", count, self.code.WORD(len(self.kinds)))
        if gives:
            fits = builder.or_(whole, builder.icmp_signed("==", count, self.code.WORD(last)))
        nothing = self.ir.Constant(self.code.ADDRESS, None)
        fits = builder.and_(fits, builder.icmp_unsigned("==", names, nothing))
        builder.cbranch(fits, body, other)
        builder.position_at_end(body)
        inputs = [self.data_at(k, other) for k in range(last)]
        if gives:
            with builder.if_else(whole) as (taken, made):
                with taken:
                    ours = self.data_at(last, other), self.counted(self.argument(last))
                    by_caller = builder.block
                with made:
                    array = self.new_array()
                    theirs = (
                        self.code.load_field(builder, array, DATA, self.numbers[last].as_pointer()),
                        array,
                    )
                    by_us = builder.block
            out, result = (builder.phi(value.type) for value in ours)
            for phi, value, fresh in zip((out, result), ours, theirs, strict=True):
                phi.add_incoming(value, by_caller)
                phi.add_incoming(fresh, by_us)
        else:
            out = self.data_at(last, other)
            result = self.counted(self.from_this_process(NONE, self.code.ADDRESS))
        write(builder, [*inputs, out], self.word)
        builder.ret(result)
        builder.position_at_end(other)
        call = self.from_this_process(OTHERWISE, self.code.ADDRESS)
        builder.ret(self.call(CALL, self.code.ADDRESS, call, arguments, count, names))

    def argument(self, k: int) -> Any:
        """Give an argument."""
        return self.builder.load(self.builder.gep(self.function.args[1], [self.code.WORD(k)]))

    def data_at(self, k: int, other: Any) -> Any:
        """Give where an array's numbers lie, or go to a block if it is another array."""
        array_type = self.from_this_process(ARRAY_TYPE, self.code.WORD)
        return self.code.data_of(
            self.builder, self.argument(k), self.kinds[k], array_type, self.numbers[k], other
        )

    def from_this_process(self, place: int, kind: Any) -> Any:
        """Give what comes with every call."""
        return self.code.load_field(self.builder, self.given, 8 * place, kind)

    def word(self, k: int) -> Any:
        """Give one of the function's own whole numbers."""
        return self.from_this_process(WORDS + k, self.code.WORD)

    def call(self, place: int, result: Any, *taken: Any) -> Any:
        """Call a function of Python's or NumPy's."""
        kind = self.ir.FunctionType(result, [value.type for value in taken]).as_pointer()
        return self.builder.call(self.from_this_process(place, kind), taken)

    def counted(self, thing: Any) -> Any:
        """Give an object, counted once more."""
        self.call(COUNT_UP, self.ir.VoidType(), thing)
        return thing

    def new_array(self) -> Any:
        """Make the last array, or return at once where there is no memory: NumPy has set the error."""
        builder, sizes = self.builder, self.kinds[-1].shape
        content = self.ir.Constant(self.ir.ArrayType(self.code.WORD, len(sizes)), list(sizes))
        shape = self.ir.GlobalVariable(self.function.module, content.type, "shape")
        shape.linkage, shape.global_constant, shape.initializer = "internal", True, content
        dimensions, places = self.code.INT(len(sizes)), builder.bitcast(shape, self.code.ADDRESS)
        numbers = self.counted(self.from_this_process(NUMBERS, self.code.ADDRESS))
        array = self.call(EMPTY, self.code.ADDRESS, dimensions, places, numbers, self.code.INT(0))
        none = builder.icmp_unsigned("==", array, self.ir.Constant(self.code.ADDRESS, None))
        with builder.if_then(none, likely=False):
            builder.ret(array)
        return array
