"""What all writers of a line of operations share: its arrays, its parts in Python and C, its operations for LLVM."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from catenary.kernels.tracing import Line, Step

if TYPE_CHECKING:  # what only says how things look need not be imported
    from catenary.kernels.llvm_code import Operation

ANGLES = ("sin", "cos")
Store = tuple[int, int, int, int]


def widths_of(line: Line) -> dict[str, int]:
    """Give the sizes of the input arrays by their names, in the order of calls."""
    widths: dict[str, int] = {}
    for name, _ in line.inputs:
        widths[name] = widths.get(name, 0) + 1
    return widths


def expected_arrays(line: Line, shape: tuple[int, ...]) -> str:
    """Tell what a call of a kernel takes, for those who gave something else."""
    widths = widths_of(line)
    sizes = ", ".join([*(f"{name} ({width},)" for name, width in widths.items()), f"out {shape}"])
    return f"kernel: expected contiguous float64 arrays of {sizes}"


def name_of(line: Line, number: int) -> str:
    """Name of a step's value."""
    step = line.steps[number]
    return f"{step.kind[0]}{step.a}" if step.kind in ANGLES else f"t{number}"


def operation(line: Line, step: Step) -> str:
    """Write a sum or product, the same in Python and in C."""
    a = name_of(line, step.a)
    if step.kind.endswith("k"):
        return f"{a} {step.kind[0]} {step.b!r}" if step.b >= 0 else f"{a} {step.kind[0]} ({step.b!r})"
    return f"{a} {step.kind} {name_of(line, int(step.b))}"


def result(line: Line, k: int) -> str:
    """Write a result."""
    given = line.results[k]
    if isinstance(given, float):
        return repr(given)
    sign, number = given
    return ("-" if sign < 0 else "") + name_of(line, number)


def needed(line: Line, numbers: Sequence[int], *, stop: Sequence[str]) -> list[int]:
    """Give the steps that the numbered ones need, and those, in order; not what is behind a kind in `stop`."""
    needed = set(numbers)
    for number in range(len(line.steps) - 1, -1, -1):
        step = line.steps[number]
        if number in needed and step.kind != "in" and step.kind not in stop:
            needed.add(step.a)
            if step.kind in ("+", "-", "*"):
                needed.add(int(step.b))
    return sorted(needed)


def llvm_operations(line: Line) -> "tuple[list[Operation], list[Store]]":
    """Give a line as `compiled.straight_line` takes it; the last array is `out`."""
    order = list(widths_of(line))
    operations: list[Operation] = []
    for step in line.steps:
        if step.kind == "in":
            name, index = line.inputs[step.a]
            operations.append(("in", order.index(name), index))
        else:
            operations.append((step.kind, step.a, step.b))
    stores: list[Store] = []
    for k, given in enumerate(line.results):
        sign, number = operation_of_result(operations, given)
        stores.append((len(order), k, sign, number))
    return operations, stores


def operation_of_result(operations: "list[Operation]", given: tuple[int, int] | float) -> tuple[int, int]:
    """Give the sign and the operation of a result; a constant becomes one."""
    if not isinstance(given, float):
        return given
    operations.append(("k", 0, given))
    return 1, len(operations) - 1
