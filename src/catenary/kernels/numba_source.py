"""Writes a line of operations as a Python module for numba: one configuration a call, and many."""

from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from catenary.kernels import compiled, llvm_code, sines
from catenary.kernels.compiled import straight_line
from catenary.kernels.line_text import (
    ANGLES,
    Store,
    expected_arrays,
    llvm_operations,
    needed,
    operation,
    operation_of_result,
    result,
    widths_of,
)
from catenary.kernels.llvm_code import Operation, Sines
from catenary.kernels.tracing import Line, Step

WORK_BYTES = 32 * 1024  # of a block of configurations: it should stay in the processor's first cache
SINES = Sines(sines.small_sine_cosine, sines.LARGEST)


@dataclass(frozen=True)
class NumbaModule:
    """A module's text, and what it takes for given: operations that numba need not read from text."""

    source: str
    given: dict[str, Any]


def numba_module(title: str, line: Line, shape: tuple[int, ...]) -> NumbaModule:
    """Write the module.

    `into(INPUT..., out)`, of arrays of one configuration each, is for compiled callers. `rows(INPUT..., out)` takes out
    (N, size) and inputs of N rows or one row each. None returns the result: handing an array back costs a third of a
    microsecond. `straight` does what they do, operation by operation in Python, to be read.

    Args:
        title: What it is, in letters and digits; goes into the first line.
        line: The operations.
        shape: Of one configuration's result.
    """
    widths = widths_of(line)
    blocks = _Blocks(line)
    text = [
        f'"""{title}: {line.operations} sums and products, {line.angles} angles."""',
        f"# with {_digest_of_what_it_calls()}; compiled, compiled_quick and the codes are given by whoever runs this",
        "",
        "import numpy as np",
        "",
        "from catenary.kernels.sines import LARGEST, sine_cosine, small_sine_cosine",
        "from catenary.errors import InputError",
        "",
        f"SHAPE = ({''.join(f'{n}, ' for n in shape)})",
        "",
        *_straight(line, widths),
        "",
        *_into(line, shape),
        "",
        *_rows(line, widths, shape, blocks),
        "",
    ]
    given = {
        "code": straight_line(*llvm_operations(line), SINES),
        "angles_code": blocks.angles_code,
        "results_code": blocks.results_code,
    }
    return NumbaModule("\n".join(text), given)


def _digest_of_what_it_calls() -> str:
    """Tell versions of the called functions apart: numba looks at the calling file alone."""
    texts = [Path(str(module.__file__)).read_bytes() for module in (sines, compiled, llvm_code)]
    texts.append(Path(__file__).read_bytes())
    return sha256(b"".join(texts)).hexdigest()[:16]


def _straight(line: Line, widths: dict[str, int]) -> list[str]:
    text = [f"def straight({', '.join(widths)}, out):"]
    named = set()
    for number, step in enumerate(line.steps):
        if step.kind == "in":
            name, index = line.inputs[step.a]
            text.append(f"    t{number} = {name}[{index}]")
        elif step.kind in ANGLES:
            if step.a not in named:
                named.add(step.a)
                text.append(f"    s{step.a}, c{step.a} = sine_cosine(t{step.a})")
        else:
            text.append(f"    t{number} = {operation(line, step)}")
    return [*text, *(f"    out[{k}] = {result(line, k)}" for k in range(len(line.results)))]


def _into(line: Line, shape: tuple[int, ...]) -> list[str]:
    widths = widths_of(line)
    wrong = [f"len({name}) != {width}" for name, width in widths.items()] + ["out.shape != SHAPE"]
    return [
        "@compiled_quick",
        f"def into({', '.join(widths)}, out):",
        f"    if {' or '.join(wrong)}:",
        f"        raise InputError('{expected_arrays(line, shape)}')",
        f"    code(({', '.join(widths)}, out, 0))",
    ]


class _Blocks:
    """How a block of configurations is worked on, number by number: the processor takes several in one go.

    The work array holds, one after the other, `size` values each of: inputs, angles, sines, cosines, results.
    """

    def __init__(self, line: Line) -> None:
        self.angles = sorted({step.a for step in line.steps if step.kind in ANGLES})
        self.slots: dict[tuple[int, int] | float, int] = {}  # of results that differ
        for given in line.results:
            self.slots.setdefault(given, len(self.slots))
        inputs, count = len(line.inputs), len(self.angles)
        self.width = inputs + 3 * count + len(self.slots)
        self.size = size = max(8, min(256, WORK_BYTES // 8 // self.width // 8 * 8))
        self.at_angle = inputs * size
        self.at_sine, self.at_cosine = self.at_angle + count * size, self.at_angle + 2 * count * size
        self.at_result = self.at_angle + 3 * count * size
        operations: list[Operation] = []
        before: dict[int, int] = {}
        for number in needed(line, self.angles, stop=()):
            before[number] = self._append(operations, before, line.steps[number])
        self.angles_code = straight_line(
            operations,
            [(0, self.at_angle + i * size, 1, before[angle]) for i, angle in enumerate(self.angles)],
            SINES,
        )
        operations = []
        after: dict[int, int] = {}
        wanted = [given[1] for given in line.results if not isinstance(given, float)]
        for number in needed(line, wanted, stop=ANGLES):
            after[number] = self._append(operations, after, line.steps[number])
        stores: list[Store] = []
        for given, slot in self.slots.items():
            sign, last = (
                (given[0], after[given[1]])
                if not isinstance(given, float)
                else operation_of_result(operations, given)
            )
            stores.append((0, self.at_result + slot * size, sign, last))
        self.results_code = straight_line(operations, stores, SINES)

    def _append(self, operations: list[Operation], numbers: dict[int, int], step: Step) -> int:
        if step.kind == "in":
            operations.append(("in", 0, step.a * self.size))
        elif step.kind in ANGLES:
            at = self.at_sine if step.kind == "sin" else self.at_cosine
            operations.append(("in", 0, at + self.angles.index(step.a) * self.size))
        else:
            b = numbers[int(step.b)] if step.kind in ("+", "-", "*") else step.b
            operations.append((step.kind, numbers[step.a], b))
        return len(operations) - 1


def _rows(line: Line, widths: dict[str, int], shape: tuple[int, ...], blocks: _Blocks) -> list[str]:
    size = blocks.size
    text = [
        f"SLOTS = np.array([{', '.join(str(blocks.slots[given]) for given in line.results)}])",
        "",
        "",
        "@compiled",
        f"def rows({', '.join(widths)}, out):",
        f"    work = np.empty({blocks.width * size})",
        f"    for start in range(0, len(out), {size}):",
        f"        count = min({size}, len(out) - start)",
    ]
    at = 0
    for name, width in widths.items():
        text += [
            f"        for k in range({size}):",
            "            # a last block that is not full repeats its last row",
            f"            row = start + min(k, count - 1) if len({name}) > 1 else 0",
            f"            for j in range({width}):",
            f"                work[{at} + j * {size} + k] = {name}[row, j]",
        ]
        at += width * size
    if blocks.angles:
        arguments = ", ".join(f"{name}[start + k if len({name}) > 1 else 0]" for name in widths)
        reshaped = "" if len(shape) == 1 else f".reshape({shape})"
        text += [
            f"        for k in range({size}):",
            "            angles_code((work, k))",
            "        small = True",
            f"        for k in range({blocks.at_angle}, {blocks.at_sine}):",
            "            small &= abs(work[k]) <= LARGEST",
            "        if not small:",
            "            for k in range(count):",
            f"                into({arguments}, out[start + k]{reshaped})",
            "            continue",
            f"        for k in range({len(blocks.angles) * size}):",
            f"            sine, cosine = small_sine_cosine(work[{blocks.at_angle} + k])",
            f"            work[{blocks.at_sine} + k] = sine",
            f"            work[{blocks.at_cosine} + k] = cosine",
        ]
    return [
        *text,
        f"        for k in range({size}):",
        "            results_code((work, k))",
        "        for k in range(count):",
        f"            for j in range({len(line.results)}):",
        f"                out[start + k, j] = work[{blocks.at_result} + SLOTS[j] * {size} + k]",
    ]
