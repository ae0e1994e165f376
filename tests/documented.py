"""The pages as people read them: blocks of code and commands, and which of them are said not to be run.

A block of a page is run by tests/test_docs.py, in a folder of the page's own, after those above it. A comment right
above a block says otherwise, with the reason: `<!-- not run: a robot -->`. Then its commands are parsed only.
`<!-- given: lab.bag -->` names files that the tests put there first (tests/given.py). `<!-- tried: --seconds 20 as --seconds 2 -->`
has the tests run less than a reader does: they read the first as the second.
"""

import re
import shlex
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
_MARK = r" *<!-- (?:not run|given|tried): [^>]*? -->\n+"
_BLOCK = re.compile(
    rf"(?P<marks>(?:{_MARK})*)^(?P<indent> *)```(?P<language>\w*)\n(?P<text>(?:(?! *```).*\n)*) *```[ ]*$"
    r"(?:\n\n```text\n(?P<printed>(?:(?!```).*\n)*)```)?",
    re.MULTILINE,
)


class Block(NamedTuple):
    """A block of code on a page."""

    page: str  # README.md, docs/tutorials/ship.md
    line: int
    language: str
    text: str
    printed: str | None  # what it is said to print: a block of text right below it
    not_run: str | None  # reason
    given: tuple[str, ...]  # files

    @property
    def commands(self) -> list[tuple[str, list[str]]]:
        """Each command behind `$`, and the lines below it, which it is said to print."""
        found: list[tuple[str, list[str]]] = []
        if self.language not in ("", "console"):
            return found
        for line in self.text.replace("\\\n", " ").splitlines():
            if line.startswith("$ "):
                found.append((" ".join(line[2:].split()), []))
            elif found:
                found[-1][1].append(line)
        return found


def blocks() -> list[Block]:
    """Return every block of every page, in the pages' order."""
    return [block for page in PAGES for block in blocks_of(page.read_text(), page.relative_to(ROOT).as_posix())]


def blocks_of(text: str, page: str) -> list[Block]:
    """Return the blocks of a page's text."""
    found = []
    for match in _BLOCK.finditer(text):
        marks = dict(re.findall(r"<!-- (not run|given): (.*?) -->", match["marks"]))
        tried = re.findall(r"<!-- tried: (.*?) as (.*?) -->", match["marks"])
        code = re.sub(rf"^{match['indent']}", "", match["text"], flags=re.MULTILINE)
        for written, run in tried:
            assert written in code, f"{page}: {written!r} is not in the block below it"
            code = code.replace(written, run)
        line = text.count("\n", 0, match.start("language")) + 1
        given = tuple(one.strip() for one in marks.get("given", "").split(",") if one.strip())
        found.append(Block(page, line, match["language"], code, match["printed"], marks.get("not run"), given))
    return found


def said_in_text() -> list[tuple[str, str]]:
    """Page and words of each command of ours that stands within a sentence."""
    return [
        (page.relative_to(ROOT).as_posix(), " ".join(line.split()))
        for page in PAGES
        for line in re.findall(r"(?<!`)`catenary ([^`]+)`(?!`)", page.read_text())
        if " needs " not in line  # a message
    ]


def words_of(command: str) -> tuple[list[str], Path | None]:
    """Return a command's words without its comment, and the file into which it is led."""
    words = shlex.split(command, comments=True)
    if ">" in words:
        at = words.index(">")
        return words[:at], Path(words[at + 1])
    return words, None


def unlike(said: list[str], printed: str) -> list[str]:
    """Return the lines that a command is said to print and did not, whatever the numbers and spaces in them."""
    lines = {_shape(line) for line in printed.splitlines()}
    return [line for line in said if line.strip() not in ("", "...") and _shape(line) not in lines]


def _shape(line: str) -> str:
    return re.sub(r"[-+]?\d[\d.]*(e[-+]\d+)?", "#", "".join(line.split()).replace("-", ""))
