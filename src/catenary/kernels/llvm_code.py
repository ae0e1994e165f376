"""Writes LLVM's instructions: arithmetic, and a look at NumPy's arrays."""

from typing import Any

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
