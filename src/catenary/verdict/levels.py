"""Does the zero of a measurement stay where it is? Errors that leap and stay, and errors of whole or half turns."""

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.verdict.finding import Finding
from catenary.verdict.pairs import Pairs

# Medians of windows of a real arm's error differ from one window to the next by at most 2.6 times what nine in ten do.
CLEARLY = 5.0
LEAST_LEAP = 5.0  # [deg, mm] by which nobody's camera registration moves, nor any homing
STAYS = 0.5  # of a leap that is left over ten windows: a burst of wild measurements is gone by then
SHARE = 50  # windows along the recording
SHORTEST, LONGEST = 10, 200  # rows of a window
HALF_TURN = 180.0  # [deg]
NEAR_TURN = 0.2  # of a half turn, within which an error is a turn: wrists are 20 deg off
MOST = 0.9  # of the rows, that stand near some turn: numbers in degrees lie anywhere
FEW = 0.05  # of the rows: fewer are single wild measurements


def turn_findings(pairs: Pairs) -> list[Finding]:
    """Find measurements of angles that stand whole or half turns from the others of their joint."""
    of_angles = [j for j, unit in enumerate(pairs.log.joint_units) if unit == "rad"]
    return [turned for j in of_angles for turned in _turns(pairs.names[j], pairs.m[:, j] - pairs.q[:, j])]


def leap_findings(pairs: Pairs, place: NDArray[np.int64]) -> list[Finding]:
    """Find errors that leap at one row and stay."""
    return [leap for i, k in enumerate(place) for leap in _leap(pairs, i, pairs.m[:, i] - pairs.q[:, k])]


def _turns(name: str, error: Floats) -> list[Finding]:
    away = error - np.median(error)
    halves = np.round(away / HALF_TURN)
    near = np.abs(away - halves * HALF_TURN) < NEAR_TURN * HALF_TURN
    turned = near & (halves != 0.0)
    if turned.mean() <= FEW or near.mean() < MOST:
        return []
    sizes, counts = np.unique(halves[turned], return_counts=True)
    most = float(sizes[np.argmax(counts)]) * HALF_TURN
    says = f"{int(turned.sum())} of {len(error)} measurements stand whole or half turns from the others"
    culprit = "an angle recorded within one turn, or a counter that lost a turn"
    remedy = "catenary import --map, which brings measurements into the turn of their commands" * (most % 360 == 0)
    return [Finding("turns", (name,), f"{says} ({most:+.0f} deg most often)", culprit, remedy)]


def _leap(pairs: Pairs, joint: int, error: Floats) -> list[Finding]:
    from scipy.ndimage import median_filter

    width = int(np.clip(len(error) // SHARE, SHORTEST, LONGEST))
    if len(error) < 4 * width:
        return []
    level = median_filter(error, size=width, mode="nearest")
    # windows side by side: the first is about row k, ends before k + width // 2, and there the second begins
    leaps = np.abs(level[width:] - level[:-width])
    k = int(np.argmax(leaps))
    leap = float(level[k + width] - level[k])
    edge, long = k + width // 2 + 1, 10 * width
    after, before = np.median(error[edge : edge + long]), np.median(error[max(0, edge - long) : edge])
    usual = float(np.percentile(leaps, 90.0))
    if abs(leap) < max(LEAST_LEAP, CLEARLY * usual) or (after - before) / leap < STAYS:
        return []
    edge = _first_after(error, k, width)
    rows = np.flatnonzero(pairs.log.ok)
    last = len(pairs.log)
    shorter = f"{rows[edge]}:{last}" if edge > len(error) // 2 else f"0:{rows[edge]}"
    unit, culprit = pairs.unit(joint), "an encoder or a robot that was zeroed anew half-way, or a slipped cable"
    says = f"at row {rows[edge]} the error leaps by {after - before:+.3g} {unit} and stays; elsewhere its level"
    says = f"{says} moves by {usual:.2g} {unit}"
    return [Finding("jump", (pairs.names[joint],), says, culprit, f"--leave-out {shorter}")]


def _first_after(error: Floats, k: int, width: int) -> int:
    """Return the first row of the new level among those of two windows, by the least sum of distances from both."""
    first, last = max(1, k - width), min(len(error) - 1, k + 2 * width)
    before, after = np.median(error[max(0, k - width) : k + 1]), np.median(error[k + width : k + 2 * width])
    rows = error[first:last]
    cost = np.cumsum(np.abs(rows - before)) - np.cumsum(np.abs(rows - after))
    return first + int(np.argmin(cost)) + 1
