"""What the scripts of this room are told on the command line: a folder, and which robots."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

Robots = tuple[int | None, ...]
_NOMINAL = -1  # for argparse, which cannot hold None apart from nothing


def make_parser(about: str | None) -> argparse.ArgumentParser:
    """Return a script's argument parser, with --help; unknown options are refused.

    Args:
        about: The script's docstring, of which the first paragraph is shown.
    """
    spec = sys.modules["__main__"].__spec__
    return argparse.ArgumentParser(
        prog=None if spec is None else f"python -m {spec.name}",
        description=(about or "").strip().split("\n\n")[0],
        allow_abbrev=False,
    )


def results_folder(text: str) -> Path:
    """Return the folder to write to.

    Raises:
        argparse.ArgumentTypeError: A file stands there.
    """
    path = Path(text)
    if path.exists() and not path.is_dir():
        raise argparse.ArgumentTypeError(f"{text}: is a file; give a folder")
    return path


def folder_argument(about: str | None, arguments: Sequence[str] | None = None) -> Path:
    """Read the folder that a script writes to; exit with 2 on anything else."""
    parser = make_parser(about)
    parser.add_argument("folder", type=results_folder, help="where the results go")
    folder: Path = parser.parse_args(arguments).folder
    return folder


def folder_and_robots(
    about: str | None, usual: Robots, arguments: Sequence[str] | None = None
) -> tuple[Path, Robots]:
    """Read the folder that a script writes to, and the seeds of the robots that it runs.

    Args:
        about: The script's docstring.
        usual: Robots where none are named; None is the nominal one.
        arguments: In place of the command line's.
    """
    parser = make_parser(about)
    parser.add_argument("folder", type=results_folder, help="where the results go")
    named = " ".join("nominal" if seed is None else str(seed) for seed in usual)
    parser.add_argument(
        "robots", nargs="*", metavar="ROBOT", type=_seed, help=f"nominal, or a seed; by default {named}"
    )
    told = parser.parse_args(arguments)
    return told.folder, tuple(None if seed == _NOMINAL else seed for seed in told.robots) or usual


def _seed(text: str) -> int:
    if text == "nominal":
        return _NOMINAL
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text}: expected nominal, or a seed of zero or more")
    return int(text)
