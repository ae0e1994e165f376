"""Runs plain arithmetic on symbols and keeps what it did: a straight line of operations, without the zeros.

A `Symbol` is a number whose value is not known yet. The recursions, run on symbols for the coordinates and on
numbers for the robot's constants, leave a graph of sums, products, sines and cosines in which

- constants are folded, and gathered: k (l x) is (k l) x, (x + k) + l is x + (k + l), k (x + l) is k x + k l;
- equal operations are one operation (value numbering; a + b is b + a, a - b is -(b - a));
- signs cost nothing: they ride on the symbols until a sum or a result takes them in;
- x 0, x 1, x + 0, -(-x), x - x and sines of multiples of pi/2 cost nothing either;
- what no result needs is left out.

Results differ from the plain recursion's in rounding only; and x 0 is 0 for an x that is NaN, so a NaN reaches every
result that depends on it, and none that does not.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, Union

import numpy as np
from numpy.typing import NDArray

Term = Union["Symbol", float]  # constants stay plain floats
Key = tuple[str, float | int, float | int]


FUNCTIONS: dict[str, Callable[[float], float]] = {
    "tanh": np.tanh, "sign": np.sign, "exp": np.exp, "abs": np.abs, "sqrt": np.sqrt, "inverse": np.reciprocal,
}  # fmt: skip
_ODD_FUNCTIONS = ("tanh", "sign", "inverse")
ANGLES = ("sin", "cos")
_QUARTER_TURNS = ((0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0))  # sine and cosine of quarter turns


class Operation(NamedTuple):
    """One operation; `a` and `b` are numbers of earlier steps, but for what is said here.

    "in": input number a (see Line.inputs). "+", "-", "*": of two steps. "+k", "*k": of step a and the constant b.
    "sin", "cos": of step a. So are the FUNCTIONS, which are written as C and for other systems, not as machine code.
    """

    kind: str
    a: int
    b: float | int


class Line(NamedTuple):
    """A straight line of operations: what a back end writes out."""

    inputs: tuple[tuple[str, int], ...]  # array and index of each input
    steps: tuple[Operation, ...]  # an operation uses earlier ones only
    results: tuple[tuple[int, int] | float, ...]  # sign and step of each result, or a constant

    @property
    def operations(self) -> int:
        """Number of sums and products."""
        return sum(step.kind not in ("in", "sin", "cos") for step in self.steps)

    @property
    def angles(self) -> int:
        """Number of angles whose sine or cosine is computed."""
        return len({step.a for step in self.steps if step.kind in ("sin", "cos")})


class Symbol:
    """A number that is not known yet; sums, differences, products and negation of it are recorded."""

    __slots__ = ("sign", "step", "trace")
    __array_ufunc__ = None  # a NumPy number times a symbol calls the symbol's __rmul__

    def __init__(self, trace: "Trace", step: int, sign: int = 1) -> None:
        self.trace, self.step, self.sign = trace, step, sign

    def __neg__(self) -> "Symbol":
        return Symbol(self.trace, self.step, -self.sign)

    def __add__(self, other: Term) -> Term:
        return self.trace.add(self, other)

    def __sub__(self, other: Term) -> Term:
        return self.trace.add(self, -other)

    def __rsub__(self, other: Term) -> Term:
        return self.trace.add(-self, other)

    def __mul__(self, other: Term) -> Term:
        return self.trace.multiply(self, other)

    def __truediv__(self, other: Term) -> Term:
        return self.trace.multiply(self, self.trace.apply("inverse", other))

    def __rtruediv__(self, other: float) -> Term:
        return self.trace.multiply(self.trace.apply("inverse", self), other)  # type: ignore[arg-type]  # a symbol

    __radd__ = __add__
    __rmul__ = __mul__


class Trace:
    """The record of what is done with the symbols of one computation."""

    def __init__(self) -> None:
        self._inputs: list[tuple[str, int]] = []
        self._steps: list[Operation] = []
        self._numbers: dict[Key, int] = {}

    def inputs(self, name: str, count: int) -> NDArray[np.object_]:
        """Return the elements of an input array as symbols, (count,)."""
        symbols = np.empty(count, dtype=object)
        for i in range(count):
            self._inputs.append((name, i))
            symbols[i] = self._symbol("in", len(self._inputs) - 1, 0)
        return symbols

    def add(self, x: Symbol, y: Term) -> Term:
        """Return x + y."""
        if not isinstance(y, Symbol):
            x, k = self._without_constant(x)
            return self._plus(x, float(y) + k)
        x, k = self._without_constant(x)
        y, l = self._without_constant(y)
        return self._plus(self._add_symbols(x, y), k + l)

    def multiply(self, x: Symbol, y: Term) -> Term:
        """Return x * y."""
        if not isinstance(y, Symbol):
            return self._scale(x, float(y))
        # factors that are constant go before the product
        x, k = self._without_factor(x)
        y, l = self._without_factor(y)
        a, b = sorted((x.step, y.step))
        return self._scale(self._symbol("*", a, b, x.sign * y.sign), k * l)

    def sine_cosine(self, x: Term) -> tuple[Term, Term]:
        """Return the sine and cosine of an angle; quarter turns that are added to it are taken exactly."""
        if not isinstance(x, Symbol):
            exact = _quarters(float(x))
            return (math.sin(x), math.cos(x)) if exact is None else _QUARTER_TURNS[exact % 4]
        x, k = self._without_constant(x)
        quarters = _quarters(k)
        angle = self._plus(x, k if quarters is None else 0.0)
        assert isinstance(angle, Symbol)
        sine: Term = self._symbol("sin", angle.step, 0, angle.sign)
        cosine: Term = self._symbol("cos", angle.step, 0)
        for _ in range((quarters or 0) % 4):
            sine, cosine = cosine, -sine
        return sine, cosine

    def apply(self, function: str, x: Term) -> Term:
        """Return one of FUNCTIONS of x."""
        if not isinstance(x, Symbol):
            return float(FUNCTIONS[function](float(x)))
        if function in _ODD_FUNCTIONS or function == "abs":
            return self._symbol(function, x.step, 0, x.sign if function in _ODD_FUNCTIONS else 1)
        return self._symbol(function, (x if x.sign > 0 else self._symbol("*k", x.step, -1.0)).step, 0)

    def line(self, results: Sequence[Term]) -> Line:
        """Return the operations that the results need, renumbered."""
        every = Line(tuple(self._inputs), tuple(self._steps), ())
        order = needed(every, [r.step for r in results if isinstance(r, Symbol)], stop=())
        numbers = {old: new for new, old in enumerate(order)}
        steps = []
        for old in order:
            step = self._steps[old]
            b = numbers[int(step.b)] if step.kind in ("+", "-", "*") else step.b
            steps.append(Operation(step.kind, step.a if step.kind == "in" else numbers[step.a], b))
        kept = ((r.sign, numbers[r.step]) if isinstance(r, Symbol) else float(r) for r in results)
        return every._replace(steps=tuple(steps), results=tuple(kept))

    def _symbol(self, kind: str, a: int, b: float | int, sign: int = 1) -> Symbol:
        key = (kind, a, b)
        number = self._numbers.get(key)
        if number is None:
            number = self._numbers[key] = len(self._steps)
            self._steps.append(Operation(kind, a, b))
        return Symbol(self, number, sign)

    def _add_symbols(self, x: Symbol, y: Symbol) -> Term:
        if x.step == y.step:
            return self._scale(x, 2.0) if x.sign == y.sign else 0.0
        if x.step > y.step:
            x, y = y, x
        return self._symbol("+" if x.sign == y.sign else "-", x.step, y.step, x.sign)

    def _plus(self, x: Term, k: float) -> Term:
        if not isinstance(x, Symbol):
            return x + k
        return x if k == 0.0 else self._symbol("+k", x.step, x.sign * k, x.sign)

    def _scale(self, x: Term, k: float) -> Term:
        if not isinstance(x, Symbol):
            return x * k
        if k == 0.0:
            return 0.0
        x, l = self._without_constant(x)
        x, m = self._without_factor(x)
        factor = k * m
        sign = x.sign if factor > 0.0 else -x.sign
        product = Symbol(self, x.step, sign)
        if abs(factor) != 1.0:
            product = self._symbol("*k", x.step, abs(factor), sign)
        return self._plus(product, k * l)

    def _without_constant(self, x: Symbol) -> tuple[Symbol, float]:
        """Split x = y + k."""
        step = self._steps[x.step]
        if step.kind != "+k":
            return x, 0.0
        return Symbol(self, step.a, x.sign), x.sign * step.b

    def _without_factor(self, x: Symbol) -> tuple[Symbol, float]:
        """Split x = k y."""
        step = self._steps[x.step]
        if step.kind != "*k":
            return x, 1.0
        return Symbol(self, step.a, x.sign), step.b


class TracedFunctions:
    """Functions of symbols by the names that NumPy has for numbers."""

    def __init__(self, trace: Trace) -> None:
        self._trace = trace

    def __getattr__(self, name: str) -> Callable[[Term], Term]:
        if name in ANGLES:
            return lambda x: self._trace.sine_cosine(x)[ANGLES.index(name)]
        return partial(self._trace.apply, name)


def _operands(step: Operation) -> tuple[int, ...]:
    if step.kind == "in":
        return ()
    return (step.a, int(step.b)) if step.kind in ("+", "-", "*") else (step.a,)


def _quarters(angle: float) -> int | None:
    """Return an angle's number of quarter turns; None if it is no multiple of one."""
    quarters = round(angle / (0.5 * math.pi))
    return quarters if abs(angle - quarters * 0.5 * math.pi) < 1e-15 * max(1.0, abs(angle)) else None


def evaluate_line(
    line: Line,
    *,
    sine: Callable[[Any], Any] = math.sin,
    cosine: Callable[[Any], Any] = math.cos,
    functions: Mapping[str, Callable[[Any], Any]] = FUNCTIONS,
    **arrays: Sequence[Any],
) -> list[Any]:
    """Evaluate a line on floats, or on symbols of another library; return its results in their order.

    Args:
        sine, cosine, functions: Functions of the library, others by the names of `FUNCTIONS`.
    """
    values: list[Any] = []
    for kind, a, b in line.steps:
        if kind == "in":
            name, index = line.inputs[a]
            values.append(arrays[name][index])
        elif kind in ("sin", "cos"):
            values.append(sine(values[a]) if kind == "sin" else cosine(values[a]))
        elif kind in FUNCTIONS:
            values.append(functions[kind](values[a]))
        else:
            other = b if kind.endswith("k") else values[int(b)]
            values.append(values[a] * other if "*" in kind else values[a] - other if kind == "-" else values[a] + other)
    return [r if isinstance(r, float) else r[0] * values[r[1]] for r in line.results]


def widths_of(line: Line) -> dict[str, int]:
    """Return the sizes of the input arrays by their names, in the order of calls."""
    widths: dict[str, int] = {}
    for name, _ in line.inputs:
        widths[name] = widths.get(name, 0) + 1
    return widths


def step_name(line: Line, number: int) -> str:
    """Return the name of a step's value."""
    step = line.steps[number]
    return f"{step.kind[0]}{step.a}" if step.kind in ANGLES else f"t{number}"


def needed(line: Line, numbers: Sequence[int], *, stop: Sequence[str]) -> list[int]:
    """Return the steps that the numbered ones need, and those, in order; not what is behind a kind in `stop`."""
    needed = set(numbers)
    for number in range(len(line.steps) - 1, -1, -1):
        if number in needed and line.steps[number].kind not in stop:
            needed.update(_operands(line.steps[number]))
    return sorted(needed)
