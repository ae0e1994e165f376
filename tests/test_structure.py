"""What a reader may rely on in every room: names once, short files, docstrings that begin as everywhere."""

import ast
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "src" / "catenary"
FILES = sorted(PACKAGE.rglob("*.py"))


def definitions(kind: type | tuple[type, ...]) -> Iterator[tuple[str, ast.AST]]:
    for path in FILES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, kind):
                yield f"{path.relative_to(PACKAGE)}:{getattr(node, 'name', '')}", node


def test_no_class_name_is_used_twice() -> None:
    names = Counter(where.split(":")[1] for where, _ in definitions(ast.ClassDef))
    assert [name for name, count in names.items() if count > 1] == []


@pytest.mark.parametrize("limit", [400])
def test_no_file_is_long(limit: int) -> None:
    lengths = {str(path.relative_to(PACKAGE)): len(path.read_text().splitlines()) for path in FILES}
    assert {name: length for name, length in lengths.items() if length > limit} == {}


def test_no_folder_holds_more_files_than_a_reader_can_survey() -> None:
    counts = Counter(str(path.parent.relative_to(PACKAGE)) for path in FILES if path.name != "__init__.py")
    assert {folder: count for folder, count in counts.items() if count > 25} == {}


def test_docstrings_of_functions_say_what_they_return_or_do() -> None:
    functions = (ast.FunctionDef, ast.AsyncFunctionDef)
    first = {
        where: (ast.get_docstring(node) or "Return").split()[0]  # type: ignore[arg-type]  # these kinds have them
        for where, node in definitions(functions)
    }
    assert {where: word for where, word in first.items() if word in ("Give", "Gives", "What")} == {}


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
