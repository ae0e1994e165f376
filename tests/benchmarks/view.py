"""What the view costs: the time from `catenary view ROBOT` to a first picture."""

import time

from tests.benchmarks.measure import Tables, report

BLUE = 0.02  # share of the picture that the reported arm fills


def first_picture(robot: str) -> dict[str, float]:
    """Return seconds from `catenary view ROBOT` to its address, to the page's words and to the arm.

    A browser is open already, as somebody's is, and goes to the address as soon as the command says it. Chromium draws by
    software here, which takes seconds where a graphics card takes a part of one.
    """
    from view.browser import PATIENCE, looked_at_empty, share_of_pixels
    from view.command import view

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


def tables(rounds: int, robot: str) -> Tables:
    """Measure the time to a first picture, some times."""
    return {"a first picture, s": {f"round {number + 1}": first_picture(robot) for number in range(rounds)}}


if __name__ == "__main__":
    report(tables, __doc__, rounds=3, robot="raven2")
