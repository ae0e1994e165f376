"""What all writers of a line of operations share: its arrays, and its parts in Python and C."""

from collections.abc import Sequence

from catenary.kernels.tracing import Line, Operation

ANGLES = ("sin", "cos")


def widths_of(line: Line) -> dict[str, int]:
    """Return the sizes of the input arrays by their names, in the order of calls."""
    widths: dict[str, int] = {}
    for name, _ in line.inputs:
        widths[name] = widths.get(name, 0) + 1
    return widths


def name_of(line: Line, number: int) -> str:
    """Return the name of a step's value."""
    step = line.steps[number]
    return f"{step.kind[0]}{step.a}" if step.kind in ANGLES else f"t{number}"


def operation(line: Line, step: Operation) -> str:
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
    """Return the steps that the numbered ones need, and those, in order; not what is behind a kind in `stop`."""
    needed = set(numbers)
    for number in range(len(line.steps) - 1, -1, -1):
        step = line.steps[number]
        if number in needed and step.kind != "in" and step.kind not in stop:
            needed.add(step.a)
            if step.kind in ("+", "-", "*"):
                needed.add(int(step.b))
    return sorted(needed)
