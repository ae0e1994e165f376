"""What every kind of finding about recordings must have: a row in a page, and code that finds it."""

import re
from pathlib import Path

import pytest

import catenary
from catenary.verdict.finding import FINDINGS

PAGES = "".join(page.read_text() for page in (Path(__file__).parents[2] / "docs").glob("*.md"))
FOUND = {
    name
    for file in Path(catenary.__file__).parent.rglob("*.py")
    for name in re.findall(r'Finding\(\s*"([a-z]+)"', file.read_text())
}


@pytest.mark.parametrize("name", FINDINGS)
def test_a_finding_has_a_row_in_a_page(name: str) -> None:
    assert f"| `{name}` |" in PAGES


def test_whatever_is_found_is_a_known_kind() -> None:
    assert FOUND <= set(FINDINGS)
