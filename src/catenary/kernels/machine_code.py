"""A line of operations as machine code: LLVM's instructions through one intrinsic of numba's.

numba's compiler spends 2 ms on each sum in a function's text. A robot has hundreds, so they are written here, one by
one, for a single configuration or for `_LANES` configurations side by side in the processor's registers; functions for
one configuration a call and for many are made of them.
"""

from collections.abc import Callable, Sequence
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import Any

from llvmlite import ir

from catenary.kernels import sines
from catenary.kernels.compiled import load_module, start_numba
from catenary.kernels.sines import LARGEST_ANGLE_RAD, small_sine_cosine
from catenary.kernels.tracing import ANGLES, Line, needed, widths_of

_LANES = 4  # numbers in a register of processors with AVX2; LLVM halves it for others
_NUMBER = ir.DoubleType()
_VECTOR = ir.VectorType(_NUMBER, _LANES)
_INT, _WORD = ir.IntType(32), ir.IntType(64)
_TEXT = '''"""{title}: {operations} sums and products, {angles} angles."""
# line {line}, written by {writers}

from catenary.errors import InputError


@compiled
def into({inputs}, out):
    one(({inputs}, out), {zeros}, {zeros})


@compiled_for("boolean({arrays}, {out})")
def single({inputs}, out):
    if {wrong}:
        raise InputError("expected {expected}")
    one(({inputs}, out), {zeros}, {zeros})
    total = 0.0  # NaN where a number is not finite
    for array in ({inputs},):
        for number in array:
            total += 0.0 * number
    return total == 0.0


@compiled
def rows({inputs}, out):
    step = ({steps}, {size})
    whole = len(out) - len(out) % {lanes}
    for k in range(0, whole, {lanes}):
        several(({inputs}, out), ({starts}, {size} * k), step)
    for k in range(whole, len(out)):
        one(({inputs}, out), ({starts}, {size} * k), step)
'''


def line_code(line: Line, lanes: int = 1) -> Any:
    """Make `code(arrays, first, step)`, to be called in compiled functions: run a line on arrays.

    `arrays` is a tuple of the inputs and `out`, `first` of the numbers of their first elements, `step` of how far the
    next configuration's are behind them. Results are stored last, so `out` may be an input.
    """
    numba = start_numba()
    names = [*widths_of(line), "out"]

    @numba.extending.intrinsic  # type: ignore[untyped-decorator]  # numba has no types
    def code(typingctx: Any, arrays: Any, first: Any, step: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            places: dict[str, tuple[Any, Any, Any]] = {}
            for i, name in enumerate(names):
                array, at, behind = (builder.extract_value(value, i) for value in arguments)
                data = context.make_array(signature.args[0].types[i])(context, builder, array).data
                places[name] = data, at, behind

            def pointers(name: str, element: int) -> list[Any]:
                data, at, behind = places[name]
                starts = [builder.add(at, builder.mul(behind, _WORD(lane))) for lane in range(lanes)]
                return [builder.gep(data, [builder.add(start, _WORD(element))]) for start in starts]

            write_line(builder, line, pointers)
            return context.get_dummy_value()

        return numba.types.void(arrays, first, step), generate

    return code


def write_line(builder: Any, line: Line, pointers: Callable[[str, int], Sequence[Any]]) -> None:
    """Write a line's operations; pointers gives where an element of an array, or of "out", is for any configuration."""
    values: dict[int, Any] = {}

    def write(number: int) -> None:
        kind, a, b = line.steps[number]
        if kind == "in":
            values[number] = _together(builder, [builder.load(place) for place in pointers(*line.inputs[a])])
        else:
            other = _constant(values[a].type, b) if kind.endswith("k") else values[int(b)]
            does = {"+": builder.fadd, "-": builder.fsub, "*": builder.fmul}[kind[0]]
            values[number] = does(values[a], other)

    angles = sorted({step.a for step in line.steps if step.kind in ANGLES})
    for number in needed(line, angles, stop=ANGLES):
        write(number)
    sines = dict(zip(angles, _sines(builder, [values[angle] for angle in angles]), strict=True))
    for number, step in enumerate(line.steps):
        if step.kind in ANGLES:
            values[number] = sines[step.a][ANGLES.index(step.kind)]
        elif number not in values:
            write(number)
    for k, result in enumerate(line.results):
        places = pointers("out", k)
        if isinstance(result, float):
            parts = [_NUMBER(result)] * len(places)
        else:
            sign, number = result
            value = values[number] if sign > 0 else builder.fneg(values[number])
            parts = _apart(builder, value)
        for part, place in zip(parts, places, strict=True):
            builder.store(part, place)


class Register:
    """A number, or `_LANES` of them, in a register: plain arithmetic on it writes instructions."""

    def __init__(self, builder: Any, value: Any) -> None:
        self._builder, self.value = builder, value

    def _written(self, write: Any, other: "Register | float", turned: bool = False) -> "Register":
        value = other.value if isinstance(other, Register) else _constant(self.value.type, other)
        return Register(self._builder, write(value, self.value) if turned else write(self.value, value))

    def __add__(self, other: "Register | float") -> "Register":
        return self._written(self._builder.fadd, other)

    def __sub__(self, other: "Register | float") -> "Register":
        return self._written(self._builder.fsub, other)

    def __rsub__(self, other: float) -> "Register":
        return self._written(self._builder.fsub, other, turned=True)

    def __mul__(self, other: "Register | float") -> "Register":
        return self._written(self._builder.fmul, other)

    __radd__, __rmul__ = __add__, __mul__


def _sines(builder: Any, angles: Sequence[Any]) -> list[tuple[Any, Any]]:
    """Write sines and cosines of angles, of single ones `_LANES` at a time."""
    if not angles or angles[0].type == _VECTOR:
        return _sines_of_vectors(builder, angles)
    # the last group is filled up with the last angle
    groups = [
        [angles[min(first + lane, len(angles) - 1)] for lane in range(_LANES)]
        for first in range(0, len(angles), _LANES)
    ]
    pairs = _sines_of_vectors(builder, [_together(builder, group) for group in groups])
    sines, cosines = ([part for vector in of for part in _apart(builder, vector)] for of in zip(*pairs, strict=True))
    return list(zip(sines, cosines, strict=True))[: len(angles)]


def _sines_of_vectors(builder: Any, angles: Sequence[Any]) -> list[tuple[Any, Any]]:
    """Write sines and cosines: all by `small_sine_cosine`, or number by number where any is large."""
    if not angles:
        return []
    small = None
    for angle in angles:
        for sign, comparison in ((1.0, "<="), (-1.0, ">=")):
            here = builder.fcmp_ordered(comparison, angle, _constant(_VECTOR, sign * LARGEST_ANGLE_RAD))
            small = here if small is None else builder.and_(small, here)
    mask = builder.bitcast(small, ir.IntType(_LANES))
    with builder.if_else(builder.icmp_unsigned("==", mask, mask.type(2**_LANES - 1)), likely=True) as (quick, slow):
        with quick:
            quick_pairs = [_small(builder, angle) for angle in angles]
            quick_block = builder.block
        with slow:
            any_angle = _any_angle(builder.module)
            called = []
            for angle in angles:
                pairs = [builder.call(any_angle, [part]) for part in _apart(builder, angle)]
                called.append(
                    [_together(builder, [builder.extract_value(pair, i) for pair in pairs]) for i in range(2)]
                )
            slow_block = builder.block
    merged = []
    for quick_pair, slow_pair in zip(quick_pairs, called, strict=True):
        phis = [builder.phi(_VECTOR), builder.phi(_VECTOR)]
        for phi, ours, theirs in zip(phis, quick_pair, slow_pair, strict=True):
            phi.add_incoming(ours, quick_block)
            phi.add_incoming(theirs, slow_block)
        merged.append((phis[0], phis[1]))
    return merged


def _small(builder: Any, angle: Any) -> list[Any]:
    """Write the sine and cosine of angles up to `LARGEST_ANGLE_RAD`."""
    of_any_numbers: Callable[[Any], tuple[Any, Any]] = small_sine_cosine
    return [part.value for part in of_any_numbers(Register(builder, angle))]


def _any_angle(module: Any) -> Any:
    """Write a function that gives sine and cosine of any angle, NaN among them; rarely called."""
    pair = ir.LiteralStructType([_NUMBER, _NUMBER])
    function = ir.Function(module, ir.FunctionType(pair, [_NUMBER]), name=module.get_unique_name("sine_cosine"))
    function.linkage = "internal"
    function.attributes.add("noinline")
    builder = ir.IRBuilder(function.append_basic_block())
    (angle,) = function.args

    def give(sine: Any, cosine: Any) -> None:
        both = builder.insert_value(ir.Constant(pair, ir.Undefined), sine, 0)
        builder.ret(builder.insert_value(both, cosine, 1))

    in_range = builder.and_(
        builder.fcmp_ordered("<=", angle, _NUMBER(LARGEST_ANGLE_RAD)),
        builder.fcmp_ordered(">=", angle, _NUMBER(-LARGEST_ANGLE_RAD)),
    )
    with builder.if_then(in_range):
        give(*_small(builder, angle))
    kind = ir.FunctionType(_NUMBER, [_NUMBER])
    library = [module.globals.get(name) or ir.Function(module, kind, name=name) for name in ANGLES]
    give(*(builder.call(function, [angle]) for function in library))
    return function


def _constant(kind: Any, number: float) -> Any:
    return ir.Constant(kind, [float(number)] * _LANES if kind == _VECTOR else float(number))


def _together(builder: Any, numbers: Sequence[Any]) -> Any:
    """Put numbers side by side; a single one stays a number."""
    if len(numbers) == 1:
        return numbers[0]
    value = ir.Constant(_VECTOR, ir.Undefined)
    for lane, number in enumerate(numbers):
        value = builder.insert_element(value, number, _INT(lane))
    return value


def _apart(builder: Any, value: Any) -> list[Any]:
    if value.type != _VECTOR:
        return [value]
    return [builder.extract_element(value, _INT(lane)) for lane in range(_LANES)]


def numba_functions(title: str, line: Line, shape: tuple[int, ...]) -> ModuleType:
    """Make a module of compiled functions that run a line of operations.

    `into(INPUT..., out)`, of arrays of one configuration each, is for compiled callers and for `bind`; it checks
    nothing. `single(INPUT..., out)` is for Python: it refuses other arrays (TypeError) and other sizes (InputError),
    and returns whether all inputs are finite. `rows(INPUT..., out)` takes `out` (N, size) and inputs of N rows or one
    row each. The title has letters, digits and hyphens.
    """
    widths = widths_of(line)
    writers = [Path(file) for file in (str(sines.__file__), __file__)]
    text = _TEXT.format(
        title=title,
        operations=line.operations,
        angles=line.angles,
        line=sha256(repr(line).encode()).hexdigest(),
        # numba looks for changes in the calling file alone
        writers=sha256(b"".join(path.read_bytes() for path in writers)).hexdigest()[:32],
        inputs=", ".join(widths),
        zeros=f"({', '.join(['0'] * (len(widths) + 1))})",
        wrong=" or ".join(f"len({name}) != {width}" for name, width in widths.items()),
        expected=", ".join(f"{name} ({width},)" for name, width in widths.items()),
        arrays=", ".join(["Array(float64, 1, 'C', readonly=True)"] * len(widths)),
        out=f"float64[{':, ' * (len(shape) - 1)}::1]",
        steps=", ".join(f"{width} * (len({name}) > 1)" for name, width in widths.items()),
        starts=", ".join(f"step[{i}] * k" for i in range(len(widths))),
        size=len(line.results),
        lanes=_LANES,
    )
    return load_module(title, text, {"one": line_code(line), "several": line_code(line, _LANES)})
