"""What every command shares with the person at the terminal: lists typed with commas, tables, progress."""

import json
import logging
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from math import isfinite
from shutil import get_terminal_size
from textwrap import fill
from typing import Any, TextIO

from catenary.errors import InputError
from catenary.visible import visible

_SILENT: ContextVar[bool] = ContextVar("silent", default=False)


class NotesOfLogs(logging.Handler):
    """What the package logs, as notes on standard error; errors also with --no-notes."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)

    def emit(self, record: logging.LogRecord) -> None:
        """Print the record's text."""
        if record.levelno >= logging.ERROR:
            announce(record.getMessage())
        else:
            print_notes([record.getMessage()])


def is_for_people(record: logging.LogRecord) -> bool:
    """Return whether a person needs to know what matplotlib logs: not where it keeps its fonts for this run."""
    return not record.getMessage().startswith(("mkdir -p failed", "Matplotlib created a temporary"))


@contextmanager
def without_notes(silent: bool) -> Iterator[None]:
    """Leave notes out while a command runs."""
    before = _SILENT.set(silent)
    try:
        yield
    finally:
        _SILENT.reset(before)


def numbers(option: str, text: str, count: int | None = None) -> tuple[float, ...]:
    """Read numbers separated by commas or spaces, as many as `count` says."""
    values = []
    for word in text.replace(",", " ").split():
        try:
            values.append(float(word))
        except ValueError:
            raise InputError(
                f"{option}: expected numbers separated by commas, got {word!r} in {text!r}"
            ) from None
    if not values or len(values) != (count or len(values)):
        expected = f"{count} numbers" if count else "numbers"
        raise InputError(f"{option}: expected {expected} separated by commas, got {text!r}")
    return tuple(values)


def base_tilt(text: str | None) -> tuple[float, float]:
    """Read roll and pitch of a base [deg] from --base-tilt-deg; a level one when None."""
    angles = (0.0, 0.0) if text is None else numbers("--base-tilt-deg", text)
    if len(angles) != 2 or not all(map(isfinite, angles)):
        raise InputError(f"--base-tilt-deg: expected roll and pitch in degrees, as 0,20; got {text!r}")
    return angles[0], angles[1]


def words(text: str) -> tuple[str, ...]:
    """Read words separated by commas."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


def print_json(content: Any) -> None:
    """Print one JSON document on standard output."""
    from catenary.files import json_text

    print(json_text(content))


def print_json_line(content: Any) -> None:
    """Print one JSON document on one line, so that a program can read them as they come."""
    from catenary.files import json_text

    print(json.dumps(json.loads(json_text(content))), flush=True)


def print_table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]], *, left: int = 1) -> None:
    """Print a table whose first `left` columns stand to the left, the others to the right.

    A unit in a header, as in `J1 [deg]`, stands on a line of its own: so six joints fit into 80 columns. A table
    is never cut; in a narrower terminal its lines run on.
    """
    heads = [name.replace(" [", "\n[").split("\n") for name in header]
    names = [[head[0] for head in heads]]
    if any(len(head) > 1 for head in heads):
        names.append([head[1] if len(head) > 1 else "" for head in heads])
    cells = [[" ".join(cell.split()) for cell in row] for row in rows]
    widths = [max(len(row[i]) for row in [*names, *cells]) for i in range(len(header))]
    rule = ["-" * width for width in widths]
    print(f"{title}\n")
    for row in (*names, rule, *cells):
        line = "  ".join(
            cell.ljust(width) if i < left else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        print(f"  {line}".rstrip())
    print()


def print_fact(name: str, text: str, *, width: int) -> None:
    """Print a name and what it stands for, the text on as many lines of a terminal as it takes."""
    print(_wrapped(f"  {name:<{width}}  ", text, sys.stdout))


def announce(text: str) -> None:
    """Print a line on standard error at once."""
    print(text, file=sys.stderr, flush=True)


def print_notes(notes: Sequence[str]) -> None:
    """Print remarks and warnings on standard error, so that piped output stays clean; remarks not with --no-notes."""
    for note in notes:
        is_warning = note.startswith("warning: ")
        if is_warning or not _SILENT.get():
            print(_wrapped("" if is_warning else "note: ", note, sys.stderr), file=sys.stderr)


def _wrapped(label: str, text: str, stream: TextIO) -> str:
    """Fill the lines of a terminal; a file or pipe gets one line, which is easier to search."""
    if not stream.isatty():
        return label + text
    columns = get_terminal_size().columns
    return fill(
        text,
        max(columns, len(label) + 20),
        initial_indent=label,
        subsequent_indent=" " * len(label),
        break_long_words=False,
        break_on_hyphens=False,
    )


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[float], None]]:
    """Show progress on standard error; in a file or pipe, where a bar cannot move, show nothing."""
    if not sys.stderr.isatty():
        yield lambda done: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    console = Console(file=getattr(sys.stderr, "stream", sys.stderr))
    with Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
    ) as bar:
        task = bar.add_task(visible(label), total=1.0)
        yield lambda done: bar.update(task, completed=done)
