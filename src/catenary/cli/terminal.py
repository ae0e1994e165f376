"""Output of commands on the terminal: JSON, facts, notes, progress."""

import json
import logging
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from pathlib import Path
from shutil import get_terminal_size
from textwrap import fill
from typing import Any, TextIO

from catenary.files import json_text
from catenary.operating_system import takes_more
from catenary.tables import Table
from catenary.terminal_text import visible

_SILENT: ContextVar[bool] = ContextVar("silent", default=False)
_FORM: ContextVar[str] = ContextVar("form", default="text")


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
    """Return True if a message of matplotlib's concerns a user: not the location of its fonts for this run."""
    return not record.getMessage().startswith(("mkdir -p failed", "Matplotlib created a temporary"))


def without_notes(silent: bool) -> AbstractContextManager[None]:
    """Leave notes out while a command runs."""
    return _set_for_a_while(_SILENT, silent)


def printing(form: str) -> AbstractContextManager[None]:
    """Print results as "text", as "json", or their tables and nothing else as "latex", while a command runs."""
    return _set_for_a_while(_FORM, form)


def prints_json() -> bool:
    """Return True if the running command was asked for JSON."""
    return _FORM.get() == "json"


@contextmanager
def _set_for_a_while(variable: ContextVar[Any], value: object) -> Iterator[None]:
    before = variable.set(value)
    try:
        yield
    finally:
        variable.reset(before)


def print_json_line(content: Any) -> None:
    """Print one JSON document on one line, so that a program can read each on arrival."""
    print(json.dumps(json.loads(json_text(content))), flush=True)


def if_read(show: Callable[[Any], None]) -> Callable[[Any], None]:
    """Return `show` for a loop: it prints nothing while that would wait, as for a stopped terminal or a full pipe."""

    def shown(status: Any) -> None:
        try:
            is_ready = takes_more(sys.stdout)
        except (OSError, ValueError):  # no file
            is_ready = True
        if is_ready:
            show(status)

    return shown


def print_result(content: Any, *parts: Any, notes: Sequence[str] = ()) -> None:
    """Print a command's result: with --json its content, with --latex its tables, or notes and parts for people.

    Parts are lines, tables and lists of facts (name, text), which are aligned; None is left out.
    """
    if prints_json():
        print(json_text(content))
        return
    print_notes(notes)
    if _FORM.get() == "latex":
        print("\n\n".join(part.latex() for part in parts if isinstance(part, Table)))
        return
    width = max((len(name) for part in parts if isinstance(part, list) for name, _ in part), default=0)
    for part in parts:
        if isinstance(part, list):
            for name, text in part:
                print(_wrapped(f"  {name:<{width}}  ", text, sys.stdout))
        elif part is not None:
            print(part if isinstance(part, str) else part.text())


def print_page(page: Path) -> None:
    """Print the path of a written page; nothing with --json and --latex."""
    if _FORM.get() == "text":
        print(f"page:  {page}")


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
