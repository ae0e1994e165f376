"""Make docs/images again, of today's demo, view and plot: `make pictures`."""

import argparse
import base64
import io
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from view.browser import looked_at
from view.command import model_of_positions, view

SETTLE = 20_000  # [ms]: software draws slowly, and curves take time to grow
PLOT = "plot panda --q-deg 0,-30,0,-120,0,90,45 --base-tilt-deg 0,20 --out"  # as docs/robots.md says it


def save(png: bytes, path: Path) -> None:
    """Write a picture in few colours, which keeps it small."""
    from PIL import Image

    Image.open(io.BytesIO(png)).convert("RGB").quantize(96, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(
        path, optimize=True
    )


def view_of_a_calibrated_arm() -> bytes:
    """Return the page of the simulated RAVEN-II with a model that is learned here."""
    with tempfile.TemporaryDirectory() as folder:
        model = model_of_positions(Path(folder) / "arm.npz")
        with view("raven2", "--model", model) as url, looked_at(url, {"width": 1280, "height": 720}) as looked:
            looked.page.wait_for_timeout(SETTLE)
            return bytes(looked.page.screenshot(timeout=120_000))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("demo", type=Path, help="folder of `make demo`")
    parser.add_argument("images", type=Path)
    options = parser.parse_args()
    report = (options.demo / "report.html").read_text()
    elbow = re.search(r'<img src="data:image/png;base64,([^"]+)"\s+alt="Errors of joint elbow', report)
    if elbow is None:
        raise SystemExit(f"{options.demo / 'report.html'} shows no errors of the elbow")
    save(base64.b64decode(elbow[1]), options.images / "demo_elbow.png")
    plot = options.images / "plot_panda.png"
    subprocess.run([sys.executable, "-m", "catenary", *PLOT.split(), str(plot)], check=True)
    save(plot.read_bytes(), plot)
    save(view_of_a_calibrated_arm(), options.images / "view.png")


if __name__ == "__main__":
    main()
