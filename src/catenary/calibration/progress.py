"""How a long task reports its progress."""

from collections.abc import Callable

Progress = Callable[[float], None]  # called with the share done, 0 to 1


def silent(_: float) -> None:
    """Report to nobody."""


def part_of(progress: Progress, part: int, parts: int) -> Progress:
    """Return the progress of the part numbered `part`, from 0, of a task of `parts` equal parts."""
    return lambda done: progress((part + done) / parts)
