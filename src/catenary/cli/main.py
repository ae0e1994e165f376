"""The catenary command: reads arguments, calls one job, prints, ends with an exit code; the commands by name."""

import contextlib
import io
import logging
import os
import sys
import warnings
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any, NoReturn, TextIO, cast

import typer
from typer.core import TyperGroup

from catenary import __version__
from catenary.cli.exit_codes import REFUSED, code_of_signal, signals_interrupt
from catenary.cli.options import as_typed
from catenary.crtk.network import parse_ros_arguments, say_ros_arguments, split_ros_arguments
from catenary.errors import CatenaryError, ImplausibleWarning
from catenary.terminal_text import ClosedOutput, VisibleStream

# groups in the order in which `catenary --help` lists them; of each command the module with its function
GROUPS: dict[str, dict[str, str]] = {
    "Calibrate": {
        "calibrate": "calibrate", "home": "record", "excite": "record", "record": "record", "extract": "calibrate",
        "fit": "fit", "evaluate": "fit", "refresh": "fit", "drift": "fit", "deploy": "calibrate", "demo": "calibrate",
    },
    "Gravity": {
        "gravity": "gravity", "track": "gravity", "hold": "gravity", "sense": "sense", "gravity-node": "nodes",
        "tool-node": "nodes",
    },
    "Identify": {
        "excitation": "identify", "identify": "identify", "identify-cable": "identify", "payload": "identify",
        "regressor": "robots",
    },
    "Move": {
        "goto": "motion", "random": "motion", "follow": "motion", "teleop": "motion", "serve": "nodes",
        "button": "nodes", "encoders": "nodes",
    },
    "Look": {
        "monitor": "view", "view": "view", "plot": "robots", "fk": "robots", "ik": "robots", "robots": "robots",
    },
    "Files": {"check": "files", "import": "files", "export": "files", "recover": "files"},
}  # fmt: skip
_MODULES = {name: module for group in GROUPS.values() for name, module in group.items()}
_HELP_NAMES = {"help_option_names": ["--help", "-h"]}
_MAX_MESSAGE_LENGTH = 10_000  # of an error: names in it may be as long as a file
# run without arguments; others then show their help
_COMPLETE = {"home", "teleop", "monitor", "view", "serve", "button", "robots", "demo"}


class Commands(Mapping[str, Any]):
    """Commands by name, each made when it is first looked at."""

    def __init__(self) -> None:
        self._made: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._made:
            function = "import_recording" if name == "import" else name.replace("-", "_")
            app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)
            command = getattr(import_module(f"catenary.cli.{_MODULES[name]}"), function)
            app.command(name, no_args_is_help=name not in _COMPLETE, context_settings=_HELP_NAMES)(as_typed(command))
            self._made[name] = typer.main.get_command(app)
            for parameter in self._made[name].params:
                if parameter.param_type_name == "argument":
                    parameter.display_type_rich = lambda ctx: None  # what it is called says what it is
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(_MODULES)

    def __len__(self) -> int:
        return len(_MODULES)


class InterruptedCommand(Exception):
    """Ctrl-C or a signal ended a command; its cause is the KeyboardInterrupt, at which newer typers exit silently."""


class CommandGroup(TyperGroup):
    """The group whose commands these are."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands: Any = Commands()

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands under the names of their groups."""
        width = max(map(len, _MODULES))
        for title, names in GROUPS.items():
            with formatter.section(title):
                limit = formatter.width - 6 - width
                formatter.write_dl(
                    [(f"{name:<{width}}", self.commands[name].get_short_help_str(limit)) for name in names]
                )

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command that is meant, its name and its arguments; what is behind `--ros-args` is kept for it."""
        name, command, rest = super().resolve_command(ctx, args)
        if any(option.name == "ros_distro" for option in (command.params if command else ())):
            rest, said = split_ros_arguments(rest)
            say_ros_arguments(parse_ros_arguments(said))
        return name, command, rest

    def invoke(self, ctx: Any) -> Any:
        """Run the command; SIGTERM and SIGHUP interrupt it as Ctrl-C does."""
        try:
            with signals_interrupt():
                return super().invoke(ctx)
        except KeyboardInterrupt as interrupt:
            raise InterruptedCommand from interrupt
        except ClosedOutput:
            raise typer.Exit from None  # whoever read our output has seen enough, as `head` does
        except BrokenPipeError as error:
            raise CatenaryError("a connection was closed from the other side") from error

    def get_params(self, ctx: Any) -> Any:
        """Return the group's options, flags False where not given: for None newer typers import pydantic, 0.2 s."""
        options = super().get_params(ctx)
        for option in options:
            if getattr(option, "is_flag", False) and option.default is None:
                option.default = False
        return options


app = typer.Typer(
    name="catenary",
    cls=CommandGroup,
    help="Make an arm's low-level model true: where cable-driven joints really are, what gravity asks of them.",
    no_args_is_help=True,
    context_settings=_HELP_NAMES,
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
    """Run the command; it ends with an exit code (cli/exit_codes.py), an error also with a message."""
    sys.stdout = sys.stdout or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  # a service may have closed it
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
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

    notes, log = NotesOfLogs(), logging.getLogger("catenary")
    log.addHandler(notes)
    logging.getLogger("matplotlib").addFilter(is_for_people)
    try:
        try:
            warnings.simplefilter("ignore", ImplausibleWarning)  # commands have notes of their own
            app(prog_name="catenary")
        finally:
            sys.stdout.flush()
            log.removeHandler(notes)
    except CatenaryError as error:
        _fail(str(error), REFUSED, error)
    except (InterruptedCommand, KeyboardInterrupt) as error:
        cause = error.__cause__ or error
        name = str(cause)
        _fail(f"ended by {name}" if name else "interrupted", code_of_signal(name), cause)
    except ClosedOutput as error:
        _close_output()  # nothing is left to say
        sys.exit(getattr(error.__context__, "code", 0))  # as the command had ended
    except OSError as error:
        _close_output()
        _fail(f"{error.filename or 'standard output'}: {error.strerror or error}", REFUSED)
    except UnicodeEncodeError as error:
        _fail(f"a name cannot be written as text: {error}", REFUSED)


def _fail(message: str, code: int, error: BaseException | None = None) -> NoReturn:
    said = "; ".join([message, *getattr(error, "__notes__", [])])
    with contextlib.suppress(OSError):  # a terminal that was closed
        print(f"catenary: {said[:_MAX_MESSAGE_LENGTH]}", file=sys.stderr)
    sys.exit(code)


def _close_output() -> None:
    """Point standard output nowhere, so that Python's own last flush does not fail once more."""
    with contextlib.suppress(io.UnsupportedOperation):  # a text in memory, in a test
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    main()
