"""The delay between commands and measurements, with an interval, separated from the hysteresis of cables.

Each joint's measurement is modelled as a cable-driven joint at any speed: a smooth function of all commands, plus play
states of its own command (Prandtl-Ishlinskii) with non-negative weights, as friction holds a joint back and never
pushes it ahead. The model is fitted with commands read a time d earlier, for every d. The residual sum of squares
RSS_j(d) is least where the clocks agree, and all joints share one clock:

    T(d) = -LOOKS/2 sum_j log RSS_j(d)

LOOKS is the number of independent observations of a joint (not of rows, whose errors are model errors and not noise).
It is set by the scatter of joints in real recordings, and is at most the number of reversals, since between reversals
a cable's slack looks like a delay. The interval contains delays with T within z^2/2 of its maximum. It is wide if
joints disagree, if motion is slow, or if hysteresis explains as much. If a choice of two delays per joint gains z^2/2,
the sensors have separate clocks. If a delay that changes evenly along the recording gains as much, the clocks drift.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Flags, Floats, Integers, spread
from catenary.plant import MotionLog
from catenary.verdict.command_response import (
    MAX_EXPLAINED_ROWS,
    MIN_EXPLAINED_ROWS,
    MOVED_DEG_MM,
    PLAY_RADII,
    TRIM_SIGMAS,
    Explanation,
    evenness,
    in_stretches,
    reversals_of,
    scales,
    speeds_of,
)

LOOKS = 6.0
CERTAIN_SIGMAS, _LIKELY_SIGMAS = 3.0, 2.0  # standard deviations of the interval, and of a note
_REACH_S, _REACH_ROWS = 1.0, 6.0  # search range: [s], or rows without stamps; at least two rows
_SCANNED_ROWS = 400
_TABLED_ROWS = 20_000  # longest recording whose columns are all computed in advance, as each is used many times
_COARSE_DELAYS = 12  # most delays on each side of the first search; whole rows if these are farther apart
_OUTLIER_SIGMAS = 10.0  # robust deviations of the error beyond which rows are left out
_BLOCKS = 8
_NO_CHANGE = 0.0, 0.0, 0.0
TOLERANCE_S, _TOLERANCE_ROWS = 0.005, 0.05  # [s], rows: smaller delays count as none; half a row without stamps
_RESOLUTION_DEG_MM = 1e-3  # [deg, mm] residual below which a fit is perfect
APART_S, APART_ROWS = 0.08, 2.0  # [s], rows: least difference of joints' delays, as unmodelled slack causes less
# [s], rows: an interval of one joint that is wider is uninformative; one that is narrower determines the delay
_UNTOLD, SHARP = {"s": 0.5, "rows": 6.0}, {"s": 0.05, "rows": 1.0}
_PAUSE_STEPS = 4.0  # step in median steps from which a pause is not interpolated
_CHANGE_SIGMAS = 4.0  # standard deviations by which a change along the recording must be significant
_DESCENTS = 6  # searches over offset and change in turn, each finer by a factor
_FINER = 0.3
_STEPS_ASIDE_S = 0.001 * 2.0 ** np.arange(11)  # [s] distances from the best at which its interval may end


@dataclass(frozen=True)
class Delay:
    """Delay of measurements relative to their commands; negative if they lead."""

    seconds: float  # in rows for a recording without stamps; in the middle of the recording if it changes
    low: float  # of its interval
    high: float
    sure: Literal["certain", "likely", "none", "unknown"]  # evidence for a delay
    change: tuple[float, float, float]  # along the recording, with its interval; zero unless certain
    unit: Literal["s", "rows"]
    cost: float = 0.0  # least sum of log RSS
    apart: tuple[tuple[str, float], ...] = ()  # joints and their own delays, if these differ
    apart_by: float = 0.0  # standard deviations of that difference
    median: float = 0.0  # of all joints' own delays
    alone: tuple[tuple[str, float, float], ...] = ()  # each joint's interval, if it had its own clock
    even: tuple[str, ...] = ()  # joints that move at one speed, as on zig-zags, which hides their delays
    span: float = 0.0  # [s] of the rows used
    middle: float = 0.0  # [s] from the first row of the recording to the middle of the rows used

    @property
    def rate(self) -> tuple[float, float, float]:
        """Change of the delay per second, with its interval; 1e-6 for one ppm."""
        change, low, high = (value / max(self.span, 1e-9) for value in self.change)
        return change, low, high

    @property
    def at_first(self) -> float:
        """The delay at the first row of the recording [s]."""
        return self.seconds - self.rate[0] * self.middle

    def __str__(self) -> str:
        between = f"any between {self.low:+.3f} and {self.high:+.3f} {self.unit}"
        if self.sure == "unknown":
            return "the delay of measurements is not known: too few rows in motion"
        if self.sure == "none":
            hidden = f"{between} would hide in hysteresis here{self._single}"
            return f"no delay found between commands and measurements; {hidden}"
        where = "late" if self.seconds > 0.0 else "early"
        size = f"measurements {abs(self.seconds):.3f} {self.unit} {where}, {between.replace('any ', '')}"
        return size if self.sure == "certain" else f"perhaps {size}; friction could look the same here"

    @property
    def _single(self) -> str:
        """Return the sentence on delays of single joints that the recording does not exclude."""
        limit = _UNTOLD[self.unit]
        wide = [joint for joint in self.alone if joint[2] - joint[1] > SHARP[self.unit]]
        ranges = [f"{joint} {low:+.2f} to {high:+.2f}" for joint, low, high in wide if high - low <= limit]
        untold = [joint for joint, low, high in self.alone if high - low > limit]
        alone = f"; for one joint alone, {', '.join(ranges)} {self.unit}" if ranges else ""
        for motion, joints in (("half a minute of random", {*self.even}), ("faster", {*untold} - {*self.even})):
            if names := ", ".join(joint for joint in untold if joint in joints):
                alone += f"; for {names} alone, any: {motion} motion would show it"
        return alone


def delay_of(
    log: MotionLog,
    place: Sequence[int] | Integers | None = None,
    about: float = 0.0,
    *,
    change_sigmas: float = _CHANGE_SIGMAS,
) -> Delay:
    """Estimate a recording's delay.

    Args:
        log: The recording, with q_encoder.
        place: Index of the command that each measurement follows (n,); its own if None.
        about: Delay near which to search [s, or rows without stamps].
        change_sigmas: Significance required of a change along the recording; smaller if two clocks were used.
    """
    assert log.q_encoder is not None
    in_time = log.time is not None
    reach, rows = reach_of(log)
    step = reach / rows if rows else 0.0
    t = np.arange(len(log), dtype=float)
    if log.time is not None:  # a step back in stamps, to another recording, becomes a pause
        steps = np.diff(log.time, prepend=log.time[:1])
        t = np.cumsum(np.where(steps < 0.0, 2.0 * _PAUSE_STEPS * step, steps))
    inside = log.ok & _unbroken(t, step, about, reach)
    if (
        in_time and inside.sum() < MIN_EXPLAINED_ROWS and log.ok.sum() >= MIN_EXPLAINED_ROWS
    ):  # poses with pauses all along
        return delay_of(replace(log, time=None), place, about / step if step else 0.0)
    unit: Literal["s", "rows"] = "s" if in_time else "rows"
    tolerance = max(TOLERANCE_S, _TOLERANCE_ROWS * step) if in_time else 0.5
    scale = scales(log)
    q, measured = scale * log.q_nominal, log.q_encoder
    places = list(range(q.shape[1])) if place is None else [int(k) for k in place]
    moved = [k for k in range(q.shape[1]) if np.ptp(q[:, k]) > MOVED_DEG_MM]
    joints = [i for i, k in enumerate(places) if k in moved]
    if not joints or inside.sum() < MIN_EXPLAINED_ROWS:
        return Delay(0.0, -np.inf, np.inf, "unknown", _NO_CHANGE, unit)
    block = np.zeros(len(t), dtype=np.int8)
    block[inside] = np.arange(inside.sum()) * _BLOCKS // inside.sum()
    between = max(step, reach / _COARSE_DELAYS)
    count = int(np.floor(reach / between + 1e-9))
    coarse: Floats = np.float64(about) + between * np.arange(-count, count + 1, dtype=np.float64)
    motion = _Motion(q, t, moved, inside, block, in_time)
    looks = [_JointLook(motion, scale[i] * np.where(log.ok, measured[:, i], 0.0), places[i], coarse) for i in joints]
    grid, costs = _scan(looks, coarse, between)
    total = costs[:, :, 0].sum(axis=0)
    best = int(np.argmin(total))
    turns = [reversals_of(q[inside, places[i]]) for i in joints]
    worth, *own_worth = (min(LOOKS, count) + 1e-9 for count in (float(np.mean(turns)), *turns))
    low, high = _interval(grid, total, CERTAIN_SIGMAS**2 / worth)
    alone = []
    for i, cost, each in zip(joints, costs[:, :, 0], own_worth, strict=True):
        first, last = _interval(grid, cost, CERTAIN_SIGMAS**2 / each)
        # a joint's interval includes the common delay
        alone.append((log.joint_names[i], min(first, low), max(last, high)))
    speeds = speeds_of(log)
    even = tuple(log.joint_names[i] for i in joints if evenness(speeds[:, places[i]])[1])
    near_low, near_high = _interval(grid, total, _LIKELY_SIGMAS**2 / worth)
    sure: Literal["certain", "likely", "none"] = "none"
    if best not in (0, len(grid) - 1) and max(near_low, -near_high) > tolerance:
        sure = "certain" if max(low, -high) > tolerance else "likely"
    along, read = np.argmin(costs[:, :, 1:].sum(axis=0), axis=0), t[inside]
    span, middle = float(np.ptp(read)), float(read[0] + read[-1]) / 2.0
    seconds, change = float(grid[best]), _NO_CHANGE
    if in_time and span > 0.0:
        clocks = _Clocks(looks, middle, span, CERTAIN_SIGMAS**2 / worth)
        seconds, change = clocks.run_apart(seconds, grid[along], reach, change_sigmas)
        if change[0]:
            low, high = clocks.interval(seconds, change[0])
            sure = "certain" if max(low, -high) > tolerance else "none"
    own, gains = _apart(grid, costs[:, :, 0], max(APART_S, 4.0 * tolerance) if in_time else APART_ROWS)
    apart_by, fine = float(np.sqrt(worth * gains.sum())), between / 10.0 * np.arange(-10, 11)
    apart_by *= not change[0]  # drifting clocks look like different delays
    of_joints = zip(joints, looks, own, worth * gains, strict=True) if apart_by > _LIKELY_SIGMAS else ()
    apart = [(log.joint_names[i], float(d + fine[look.costs(d + fine)[:, 0].argmin()]))
             for i, look, d, z2 in of_joints if z2 > 1.0]  # fmt: skip
    return Delay(
        seconds, low, high, sure, change, unit, float(total[best]), tuple(apart),
        apart_by, float(np.median(own)), tuple(alone), even, span, middle,
    )  # fmt: skip


def reach_of(log: MotionLog) -> tuple[float, float]:
    """Return the search range of a delay, in seconds (rows without stamps), and in rows; 0 rows where unknown."""
    if log.time is None:
        return _REACH_ROWS, _REACH_ROWS
    step = float(np.median(np.diff(log.time))) if len(log) > 1 else 0.0
    reach = max(_REACH_S, 2.0 * step)
    return reach, reach / step if step > 0.0 else 0.0


def _unbroken(t: Floats, step: float, about: float, reach: float) -> Flags:
    """Return flags (N,) of rows for which every delay in the search range stays between two pauses."""
    cuts = np.flatnonzero(np.diff(t) > _PAUSE_STEPS * step)
    part = np.searchsorted(cuts, np.arange(len(t)), side="left")
    first, last = np.r_[0, cuts + 1], np.r_[cuts, len(t) - 1]
    from_, to = t - about - reach, t - about + reach
    unbroken: Flags = (from_ >= t[first][part]) & (to <= t[last][part])
    return unbroken


class _Motion(NamedTuple):
    q: Floats  # (N, n) commands [deg, mm]
    t: Floats  # (N,) rising [s], or rows
    moved: list[int]  # joints that move
    inside: Flags  # (N,) rows used
    block: NDArray[np.int8]  # (N,)
    in_time: bool


class _JointLook:
    """The fit of one joint, on its rows without outliers."""

    def __init__(self, motion: _Motion, seen: Floats, own: int, coarse: Floats) -> None:
        q, inside, self.t, self.y, self.block = motion.q, motion.inside, motion.t, seen, motion.block
        error = seen - q[:, own]
        away = np.abs(error - np.median(error[inside]))
        rows = np.flatnonzero(inside & (away <= _OUTLIER_SIGMAS * max(1.4826 * float(np.median(away[inside])), 1.0)))
        rows = in_stretches(rows, MAX_EXPLAINED_ROWS, q[:, own], motion.t if motion.in_time else None)
        few_rows, stretches = len(q) <= _TABLED_ROWS, None
        if not few_rows:
            farthest = 2.0 * coarse[0] - coarse[1], 2.0 * coarse[-1] - coarse[-2]  # finer ones go beyond
            last, first = (np.searchsorted(self.t, self.t[rows] - d) for d in farthest)
            stretches = [*zip(np.maximum(first - 2, 0).tolist(), (last + 2).tolist(), strict=True)]
        explanation = Explanation(q, own, motion.moved, len(rows), stretches=stretches)
        self.columns_at = explanation.at(np.arange(len(q))).__getitem__ if few_rows else explanation.at
        few = rows[spread(len(rows), _SCANNED_ROWS)]
        best = coarse[int(np.argmin([np.mean(self.unexplained(few, d) ** 2) for d in coarse]))]
        for _ in range(3):
            left = np.abs(self.unexplained(rows, best))
            good = left <= TRIM_SIGMAS * 1.4826 * np.median(left)
            rows = rows[good]
            if good.mean() > 0.999:
                break
        self.rows = rows

    def unexplained(self, rows: Integers, d: float | Floats) -> Floats:
        """Return the residual of some rows with commands read a time d earlier; each block has its own offset."""
        from scipy.optimize import nnls

        s = self.t[rows] - d
        k = np.clip(np.searchsorted(self.t, s, side="right") - 1, 0, len(self.t) - 2)
        share = ((s - self.t[k]) / np.maximum(self.t[k + 1] - self.t[k], 1e-12))[:, None]
        before, after = self.columns_at(k), self.columns_at(k + 1)
        columns = np.column_stack([before * (1.0 - share) + after * share, self.y[rows]])
        # blocks follow each other
        _, firsts, counts = np.unique(self.block[rows], return_index=True, return_counts=True)
        columns -= np.repeat(np.add.reduceat(columns, firsts) / counts[:, None], counts, axis=0)
        free, others = columns[:, : -1 - len(PLAY_RADII)], columns[:, -1 - len(PLAY_RADII) :]
        free = free / (np.sqrt(np.einsum("ij,ij->j", free, free)) + 1e-12)  # thrice as fast as NumPy's norm
        gram = free.T @ free + 1e-6 * np.eye(free.shape[1])
        others = others - free @ np.linalg.solve(gram, free.T @ others)
        plays, y = others[:, :-1], others[:, -1]
        plays = plays / (np.sqrt(np.einsum("ij,ij->j", plays, plays)) + 1e-9 * np.sqrt(len(y)))
        lower = np.linalg.cholesky(plays.T @ plays + 1e-6 * np.eye(len(PLAY_RADII)))
        left: Floats = y - plays @ nnls(lower.T, np.linalg.solve(lower, plays.T @ y))[0]
        return left

    def costs(self, delays: Floats) -> Floats:
        """Return the log residual variance of all rows and of each block's (delays, 1 + _BLOCKS)."""
        b = self.block[self.rows]
        n = np.maximum(np.bincount(b, minlength=_BLOCKS), 1)
        squares = [self.unexplained(self.rows, d) ** 2 for d in delays]
        each = [np.r_[s.mean(), np.bincount(b, s, minlength=_BLOCKS) / n] for s in squares]
        costs: Floats = np.log(np.array(each) + _RESOLUTION_DEG_MM**2)
        return costs


def _scan(looks: Sequence[_JointLook], coarse: Floats, step: float) -> tuple[Floats, Floats]:
    """Return delays and their costs (joints, delays, 1 + _BLOCKS), in steps of 1, .1 and .01 towards the best."""
    grids, costs = [coarse], [np.stack([look.costs(coarse) for look in looks])]
    for reach, fine in ((12, 10), (9, 100)):
        best = grids[-1][int(np.argmin(costs[-1][:, :, 0].sum(axis=0)))]
        grids.append(best + np.arange(-reach, reach + 1) * step / fine)
        costs.append(np.stack([look.costs(grids[-1]) for look in looks]))
    grid, order = np.unique(np.concatenate(grids[::-1]), return_index=True)
    return grid, np.concatenate(costs[::-1], axis=1)[:, order]


def _interval(x: Floats, cost: Floats, above: float) -> tuple[float, float]:
    """Return the outermost x at which a cost, linearly interpolated, exceeds its minimum by `above`."""
    level = cost.min() + above
    inside = np.flatnonzero(cost <= level)
    a, b = inside[0], inside[-1]
    low = x[a] if a == 0 else np.interp(-level, [-cost[a - 1], -cost[a]], [x[a - 1], x[a]])
    high = x[b] if b == len(x) - 1 else np.interp(level, [cost[b], cost[b + 1]], [x[b], x[b + 1]])
    return float(low), float(high)


def _apart(grid: Floats, costs: Floats, least: float) -> tuple[Floats, Floats]:
    """Return each joint's delay of two that differ by `least`, and its gain over one; costs (joints, delays)."""
    pairs = np.minimum(costs[:, :, None], costs[:, None, :]).sum(axis=0)
    near = (np.abs(grid[:, None] - grid) < least) & ~np.eye(len(grid), dtype=bool)
    pairs = np.where(near, np.inf, pairs)  # one delay of all remains a choice
    two = np.array(np.unravel_index(np.argmin(pairs), pairs.shape))
    one = int(np.argmin(costs.sum(axis=0)))
    chosen = two[np.argmin(costs[:, two], axis=1)]
    return grid[chosen], costs[:, one] - costs[np.arange(len(costs)), chosen]


class _Clocks:
    """Delays that change evenly along the recording, with the same cost as for a constant delay."""

    def __init__(self, looks: Sequence[_JointLook], middle: float, span: float, certain: float) -> None:
        """Set the joints' fits, the time span [s], and the cost above the minimum that is `certain`."""
        self._looks, self._middle, self._span, self._certain = looks, middle, span, certain

    def cost(self, delay: float, change: float, max_rows: int = MAX_EXPLAINED_ROWS) -> float:
        """Return the sum of log RSS where the delay in the middle is `delay`, and grows by `change` [s]."""
        total = 0.0
        for look in self._looks:
            rows = look.rows[spread(len(look.rows), max_rows)]
            left = look.unexplained(rows, delay + change * (look.t[rows] - self._middle) / self._span)
            total += float(np.log(np.mean(left**2) + _RESOLUTION_DEG_MM**2))
        return total

    def run_apart(
        self, delay: float, along: Floats, reach: float, sigmas: float
    ) -> tuple[float, tuple[float, float, float]]:
        """Return the delay in the middle, and its change with an interval (zero unless certain)."""
        from scipy.stats import theilslopes

        slope, level, *_ = theilslopes(along, np.linspace(-0.5, 0.5, len(along)))
        starts = [(delay, aside) for aside in np.r_[-_STEPS_ASIDE_S, _STEPS_ASIDE_S].tolist()] + [
            (float(level), float(slope))
        ]
        few = [self.cost(*start, _SCANNED_ROWS) for start in starts]
        needed = (sigmas / CERTAIN_SIGMAS) ** 2 * self._certain
        if self.cost(delay, 0.0, _SCANNED_ROWS) - min(few) < needed / 3.0:
            return delay, _NO_CHANGE
        one = self.cost(delay, 0.0)
        _, middle, change = self._descent(*starts[int(np.argmin(few))], reach / 2.0)
        # with periodic motion, a search without a change may be off by whole periods
        others = middle + np.linspace(-reach, reach, 4 * _COARSE_DELAYS + 1)
        again = others[np.argmin([self.cost(other, change, _SCANNED_ROWS) for other in others])]
        cost, middle, change = self._descent(float(again), change, reach / 2.0)
        if one - cost < needed:
            return delay, _NO_CHANGE
        low, high = self._around(lambda aside: self.cost(middle, change + aside))
        return middle, (change, change + low, change + high)

    def interval(self, delay: float, change: float) -> tuple[float, float]:
        low, high = self._around(lambda aside: self.cost(delay + aside, change))
        return delay + low, delay + high

    def _descent(self, delay: float, change: float, reach: float) -> tuple[float, float, float]:
        width = reach
        for turn in range(_DESCENTS):
            count = MAX_EXPLAINED_ROWS if turn > 1 else _SCANNED_ROWS
            asides = width * np.linspace(-1.0, 1.0, 11)
            change += float(asides[np.argmin([self.cost(delay, change + aside, count) for aside in asides])])
            delay += float(asides[np.argmin([self.cost(delay + aside, change, count) for aside in asides])])
            width *= _FINER
        return self.cost(delay, change), delay, change

    def _around(self, cost: Callable[[float], float]) -> tuple[float, float]:
        """Return the interval about zero in which a cost is not significantly above its value at zero."""
        asides = np.r_[-_STEPS_ASIDE_S[::-1], 0.0, _STEPS_ASIDE_S]
        return _interval(asides, np.array([cost(aside) for aside in asides]), self._certain)
