import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from view.browser import PATIENCE, looked_at_empty

pytestmark = pytest.mark.slow

QUESTIONS = "troubleshooting.html#"
# what a newcomer types, and the place that answers it
BROUGHT = QUESTIONS + "how-do-i-use-my-bag-a-matlab-file-or-a-csv-in-degrees"
SEARCHES = {
    "camera delay": QUESTIONS + "does-my-camera-have-a-delay",
    "my CSV in degrees": BROUGHT,
    "dVRK CSV": "tutorials/my-dvrk.html",
    "homed again model wrong": QUESTIONS + "the-robot-was-homed-again",
    "C++ header": QUESTIONS + "how-do-i-export-to-c",
    "error bars 1 kHz loop": QUESTIONS + "how-do-i-get-error-bars-in-my-1-khz-loop",
    "joint is not homed": QUESTIONS + "my-joint-is-not-homed",
    "tilt of the base": QUESTIONS + "tilt-of-the-base",
    "URDF gravity torque": QUESTIONS + "what-is-the-gravity-torque-of-my-urdf",
    "payload": "identification.html#payload",
    "which joints": QUESTIONS + "which-joints-does-a-robot-have",
    "ROS 2 without ROS": "crtk.html#ros-2-without-ros",
    "recording cut off": QUESTIONS + "was-my-recording-cut-off",
    "sign of gravity": QUESTIONS + "what-is-the-sign-of-gravity",
    "export to C": QUESTIONS + "how-do-i-export-to-c",
    "which model": QUESTIONS + "which-model",
    "how to cite": "cite.html",
    "joystick": "tools.html#keyboard-catenary-teleop",
    "MATLAB file": BROUGHT,
    "IMU on a ship": "tutorials/ship.html",
    "emergency stop": "safety.html#run-levels-and-the-emergency-stop",
    "install": "start.html#install",
    "how much data": "calibration.html",
}
PAGES = (
    "index", "calibration", "commands", "paper-gravity-regressor", "tutorials/ship", "tutorial-two-link", "api/control",
)  # fmt: skip


@pytest.fixture
def page(request: pytest.FixtureRequest) -> Iterator[Any]:
    """A page to be opened from the disk, which asks nobody for anything and complains of nothing."""
    with looked_at_empty({"width": request.param, "height": 900}) as looked:
        looked.page.set_default_timeout(PATIENCE)
        yield looked.page
        assert (looked.foreign, looked.complaints) == ([], [])


@pytest.mark.parametrize("page", [1400], indirect=True)
def test_the_first_hit_of_a_search_answers_it(site: Path, page: Any) -> None:
    missed = {}
    for words, answer in SEARCHES.items():
        page.goto((site / "index.html").as_uri())
        page.locator(".md-search__button").click()
        box = page.get_by_role("combobox")
        box.wait_for()
        page.wait_for_timeout(300)  # it grows into view
        box.press_sequentially(words, delay=20)
        page.get_by_role("option").first.wait_for()
        page.wait_for_timeout(1000)  # results of the last letter
        assert box.input_value() == words
        # words to be marked on the page stand between its name and the place on it
        found = re.sub(r"\?h=[^#]*", "", page.get_by_role("option").first.get_attribute("href"))
        if not found.removeprefix(site.as_uri() + "/").startswith(answer):
            missed[words] = found
    assert missed == {}


@pytest.mark.parametrize("page", [1400, 420], indirect=True)
def test_pages_fit_their_window_with_pictures_loaded(site: Path, page: Any) -> None:
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
