import re
import tomllib
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

import catenary

ROOT = Path(__file__).parents[2]
CONFIG = ROOT / "zensical.toml"
# what a browser loads by itself, by tag
LOADED = {"script": "src", "img": "src", "iframe": "src", "source": "src", "link": "href", "object": "data"}
NOT_LOADED = {"canonical", "prev", "next", "alternate", "describedby"}


class Page(HTMLParser):
    """What a page loads, where it leads, and its anchors."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.anchors = {""}
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.anchors |= {str(values[name]) for name in ("id", "name") if values.get(name)}
        address = values.get(LOADED.get(tag, ""))
        if address and not (tag == "link" and values.get("rel") in NOT_LOADED):
            self.loads.append(address)
        if tag == "a" and values.get("href"):
            self.links.append(str(values["href"]))
        self.loads += re.findall(r"url\(([^)]*)\)", values.get("style") or "")


CLAIMS = "results/claims.md"


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    return {path: Page(path) for path in sorted(site.rglob("*.html"))}


def _navigation(entries: list[object]) -> Iterator[str]:
    for entry in entries:
        for value in [entry] if isinstance(entry, str) else dict(entry).values():  # type: ignore[call-overload]
            if isinstance(value, str):
                yield value
            else:
                yield from _navigation(value)


def test_every_page_is_in_the_navigation_once_and_is_built(site: Path) -> None:
    listed = list(_navigation(tomllib.loads(CONFIG.read_text())["project"]["nav"]))
    written = {path.relative_to(ROOT / "docs").as_posix() for path in (ROOT / "docs").rglob("*.md")}
    # pages of single experiments are reached from the claims
    assert sorted(listed) == sorted(name for name in written if name == CLAIMS or not name.startswith("results/"))
    assert [name for name in listed if not (site / name).with_suffix(".html").exists()] == []


def test_no_page_loads_anything_from_another_machine(site: Path, pages: dict[Path, Page]) -> None:
    loaded = {(path.name, address) for path, page in pages.items() for address in page.loads}
    assert {one for one in loaded if urlsplit(one[1]).scheme not in ("", "data") or one[1].startswith("//")} == set()
    for sheet in site.rglob("*.css"):
        found = re.findall(r"""(?:@import\s+|url\()["']?([^"')]+)""", sheet.read_text())
        assert [one for one in found if urlsplit(one).scheme not in ("", "data")] == []
    for program in site.rglob("*.js"):
        if program.parent.name == "assets":  # ours; the theme's own is watched in a browser
            assert "http" not in program.read_text()


def test_every_link_leads_to_a_page_and_a_place_on_it(site: Path, pages: dict[Path, Page]) -> None:
    lost = []
    for path, page in pages.items():
        for link in page.links:
            parts = urlsplit(link)
            if parts.scheme:
                # another site's: its form alone
                assert parts.scheme in ("https", "http", "mailto"), link
                assert parts.netloc or parts.scheme == "mailto", link
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            target = target / "index.html" if target.is_dir() else target
            there = pages.get(target)
            if not target.exists() or (there is not None and unquote(parts.fragment) not in there.anchors):
                lost.append((path.relative_to(site).as_posix(), link))
    # the page for addresses that do not exist is served at any depth: its links begin at the root
    assert [one for one in lost if one[0] != "404.html"] == []


def test_pictures_are_there(site: Path, pages: dict[Path, Page]) -> None:
    for path, page in pages.items():
        if path.name != "404.html":
            local = [unquote(urlsplit(one).path) for one in page.loads if not one.startswith("data:")]
            assert [one for one in local if not (path.parent / one).exists()] == [], path.name


def test_python_interface_has_every_name_of_the_package(pages: dict[Path, Page]) -> None:
    anchors = {name for path, page in pages.items() if path.parent.name == "api" for name in page.anchors}
    assert {name for name in catenary.__all__ if f"catenary.{name}" not in anchors} == {"__version__"}


def test_no_formula_is_left_unread(site: Path) -> None:
    for path in site.rglob("*.html"):
        outside = re.sub(r"<(pre|code|script|math)\b.*?</\1>", "", path.read_text(), flags=re.DOTALL)
        assert re.findall(r"\$[^$\n]{1,80}\$|\$\$", outside) == [], path.name
