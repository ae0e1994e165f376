"""Time from `catenary view ROBOT` to an arm on the screen: python -m tests.benchmarks.first_picture [--robot R].

A browser is open already, as somebody's is, and goes to the address as soon as the command says it. Chromium draws by
software here, which takes seconds where a graphics card takes a part of one.
"""

import argparse
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from view.browser import PATIENCE, looked_at_empty, share_of_pixels
from view.command import view

BLUE = 0.02  # share of the picture that the reported arm fills


def first_picture(robot: str) -> dict[str, float]:
    """Return seconds from the command to its address, to the page's words and to the arm."""
    with looked_at_empty() as looked:
        begin = time.monotonic()
        with view(robot) as url:
            seconds = {"address": time.monotonic() - begin}
            looked.page.goto(url, wait_until="commit", timeout=PATIENCE)
            looked.wait_for_words()
            seconds["words"] = time.monotonic() - begin
            while share_of_pixels(looked.picture(), more=2, than=(0, 1)) < BLUE:
                pass
            seconds["arm"] = time.monotonic() - begin
    return seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="raven2")
    parser.add_argument("--rounds", type=int, default=3)
    options = parser.parse_args()
    for _ in range(options.rounds):
        taken = first_picture(options.robot)
        print("   ".join(f"{what} after {seconds:.1f} s" for what, seconds in taken.items()), flush=True)


if __name__ == "__main__":
    main()
