"""A part of the campaign: a name, how many cases are asked for, and a case by its seed."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

from catenary.errors import CatenaryError

# limits of a case that waits for programs of its own
PROGRAMS: dict[str, Any] = {"processor_time": math.inf, "patience": 600.0, "memory": None, "warnings_fail": False}
# a case by its seed, in a folder of its own where it leaves its input
Case = Callable[[int, Path], object]


class Fell(AssertionError):
    """Something that was promised did not hold."""


@dataclass(frozen=True)
class Part:
    """Cases of one kind; a case that returns has held, and one that raises has failed.

    Modules of parts import what is slow to import in their functions: they are all read for a list of names. The
    cases run one after the other in a child process, which may keep what is dear to make (`functools.cache`).

    Args:
        name: Group and kind, as "files.journal".
        target: Cases that are asked for.
        case: Tries one: (seed, empty folder). Leave the input in the folder before using it: the folder is kept
            where the case fails, also where the process ends in it.
        may_refuse: A CatenaryError is an answer: the case has held.
        warnings_fail: Warnings from below are errors, but for those of what is deprecated.
        processor_time: A case may take [s]; of the child process, not of processes of its own. inf limits nothing.
        patience: A case may last [s], on a busy machine: one that hangs takes no processor time.
        memory: A case may take beyond what the child process has after its imports [bytes]; None limits nothing.
            Processes that a case starts inherit both limits.
    """

    name: str
    target: int
    case: Case
    may_refuse: bool = False
    warnings_fail: bool = True
    processor_time: float = 5.0
    patience: float = 120.0
    memory: int | None = 10**9

    def attempt(self, call: Callable[[], object]) -> None:
        """Run a case; raise what it is not allowed to raise."""
        try:
            call()
        except CatenaryError:
            if not self.may_refuse:
                raise


def found_parts() -> dict[str, tuple[str, Part]]:
    """Return the parts by their names, each with its module."""
    parts: dict[str, tuple[str, Part]] = {}
    for entry in iter_modules([str(Path(__file__).with_name("parts"))]):
        module = f"tests.campaign.parts.{entry.name}"
        for part in getattr(import_module(module), "PARTS", ()):
            parts[part.name] = (module, part)
    return dict(sorted(parts.items()))


def chosen(names: Sequence[str]) -> dict[str, tuple[str, Part]]:
    """Return the parts of these names or groups ("files"); all of them where none or "all" is asked for."""
    parts = found_parts()
    unknown = [n for n in names if n != "all" and not any(p == n or p.startswith(f"{n}.") for p in parts)]
    if unknown:
        raise SystemExit(f"unknown part {unknown[0]}; there are: {', '.join(parts)}")
    if not names or "all" in names:
        return parts
    return {p: found for p, found in parts.items() if any(p == n or p.startswith(f"{n}.") for n in names)}
