"""How a page begins and ends, and that a page holds the words by which people search."""

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
GENERATED = {"public-robots", "formats-read"}  # by python -m tests.descriptions, tests.gallery
PAGES = [
    page
    for page in sorted(DOCS.rglob("*.md"))
    if page.stem not in GENERATED and page.parent.name not in ("api", "results")
]
SEARCHED = [
    "sign of gravity", "degrees", "not homed", "outside the valid range", "mount the sensor", "export to C",
    "my bag", "which model", "how to cite",
]  # fmt: skip


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_begins_with_what_it_is_for_and_ends_with_what_to_read_next(page: Path) -> None:
    text = re.sub(r"\A---\n.*?---\n", "", page.read_text(), flags=re.DOTALL)  # what a search leaves out
    title, first, *_, last = text.strip().split("\n\n")
    assert re.match(r"# \S", title)
    assert re.match(r"[A-Z`*]", first), "a sentence, not a table or a block"
    assert re.match(r"(\*\*Read next:\*\*|Next:) .*\]\(", last)


def test_pages_are_short() -> None:
    """Words with a letter or a digit, of pages that people write: none beyond 2,200, all together 60,000 at most."""
    texts = {page.name: re.sub(r"<!--.*?-->", "", page.read_text()) for page in PAGES if page.stem != "rooms"}
    words = {
        name: sum(bool(re.search(r"\w", word)) for word in re.findall(r"[^\s|]+", text)) for name, text in texts.items()
    }
    assert {name: count for name, count in words.items() if count > 2200} == {}
    assert sum(words.values()) <= 60_000


@pytest.mark.parametrize("words", SEARCHED)
def test_words_that_people_search_stand_on_a_page(words: str) -> None:
    texts = [page.read_text() for page in [DOCS.parent / "README.md", *DOCS.rglob("*.md")]]
    assert any(words.lower() in " ".join(text.lower().split()) for text in texts)
