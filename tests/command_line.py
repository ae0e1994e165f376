"""The catenary command, run in this process or one of its own: what it prints, and its exit code."""

import contextlib
import io
import json
import subprocess
import sys
from collections.abc import Iterable
from typing import Any, NamedTuple, TextIO
from unittest.mock import patch

from catenary.cli.main import main


class Outcome(NamedTuple):
    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """Standard output as strict JSON: nothing else may stand there, no NaN or infinity in it."""

        def refuse(word: str) -> None:
            raise ValueError(f"{word} is not JSON")

        return json.loads(self.out, parse_constant=refuse)


def catenary(*arguments: object) -> Outcome:
    """Run the command; an exception other than its exit would be a traceback to a user, and fails the test."""
    out, err = io.StringIO(), io.StringIO()
    return Outcome(exit_code(arguments, out, err), out.getvalue(), err.getvalue())


def exit_code(arguments: Iterable[object], out: TextIO, err: TextIO) -> int:
    """Run the command with these streams in place of the process's own, and nobody at the keyboard."""
    with (
        patch.object(sys, "argv", ["catenary", *map(str, arguments)]),
        patch.object(sys, "stdin", io.StringIO()),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
        except SystemExit as end:
            return int(end.code or 0)
    return 0


def in_its_own_process(*arguments: str) -> Outcome:
    """Run the command as a shell does, where what this process is or has imported would change what it says."""
    ended = subprocess.run(
        [sys.executable, "-m", "catenary.cli.main", *arguments],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=120.0,
        check=False,
    )
    return Outcome(ended.returncode, ended.stdout, ended.stderr)


def refusal(*arguments: object) -> str:
    """Run the command on bad input: exit code 2, nothing on standard output; give the message."""
    outcome = catenary(*arguments)
    assert outcome.code == 2, outcome
    assert outcome.out == ""
    assert "Traceback" not in outcome.err
    return outcome.err
