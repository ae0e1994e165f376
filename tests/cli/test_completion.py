"""What a shell is told when a key asks it to complete a word."""

import pytest
from typer.testing import CliRunner

from catenary.cli.main import app


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
