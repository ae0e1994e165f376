import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from view.browser import ARGUMENTS, CHROMIUM, PATIENCE

pytestmark = pytest.mark.slow

QUESTIONS = "troubleshooting.html#"
# what somebody types, and the places that answer it
SEARCHES = {
    "sign of gravity": ("dynamics.html#conventions", QUESTIONS + "what-is-the-sign-of-gravity"),
    "how do I use degrees": (QUESTIONS + "how-do-i-use-degrees",),
    "joint is not homed": (QUESTIONS + "my-joint-is-not-homed",),
    "outside": ("calibration.html#the-valid-range", QUESTIONS + "what-does-outside-mean"),
    "mount the sensor": ("gravity-vector.html#mount-it-and-tumble-it", QUESTIONS + "how-do-i-mount-the-sensor"),
    "export to C": ("kernels.html#c-for-a-real-robots-loop", QUESTIONS + "how-do-i-export-to-c"),
    "a bag of mine": ("tutorials/bring-your-recordings.html", QUESTIONS + "how-do-i-use-a-bag-of-mine"),
    "which model": ("calibration.html#models", QUESTIONS + "which-model"),
    "how to cite": ("cite.html",),
}
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


def test_a_search_finds_its_answer_among_the_first_five(site: Path, browser: Any) -> None:
    watched = Watched(browser, 1400)
    page = watched.page
    missed = {}
    for words, answers in SEARCHES.items():
        page.goto((site / "index.html").as_uri())
        page.locator(".md-search__button").click()
        box = page.get_by_role("combobox")
        box.wait_for()
        page.wait_for_timeout(300)  # it grows into view
        box.press_sequentially(words, delay=20)
        page.get_by_role("option").first.wait_for()
        page.wait_for_timeout(1000)  # results of the last letter
        assert box.input_value() == words
        first_five = "options => options.slice(0, 5).map(one => one.getAttribute('href') || '')"
        found = page.get_by_role("option").evaluate_all(first_five)
        # words to be marked on the page stand between its name and the place on it
        places = [re.sub(r"\?h=[^#]*", "", href).removeprefix(site.as_uri() + "/") for href in found]
        if not any(place.startswith(answer) for place in places for answer in answers):
            missed[words] = places
    assert missed == {}
    watched.fine()


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
