"""Pictures of the view for the documentation: python -m view.screenshots FOLDER, with src and tests on PYTHONPATH.

They are of a model that is learned here, so nothing but Chromium is needed: arm, tilt, calibration, and a recording.
"""

import argparse
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from catenary.calibration import calibration
from catenary.recording.logs import write_parquet
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.workflows.simulated_recording import record_simulated
from oracles.cable_arms import homed_plant
from view.browser import LookedAtPage, looked_at

SIZE = {"width": 1280, "height": 720}
SETTLE = 8_000  # [ms]: software draws slowly


@contextmanager
def page_of(*arguments: object) -> Iterator[LookedAtPage]:
    """Start `catenary view`, and open its page."""
    command = [sys.executable, "-m", "catenary.cli.main", "view", *map(str, arguments), "--port", "18500"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        found = None
        while found is None and (line := program.stdout.readline()):
            found = re.search(r"http://127\.0\.0\.1:\d+", line)
        assert found is not None, "catenary view did not start"
        try:
            with looked_at(found[0], SIZE) as looked:
                yield looked
        finally:
            program.terminate()


def shot(looked: LookedAtPage, path: Path) -> None:
    """Save what is to be seen, in few colours, which keeps it small."""
    from PIL import Image

    looked.page.wait_for_timeout(SETTLE)
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
            motion = random_sinusoids(np.random.default_rng(0), 60.0)
            recording = record_simulated(homed_plant("left"), motion, "a minute", np.random.default_rng(1))
            write_parquet(recording, log)
            inputs = [f"q:{name}" for name in recording.joint_names]
            calibration.fit(recording, model="linear", inputs=inputs).save(model)
        if wanted("arm"):
            with page_of("raven2") as looked:
                shot(looked, options.folder / "arm.png")
        if wanted("tilt"):
            with page_of("ur5e") as looked:
                looked.page.get_by_role("tab", name="Surroundings").click()
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
