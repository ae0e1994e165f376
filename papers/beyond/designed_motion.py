"""A motion designed for calibration: every joint back and forth through its range, as often as in random motion.

A cable's error depends on where the joint is and on which side of its friction and slack the last move left it. So each
joint crosses its range at constant speed and turns back at the ends, which shows it in both directions everywhere; the
numbers of crossings have no common divisor, so that over the whole motion any position of one joint meets all positions
of the others, as a zig-zag's sweeps do.
"""

from math import gcd

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.trajectories.sinusoids import FASTEST, SLOWEST, TURN_TIME
from catenary.trajectories.smoothed_path import BrokenLine, SmoothedPath
from catenary.trajectories.zigzag import CALIBRATION_LOWER, CALIBRATION_UPPER


def crossings(duration: float, widths: Floats, speeds: Floats) -> list[int]:
    """Return how often joints cross ranges (n,) [rad|m] in [s] at about these speeds: no two with a common divisor."""
    chosen: list[int] = []
    for wish in duration * speeds / widths:
        free = [k for k in range(2, int(2 * wish) + 1) if all(gcd(k, other) == 1 for other in chosen)]
        if not free:
            raise InputError(f"duration: {duration:g} s leave no time to cross a joint's range twice")
        chosen.append(min(free, key=lambda k: abs(k - wish)))
    return chosen


def designed(
    duration: float, *, lower: ArrayLike = CALIBRATION_LOWER, upper: ArrayLike = CALIBRATION_UPPER
) -> SmoothedPath:
    """Return the motion [s] of three joints between two ends (3,) [rad|m], at the middle of random motion's speeds."""
    low, high = as_array("lower", lower, (3,)), as_array("upper", upper, (3,))
    if not (low < high).all():
        raise InputError(f"lower, upper: expected lower below upper for each joint, got {low} and {high}")
    counts = crossings(duration, high - low, (SLOWEST + FASTEST) / 2.0)
    lines = []
    for j, count in enumerate(counts):
        times = np.linspace(0.0, duration - TURN_TIME, count + 1)
        lines.append(BrokenLine(times, np.where(np.arange(count + 1) % 2, high[j], low[j]), TURN_TIME))
    return SmoothedPath(lines)
