"""Clocks that somebody sets while a robot is recorded: no message is lost, and their order is kept."""

from itertools import pairwise
from pathlib import Path

import numpy as np

from tests.campaign.part import Fell, Part

SECOND = 1_000_000_000
EPOCH = 1_700_000_000 * SECOND


def stamps(seed: int, folder: Path) -> None:
    """Set the clock of a robot, or of an old recorder, any number of times by any step; state and encoder share it."""
    from catenary.recording.series import without_steps

    rng = np.random.default_rng(seed)
    rate, seconds = float(rng.choice([30.0, 100.0])), float(rng.uniform(5.0, 60.0))
    true = EPOCH + np.rint(SECOND * np.cumsum(rng.normal(1.0, 0.05, int(rate * seconds)).clip(0.25) / rate)).astype(
        np.int64
    )
    delay = rng.exponential(5e5, len(true)).astype(np.int64) + 200_000
    arrival = np.maximum.accumulate(true + delay)
    steps = sorted((float(rng.uniform(0.5, seconds - 0.5)), _step(rng)) for _ in range(rng.integers(1, 4)))
    if any(b - a < 0.5 for (a, _), (b, _) in pairwise(steps)):
        steps = steps[:1]
    set_clock = np.zeros(len(true), dtype=np.int64)
    for at, by in steps:
        set_clock[true >= EPOCH + int(at * SECOND)] += by
    np.savez(folder / "clock.npz", true=true, arrival=arrival, set_clock=set_clock)
    kind = seed % 3
    if kind == 0:  # the robot's
        stamp, found = without_steps(true + set_clock, arrival)
        if len(found) != len(steps) or any(abs(one.by - by) > 5e6 for one, (_, by) in zip(found, steps, strict=True)):
            raise Fell(f"steps {steps}, found {found}")
    elif kind == 1:  # the recorder's, which told arrivals by it
        stamp, found = without_steps(true, arrival + set_clock)
        if found:
            raise Fell(f"the recorder's clock was taken for the robot's: {found}")
    else:  # the robot's, which never goes back
        stamp, found = without_steps(_monotonic(true + set_clock), arrival)
    if len(stamp) != len(true) or (np.diff(stamp) <= 0).sum() > 3 * len(steps):
        raise Fell("messages lost their order")
    # stamps that stood still may end less than 0.25 s off, which is left as it is; and fewer than three messages
    # between two changes of a clock are not told from messages that were late
    if (np.abs(stamp - true) > (250e6 if kind == 2 else 10e6)).sum() >= (3 if kind == 2 else 1):
        raise Fell(f"a stamp is {np.abs(stamp - true).max() / 1e6:.1f} ms off after {steps}")


def _step(rng: np.random.Generator) -> int:
    size = float(np.exp(rng.uniform(np.log(0.3), np.log(1e6))))
    return int(SECOND * size * rng.choice([-1.0, 1.0]))


def _monotonic(stamp: "np.ndarray") -> "np.ndarray":
    out, last = [], 0
    for one in stamp.tolist():
        last = max(one, last + 1)
        out.append(last)
    return np.array(out)


PARTS = (Part("clocks.stamps", 3000, stamps),)
