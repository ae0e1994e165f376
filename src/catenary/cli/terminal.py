"""What every command shares with the person at the terminal: lists typed with commas, tables, progress."""

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from catenary.errors import InputError


def numbers(option: str, text: str) -> tuple[float, ...]:
    """Read numbers separated by commas or spaces.

    Raises:
        InputError: A word is no number; the message names the option.
    """
    values = []
    for word in text.replace(",", " ").split():
        try:
            values.append(float(word))
        except ValueError:
            raise InputError(
                f"{option}: expected numbers separated by commas, got {word!r} in {text!r}"
            ) from None
    if not values:
        raise InputError(f"{option}: expected numbers separated by commas, got {text!r}")
    return tuple(values)


def words(text: str) -> tuple[str, ...]:
    """Read words separated by commas."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


def print_json(content: Any) -> None:
    """Print one JSON document on standard output."""
    print(json.dumps(content, indent=2, ensure_ascii=False, allow_nan=True))


def print_table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print a table, the first column to the left, the others to the right."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    table = Table(
        title=title,
        title_justify="left",
        box=SIMPLE_HEAD,
        title_style="bold",
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    for i, name in enumerate(header):
        table.add_column(name, justify="left" if i == 0 else "right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    # a pipe or file has no width: let the table have what it needs
    Console(width=None if sys.stdout.isatty() else 200).print(table)


def print_notes(notes: Sequence[str]) -> None:
    """Print remarks on standard error, so that piped output stays clean."""
    for note in notes:
        print(f"note: {note}", file=sys.stderr)


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[float], None]]:
    """Show progress on standard error; in a file or pipe, where a bar cannot move, show nothing."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    console = Console(stderr=True)
    with Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    ) as bar:
        task = bar.add_task(label, total=1.0)
        yield lambda done: bar.update(task, completed=done)
