"""A page in Debian's Chromium, headless, drawn by its own software; nothing is downloaded."""

import io
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

CHROMIUM = shutil.which("chromium")
ARGUMENTS = [
    "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--no-first-run", "--disable-dev-shm-usage",
]  # fmt: skip
PATIENCE = 120_000  # [ms]: two slow processors draw a picture in seconds
SIZE = {"width": 1000, "height": 560}


class LookedAtPage:
    """A page of this machine, and what its console says."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.complaints: list[str] = []
        self.foreign: list[str] = []
        page.on("console", lambda m: self.complaints.append(m.text) if m.type == "error" else None)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("request", self._asked)

    def _asked(self, request: Any) -> None:
        if not request.url.startswith(("http://127.0.0.1", "ws://127.0.0.1", "data:", "blob:", "file:", "about:")):
            self.foreign.append(request.url)

    def joint(self, name: str, column: int = 0) -> float:
        """What the page's table says of a joint [deg|mm]: reported, calibrated where there is a model, true."""
        row = self.page.locator("tr", has_text=f"{name} [").first
        text = row.locator("td").nth(1 + column).inner_text(timeout=PATIENCE)
        return float(text.split()[0].replace("−", "-"))

    def wait_for_words(self) -> None:
        """Wait until the page says how the robot is."""
        words = self.page.locator("text=warnings").first.or_(self.page.locator("text=⚠").first)
        words.first.wait_for(timeout=PATIENCE)

    def wait_for_joint(self, name: str, value: float, within: float) -> None:
        for _ in range(240):
            if abs(self.joint(name) - value) <= within:
                return
            self.page.wait_for_timeout(500)
        raise AssertionError(f"{name} is at {self.joint(name)}, expected {value}")

    def wait_for_color(self, share: float, *, more: int, than: tuple[int, int]) -> None:
        """Wait until a share of the picture's pixels has more of one colour; shapes come one by one."""
        for _ in range(60):
            found = share_of_pixels(self.picture(), more=more, than=than)
            if found > share:
                return
            self.page.wait_for_timeout(500)
        raise AssertionError(f"{found:.4f} of the picture, expected {share}")

    def set_slider(self, label: str, value: float) -> None:
        """Type a value into the box beside a slider."""
        box = self._row(label).locator("input").last
        box.fill(str(value), timeout=PATIENCE)
        box.press("Enter")

    def words(self) -> str:
        """All that the page says."""
        return self.page.inner_text("body", timeout=PATIENCE)

    def wait_until(self, claim: Callable[[], object], every: int = 500) -> None:
        """Look at the page every so often [ms] until a claim is true."""
        for _ in range(PATIENCE // every):
            if claim():
                return
            self.page.wait_for_timeout(every)
        raise AssertionError(f"it did not come true; the page says: {self.words()}")

    def wait_for_text(self, text: str) -> None:
        """Wait until the page says something."""
        self.wait_until(lambda: text in self.words())

    def tab(self, name: str) -> None:
        """Turn to a tab."""
        self.page.get_by_role("tab", name=name, exact=True).click(timeout=PATIENCE)

    def press(self, name: str) -> None:
        """Press a button."""
        self.page.get_by_role("button", name=name, exact=True).first.click(timeout=PATIENCE)

    def tick(self, label: str) -> None:
        """Tick a box, or take the tick away."""
        self._row(label).locator("input").last.click(timeout=PATIENCE)

    def choose(self, label: str, option: str) -> None:
        """Choose one of what a control offers."""
        self._row(label).locator("input").first.click(timeout=PATIENCE)
        self.page.get_by_role("option", name=option, exact=True).first.click(timeout=PATIENCE)

    def _row(self, label: str) -> Any:
        exact = self.page.locator("label", has_text=re.compile(f"^{re.escape(label)}$"))
        return exact.locator("visible=true").first.locator("xpath=ancestor::*[.//input][1]")

    def picture(self) -> np.ndarray:
        """The middle of the window, between the panels, (rows, columns, 3)."""
        from PIL import Image

        shot = self.page.screenshot(timeout=PATIENCE)
        pixels = np.asarray(Image.open(io.BytesIO(shot)).convert("RGB")).astype(int)
        return pixels[:, 320:620]


@contextmanager
def looked_at_empty(size: dict[str, int] = SIZE, *options: str) -> Iterator[LookedAtPage]:
    """Start a browser whose page is empty yet; options are Chromium's."""
    sync_api = pytest.importorskip("playwright.sync_api")
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed (apt install chromium)")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=[*ARGUMENTS, *options])
        try:
            yield LookedAtPage(browser.new_page(viewport=size))
        finally:
            browser.close()


@contextmanager
def looked_at(url: str, size: dict[str, int] = SIZE) -> Iterator[LookedAtPage]:
    """Open a page and wait until it shows a robot's state."""
    with looked_at_empty(size) as looked:
        looked.page.goto(url, timeout=PATIENCE)
        looked.wait_for_words()
        # fades in, and a message about drawing by software lies over it
        closing = (
            "document.querySelectorAll('button.mantine-Notification-closeButton').forEach(button => button.click())"
        )
        looked.page.evaluate(closing)
        looked.page.wait_for_timeout(3000)
        yield looked


def share_of_pixels(picture: np.ndarray, *, more: int, than: tuple[int, int], by: int = 18) -> float:
    """Share of pixels in which one channel is larger than the two others."""
    a, b, c = picture[..., more], picture[..., than[0]], picture[..., than[1]]
    return float(np.mean((a > b + by) & (a > c + by)))
