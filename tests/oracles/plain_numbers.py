"""Numbers that know + - * only: what tracing asks of a recursion, and so what a recursion may ask of its numbers."""

from typing import Union

import numpy as np
from numpy.typing import NDArray

from oracles.random_trees import Floats

Term = Union["Symbol", float]


class Symbol:
    """A number that can be added and multiplied."""

    def __init__(self, value: float) -> None:
        self.value = value

    def __add__(self, other: Term) -> "Symbol":
        return Symbol(self.value + _value(other))

    def __sub__(self, other: Term) -> "Symbol":
        return Symbol(self.value - _value(other))

    def __rsub__(self, other: Term) -> "Symbol":
        return Symbol(_value(other) - self.value)

    def __mul__(self, other: Term) -> "Symbol":
        return Symbol(self.value * _value(other))

    def __neg__(self) -> "Symbol":
        return Symbol(-self.value)

    __radd__ = __add__
    __rmul__ = __mul__


def _value(term: Term) -> float:
    return term.value if isinstance(term, Symbol) else term


def symbols(values: Floats) -> NDArray[np.object_]:
    return np.array([Symbol(float(v)) for v in values], dtype=object)


def values(array: NDArray[np.object_]) -> Floats:
    return np.vectorize(_value, otypes=[float])(array)


def empty(*shape: int) -> NDArray[np.object_]:
    return np.empty(shape, dtype=object)
