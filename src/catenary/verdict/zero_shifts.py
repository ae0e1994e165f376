"""Does the zero of a measurement stay where it is? Errors that leap and stay, that drift, or are of whole turns."""

from dataclasses import replace

import numpy as np

from catenary.arrays import Floats, Integers
from catenary.verdict.command_response import (
    FINE_RADII,
    TRIM_SIGMAS,
    Explanation,
    Pairs,
    in_stretches,
    pairs_of,
    reversals_of,
    scales,
)
from catenary.verdict.finding import Finding
from catenary.verdict.whole_turns import from_median

# Medians of windows of a real arm's error differ from one window to the next by at most 2.6 times what nine in ten do.
_CLEAR_RATIO = 5.0
_MIN_LEAP_DEG_MM = 5.0  # [deg, mm] by which nobody's camera registration moves, nor any homing
# rows of windows between which a smaller leap is looked for, and how small [deg, mm]
_SUDDEN_ROWS, _MIN_SUDDEN_DEG_MM = 5, 0.3
# times any other, that it is: reversals leap too; of untouched real recordings 2.6 and less where it stays
_ALONE_RATIO = 3.0
_STAYS_SHARE = 0.5  # of a leap that is left over ten windows: a burst of wild measurements is gone by then
_MIN_STAY_WINDOWS = 3  # of rows on either side of a leap, that show whether it stays
_WINDOWS = 50  # windows along the recording
_MIN_WINDOW_ROWS, _MAX_WINDOW_ROWS = 10, 200  # rows of a window
_HALF_TURN_DEG = 180.0  # [deg]
_NEAR_TURN_SHARE = 0.2  # of a half turn, within which an error is a turn: wrists are 20 deg off
_MIN_NEAR_SHARE = 0.9  # of the rows, that stand near some turn: numbers in degrees lie anywhere
_MIN_TURNED_SHARE = 0.05  # of the rows: fewer are single wild measurements
_WRAP_RANGE = 1.05  # times its period, that a counter that wraps reaches at most
# A drift is reported where it is this many standard errors, of the rows' own and of their whole error's deviations. The
# first rows, in which nobody knows on which side of its slack a joint lies, do not count. Untouched real runs of half
# a minute drift by up to 3.3 of their rows' deviations and 9 standard errors, but by 0.08 of the error's.
_DRIFT_STANDARD_ERRORS, _DRIFT_ROW_SIGMAS, _DRIFT_ERROR_SIGMAS, _LEAP_ERROR_SIGMAS = 8.0, 2.0, 0.1, 0.25
# In fewer rows, or with fewer reversals, slack and friction are hardly separable from a zero that moves: windows of two
# minutes of a real wrist's poses stray by up to 20 deviations.
_MIN_DRIFT_ROWS, _MANY_ROWS, _MANY_REVERSALS, _FEW_ROW_SIGMAS = 400, 1000, 12, 25.0
_BEGINNING_SHARE, _PARTS, _MAX_ROWS = 0.15, 20, 2000
_LEAP_EDGES = np.linspace(0.15, 0.85, 15)  # of the rows that count, at which a leap is tried
_ZEROED_CULPRIT = "an encoder, camera or robot that was zeroed again half-way, or a slipped cable"


def turn_findings(pairs: Pairs) -> tuple[list[Finding], Pairs]:
    """Find measurements that stand whole or half turns, or a counter's period, from the others; bring them there."""
    findings, measured = list[Finding](), np.array(pairs.log.q_encoder)
    for j, joint_unit in enumerate(pairs.log.joint_units):
        away = from_median(pairs.m[:, j] - pairs.q[:, j])
        if period := _period_of_wraps(pairs.m[:, j], away):
            rounds, in_si = np.round(away / period), period / float(scales(pairs.log)[j])
            measured[pairs.log.ok, j] -= rounds * in_si
            rows, size = np.count_nonzero(rounds), f"{period:.4g} {pairs.unit(j)}"
            says = f"{rows} of {len(away)} measurements are {size} off the others, and all lie within one such range"
            findings.append(_turned(pairs.names[j], says, "a counter that wraps", in_si))
            continue
        if joint_unit != "rad":
            continue
        halves = np.round(away / _HALF_TURN_DEG)
        near = np.abs(away - halves * _HALF_TURN_DEG) < _NEAR_TURN_SHARE * _HALF_TURN_DEG
        turned = near & (halves != 0.0)
        if turned.mean() <= _MIN_TURNED_SHARE or near.mean() < _MIN_NEAR_SHARE:
            continue
        measured[pairs.log.ok, j] -= np.deg2rad(_HALF_TURN_DEG * halves)
        sizes, counts = np.unique(halves[turned], return_counts=True)
        commonest = float(sizes[np.argmax(counts)]) * _HALF_TURN_DEG
        says = f"{int(turned.sum())} of {len(away)} measurements are whole or half turns off the others"
        culprit = "an angle recorded within one turn, or a counter that lost a turn"
        period = np.deg2rad(_HALF_TURN_DEG) * (1 + (np.abs(halves[turned]) % 2.0 == 0.0).all())
        findings.append(_turned(pairs.names[j], f"{says} ({commonest:+.0f} deg most often)", culprit, period))
    return findings, (pairs_of(replace(pairs.log, q_encoder=measured)) or pairs) if findings else pairs


def _turned(joint: str, says: str, culprit: str, period: float) -> Finding:
    return Finding("turns", (joint,), says, culprit, f"--unwrap {joint}={period:.5g}")


def _period_of_wraps(measured: Floats, away: Floats) -> float:
    """Return the period at which a counter wraps: it jumps, where errors `away` from their median do; else 0."""
    far = np.abs(away) > 0.5 * np.ptp(measured)
    if far.mean() <= _MIN_TURNED_SHARE:
        return 0.0
    period = float(np.median(np.abs(away[far])))
    rounds = np.round(away / period)
    changes = np.diff(rounds) != 0.0
    jumps = np.abs(np.diff(measured))[changes] > 0.5 * period
    near = np.abs(away - rounds * period) < _NEAR_TURN_SHARE * period
    if np.ptp(measured) > _WRAP_RANGE * period or near.mean() < _MIN_NEAR_SHARE or not len(jumps):
        return 0.0
    # from one row to the next an error hardly changes but by the jump
    return float(np.median(np.abs(np.diff(away))[changes])) if jumps.mean() > _MIN_NEAR_SHARE else 0.0


def leap_findings(pairs: Pairs, place: Integers) -> list[Finding]:
    """Find errors that leap at one row and stay; small ones, and errors that drift, are notes."""
    findings = []
    for i, k in enumerate(place):
        error = pairs.m[:, i] - pairs.q[:, k]
        wide = int(np.clip(len(error) // _WINDOWS, _MIN_WINDOW_ROWS, _MAX_WINDOW_ROWS))
        findings += _leap(pairs, i, error, wide, _MIN_LEAP_DEG_MM) or _leap(
            pairs, i, error, _SUDDEN_ROWS, _MIN_SUDDEN_DEG_MM, _ALONE_RATIO
        )
    jumped = {joint for finding in findings for joint in finding.joints}
    return findings + [d for i, k in enumerate(place) if pairs.names[i] not in jumped for d in _drift(pairs, i, int(k))]


def _leap(pairs: Pairs, joint: int, error: Floats, width: int, least: float, alone: float = 0.0) -> list[Finding]:
    """Find a leap between windows of some rows, of this size at least and so many times any other."""
    from scipy.ndimage import median_filter

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
    others = float(np.max(np.delete(leaps, slice(max(0, k - 2 * width), k + 2 * width)), initial=0.0))
    if abs(leap) < max(least, _CLEAR_RATIO * usual, alone * others) or (after - before) / leap < _STAYS_SHARE:
        return []
    edge = _first_after(error, k, width)
    if min(edge, len(error) - edge) < _MIN_STAY_WINDOWS * width:
        return []
    steps = np.abs(np.diff(pairs.q, axis=0)).max(axis=1)
    if alone and steps[max(0, edge - width) : edge + width].max() > _CLEAR_RATIO * np.percentile(steps, 90.0):
        return []  # commands leap too, where recordings were joined
    rows = np.flatnonzero(pairs.log.ok)
    last = len(pairs.log)
    shorter = f"{rows[edge]}:{last}" if edge > len(error) // 2 else f"0:{rows[edge]}"
    unit = pairs.unit(joint)
    says = f"at row {rows[edge]} the error leaps by {leap if alone else after - before:+.3g} {unit} and stays; "
    says = f"{says}elsewhere its level moves by {usual:.2g} {unit}"
    return [Finding("jump", (pairs.names[joint],), says, _ZEROED_CULPRIT, f"--leave-out {shorter}", not alone)]


def _drift(pairs: Pairs, joint: int, own: int) -> list[Finding]:
    """Note an error that drifts, or leaps at about some row, where what motion and friction explain does not."""
    log, moved = pairs.log, [int(k) for k in np.flatnonzero(pairs.moved)]
    rows = np.flatnonzero(log.ok)
    time = None if log.time is None else log.time[rows]
    kept = in_stretches(
        np.arange(int(_BEGINNING_SHARE * len(rows)), len(rows)), _MAX_ROWS, pairs.q[:, own], time, _PARTS
    )
    if own not in moved or len(kept) < _MIN_DRIFT_ROWS:
        return []
    columns = Explanation(scales(log) * log.q_nominal, own, moved, len(kept), FINE_RADII).at(rows[kept])
    columns = np.column_stack([columns, np.ones(len(kept))])
    columns /= np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
    error, along = (pairs.m[:, joint] - pairs.q[:, own])[kept], (kept - kept[0]) / (kept[-1] - kept[0])
    ways = np.column_stack([along, *(along > edge for edge in _LEAP_EDGES)])  # in which it may move, by one each
    good = np.ones(len(kept), dtype=bool)
    for _ in range(3):
        onto = np.linalg.qr(columns[good])[0]
        free, errors = (x[good] - onto @ (onto.T @ x[good]) for x in (ways, error))
        sizes = np.maximum(np.square(free).sum(axis=0), 1e-300)
        way = int(np.argmax((free.T @ errors) ** 2 / sizes))
        free, size = free[:, way], sizes[way]
        by = float(free @ errors / size)
        left = errors - by * free
        moves = error - by * ways[:, way]
        away = np.abs(moves - columns @ np.linalg.lstsq(columns[good], moves[good], rcond=None)[0])
        part, fits = np.flatnonzero(good) * _PARTS // len(kept), away[good]
        good = away <= TRIM_SIGMAS * 1.4826 * np.median(fits) + 1e-9
    # rows depend on each other, parts of the recording hardly
    scatter = float(np.sqrt(np.square(np.bincount(part, free * left, minlength=_PARTS)).sum())) / size
    usual, whole, unit = float(np.std(left)), float(np.std(error[good])), pairs.unit(joint)
    many = len(kept) >= _MANY_ROWS and reversals_of(pairs.q[:, own]) >= _MANY_REVERSALS
    of_rows, of_error = (
        _DRIFT_ROW_SIGMAS if many else _FEW_ROW_SIGMAS,
        _DRIFT_ERROR_SIGMAS if way == 0 else _LEAP_ERROR_SIGMAS,
    )
    if abs(by) <= max(_DRIFT_STANDARD_ERRORS * scatter, of_rows * usual, of_error * whole):
        return []
    if way == 0:
        name, says = "drift", f"the error drifts by {by / (1.0 - _BEGINNING_SHARE):+.2g} {unit} along the recording"
        culprit = "a camera or encoder that moves, or a cable that stretches or warms"
    else:
        row = rows[kept[np.searchsorted(along, _LEAP_EDGES[way - 1])]]
        name, says, culprit = "jump", f"the error leaps by {by:+.2g} {unit} at about row {row}", _ZEROED_CULPRIT
    says = f"{says}, where motion and friction explain it to {usual:.2g} {unit}: what is printed here is of the mean"
    return [Finding(name, (pairs.names[joint],), says, culprit, refuses=False)]


def _first_after(error: Floats, k: int, width: int) -> int:
    """Return the first row of the new level among those of two windows, by the least sum of distances from both."""
    first, last = max(1, k - width), min(len(error) - 1, k + 2 * width)
    before, after = np.median(error[max(0, k - width) : k + 1]), np.median(error[k + width : k + 2 * width])
    rows = error[first:last]
    cost = np.cumsum(np.abs(rows - before)) - np.cumsum(np.abs(rows - after))
    return first + int(np.argmin(cost)) + 1
