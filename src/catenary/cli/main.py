"""The catenary command: reads arguments, calls one job, prints."""

import sys

import typer

from catenary import __version__
from catenary.cli import calibration, check, robots

app = typer.Typer(
    name="catenary",
    help="Make an arm's low-level model true: where cable-driven joints really are, what gravity asks of them.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
app.command("fit", no_args_is_help=True)(calibration.fit)
app.command("evaluate", no_args_is_help=True)(calibration.evaluate)
app.command("check", no_args_is_help=True)(check.check)
app.command("fk", no_args_is_help=True)(robots.fk)
app.command("ik", no_args_is_help=True)(robots.ik)
app.command("robots")(robots.robots)
app.command("demo")(calibration.demo)


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

    try:
        app()
    except CatenaryError as error:
        print(f"catenary: {error}", file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        print("catenary: interrupted", file=sys.stderr)
        sys.exit(130)
    except BrokenPipeError:
        sys.stderr.close()  # the reader of our output went away; nothing is left to say
        sys.exit(1)


if __name__ == "__main__":
    main()
