import re
import shlex
from pathlib import Path

import pytest

from catenary.robots.catalog import load_robot
from command_line import catenary

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(language: str) -> list[tuple[str, str]]:
    """Name of the page and text of each block in a language."""
    return [
        (page.name, text)
        for page in PAGES
        for text in re.findall(rf"^```{language}\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)
    ]


def programs() -> list[tuple[str, str, str | None]]:
    """Name of the page, code, and what it is said to print: a block of text right below a block of Python."""
    form = r"^```python\n((?:(?!^```).)*?)^```\n(?:\n```text\n(.*?)^```)?"
    return [
        (page.name, code, text or None)
        for page in PAGES
        for code, text in re.findall(form, page.read_text(), re.MULTILINE | re.DOTALL)
    ]


@pytest.mark.parametrize(("page", "code", "text"), programs(), ids=lambda value: str(value)[:20])
def test_python_on_the_pages_runs_and_prints_what_stands_below_it(
    page: str,
    code: str,
    text: str | None,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "examples").symlink_to(
        ROOT / "examples"
    )  # pages run from the root; what they write goes elsewhere
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    exec(compile(code, page, "exec"), {})
    assert text is None or capsys.readouterr().out == text


@pytest.mark.parametrize(("page", "text"), blocks("toml"), ids=lambda value: value[:20])
def test_robots_on_the_pages_load(page: str, text: str, tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text(text)
    assert not load_robot(tmp_path / "robot.toml").missing_inertia


def commands() -> list[str]:
    """Commands on the pages that are complete: with arguments, and none of them a placeholder."""
    lines = [line for page in PAGES for line in re.findall(r"`catenary ([^`]+)`", page.read_text())]
    return sorted({line for line in lines if " " in line and not re.search(r"[A-Z]{2}|\.\.\.", line)})


def test_there_are_commands_on_the_pages() -> None:
    assert commands()


@pytest.mark.parametrize("line", commands())
def test_commands_on_the_pages_run(line: str) -> None:
    assert catenary(*shlex.split(line)).code == 0


def test_help_examples_that_name_no_file_run() -> None:
    for name in ("fk", "ik"):
        text = " ".join(catenary(name, "--help").out.split())
        example = re.search(r"Example: catenary (.*?) (?:Arguments|Options):", text)
        assert example
        assert catenary(*shlex.split(example.group(1))).code == 0
