"""How far the clock of one file is ahead of another's, and how fast it runs beside it, from the motion that both saw.

Speeds of all joints are correlated over every lag, in parts of 20 minutes that clocks hardly run apart in; what is left
is found as any delay between commands and measurements is (`verdict/delay.py`).
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from catenary.arrays import Flags, Floats, Integers
from catenary.errors import InputError
from catenary.plant import MotionLog, nameless
from catenary.recording.import_formats.series import Series, interpolate
from catenary.topics import SECOND
from catenary.units import DISPLAY
from catenary.verdict.delay import CERTAIN_SIGMAS, LOOKS, TOLERANCE_S, Delay, delay_of
from catenary.verdict.pairs import MOVED_DEG_MM

_STEP_S = 0.1  # [s] of the grid on which speeds are correlated
_SMOOTH_STEPS = 9  # of the grid, over which speeds are averaged
_PART_S = 1200.0  # [s]
_MIN_OVERLAP_S = 10.0
_MIN_OVERLAP_SHARE = 0.3  # of a part
_MIN_CORRELATION = 0.6  # of two sensors of one motion; of other motions it stays below .4
_RIVAL_S = 2.0  # [s] from the best lag on which another is a rival
_RIVAL_RATIO = 2.0  # times more unexplained, from which it is none
_MAX_RIVALS = 4
_CLOSE = CERTAIN_SIGMAS**2 / LOOKS  # in logarithms of what is unexplained, within which two are alike
_MIN_UNEXPLAINED = 1e-3  # share of speeds' variance that counts as none
_MAX_DRIFT = 2e-3  # of one clock beside another
_MAX_ROWS = 200_000  # that the delay is found by
_GAP_S = 1.0  # [s] beyond which nothing is read between two samples
_ROUNDS = 3
_GIVEN = "--clock SECONDS,PPM gives its offset and rate, 0,0 where it is one with q_nominal's"
_CHANGE_SIGMAS = 2.0  # by which the rate of a clock must differ: no two are the same


class NothingInCommonError(InputError):
    """Two files that both saw motion saw no motion that both have."""


@dataclass(frozen=True)
class FileClock:
    """A file's clock beside that of q_nominal's."""

    ahead: float = 0.0  # [s] by which it reads more when the rows of q_nominal begin
    fast: float = 0.0  # by which it gains, 1e-6 for one ppm
    delay: Delay | None = None  # what is left, by which it was found; None if it was given

    @property
    def is_certain(self) -> bool:
        """Whether the motion shows that it is another clock."""
        if self.delay is None or self.fast != 0.0 or abs(self.ahead) > _GAP_S:
            return True
        low, high = self.interval
        return max(low, -high) > TOLERANCE_S

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the interval of `ahead` [s]."""
        if self.delay is None:
            return self.ahead, self.ahead
        return self.ahead + self.delay.low - self.delay.seconds, self.ahead + self.delay.high - self.delay.seconds

    def onto_base(self, stamp: Integers, origin: int) -> Integers:
        """Return stamps (M,) [ns] as q_nominal's clock reads them; its rows begin at `origin`."""
        since = stamp - (origin + round(self.ahead * SECOND))
        return origin + np.rint(since / (1.0 + self.fast)).astype(np.int64)

    def __str__(self) -> str:
        """Return the clock as text, with its intervals."""
        said = f"its clock is {self.ahead:+.4f} s ahead of q_nominal's and gains {1e6 * self.fast:+.1f} ppm"
        if self.delay is None:
            return f"{said}, as given"
        low, high = self.interval
        _, slowest, fastest = (1e6 * (self.fast + rate) for rate in self.delay.rate)
        gains = f", {slowest:+.0f} to {fastest:+.0f} ppm" * bool(slowest < fastest)
        return f"{said} ({low:+.3f} to {high:+.3f} s{gains}), by the motion that both saw"


def clock_by_motion(base: Series, other: Series, units: tuple[str, ...], where: str) -> FileClock:
    """Return the clock of `other` beside that of `base`, both of the joints' positions (M, n) [rad|m].

    Raises:
        NothingInCommonError: No motion is in both.
        InputError: Too little moves, or motion repeats itself.
    """
    moved = np.nanpercentile(base.values, 98.0, axis=0) - np.nanpercentile(base.values, 2.0, axis=0)
    joints = moved * [DISPLAY[unit][1] for unit in units] > MOVED_DEG_MM
    lasts = min(float(np.ptp(one.stamp)) / SECOND for one in (base, other))
    if not joints.any() or lasts < _MIN_OVERLAP_S:
        raise InputError(f"{where}: too little moves to tell its clock; {_GIVEN}")
    ours, its = (replace(one, values=one.values[:, joints]) for one in (base, other))
    rivals = [_refined(clock, base, other, units, where) for clock in _by_speeds(ours, its, where)]
    left = np.array([_unexplained(clock, ours, its) for clock in rivals])
    best = rivals[int(np.argmin(left))]
    others = [
        each for each, cost in zip(rivals, left, strict=True) if cost < left.min() + _CLOSE and _is_close(each, best)
    ]
    if others:
        raise InputError(
            f"{where}: the motion repeats itself: its clock may be {best.ahead:+.3f} s ahead of q_nominal's, or "
            f"{', '.join(f'{rival.ahead:+.3f}' for rival in others)} s; {_GIVEN}"
        )
    return best


def _is_close(rival: FileClock, best: FileClock) -> bool:
    """Return True if a clock some periods off leaves as little of the positions as the best one."""
    if abs(rival.ahead - best.ahead) < _RIVAL_S:
        return False
    return best.delay is None or rival.delay is None or rival.delay.cost < best.delay.cost + _CLOSE


def _unexplained(clock: FileClock, base: Series, other: Series) -> float:
    """Return the sum over joints of the logarithm of the share of speeds' variance that a clock leaves unexplained."""
    rows = np.arange(base.stamp[0], base.stamp[-1], round(_STEP_S * SECOND))
    shifted = replace(other, stamp=clock.onto_base(other.stamp, int(base.stamp[0])))
    pair = [np.diff(interpolate(one, rows, 3.0 * _GAP_S), axis=0) for one in (base, shifted)]
    both = np.isfinite(pair[0]).all(axis=1) & np.isfinite(pair[1]).all(axis=1)
    if both.sum() < _MIN_OVERLAP_S / _STEP_S:
        return 0.0
    x, y = (one[both] - one[both].mean(axis=0) for one in pair)
    size = np.maximum((x**2).sum(axis=0) * (y**2).sum(axis=0), 1e-30)
    return float(np.log(1.0 - (x * y).sum(axis=0) ** 2 / size + _MIN_UNEXPLAINED).sum())


def _refined(clock: FileClock, base: Series, other: Series, units: tuple[str, ...], where: str) -> FileClock:
    """Return a clock that is right to a second, by what a delay beside it explains."""
    origin, stride = int(base.stamp[0]), -(-len(base.stamp) // _MAX_ROWS)
    known = np.flatnonzero(np.isfinite(base.values).all(axis=1))[::stride]
    rows, q = base.stamp[known], base.values[known]
    time, n = (rows - origin) / SECOND, q.shape[1]
    gap = max(_GAP_S, 3.0 * float(np.median(np.diff(other.stamp))) / SECOND)
    for _ in range(_ROUNDS):
        seen = interpolate(replace(other, stamp=clock.onto_base(other.stamp, origin)), rows, gap)
        ok = np.asarray(np.isfinite(seen).all(axis=1))
        log = MotionLog(where, nameless(n), units, q, ok, q_encoder=seen, time=time)
        left = delay_of(log, change_sigmas=_CHANGE_SIGMAS)
        if left.sure == "unknown":
            return clock
        grows = left.rate[0]
        # delays count from the first of the rows that are read, clocks from the first of q_nominal's
        clock = FileClock(clock.ahead + left.at_first - grows * float(time[0]), clock.fast + grows, left)
        if not grows:
            break
    return clock


def _by_speeds(base: Series, other: Series, where: str) -> list[FileClock]:
    """Return the clock to a step of the grid, by the parts of the motion that agree on it, and such as may be meant."""
    (speed, known), (its, seen) = _speeds(base), _speeds(other)
    size = round(_PART_S / _STEP_S)
    edges = np.linspace(0, len(speed), -(-len(speed) // size) + 1).astype(int)
    begins = (int(other.stamp[0]) - int(base.stamp[0])) / SECOND
    found = []
    for first, last in pairwise(edges):
        lags, correlations = _best_lags(speed[first:last], known[first:last], its, seen)
        found.append((correlations, (first + last) / 2.0 * _STEP_S, (lags - first) * _STEP_S))
    correlations, at, aheads = max(found, key=lambda each: float(each[0][0]))
    best = float(correlations[0])
    if best < _MIN_CORRELATION:
        raise NothingInCommonError(
            f"{where}: no motion in common with q_nominal's (speeds correlate by {best:.2f} at best): are the columns "
            f"those of the same joints, in this order, of the same recording? {_GIVEN}"
        )
    clocks = []
    for ahead in aheads[1.0 - correlations < _RIVAL_RATIO * (1.0 - best) + 1e-9]:
        like = [(t, a[0]) for r, t, a in found if r[0] > _MIN_CORRELATION and abs(a[0] - ahead) < _near(t - at)]
        times, near = np.array([*like, (at, ahead)]).T
        fast = float(np.polyfit(times, near, 1)[0]) if len(like) > 2 else 0.0
        clocks.append(FileClock(begins + float(np.mean(near)) - fast * float(np.mean(times)), fast))
    return clocks


def _near(seconds: float) -> float:
    """Return the largest change of one clock's offset [s] over this time."""
    return _MAX_DRIFT * abs(seconds) + 0.5


def _speeds(series: Series) -> tuple[Floats, Floats]:
    """Return joints' speeds on the grid (G, n), each of mean square 1, and where they are known (G,)."""
    there = np.isfinite(series.values).all(axis=1)
    t, q = (series.stamp[there] - series.stamp[0]) / SECOND, series.values[there]
    grid = np.arange(0.0, max(t[-1], 2.0 * _STEP_S), _STEP_S)
    after = np.clip(np.searchsorted(t, grid), 1, len(t) - 1)
    known = ((t[after] - t[after - 1] <= _GAP_S) & (grid >= t[0]) & (grid <= t[-1])).astype(np.float64)
    box = np.ones(_SMOOTH_STEPS) / _SMOOTH_STEPS
    speed = np.column_stack([np.gradient(np.convolve(np.interp(grid, t, c), box, "same")) for c in q.T])
    speed[:_SMOOTH_STEPS] = speed[-_SMOOTH_STEPS:] = 0.0
    most = 2.0 * np.percentile(np.abs(speed[known > 0.0]), 99.0, axis=0) + 1e-12  # wild rows are no motion
    speed = np.clip(speed, -most, most) * known[:, None]
    return speed / np.maximum(np.sqrt((speed**2).mean(axis=0)), 1e-12), known


def _best_lags(a: Floats, known: Floats, b: Floats, seen: Floats) -> tuple[Integers, Floats]:
    """Return the lags [steps] of a's beginning in b at which speeds correlate best, and how well, the best first."""
    from scipy.signal import fftconvolve

    def over_lags(x: Floats, y: Floats) -> Floats:
        return np.asarray(fftconvolve(y, x[::-1]))

    lags = np.arange(len(a) + len(b) - 1) - (len(a) - 1)
    total = np.zeros(len(lags))
    for x, y in zip(a.T, b.T, strict=True):
        size = np.maximum(over_lags(x**2, seen) * over_lags(known, y**2), 1e-6)
        total += np.abs(over_lags(x, y)) / np.sqrt(size)  # a column may have the other sign
    needed = max(_MIN_OVERLAP_S, _MIN_OVERLAP_SHARE * min(len(a), len(b)) * _STEP_S)
    total = np.where(over_lags(known, seen) * _STEP_S >= needed, total / a.shape[1], 0.0)
    best: list[int] = []
    for _ in range(_MAX_RIVALS):
        best.append(int(np.argmax(np.where(_is_far(lags, lags[best]), total, -1.0))))
    return lags[best], total[best]


def _is_far(lags: Integers, others: Integers) -> Flags:
    """Return flags of lags that are rivals of all others."""
    return np.asarray((np.abs(lags[:, None] - others) * _STEP_S > _RIVAL_S).all(axis=1))
