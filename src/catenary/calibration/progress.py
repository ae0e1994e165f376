"""How a fit tells how far it is."""

from collections.abc import Callable

Progress = Callable[[float], None]  # called with the share done, 0 to 1


def silent(_: float) -> None:
    """Tell nobody."""


def part_of(progress: Progress, part: int, parts: int) -> Progress:
    """Progress of the part numbered `part`, from 0, of a task of `parts` equal parts."""
    return lambda done: progress((part + done) / parts)
