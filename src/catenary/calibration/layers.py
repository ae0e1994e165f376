"""The layers of networks, written for the processor's registers: as many numbers at once as they hold.

A layer's outputs are summed in registers, a block of columns at a time, while its weights are read once, row by row.
Every product is fused with its sum, and the order of the sums follows from the sizes alone, so the bits are the same on
any machine, for one row of features and for many. A compiler left to itself takes half the register's width, and keeps
sums in memory.

Rows of weights, biases and outputs are whole lines (`lines`), filled up with zeros.
"""

from collections.abc import Callable
from typing import Any

from llvmlite import ir

from catenary.arrays import Floats
from catenary.compiled import compiled, inlined, instructions
from catenary.llvm_code import INT, NUMBER, WORD, Several, constant_like, fused

LINE = 8  # floats of a processor's cache line, and of the widest registers
BLOCK = 6  # lines that are summed at once; processors have twice as many registers, of half a line or more
TANH, LOGISTIC = range(2)
VECTOR = ir.VectorType(NUMBER, LINE)


@inlined
def lines(size: int) -> int:
    """Round a number of floats up to whole lines."""
    return (size + LINE - 1) // LINE * LINE


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


def _block(size: int) -> Any:
    """Make `code((x, numbers, out, x_at, weights, stride, bias, inputs, out_at))` for some lines of a layer's outputs.

    It writes bias + x @ weights. A block of few lines sums several rows apart: a sum that waits for the one before
    takes four times as long as one that does not.
    """
    chains = max(1, 4 // size)

    def write(builder: Any, arguments: list[Any]) -> None:
        x, numbers, out, x_at, weights, stride, bias, inputs, out_at = arguments

        def add_row(i: Any, sums: list[Any]) -> list[Any]:
            value = builder.load(builder.gep(x, [builder.add(x_at, i)]))
            lane = builder.insert_element(ir.Constant(VECTOR, ir.Undefined), value, INT(0))
            everywhere = builder.shuffle_vector(lane, lane, ir.Constant(ir.VectorType(INT, LINE), [0] * LINE))
            row = builder.add(weights, builder.mul(i, stride))
            return [
                fused(builder, everywhere, _load(builder, numbers, builder.add(row, WORD(LINE * k))), each)
                for k, each in enumerate(sums)
            ]

        sums = [_load(builder, numbers, builder.add(bias, WORD(LINE * k))) for k in range(size)]
        sums += [constant_like(sums[0], 0.0)] * (size * (chains - 1))

        def add_rows(i: Any, *sums: Any) -> list[Any]:
            following: list[Any] = []
            for chain in range(chains):
                following += add_row(
                    builder.add(i, WORD(chain)), list(sums[chain * size : (chain + 1) * size])
                )
            return following

        whole = builder.sub(inputs, builder.srem(inputs, WORD(chains)))
        sums = _counted(builder, WORD(0), whole, chains, sums, add_rows)
        rest = _counted(builder, whole, inputs, 1, sums[:size], lambda i, *first: add_row(i, list(first)))
        sums = rest + sums[size:]
        while len(sums) > size:
            half = len(sums) // 2
            sums = [builder.fadd(a, b) for a, b in zip(sums[:half], sums[half:], strict=True)]
        for k, each in enumerate(sums):
            _store(builder, each, out, builder.add(out_at, WORD(LINE * k)))

    return instructions(write)


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

    def write(builder: Any, arguments: list[Any]) -> None:
        values, at, end = arguments

        def bend_line(i: Any) -> list[Any]:
            bent = function(Several(builder, _load(builder, values, i)))
            _store(builder, bent.value, values, i)
            return []

        _counted(builder, at, end, LINE, [], bend_line)

    return instructions(write)


_block_1, _block_2, _block_3, _block_4, _block_5, _block_6 = (_block(size) for size in range(1, BLOCK + 1))
_bend_tanh, _bend_logistic = _bend(_tanh), _bend(_logistic)


@compiled
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
    stride = lines(outputs)
    bias, left = at + inputs * stride, stride // LINE
    blocks = (left + BLOCK - 1) // BLOCK
    for k in range(blocks, 0, -1):
        size = (left + k - 1) // k  # nearly equal blocks: none of few lines, which wait for themselves
        given = (x, numbers, out, x_at, at, stride, bias, inputs, out_at)
        if size == 1:
            _block_1(given)
        elif size == 2:
            _block_2(given)
        elif size == 3:
            _block_3(given)
        elif size == 4:
            _block_4(given)
        elif size == 5:
            _block_5(given)
        else:
            _block_6(given)
        left -= size
        at, bias, out_at = at + LINE * size, bias + LINE * size, out_at + LINE * size


@compiled
def bend(activation: int, values: Floats, at: int, count: int) -> None:
    """Replace values from `at` on, whole lines of them, by their hyperbolic tangents or logistic functions."""
    if activation == TANH:
        _bend_tanh((values, at, at + count))
    else:
        _bend_logistic((values, at, at + count))
