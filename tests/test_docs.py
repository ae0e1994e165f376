import os
import re
import shlex
import subprocess
import sys
from contextlib import contextmanager, nullcontext
from pathlib import Path

import pytest

from catenary.robots.catalog import load_robot
from command_line import catenary
from documented import ROOT, Block, blocks, blocks_of, said_in_text, unlike, words_of
from given import give
from parsed_commands import complaint
from recordings import short_training

BLOCKS = blocks()
RUN = [block for block in BLOCKS if block.not_run is None]
# commands that end with 1 where they find something wrong
JUDGES = {"check", "drift", "sense"}
# commands that go on until they are ended
ENDLESS = {"view", "serve", "teleop", "monitor", "encoders", "gravity-node", "tool-node"}


def _pages() -> list[object]:
    """Pages with something to run; those with commands take long."""
    names = {block.page: None for block in RUN if block.language == "python" or block.commands}
    slow = {block.page for block in RUN if block.commands}
    return [pytest.param(name, marks=pytest.mark.slow if name in slow else (), id=name) for name in names]


@pytest.mark.usefixtures("hurried")
@pytest.mark.parametrize("page", _pages())
def test_a_page_does_what_it_says(
    page: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
) -> None:
    # pages run from the root; what they write goes elsewhere
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    run = [block for block in RUN if block.page == page]
    with nullcontext() if any(block.commands for block in run) else contextmanager(short_training)():
        for block in run:
            give(block.given, tmp_path, request)
            _run(block, capsys)


def _run(block: Block, capsys: pytest.CaptureFixture[str]) -> None:
    if block.language == "python":
        # lines as on the page, for who reads a traceback
        exec(compile("\n" * block.line + block.text, block.page, "exec"), {})
        out = capsys.readouterr().out
        assert block.printed is None or out == block.printed
    for command, said in block.commands:
        words, into = words_of(command)
        if words[0] == "catenary":
            outcome = catenary(*words[1:])
            assert outcome.code in ((0, 1) if words[1] in JUDGES else (0,)), (command, outcome)
            out, err = outcome.out, outcome.err
        else:
            assert words[0] == "python", f"{block.page}:{block.line}: is not run here, and does not say why: {command}"
            ended = subprocess.run(
                [sys.executable, *words[1:]], capture_output=True, text=True, check=True, env=_with_package()
            )
            out, err = ended.stdout, ended.stderr
        if into is not None:
            into.write_text(out)
        assert unlike(said, out + err) == [], (f"{block.page}:{block.line}: {command}", out + err)


def _with_package() -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT / "src"), os.environ.get("PYTHONPATH", "")])}


def test_every_command_on_the_pages_is_one_that_the_parser_takes() -> None:
    in_blocks = [
        (f"{block.page}:{block.line}", words_of(command)[0])
        for block in BLOCKS
        for command, _ in block.commands
        if command.startswith("catenary ")
    ]
    in_text = [(page, ["catenary", *words_of(line)[0]]) for page, line in said_in_text()]
    wrong = {
        (where, shlex.join(words)): found
        for where, words in in_blocks + in_text
        if (found := complaint(words[1:])) is not None
    }
    assert wrong == {}
    for refused in ("fit LOG --no-such-option", "gravity raven2 --q", "nothing ROBOT", "random --seconds ten"):
        assert complaint(shlex.split(refused)) is not None
    assert len(in_blocks) > 40
    assert len(in_text) > 100


def test_no_command_that_is_run_goes_on_for_ever_or_reaches_for_a_robot() -> None:
    """Those need a comment above their block that says why they are not run."""
    found = [(f"{block.page}:{block.line}", words_of(command)[0]) for block in RUN for command, _ in block.commands]
    assert [
        (where, words)
        for where, words in found
        if words[0] == "catenary" and (words[1] in ENDLESS or {"--ros", "--port"} & set(words))
    ] == []
    assert {words[0] for _, words in found} <= {"catenary", "python"}


def test_every_command_in_a_block_stands_behind_a_dollar_sign() -> None:
    bare = [
        f"{block.page}:{block.line}: {line}"
        for block in BLOCKS
        if block.language in ("", "bash", "console")
        for line in block.text.splitlines()
        if "  " not in line.strip().partition(" #")[0]  # a screen
        and re.match(r"\s*(catenary|python3?|make|pip|ssh|export|apt) (?=\S)", line)
    ]
    assert bare == []


def test_a_block_is_read_with_its_marks_its_place_and_what_it_prints() -> None:
    text = (
        "A\n\n<!-- given: a.npz, b.npz -->\n<!-- not run: a robot -->\n\n   ```\n   $ catenary home \\\n     --ros 1\n   done\n   ```\n"
        "\n<!-- tried: (3) as (1) -->\n```python\nprint(3)\n```\n\n```text\n1\n```\n"
    )
    first, second = blocks_of(text, "page.md")
    assert first.commands == [("catenary home --ros 1", ["done"])]
    assert (first.line, first.not_run, first.given) == (6, "a robot", ("a.npz", "b.npz"))
    assert (second.text, second.printed, second.not_run) == ("print(1)\n", "1\n", None)


@pytest.mark.parametrize(
    "block", [one for one in BLOCKS if one.language == "toml"], ids=lambda one: f"{one.page}:{one.line}"
)
def test_robots_on_the_pages_load(block: Block, tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text(block.text)
    assert not load_robot(tmp_path / "robot.toml").missing_inertia


def complete_commands() -> list[str]:
    """Commands within sentences that are complete: with arguments, and none of them a placeholder."""
    lines = {line for _, line in said_in_text()}
    return sorted(line for line in lines if " " in line and not re.search(r"[A-Z]{2}|\.\.\.", line))


@pytest.mark.slow
@pytest.mark.usefixtures("hurried")
@pytest.mark.parametrize("line", complete_commands())
def test_commands_within_sentences_run(line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert catenary(*shlex.split(line)).code == 0


def test_help_examples_that_name_no_file_run() -> None:
    assert len(complete_commands()) > 5
    for name in ("fk", "ik"):
        text = " ".join(catenary(name, "--help").out.split())
        example = re.search(r"Example: catenary (.*?) (?:Arguments|Options):", text)
        assert example
        assert catenary(*shlex.split(example.group(1))).code == 0


def _numbers(text: str) -> list[str]:
    return re.findall(r"(?<![\w.])\d+(?:\.\d+)?(?:e-\d+)?", text)


def test_every_number_of_the_accuracy_page_stands_on_the_page_that_measures_it() -> None:
    page = ROOT / "docs" / "accuracy.md"
    rows = [line.strip("| ").split(" | ") for line in page.read_text().splitlines() if line.startswith("| ")][1:]
    assert len(rows) > 10
    for name, result, peer, link in rows:
        source = re.search(r"\]\(([\w-]+\.md)", link)
        assert source is not None, name
        measured = [float(number) for number in _numbers((page.parent / source[1]).read_text())]
        for number in _numbers(f"{result} {peer}"):
            unit = 0.0 if "e" in number else 10.0 ** -len(number.partition(".")[2])
            shown = [abs(float(number) - n) <= 0.501 * unit for m in measured for n in (m, 100.0 * m)]
            assert any(shown), f"{name}: {number} is not in {source[1]}"
