"""The catenary command: reads arguments, calls one job, prints."""

import io
import os
import sys

import typer

from catenary import __version__
from catenary.cli import (
    calibration,
    check,
    export,
    gravity,
    identification,
    monitor,
    motion,
    nodes,
    pipeline,
    regressor,
    robots,
    sense,
    serve,
    teleop,
)

app = typer.Typer(
    name="catenary",
    help="Make an arm's low-level model true: where cable-driven joints really are, what gravity asks of them.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # plain help: nothing is cut, and it comes in half the time
)
app.command("calibrate", no_args_is_help=True)(pipeline.calibrate)
app.command("home", no_args_is_help=True)(pipeline.home)
app.command("excite", no_args_is_help=True)(pipeline.excite)
app.command("record", no_args_is_help=True)(pipeline.record)
app.command("extract", no_args_is_help=True)(pipeline.extract)
app.command("fit", no_args_is_help=True)(calibration.fit)
app.command("evaluate", no_args_is_help=True)(calibration.evaluate)
app.command("deploy", no_args_is_help=True)(pipeline.deploy)
app.command("goto", no_args_is_help=True)(motion.goto)
app.command("random", no_args_is_help=True)(motion.random)
app.command("follow", no_args_is_help=True)(motion.follow)
app.command("teleop")(teleop.teleop)
app.command("monitor")(monitor.monitor)
app.command("gravity", no_args_is_help=True)(gravity.gravity)
app.command("track", no_args_is_help=True)(gravity.track)
app.command("hold", no_args_is_help=True)(gravity.hold)
app.command("identify", no_args_is_help=True)(identification.identify)
app.command("excitation", no_args_is_help=True)(identification.excitation)
app.command("payload", no_args_is_help=True)(identification.payload)
app.command("check", no_args_is_help=True)(check.check)
app.command("fk", no_args_is_help=True)(robots.fk)
app.command("ik", no_args_is_help=True)(robots.ik)
app.command("regressor", no_args_is_help=True)(regressor.regressor)
app.command("sense", no_args_is_help=True)(sense.sense)
app.command("encoders", no_args_is_help=True)(nodes.encoders)
app.command("gravity-node", no_args_is_help=True)(nodes.gravity_node)
app.command("export", no_args_is_help=True)(export.export)
app.command("serve")(serve.serve)
app.command("button")(serve.button)
app.command("robots")(robots.robots)
app.command("demo")(pipeline.demo)


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"catenary {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: bool = typer.Option(
        False, "--version", callback=_print_version, is_eager=True, help="Print the version."
    ),
) -> None:
    """Take the options that stand before a command."""


def main() -> None:
    """Run the command; bad input ends with exit code 2 and a message, a found fault with 1."""
    from catenary.errors import CatenaryError

    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: SIM115  # a service may have closed it
    sys.stderr = sys.stderr or open(os.devnull, "w")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(
                errors="backslashreplace"
            )  # a terminal without a character still shows the rest
    try:
        try:
            app(prog_name="catenary")
        finally:
            sys.stdout.flush()
    except CatenaryError as error:
        _fail(str(error), 2)
    except KeyboardInterrupt:
        _fail("interrupted", 130)
    except BrokenPipeError:
        _close_output()  # the reader of our output went away; nothing is left to say
        sys.exit(1)
    except OSError as error:
        _close_output()
        _fail(f"{error.filename or 'output'}: {error.strerror or error}", 2)
    except UnicodeError as error:
        _fail(f"a name cannot be written as text: {error}", 2)


def _fail(message: str, code: int) -> None:
    print(f"catenary: {message}", file=sys.stderr)
    sys.exit(code)


def _close_output() -> None:
    """Point standard output nowhere, so that Python's own last flush does not fail once more."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


if __name__ == "__main__":
    main()
