from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from view.browser import ARGUMENTS, CHROMIUM, PATIENCE

pytestmark = pytest.mark.slow

PAGES = (
    "index",
    "calibration",
    "commands",
    "paper-gravity-regressor",
    "tutorials/ship",
    "tutorial-two-link",
    "api/control",
)


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    sync_api = pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed (apt install chromium)")
    with sync_api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield started
        started.close()


class Watched:
    """A page opened from the disk: what it asks for and what its console says."""

    def __init__(self, browser: Any, width: int) -> None:
        self.page = browser.new_page(viewport={"width": width, "height": 900})
        self.page.set_default_timeout(PATIENCE)
        self.asked: list[str] = []
        self.complaints: list[str] = []
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.on("console", lambda m: self.complaints.append(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))

    def fine(self) -> None:
        assert [url for url in self.asked if not url.startswith(("file:", "data:", "blob:", "about:"))] == []
        assert self.complaints == []


@pytest.mark.parametrize("width", [1400, 420])
def test_pages_fit_their_window_with_pictures_loaded(site: Path, browser: Any, width: int) -> None:
    watched = Watched(browser, width)
    page = watched.page
    for name in PAGES:
        page.goto((site / f"{name}.html").as_uri())
        wide = page.evaluate("document.documentElement.scrollWidth > document.documentElement.clientWidth")
        assert not wide, name
        # lazily loaded ones too
        broken = page.evaluate(
            """async () => {
              const pictures = [...document.images];
              pictures.forEach((one) => { one.loading = "eager"; });
              await Promise.allSettled(pictures.map((one) => one.decode()));
              return pictures.filter((one) => !one.naturalWidth).map((one) => one.src);
            }"""
        )
        assert broken == [], name
        # what is wider than the text scrolls within itself
        cut = page.evaluate(
            """() => [...document.querySelectorAll("article table, article pre, article .formula, article img")]
              .filter((one) => {
                if (one.getBoundingClientRect().right <= innerWidth + 1) return false;
                for (let box = one; box; box = box.parentElement)
                  if (["auto", "scroll"].includes(getComputedStyle(box).overflowX)) return false;
                return true;
              }).map((one) => one.outerHTML.slice(0, 120))"""
        )
        assert cut == [], name
    watched.fine()
