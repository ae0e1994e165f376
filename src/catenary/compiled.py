"""The one place that asks numba for anything, but for calls of compiled code that must be quick (exact_calls.py).

`inlined` functions stay plain Python that runs on any numbers (floats, symbols) and may be called from
compiled ones. `compiled` functions are machine code, built on first use and cached on disk. `straight_line` takes
operations one by one, where there are hundreds: numba's compiler thinks for 2 ms about each sum in a function's text.
"""

import sys
from collections.abc import Callable, Sequence
from fractions import Fraction
from importlib.util import find_spec
from typing import Any, NamedTuple, TypeVar, cast

import numba
from llvmlite import ir
from numba.core import cgutils
from numba.extending import intrinsic, overload, register_jitable


def _learn_of_blas() -> None:
    """Let numba ask whether there is a BLAS without importing all of scipy.linalg, which takes 0.3 s.

    It asks once, before it loads or compiles anything, and looks for the BLAS itself when a matrix product is compiled.
    """
    if "numba.np.arraymath" in sys.modules or find_spec("scipy") is None:
        return
    from numba.np import linalg

    ask, linalg.ensure_blas = linalg.ensure_blas, lambda: None
    try:
        from numba.np import arraymath
    finally:
        linalg.ensure_blas = ask
    arraymath.ensure_blas = ask


_learn_of_blas()

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


class Sines(NamedTuple):
    """How `straight_line` takes sines: `inlined` functions of an angle that give its sine and cosine."""

    any: Callable[[float], tuple[float, float]]
    small: Callable[[Any], tuple[Any, Any]]  # nothing but + - *, for angles up to `largest`
    largest: float


def straight_line(
    operations: Sequence[Operation], stores: Sequence[tuple[int, int, int, int]], sines: Sines
) -> Any:
    """Make `code(arrays, k)`, to be called in compiled functions: operations on float64, one after the other.

    Args:
        operations: Kind, a, b; each gives a number.
            "in": element b + k of array a. "+", "-", "*": of the numbers of operations a and b. "+k", "*k": of a and
            the constant b. "sin", "cos": of a, which no sine or cosine goes into; they are taken several at once.
        stores: Array, element, sign and operation of each result; a constant is an operation "k", 0, value.
        sines: How they are taken.
    """
    angles = sorted({a for kind, a, _ in operations if kind in ("sin", "cos")})

    @intrinsic  # type: ignore[untyped-decorator]
    def code(typingctx: Any, arrays: Any, k: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            data = []
            for i, kind in enumerate(signature.args[0].types):
                given = builder.extract_value(arguments[0], i)
                if isinstance(kind, numba.types.Array):
                    given = context.make_array(kind)(context, builder, given).data
                data.append(given)

            def place(array: int, element: int) -> Any:
                index = builder.add(arguments[1], ir.Constant(ir.IntType(64), element))
                return builder.gep(data[array], [index])

            values: dict[int, Any] = {}

            def value_of(number: int) -> Any:
                """Write an operation, and before it those that it needs."""
                waiting = [number]
                while waiting:
                    kind, a, b = operations[waiting[-1]]
                    needs = [] if kind in ("in", "k") else [a]
                    if kind in ("+", "-", "*"):
                        needs.append(int(b))
                    missing = [need for need in needs if need not in values]
                    if missing:
                        waiting += missing
                        continue
                    here = waiting.pop()
                    if kind == "in":
                        values[here] = builder.load(place(a, int(b)))
                    elif kind == "k":
                        values[here] = ir.Constant(NUMBER, float(b))
                    else:
                        other = ir.Constant(NUMBER, float(b)) if kind.endswith("k") else values[int(b)]
                        does = {"+": builder.fadd, "-": builder.fsub, "*": builder.fmul}[kind[0]]
                        values[here] = does(values[a], other)
                return values[number]

            taken = _sines(context, builder, [value_of(angle) for angle in angles], sines)
            for number, (kind, a, _) in enumerate(operations):
                if kind in ("sin", "cos"):
                    values[number] = taken[angles.index(a)][0 if kind == "sin" else 1]
            for array, element, sign, operation in stores:
                value = value_of(operation)
                builder.store(value if sign > 0 else builder.fneg(value), place(array, element))
            return context.get_dummy_value()

        return numba.types.void(arrays, numba.types.int64), generate

    return code


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


NUMBER = ir.DoubleType()
LANES = 4  # numbers in a register of processors with AVX2; LLVM halves it for others


class _Several:
    """Numbers side by side in a register: plain arithmetic on them writes instructions."""

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value = builder, value

    def _other(self, other: "_Several | float") -> Any:
        if isinstance(other, _Several):
            return other.value
        return ir.Constant(self.value.type, [float(other)] * self.value.type.count)

    def __add__(self, other: "_Several | float") -> "_Several":
        return _Several(self.builder, self.builder.fadd(self.value, self._other(other)))

    def __sub__(self, other: "_Several | float") -> "_Several":
        return _Several(self.builder, self.builder.fsub(self.value, self._other(other)))

    def __rsub__(self, other: float) -> "_Several":
        return _Several(self.builder, self.builder.fsub(self._other(other), self.value))

    def __mul__(self, other: "_Several | float") -> "_Several":
        return _Several(self.builder, self.builder.fmul(self.value, self._other(other)))

    __radd__ = __add__
    __rmul__ = __mul__


def _sines(context: Any, builder: Any, angles: Sequence[Any], sines: Sines) -> list[tuple[Any, Any]]:
    """Write sines and cosines of angles: all by `small` side by side, or each by `any` if one is large."""
    if not angles:
        return []
    lanes = min(LANES, 1 << (len(angles) - 1).bit_length())
    vector, index = ir.VectorType(NUMBER, lanes), ir.IntType(32)
    groups = []
    for first in range(0, len(angles), lanes):
        group = ir.Constant(vector, ir.Undefined)
        for lane in range(lanes):
            angle = angles[min(first + lane, len(angles) - 1)]
            group = builder.insert_element(group, angle, ir.Constant(index, lane))
        groups.append(group)
    small = None
    for group in groups:
        for sign, comparison in ((1.0, "<="), (-1.0, ">=")):
            bound = ir.Constant(vector, [sign * sines.largest] * lanes)
            here = builder.fcmp_ordered(comparison, group, bound)
            small = here if small is None else builder.and_(small, here)
    mask = builder.bitcast(small, ir.IntType(lanes))
    pair = numba.types.UniTuple(numba.types.float64, 2)(numba.types.float64)
    count = ir.Constant(ir.IntType(64), lanes * len(groups))
    place, sine_place, cosine_place = (
        cgutils.alloca_once(builder, vector, size=len(groups), name=name) for name in ("x", "sine", "cosine")
    )
    with builder.if_else(builder.icmp_unsigned("==", mask, mask.type(2**lanes - 1)), likely=True) as (
        quick,
        slow,
    ):
        with quick:
            found = [sines.small(_Several(builder, group)) for group in groups]
            quick_block = builder.block
        with slow:
            for k, group in enumerate(groups):
                builder.store(group, builder.gep(place, [index(k)]))
            numbers = [builder.bitcast(p, NUMBER.as_pointer()) for p in (place, sine_place, cosine_place)]
            with cgutils.for_range(builder, count) as loop:
                at = [builder.gep(p, [loop.index]) for p in numbers]
                both = context.compile_internal(builder, sines.any, pair, [builder.load(at[0])])
                builder.store(builder.extract_value(both, 0), at[1])
                builder.store(builder.extract_value(both, 1), at[2])
            loaded = [
                tuple(builder.load(builder.gep(p, [index(k)])) for p in (sine_place, cosine_place))
                for k in range(len(groups))
            ]
            slow_block = builder.block
    merged = []
    for quick_pair, slow_pair in zip(found, loaded, strict=True):
        phis = []
        for ours, theirs in zip(quick_pair, slow_pair, strict=True):
            phi = builder.phi(vector)
            phi.add_incoming(ours.value, quick_block)
            phi.add_incoming(theirs, slow_block)
            phis.append(phi)
        merged.append(phis)
    return [
        tuple(builder.extract_element(phi, ir.Constant(index, i % lanes)) for phi in merged[i // lanes])
        for i in range(len(angles))
    ]
