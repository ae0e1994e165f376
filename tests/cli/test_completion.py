"""What a shell is told when a key asks it to complete a word."""

import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from catenary.cli.main import app
from catenary.robots.catalog import robot_names

RUN = [sys.executable, "-m", "catenary.cli.main"]


def completed(*words: str) -> list[str]:
    """What completes the last of the words, as bash asks for it."""
    asked = {"COMP_WORDS": " ".join(["catenary", *words]), "COMP_CWORD": str(len(words))}
    environment = asked | {"_CATENARY_COMPLETE": "complete_bash"}
    return CliRunner().invoke(app, [], prog_name="catenary", env=environment).output.split()


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (("mon",), ["monitor"]),
        (("fit", "--held"), ["--held-out"]),
        (("fk", "raven2_f"), ["raven2_full", "raven2_full_right"]),
        (("goto", "--robot", "two"), ["two_link"]),
        (("check", "no_robot_is_called_so"), []),  # bash then completes files
    ],
)
def test_commands_options_and_robots_complete(words: tuple[str, ...], found: list[str]) -> None:
    assert completed(*words) == found


@pytest.mark.skipif(shutil.which("bash") is None, reason="bash is not installed")
def test_the_script_completes_in_a_shell(tmp_path: Path) -> None:
    command = tmp_path / "catenary"
    command.write_text(f'#!/bin/sh\nexec {shlex.join(RUN)} "$@"\n')
    command.chmod(0o755)
    environment = os.environ | {"_CATENARY_COMPLETE": "source_bash"}
    script = subprocess.run(RUN, env=environment, capture_output=True, text=True, check=True).stdout
    line = (
        f"{script}\nCOMP_WORDS=(catenary fk rav); COMP_CWORD=2; _catenary_completion {command}; echo ${{COMPREPLY[@]}}"
    )
    shell = subprocess.run(["bash", "--norc", "-c", line], capture_output=True, text=True, check=True)
    assert shell.stdout.split() == [name for name in robot_names() if name.startswith("rav")]
