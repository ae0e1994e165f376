"""What a reader may rely on in every room: names once, short files, a page that knows them all."""

import ast
import re
from collections import Counter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "src" / "catenary"
FILES = sorted(PACKAGE.rglob("*.py"))


def test_no_class_name_is_used_twice() -> None:
    trees = (ast.walk(ast.parse(path.read_text())) for path in FILES)
    names = Counter(node.name for nodes in trees for node in nodes if isinstance(node, ast.ClassDef))
    assert [name for name, count in names.items() if count > 1] == []


def test_no_file_is_long() -> None:
    lengths = {str(path.relative_to(PACKAGE)): len(path.read_text().splitlines()) for path in FILES}
    assert {name: length for name, length in lengths.items() if length > 400} == {}


def test_no_folder_holds_more_files_than_a_reader_can_survey() -> None:
    counts = Counter(str(path.parent.relative_to(PACKAGE)) for path in FILES if path.name != "__init__.py")
    assert {folder: count for folder, count in counts.items() if count > 25} == {}


ARCHITECTURE = (PACKAGE.parents[1] / "docs" / "architecture.md").read_text()


def test_files_that_the_architecture_page_sends_readers_to_exist() -> None:
    named = re.findall(r"`([a-z_0-9/]+/[a-z_0-9]+\.py)`", ARCHITECTURE)
    assert len(named) > 30
    assert [name for name in named if not (PACKAGE / name).is_file()] == []


@pytest.mark.parametrize("room", sorted(path.parent.name for path in PACKAGE.glob("*/__init__.py")))
def test_architecture_page_names_the_files_of_every_room(room: str) -> None:
    (row,) = re.findall(rf"^\| `{room}` \|(.*)$", ARCHITECTURE, re.MULTILINE)
    files = {path.stem for path in (PACKAGE / room).rglob("*.py")} - {"__init__"}
    assert sorted(files - set(re.findall(r"[a-z_0-9]+", row))) == []
