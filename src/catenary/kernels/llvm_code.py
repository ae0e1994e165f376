"""Writes LLVM's instructions: straight lines of operations, and a look at NumPy's arrays.

numba's compiler thinks for 2 ms about each sum in a function's text; where there are hundreds they are written here,
one by one, for numba's functions (compiled.py, exact_calls.py) and for those by LLVM alone (llvm_calls.py).
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir

from catenary.kernels.array_layout import (
    BYTE_ORDER,
    DATA,
    DESCRIPTION,
    DIMENSIONS,
    FLAGS,
    READABLE,
    SHAPE,
    TYPE,
    TYPE_NUMBER,
    WRITABLE,
    ArrayKind,
)

NUMBER = ir.DoubleType()
BYTE, INT, WORD = ir.IntType(8), ir.IntType(32), ir.IntType(64)
ADDRESS = BYTE.as_pointer()
LANES = 4  # numbers in a register of processors with AVX2; LLVM halves it for others
Operation = tuple[str, int, float | int]


class Sines(NamedTuple):
    """How sines are taken."""

    small: Callable[
        [Any], tuple[Any, Any]
    ]  # an angle's sine and cosine by nothing but + - *, up to `largest`
    largest: float  # beyond it the C library is asked


class Several:
    """Numbers side by side in a register, or one: plain arithmetic on them writes instructions."""

    def __init__(self, builder: Any, value: Any) -> None:
        self.builder, self.value = builder, value

    def _other(self, other: "Several | float") -> Any:
        return other.value if isinstance(other, Several) else constant_like(self.value, other)

    def __add__(self, other: "Several | float") -> "Several":
        return Several(self.builder, self.builder.fadd(self.value, self._other(other)))

    def __sub__(self, other: "Several | float") -> "Several":
        return Several(self.builder, self.builder.fsub(self.value, self._other(other)))

    def __rsub__(self, other: float) -> "Several":
        return Several(self.builder, self.builder.fsub(self._other(other), self.value))

    def __mul__(self, other: "Several | float") -> "Several":
        return Several(self.builder, self.builder.fmul(self.value, self._other(other)))

    def __truediv__(self, other: "Several | float") -> "Several":
        return Several(self.builder, self.builder.fdiv(self.value, self._other(other)))

    def times_plus(self, factor: "Several | float", other: "Several | float") -> "Several":
        """Give self * factor + other, rounded once."""
        return Several(self.builder, fused(self.builder, self.value, self._other(factor), self._other(other)))

    def within(self, bound: float) -> "Several":
        """Give the nearest numbers from -bound to bound; NaN stays NaN."""
        value = self.value
        for comparison, limit in (("<", -bound), (">", bound)):
            constant = constant_like(value, limit)
            beyond = self.builder.fcmp_ordered(comparison, value, constant)
            value = self.builder.select(beyond, constant, value)
        return Several(self.builder, value)

    __radd__ = __add__
    __rmul__ = __mul__


def constant_like(value: Any, number: float) -> Any:
    """Give a constant of the type of a value, the same in every lane."""
    kind = value.type
    content = [float(number)] * kind.count if isinstance(kind, ir.VectorType) else float(number)
    return ir.Constant(kind, content)


def fused(builder: Any, a: Any, b: Any, c: Any) -> Any:
    """Write a * b + c, rounded once; llvmlite writes it of single numbers only."""
    kind = a.type
    name = f"llvm.fma.v{kind.count}f64" if isinstance(kind, ir.VectorType) else "llvm.fma.f64"
    known = builder.module.globals.get(name)
    return builder.call(
        known or ir.Function(builder.module, ir.FunctionType(kind, [kind] * 3), name=name), [a, b, c]
    )


def write_line(
    builder: Any,
    operations: Sequence[Operation],
    stores: Sequence[tuple[int, int, int, int]],
    place: Callable[[int, int], Any],
    sines: Sines,
) -> None:
    """Write operations on float64, one after the other, and then the stores, so that arrays may be the same ones.

    Args:
        builder: Where to.
        operations: As `compiled.straight_line` takes them.
        stores: As `compiled.straight_line` takes them.
        place: Gives a pointer to an element of an array.
        sines: How they are taken.
    """
    values: dict[int, Any] = {}

    def value_of(number: int) -> Any:
        """Write an operation, and before it those that it needs."""
        waiting = [number]
        while waiting:
            if waiting[-1] in values:
                waiting.pop()
                continue
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

    angles = sorted({a for kind, a, _ in operations if kind in ("sin", "cos")})
    taken = dict(zip(angles, _sines(builder, [value_of(angle) for angle in angles], sines), strict=True))
    for number, (kind, a, _) in enumerate(operations):
        if kind in ("sin", "cos"):
            values[number] = taken[a][0 if kind == "sin" else 1]
    results = [value_of(operation) for _, _, _, operation in stores]
    for (array, element, sign, _), value in zip(stores, results, strict=True):
        builder.store(value if sign > 0 else builder.fneg(value), place(array, element))


def _sines(builder: Any, angles: Sequence[Any], sines: Sines) -> list[tuple[Any, Any]]:
    """Write sines and cosines of angles: all by `small` side by side, or one by one if any is large."""
    if not angles:
        return []
    lanes = min(LANES, 1 << (len(angles) - 1).bit_length())
    vector = ir.VectorType(NUMBER, lanes)
    groups = [
        _side_by_side(builder, vector, [angles[min(first + lane, len(angles) - 1)] for lane in range(lanes)])
        for first in range(0, len(angles), lanes)
    ]
    small = None
    for group in groups:
        for sign, comparison in ((1.0, "<="), (-1.0, ">=")):
            here = builder.fcmp_ordered(comparison, group, constant_like(group, sign * sines.largest))
            small = here if small is None else builder.and_(small, here)
    mask = builder.bitcast(small, ir.IntType(lanes))
    all_small = builder.icmp_unsigned("==", mask, mask.type(2**lanes - 1))
    with builder.if_else(all_small, likely=True) as (quick, slow):
        with quick:
            found = [sines.small(Several(builder, group)) for group in groups]
            quick_block = builder.block
        with slow:
            any_angle = _any_angle(builder.module, sines)
            both = [
                [builder.call(any_angle, [builder.extract_element(group, INT(i))]) for i in range(lanes)]
                for group in groups
            ]
            called = [
                [
                    _side_by_side(builder, vector, [builder.extract_value(pair, part) for pair in pairs])
                    for part in range(2)
                ]
                for pairs in both
            ]
            slow_block = builder.block
    merged = []
    for quick_pair, slow_pair in zip(found, called, strict=True):
        phis = []
        for ours, theirs in zip(quick_pair, slow_pair, strict=True):
            phi = builder.phi(vector)
            phi.add_incoming(ours.value, quick_block)
            phi.add_incoming(theirs, slow_block)
            phis.append(phi)
        merged.append(phis)
    return [
        tuple(builder.extract_element(phi, INT(i % lanes)) for phi in merged[i // lanes])
        for i in range(len(angles))
    ]


def _side_by_side(builder: Any, vector: Any, numbers: Sequence[Any]) -> Any:
    value = ir.Constant(vector, ir.Undefined)
    for lane, number in enumerate(numbers):
        value = builder.insert_element(value, number, INT(lane))
    return value


def _any_angle(module: Any, sines: Sines) -> Any:
    """Write a function that gives sine and cosine of any angle, NaN among them; rarely called."""
    pair = ir.LiteralStructType([NUMBER, NUMBER])
    name = module.get_unique_name("sine_cosine")
    function = ir.Function(module, ir.FunctionType(pair, [NUMBER]), name=name)
    function.linkage = "internal"
    function.attributes.add("noinline")
    builder = ir.IRBuilder(function.append_basic_block())
    (angle,) = function.args

    def give(sine: Any, cosine: Any) -> None:
        both = builder.insert_value(ir.Constant(pair, ir.Undefined), sine, 0)
        builder.ret(builder.insert_value(both, cosine, 1))

    near = builder.and_(
        builder.fcmp_ordered("<=", angle, NUMBER(sines.largest)),
        builder.fcmp_ordered(">=", angle, NUMBER(-sines.largest)),
    )
    with builder.if_then(near):
        give(*(part.value for part in sines.small(Several(builder, angle))))
    library = [_of_the_c_library(module, name) for name in ("sin", "cos")]
    give(*(builder.call(each, [angle]) for each in library))
    return function


def _of_the_c_library(module: Any, name: str) -> Any:
    known = module.globals.get(name)
    return known or ir.Function(module, ir.FunctionType(NUMBER, [NUMBER]), name=name)


def number_of(dtype: str) -> Any:
    """Give LLVM's type of a NumPy type's numbers."""
    return NUMBER if dtype == "float64" else ir.IntType(8 * np.dtype(dtype).itemsize)


def load_field(builder: Any, of: Any, offset: int, kind: Any) -> Any:
    """Load what lies some bytes behind an address."""
    place = builder.gep(builder.bitcast(of, ADDRESS), [WORD(offset)])
    return builder.load(builder.bitcast(place, kind.as_pointer()))


def data_of(builder: Any, given: Any, kind: ArrayKind, array_type: Any, number: Any, other: Any) -> Any:
    """Write a look at a Python object: give where its numbers lie, or go to a block if it is no such array.

    Args:
        builder: Where to; it goes on in a block of its own.
        given: The object.
        kind: The array expected.
        array_type: Address of NumPy's array type, an integer.
        number: LLVM's type of a number of the array.
        other: Block to go to.
    """

    def expect(fits: Any) -> None:
        following = builder.append_basic_block()
        builder.cbranch(fits, following, other).set_weights([99, 1])
        builder.position_at_end(following)

    def equals(value: Any, expected: int) -> Any:
        return builder.icmp_unsigned("==", value, value.type(expected))

    dtype = np.dtype(kind.dtype)
    expect(builder.icmp_unsigned("==", load_field(builder, given, TYPE, WORD), array_type))
    wanted = WRITABLE if kind.writable else READABLE
    flags = builder.and_(load_field(builder, given, FLAGS, INT), INT(wanted))
    size = load_field(builder, given, DIMENSIONS, INT)
    expect(builder.and_(equals(flags, wanted), equals(size, len(kind.shape))))
    description, shape = (load_field(builder, given, field, ADDRESS) for field in (DESCRIPTION, SHAPE))
    fits = builder.and_(
        equals(load_field(builder, description, TYPE_NUMBER, INT), dtype.num),
        equals(load_field(builder, description, BYTE_ORDER, BYTE), ord(dtype.byteorder)),
    )
    for k, length in enumerate(kind.shape):
        fits = builder.and_(fits, equals(load_field(builder, shape, 8 * k, WORD), length))
    expect(fits)
    return load_field(builder, given, DATA, number.as_pointer())
