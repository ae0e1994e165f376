from pathlib import Path
from typing import Any

import pytest

from papers.arguments import folder_and_robots, folder_argument

USUAL = (None, 1, 2)


def test_a_folder_is_read_and_robots_are_the_usual_ones_unless_named(tmp_path: Path) -> None:
    assert folder_argument("About.", [str(tmp_path / "new")]) == tmp_path / "new"
    assert folder_and_robots("About.", USUAL, [str(tmp_path)]) == (tmp_path, USUAL)
    assert folder_and_robots("About.", USUAL, [str(tmp_path), "nominal", "7"]) == (tmp_path, (None, 7))


def test_help_tells_what_the_script_does_and_runs_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        folder_and_robots("What it does.\n\nHow.", USUAL, ["--help"])
    assert end.value.code == 0
    out = capsys.readouterr().out
    assert "What it does." in out
    assert "nominal 1 2" in out
    assert "How." not in out


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ((), "folder"),
        (("results", "--fast"), "--fast"),
        (("results", "first"), "expected nominal, or a seed"),
        (("results", "-1"), "-1"),
        ((__file__,), "is a file"),
    ],
)
def test_bad_arguments_are_refused(given: tuple[str, ...], word: str, capsys: Any) -> None:
    with pytest.raises(SystemExit) as end:
        folder_and_robots("About.", USUAL, given)
    assert end.value.code == 2
    assert word in capsys.readouterr().err
