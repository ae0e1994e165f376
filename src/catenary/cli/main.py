"""The catenary command: reads arguments, calls one job, prints, ends with an exit code."""

import contextlib
import io
import logging
import os
import sys
from typing import TextIO, cast

import typer

from catenary import __version__
from catenary.cli.commands import HELP_NAMES, CommandGroup, InterruptedCommand
from catenary.cli.signals import exit_code
from catenary.visible import ClosedOutput, VisibleStream

MOST_SAID = 10_000  # characters of an error: names in it may be as long as a file

app = typer.Typer(
    name="catenary",
    cls=CommandGroup,
    help="Make an arm's low-level model true: where cable-driven joints really are, what gravity asks of them.",
    no_args_is_help=True,
    context_settings=HELP_NAMES,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # plain help: nothing is cut, and it comes in half the time
)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"catenary {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: bool = typer.Option(False, "--version", callback=_print_version, is_eager=True, help="Print the version."),
) -> None:
    """Read the options that stand before a command."""


def main() -> None:
    """Run the command; bad input ends with exit code 2 and a message, a found fault with 1."""
    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: SIM115  # a service may have closed it
    sys.stderr = sys.stderr or open(os.devnull, "w")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # a terminal without a character still shows the rest
            stream.reconfigure(errors="backslashreplace")
    out, err = sys.stdout, sys.stderr
    # also what is logged goes through them
    sys.stdout, sys.stderr = cast(TextIO, VisibleStream(out)), cast(TextIO, VisibleStream(err))
    try:
        _run()
    finally:
        sys.stdout, sys.stderr = out, err


def _run() -> None:
    from catenary.cli.terminal import NotesOfLogs, is_for_people
    from catenary.errors import CatenaryError

    notes, log = NotesOfLogs(), logging.getLogger("catenary")
    log.addHandler(notes)
    logging.getLogger("matplotlib").addFilter(is_for_people)
    try:
        try:
            app(prog_name="catenary")
        finally:
            sys.stdout.flush()
            log.removeHandler(notes)
    except CatenaryError as error:
        _fail(_with_notes(str(error), error), 2)
    except (InterruptedCommand, KeyboardInterrupt) as error:
        cause = error.__cause__ or error
        name = str(cause)
        _fail(_with_notes(f"ended by {name}" if name else "interrupted", cause), exit_code(name))
    except ClosedOutput as error:
        _close_output()  # nothing is left to say
        sys.exit(getattr(error.__context__, "code", 0))  # as the command had ended
    except OSError as error:
        _close_output()
        _fail(f"{error.filename or 'standard output'}: {error.strerror or error}", 2)
    except UnicodeError as error:
        _fail(f"a name cannot be written as text: {error}", 2)


def _with_notes(message: str, error: BaseException) -> str:
    """Return an error's message with its notes, such as that a robot could not be paused."""
    return "; ".join([message, *getattr(error, "__notes__", [])])


def _fail(message: str, code: int) -> None:
    with contextlib.suppress(OSError):  # a terminal that was closed
        print(f"catenary: {message[:MOST_SAID]}", file=sys.stderr)
    sys.exit(code)


def _close_output() -> None:
    """Point standard output nowhere, so that Python's own last flush does not fail once more."""
    with contextlib.suppress(io.UnsupportedOperation):  # a text in memory, in a test
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    main()
