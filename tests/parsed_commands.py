"""A command of ours parsed by its own parser, and not run: unknown options and missing arguments are found."""

import re
from itertools import pairwise
from typing import Any

import typer

from catenary.cli.main import app
from catenary.errors import CatenaryError

# ROBOT, LOG.npz, Q,Q,..., N: what a reader replaces
PLACEHOLDER = re.compile(r"\.\.\.|\b[A-Z][A-Z_]*\b")
ENDS_AT_ONCE = {"--help", "-h", "--version", "--install-completion"}


def complaint(words: list[str]) -> str | None:
    """Return what the parser has against a command's words, None for nothing.

    Whatever stands in capitals is what a reader replaces, and may be of another type than the command takes.
    """
    words = [word.removesuffix("...") or word for word in words]
    if ENDS_AT_ONCE & set(words):
        return None
    group: Any = typer.main.get_command(app)
    context = group.make_context("catenary", words[:1], resilient_parsing=True)
    command = group.get_command(context, words[0])
    if command is None:
        return f"no command {words[0]}"
    if len(words) == 1:
        return None  # its name
    try:
        command.make_context(words[0], words[1:], parent=context)
    except CatenaryError as error:
        return str(error)
    except Exception as error:
        # the parser's own classes are not public
        if isinstance(error, typer.BadParameter) and PLACEHOLDER.search(_value(error, words)):
            return None
        if hasattr(error, "format_message"):
            return str(error.format_message())
        raise
    return None


def _value(error: Any, words: list[str]) -> str:
    """Return what was given for the parameter that an error is about: an option's next word, or all words."""
    names = getattr(error.param, "opts", [])
    given = [after for word, after in pairwise(words) if word in names]
    return " ".join(given or words)
