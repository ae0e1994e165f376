import re
import shlex
from pathlib import Path

import pytest

from catenary.robots.catalog import load_robot
from command_line import catenary

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def blocks(language: str) -> list[tuple[str, str, str | None]]:
    """Page and text of each block in a language, and what it is said to print: a block of text right below it."""
    form = rf"^```{language}\n((?:(?!^```).)*?)^```\n(?:\n```text\n(.*?)^```)?"
    pages = {page.name: re.findall(form, page.read_text(), re.MULTILINE | re.DOTALL) for page in PAGES}
    return [(name, code, text or None) for name, found in pages.items() for code, text in found]


@pytest.mark.parametrize(("page", "code", "text"), blocks("python"), ids=lambda value: str(value)[:20])
def test_python_on_the_pages_runs_and_prints_what_stands_below_it(
    page: str,
    code: str,
    text: str | None,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # pages run from the root; what they write goes elsewhere
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    exec(compile(code, page, "exec"), {})
    assert text is None or capsys.readouterr().out == text


@pytest.mark.parametrize(("page", "text", "_"), blocks("toml"), ids=lambda value: str(value)[:20])
def test_robots_on_the_pages_load(page: str, text: str, _: None, tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text(text)
    assert not load_robot(tmp_path / "robot.toml").missing_inertia


def commands() -> list[str]:
    """Commands on the pages that are complete, with no placeholder, and end by themselves."""
    lines = [line for page in PAGES for line in re.findall(r"`catenary ([^`]+)`", page.read_text())]
    whole = {line for line in lines if " " in line and not re.search(r"[A-Z]{2}|\.\.\.", line)}
    return sorted(line for line in whole if not line.startswith("view "))


@pytest.mark.slow
@pytest.mark.parametrize("line", commands())
def test_commands_on_the_pages_run(line: str) -> None:
    assert catenary(*shlex.split(line)).code == 0


def test_help_examples_that_name_no_file_run() -> None:
    assert len(commands()) > 5  # on the pages
    for name in ("fk", "ik"):
        text = " ".join(catenary(name, "--help").out.split())
        example = re.search(r"Example: catenary (.*?) (?:Arguments|Options):", text)
        assert example
        assert catenary(*shlex.split(example.group(1))).code == 0
