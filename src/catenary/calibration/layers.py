"""Layers of networks, and every other row times a matrix, written for the processor's registers.

A layer's outputs are summed in registers, a block of columns at a time, while its weights are read once, row by row.
Every product is fused with its sum, and the order of the sums follows from the sizes alone, so the bits are the same on
any machine, for one row of features and for many. A compiler left to itself takes half the register's width, and keeps
sums in memory.

Rows of weights, biases and outputs are whole lines (`lines`), filled up with zeros.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

from llvmlite import binding, ir

from catenary.arrays import Floats
from catenary.kernels.compiled import inlined, instructions
from catenary.kernels.llvm_code import INT, NUMBER, WORD, Several, constant_like, fused

LINE = 8  # floats of a processor's cache line, and of the widest registers
# Lines that are summed at once: processors have 16 registers of half a line, those with AVX-512 32 of a whole one.
# No bit depends on it: where outputs take several blocks, each is so wide that it sums one row after the other.
BLOCK = 14 if binding.get_host_cpu_features().get("avx512f") else 6
TANH, LOGISTIC = range(2)
VECTOR = ir.VectorType(NUMBER, LINE)


@inlined
def lines(size: int) -> int:
    """Round a number of floats up to whole lines."""
    return (size + LINE - 1) & -LINE


def _load(builder: Any, numbers: Any, at: Any) -> Any:
    place = builder.bitcast(builder.gep(numbers, [at]), VECTOR.as_pointer())
    return builder.load(place, align=8)  # wherever arrays begin


def _store(builder: Any, value: Any, numbers: Any, at: Any) -> None:
    place = builder.bitcast(builder.gep(numbers, [at]), VECTOR.as_pointer())
    builder.store(value, place, align=8)


def _counted(
    builder: Any, first: Any, end: Any, step: int, carried: list[Any], body: Callable[..., list[Any]]
) -> list[Any]:
    """Write a loop from `first` while below `end`: `body(i, *carried)` gives what it carries on."""
    before = builder.block
    head, inside, after = (builder.append_basic_block() for _ in range(3))
    builder.branch(head)
    builder.position_at_end(head)
    i = builder.phi(WORD)
    values = [builder.phi(value.type) for value in carried]
    builder.cbranch(builder.icmp_signed("<", i, end), inside, after)
    builder.position_at_end(inside)
    following = body(i, *values)
    for phi, start, then in zip(
        [i, *values], [first, *carried], [builder.add(i, WORD(step)), *following], strict=True
    ):
        phi.add_incoming(start, before)
        phi.add_incoming(then, builder.block)
    builder.branch(head)
    builder.position_at_end(after)
    return values


def _sums(
    builder: Any, x: Any, rows: Any, bias: Any, out: Any, stride: Any, inputs: Any, *, size: int
) -> None:
    """Write bias + x @ rows, `size` lines of it: each sum stays in its register.

    A block of few lines sums several rows apart: a sum that waits for the one before takes four times as long as one
    that does not.
    """
    chains = max(1, 4 // size)

    def add_row(i: Any, sums: list[Any]) -> list[Any]:
        value = builder.load(builder.gep(x, [i]))
        lane = builder.insert_element(ir.Constant(VECTOR, ir.Undefined), value, INT(0))
        everywhere = builder.shuffle_vector(lane, lane, ir.Constant(ir.VectorType(INT, LINE), [0] * LINE))
        row = builder.mul(i, stride)
        return [
            fused(builder, everywhere, _load(builder, rows, builder.add(row, WORD(LINE * k))), each)
            for k, each in enumerate(sums)
        ]

    sums = [_load(builder, bias, WORD(LINE * k)) for k in range(size)]
    sums += [constant_like(sums[0], 0.0)] * (size * (chains - 1))

    def add_rows(i: Any, *sums: Any) -> list[Any]:
        following: list[Any] = []
        for chain in range(chains):
            following += add_row(builder.add(i, WORD(chain)), list(sums[chain * size : (chain + 1) * size]))
        return following

    whole = builder.sub(inputs, builder.srem(inputs, WORD(chains)))
    sums = _counted(builder, WORD(0), whole, chains, sums, add_rows)
    rest = _counted(builder, whole, inputs, 1, sums[:size], lambda i, *first: add_row(i, list(first)))
    sums = rest + sums[size:]
    while len(sums) > size:
        half = len(sums) // 2
        sums = [builder.fadd(a, b) for a, b in zip(sums[:half], sums[half:], strict=True)]
    for k, each in enumerate(sums):
        _store(builder, each, out, WORD(LINE * k))


def _function(module: Any, name: str, given: list[Any], write: Callable[..., None]) -> Any:
    """Give a function of the module's own for some arguments; it may use the widest registers that there are.

    A compiler left to itself takes the lesser half of them: they made the first processors that had them slower.
    """
    name = f"catenary_{name}"
    if name in module.globals:
        return module.globals[name]
    kinds = [value.type for value in given]
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), kinds), name=name)
    function.linkage = "internal"
    # llvmlite knows attributes without values only
    set.add(function.attributes, '"min-legal-vector-width"="512" "prefer-vector-width"="512"')
    function.attributes.add("noinline")
    builder = ir.IRBuilder(function.append_basic_block())
    write(builder, *function.args)
    builder.ret_void()
    return function


def _layer(builder: Any, x: Any, numbers: Any, out: Any, inputs: Any, outputs: Any) -> None:
    """Write what `layer` does, in blocks of lines."""
    wide = builder.and_(builder.add(outputs, WORD(LINE - 1)), WORD(-LINE))
    bias = builder.gep(numbers, [builder.mul(inputs, wide)])
    before = builder.block
    head, inside, one, some, following, end = (builder.append_basic_block() for _ in range(6))
    count = builder.lshr(wide, WORD(LINE.bit_length() - 1))
    builder.branch(head)
    builder.position_at_end(head)
    left, at = builder.phi(WORD), builder.phi(WORD)
    builder.cbranch(builder.icmp_signed(">", left, WORD(0)), inside, end)
    builder.position_at_end(inside)
    builder.cbranch(builder.icmp_signed(">", left, WORD(BLOCK)), some, one)
    builder.position_at_end(some)  # nearly equal blocks: none of few lines, which wait for themselves
    blocks = builder.udiv(builder.add(left, WORD(BLOCK - 1)), WORD(BLOCK))
    part = builder.udiv(builder.sub(builder.add(left, blocks), WORD(1)), blocks)
    builder.branch(one)
    builder.position_at_end(one)
    size = builder.phi(WORD)
    size.add_incoming(left, inside)
    size.add_incoming(part, some)
    given = [x, *(builder.gep(begin, [at]) for begin in (numbers, bias, out)), wide, inputs]
    choice = builder.switch(size, following)
    for k in range(1, BLOCK + 1):
        function = _function(builder.module, f"sums_{k}", given, partial(_sums, size=k))
        case = builder.append_basic_block()
        choice.add_case(WORD(k), case)
        builder.position_at_end(case)
        builder.call(function, given)
        builder.branch(following)
    builder.position_at_end(following)
    for phi, start, then in (
        (left, count, builder.sub(left, size)),
        (at, WORD(0), builder.add(at, builder.mul(size, WORD(LINE)))),
    ):
        phi.add_incoming(start, before)
        phi.add_incoming(then, following)
    builder.branch(head)
    builder.position_at_end(end)


def _write_layer(builder: Any, arguments: list[Any]) -> None:
    x, x_at, numbers, at, inputs, outputs, out, out_at = arguments
    places = [builder.gep(array, [index]) for array, index in ((x, x_at), (numbers, at), (out, out_at))]
    given = [*places, inputs, outputs]
    builder.call(_function(builder.module, "layer", given, _layer), given)


def _expm1(v: Several) -> Several:
    """Give exp(v) - 1 for |v| <= 40, to a few units in the last place, from +, * and fused products and sums.

    Taylor's series of v / 64 to the ninth power, then exp(2 t) - 1 = e (2 + e), e = exp(t) - 1, six times; the
    doubling loses no relative accuracy near zero. The C library's function takes one number at a time.
    """
    t = v * 0.015625
    e = t.times_plus(1.0 / 362880.0, 1.0 / 40320.0)
    for factor in (1.0 / 5040.0, 1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5):
        e = t.times_plus(e, factor)
    e = t * t.times_plus(e, 1.0)
    for _ in range(6):
        e = e.times_plus(e, e + e)
    return e


def _tanh(v: Several) -> Several:
    e = _expm1(v.within(20.0) * 2.0)  # 1 in float64 beyond 20
    return e / (e + 2.0)


def _logistic(v: Several) -> Several:
    e = _expm1(v.within(40.0))  # 0 or 1 to 1e-17 beyond 40
    return (e + 1.0) / (e + 2.0)


def _bend(function: Callable[[Several], Several]) -> Any:
    """Make `code((values, at, end))`, which replaces values by a function of theirs."""

    def bend_lines(builder: Any, values: Any, at: Any, end: Any) -> None:
        def bend_line(i: Any) -> list[Any]:
            bent = function(Several(builder, _load(builder, values, i)))
            _store(builder, bent.value, values, i)
            return []

        _counted(builder, at, end, LINE, [], bend_line)

    def write(builder: Any, arguments: list[Any]) -> None:
        builder.call(_function(builder.module, function.__name__, arguments, bend_lines), arguments)

    return instructions(write)


_of_layers = instructions(_write_layer)
_bend_tanh, _bend_logistic = _bend(_tanh), _bend(_logistic)


@inlined
def layer(
    x: Floats, x_at: int, numbers: Floats, at: int, inputs: int, outputs: int, out: Floats, out_at: int
) -> None:
    """Write bias + x @ weights into whole lines of `out`.

    Args:
        x: Inputs, from `x_at` on.
        x_at: Where they begin.
        numbers: From `at` on weights (inputs, lines(outputs)), bias (lines(outputs),).
        at: Where they begin.
        inputs: How many.
        outputs: How many.
        out: Written from `out_at` on.
        out_at: Where it begins.
    """
    _of_layers((x, x_at, numbers, at, inputs, outputs, out, out_at))


@inlined
def bend(activation: int, values: Floats, at: int, count: int) -> None:
    """Replace values from `at` on, whole lines of them, by their hyperbolic tangents or logistic functions."""
    if activation == TANH:
        _bend_tanh((values, at, at + count))
    else:
        _bend_logistic((values, at, at + count))
