"""Pictures of the view for the documentation: python -m view.screenshots FOLDER, with src and tests on PYTHONPATH.

They are of a model that is learned here, so nothing but Chromium is needed: arm, tilt, calibration, and a recording.
"""

import argparse
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from catenary.recording.logs import write_parquet
from view.browser import LookedAtPage, looked_at
from view.command import model_of_positions, recorded_motion, view

SIZE = {"width": 1280, "height": 720}
SETTLE = 8_000  # [ms]: software draws slowly


@contextmanager
def page_of(*arguments: object) -> Iterator[LookedAtPage]:
    """Start `catenary view`, and open its page."""
    with view(*arguments) as url, looked_at(url, SIZE) as looked:
        yield looked


def shot(looked: LookedAtPage, path: Path) -> None:
    """Save what is to be seen, in few colours, which keeps it small."""
    from PIL import Image

    looked.page.wait_for_timeout(SETTLE)
    for close in looked.page.locator("button.mantine-Notification-closeButton").all():  # that software draws
        close.click()
    looked.page.screenshot(path=str(path), timeout=120_000)
    Image.open(path).convert("RGB").quantize(96).save(path, optimize=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", help="arm, tilt, calibration or log")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)

    def wanted(name: str) -> bool:
        return options.only in (None, name)

    with tempfile.TemporaryDirectory() as folder:
        log, model = Path(folder) / "log.parquet", Path(folder) / "arm.npz"
        if wanted("calibration") or wanted("log"):
            write_parquet(recorded_motion(), log)
            model_of_positions(model)
        if wanted("arm"):
            with page_of("raven2") as looked:
                shot(looked, options.folder / "arm.png")
        if wanted("tilt"):
            with page_of("ur5e") as looked:
                looked.tab("Surroundings")
                looked.set_slider("base roll [deg]", 40.0)
                shot(looked, options.folder / "tilt.png")
        if wanted("calibration"):
            with page_of("raven2", "--model", model) as looked:
                shot(looked, options.folder / "view.png")
        if wanted("log"):
            with page_of("raven2", "--log", log, "--model", model) as looked:
                shot(looked, options.folder / "log.png")


if __name__ == "__main__":
    main()
