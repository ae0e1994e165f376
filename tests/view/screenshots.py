"""The view's picture in the documentation: python -m view.screenshots FILE, with src and tests on PYTHONPATH.

It is of a model that is learned here, so nothing but Chromium is needed.
"""

import argparse
import tempfile
from pathlib import Path

from PIL import Image

from view.browser import looked_at
from view.command import model_of_positions, view

SIZE = {"width": 1280, "height": 720}
SETTLE = 8_000  # [ms]: software draws slowly


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    path = parser.parse_args().file
    with tempfile.TemporaryDirectory() as folder:
        model = model_of_positions(Path(folder) / "arm.npz")
        with view("raven2", "--model", model) as url, looked_at(url, SIZE) as looked:
            looked.page.wait_for_timeout(SETTLE)
            for close in looked.page.locator("button.mantine-Notification-closeButton").all():  # that software draws
                close.click()
            looked.page.screenshot(path=str(path), timeout=120_000)
    Image.open(path).convert("RGB").quantize(96).save(path, optimize=True)  # few colours, which keeps it small


if __name__ == "__main__":
    main()
