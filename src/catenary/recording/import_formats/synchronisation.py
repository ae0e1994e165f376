"""The synchroniser: what was recorded at rates and by clocks of its own, at the stamps of q_nominal.

Topics of a bag, tables beside one another and the columns of one table are alike: samples with stamps, put in order,
and read on the straight line between their two neighbours in time. Steps of their clock are taken out, and files with
clocks of their own are brought onto that of q_nominal's, by the motion that both saw: speeds of all joints are
correlated over every lag, in parts of 20 minutes that clocks hardly run apart in; what is left is found as any delay
between commands and measurements is (`verdict/delay.py`).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from catenary.arrays import Flags, Floats, Integers
from catenary.errors import InputError
from catenary.plant import MotionLog, nameless
from catenary.recording.import_formats.columns import Place, Stream
from catenary.recording.import_formats.mapping import RecordingMapping
from catenary.recording.import_formats.sampled_signals import (
    GAP_INTERVALS,
    ClockStep,
    Series,
    clean_series,
    interpolate,
)
from catenary.recording.import_formats.table_time import TableTime, time_of
from catenary.topics import SECOND
from catenary.units import DISPLAY
from catenary.verdict.command_response import MOVED_DEG_MM
from catenary.verdict.delay import CERTAIN_SIGMAS, LOOKS, TOLERANCE_S, Delay, delay_of

DIFFERENT_CLOCKS_S = 1.0  # [s] between the clocks of two topics' stamps from which they are no one clock
_FIRST_DATED_NS = 10**9 * SECOND  # [ns] below which stamps count from a zero of their own
_BASE = "q_nominal"  # the quantity whose samples are the rows
# of a quantity's rows, or of q_nominal's: a table that lacks more of them has the two at rates of their own
_OTHER_RATE_SHARE = 0.5
_LOST = np.iinfo(np.int64).min  # stamp of a row without time
_BETWEEN_RECORDINGS_S = 10 * 24 * 3600  # [s] between recordings that stand one behind the other in a table
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
_MAX_PARTS = 8  # of a file whose clock was set again: more pauses are rows that were lost
_GIVEN = "--clock SECONDS,PPM gives its offset and rate, 0,0 where it is one with q_nominal's"
_CHANGE_SIGMAS = 2.0  # by which the rate of a clock must differ: no two are the same
InSi = Callable[[Floats], Floats]  # makes of a quantity's columns (N, n) numbers in SI


class CommonMotion(NamedTuple):
    """What a measured quantity and q_nominal both show of a motion, k numbers [rad|m] of each."""

    of_commands: InSi
    of_measurements: InSi
    units: tuple[str, ...]  # (k,)


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

    def rivals(self, best: "FileClock") -> bool:
        """Return True if this clock is some periods off the best one, and leaves as little of the positions."""
        if abs(self.ahead - best.ahead) < _RIVAL_S or self.delay is None or best.delay is None:
            return abs(self.ahead - best.ahead) >= _RIVAL_S
        return self.delay.cost < best.delay.cost + _CLOSE

    def __str__(self) -> str:
        """Return the clock as text, with its intervals."""
        clock = f"its clock is {self.ahead:+.4f} s ahead of q_nominal's and gains {1e6 * self.fast:+.1f} ppm"
        if self.delay is None:
            return f"{clock}, as given"
        low, high = self.interval
        _, slowest, fastest = (1e6 * (self.fast + rate) for rate in self.delay.rate)
        gains = f", {slowest:+.0f} to {fastest:+.0f} ppm" * bool(slowest < fastest)
        return f"{clock} ({low:+.3f} to {high:+.3f} s{gains}), by the motion that both saw"


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
    others = [each for each, cost in zip(rivals, left, strict=True) if cost < left.min() + _CLOSE and each.rivals(best)]
    if others:
        raise InputError(
            f"{where}: the motion repeats itself: its clock may be {best.ahead:+.3f} s ahead of q_nominal's, or "
            f"{', '.join(f'{rival.ahead:+.3f}' for rival in others)} s; {_GIVEN}"
        )
    return best


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
    candidates = []
    for first, last in pairwise(edges):
        lags, correlations = _best_lags(speed[first:last], known[first:last], its, seen)
        candidates.append((correlations, (first + last) / 2.0 * _STEP_S, (lags - first) * _STEP_S))
    correlations, at, aheads = max(candidates, key=lambda each: float(each[0][0]))
    best = float(correlations[0])
    if best < _MIN_CORRELATION:
        raise NothingInCommonError(
            f"{where}: no motion in common with q_nominal's (speeds correlate by {best:.2f} at best): are the columns "
            f"those of the same joints, in this order, of the same recording? {_GIVEN}"
        )
    clocks = []
    for ahead in aheads[1.0 - correlations < _RIVAL_RATIO * (1.0 - best) + 1e-9]:
        like = [
            (t, a[0])
            for r, t, a in candidates
            if r[0] > _MIN_CORRELATION and abs(a[0] - ahead) < _MAX_DRIFT * abs(t - at) + 0.5
        ]
        times, near = np.array([*like, (at, ahead)]).T
        fast = float(np.polyfit(times, near, 1)[0]) if len(like) > 2 else 0.0
        clocks.append(FileClock(begins + float(np.mean(near)) - fast * float(np.mean(times)), fast))
    return clocks


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
    limit = 2.0 * np.percentile(np.abs(speed[known > 0.0]), 99.0, axis=0) + 1e-12  # wild rows are no motion
    speed = np.clip(speed, -limit, limit) * known[:, None]
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
        is_far = (np.abs(lags[:, None] - lags[best]) * _STEP_S > _RIVAL_S).all(axis=1)  # a rival of all others
        best.append(int(np.argmax(np.where(is_far, total, -1.0))))
    return lags[best], total[best]


class OneClock:
    """Quantities of a recording at the stamps of q_nominal.

    Where headers of two topics are delayed behind arrivals by times more than a second apart, nobody set the clocks,
    and all topics take arrivals. Files beside q_nominal's have clocks of their own, which are estimated from the motion
    that both saw. Rows of one table in which time goes back begin another recording.
    """

    def __init__(
        self,
        streams: Mapping[str, Stream],
        quantities: Mapping[str, Sequence[Place]],
        mapping: RecordingMapping,
        today: float,
        common: Mapping[str, CommonMotion],  # of quantities that saw the joints move
    ) -> None:
        """Clean the streams, by name; those that no quantity has columns of are only reported on."""
        self._quantities, self._mapping, self._today = quantities, mapping, today
        self.base = quantities[_BASE][0].stream
        self._alone = len(streams) == 1 and streams[self.base].stamp is None
        self._tables, self.notes = dict[str, TableTime](), list[str]()
        stamps = {name: self._stamp_of(stream) for name, stream in streams.items()}
        series_of = self._clean(streams, stamps)
        arrivals = {name: one.arrival for name, one in streams.items() if one.arrival is not None}
        headed = {name for name, one in streams.items() if one.stamp is not None and one.stamp.any()}
        headed = headed & arrivals.keys() if mapping.stamps != "arrival" else set[str]()
        offsets = {name: series_of[name, ""].report.clock_offset for name in arrivals if name in headed}
        spread = [*offsets.values(), *([0.0] if offsets and headed < arrivals.keys() else [])]
        if mapping.stamps == "auto" and spread and max(spread) - min(spread) > DIFFERENT_CLOCKS_S:
            by = ", ".join(f"{name} {offset:.3f} s" for name, offset in offsets.items())
            self.notes.append(
                f"stamps lie before arrival by {by}: clocks that differ; arrivals were taken for all topics"
            )
            series_of = self._clean(streams, stamps | arrivals)
        elif mapping.stamps == "arrival" and arrivals:
            self.notes.append("arrival times were taken, as asked")
        self._take(series_of)
        self._by_motion_alone = set[str]()  # streams on clocks that were found by their motion
        if clocks := self._clocks(streams, stamps, common):
            self._by_motion_alone = {name for name, parts in clocks.items() if parts[0][1].delay is not None}
            origin = int(series_of[self.base, ""].stamp[0])
            for name, parts in clocks.items():
                stamp, came = stamps[name].copy(), streams[name].arrival
                for begins, clock in parts:  # each from its first row on
                    stamp[begins:] = clock.onto_base(stamps[name][begins:], origin)
                stamps[name] = np.where(stamps[name] != _LOST, stamp, _LOST)
                moved = None if came is None else parts[0][1].onto_base(came, origin)
                streams = {**streams, name: replace(streams[name], arrival=moved)}
            series_of = self._clean(streams, stamps)
            self._take(series_of)
        series = series_of[self.base, ""]
        self.repeated = series.report.repeated
        table = self._tables.get(self.base)
        self._at: dict[tuple[str, str], Floats] = {}
        self.stamp = series.stamp
        self._own_stamp, self._seconds = series.stamp, None
        self.rows_of_base = rows = series.values[:, -1].astype(np.int64)  # in the order in which they were read
        if table is not None:
            self._own_stamp = table.stamp[rows]
            self._seconds = table.seconds[rows] if self._alone and table.seconds is not None else None
        if len(streams[self.base].starts) > 1:  # time restarts with each recording, as a cable's memory does
            of = np.searchsorted(streams[self.base].starts, rows, side="right")
            _, first, of = np.unique(of, return_index=True, return_inverse=True)
            later = (self._own_stamp[first] - self._own_stamp[0])[of]
            self._own_stamp = self._own_stamp - later
            self._seconds = None if self._seconds is None else self._seconds - later / SECOND
        self._began = streams[self.base].began
        self.is_timed = table is None or table.column is not None
        self.reports = tuple(one.report for one in series_of.values())
        self.notes += [note for report in self.reports for note in report.notes()]
        used = {place.stream for places in quantities.values() for place in places}
        for (name, _), one in series_of.items():
            if name in used and (one.stamp[-1] < self.stamp[0] or one.stamp[0] > self.stamp[-1]):
                raise InputError(
                    f"{name}: is of another time than {self.base}: {_seconds(one, self.stamp[0])} after its first, "
                    f"{_seconds(series, self.stamp[0])}; are the units of time different? --clock SECONDS,PPM says by "
                    "how much its clock is ahead, and gains"
                )

    def _take(self, series: dict[tuple[str, str], Series]) -> None:
        """Keep series, and of which part each column of a quantity is, with its place in it."""
        self._series = series
        self._where: dict[str, list[tuple[tuple[str, str], int]]] = {}
        for key, places in self._quantities.items():
            parts = [(place.stream, key if (place.stream, key) in series else "") for place in places]
            columns = [self._columns[part].index(place.column) for part, place in zip(parts, places, strict=True)]
            self._where[key] = list(zip(parts, columns, strict=True))

    def _clocks(
        self, streams: Mapping[str, Stream], stamps: Mapping[str, Integers], common: Mapping[str, CommonMotion]
    ) -> dict[str, list[tuple[int, FileClock]]]:
        """Return the clocks of streams of other files than q_nominal's, as given, or by the motion; say them.

        A clock that was set, or restarted, within a file is another one from a row on: each comes with its first row.
        """
        # topics of bags share a clock
        file_of = {name: name if stream.type == "table" else "bag" for name, stream in streams.items()}
        others = dict.fromkeys(file for file in file_of.values() if file != file_of[self.base])
        stated_clocks, of = self._mapping.clocks, dict[str, list[tuple[int, FileClock]]]()
        if unknown := [file for file in stated_clocks if not others or file not in ("", *others)]:
            known = f"expected {', '.join(others)}" if others else "none is read beside q_nominal's"
            named = " ".join(["no file", *filter(None, unknown[:1])])
            raise InputError(f"--clock: {named}: {known}")
        for file in others:
            stated = stated_clocks.get(file, stated_clocks.get(""))
            keys = [key for key in common if file_of[self._where[key][0][0][0]] == file]
            if stated is not None:
                of[file] = [(0, FileClock(*stated))]
                self.notes.append(f"{file}: {of[file][0][1]}")
            elif keys and (parts := self._by_parts(keys[0], file, streams, stamps, common[keys[0]])):
                of[file] = parts
                for first, clock in parts:
                    since = f" from row {first} on" * (len(parts) > 1)
                    self.notes.append(f"{file}{since}: {clock}; taken onto q_nominal's (--clock 0,0 leaves it)")
        return {name: of[file_of[name]] for name in streams if file_of[name] in of}

    def _by_parts(
        self, key: str, file: str, streams: Mapping[str, Stream], stamps: Mapping[str, Integers], common: CommonMotion
    ) -> list[tuple[int, FileClock]]:
        """Return the clocks of a file that saw the joints, and their first rows; none if it may be q_nominal's."""
        name, series, notes = self._where[key][0][0][0], self._series, list(self.notes)
        edges, parts = _restarts(stamps[name]) if file == name else [0], list[tuple[int, FileClock]]()
        for first, last in pairwise([*edges, len(stamps[name])] if len(edges) > 1 else []):
            stamp = np.full(len(stamps[name]), _LOST)
            stamp[first:last] = stamps[name][first:last]
            self._take(self._clean(streams, {**stamps, name: stamp}))
            pair = self._pair(key, common)
            try:
                parts.append((first, clock_by_motion(pair[0], pair[-1], common.units, file)))
            except InputError:
                continue
        self.notes = notes
        self._take(series)
        if len(parts) == len(edges) > 1:
            ends = [clock.interval for _, clock in parts]
            if max(low for low, _ in ends) > min(high for _, high in ends):
                return parts
        one = self._by_motion(key, file, common)
        return [] if one is None else [(0, one)]

    def _pair(self, key: str, common: CommonMotion) -> list[Series]:
        """Return the motion of commands, and of a quantity beside them; fewer where one is of several streams."""
        pair = [(self.samples(_BASE), common.of_commands), (self.samples(key), common.of_measurements)]
        return [replace(one, values=in_si(one.values)) for one, in_si in pair if one is not None]

    def _by_motion(self, key: str, file: str, common: CommonMotion) -> FileClock | None:
        """Return the clock of a file that saw the joints; None if it may well be that of q_nominal's."""
        if len(pair := self._pair(key, common)) < 2:
            return None
        base, its = pair
        # two that count from zeros of their own are hardly one; of dated ones the motion must say so
        is_dated = min(base.stamp[0], its.stamp[0]) >= _FIRST_DATED_NS
        try:
            clock = clock_by_motion(base, its, common.units, file)
        except InputError as error:
            apart = its.stamp[-1] < base.stamp[0] or its.stamp[0] > base.stamp[-1]
            if apart or (isinstance(error, NothingInCommonError) and not is_dated):
                raise
            self.notes.append(f"{error}; taken to be one with q_nominal's")
            return None
        return clock if clock.is_certain or (not is_dated and abs(clock.ahead) > TOLERANCE_S) else None

    @property
    def arrivals(self) -> dict[str, tuple[float, float]]:
        """How long before arrival a quantity was stamped, and its step [s]; no stamps that are the arrival."""
        arrivals = {}
        for key, where in self._where.items():
            one = self._series[where[0][0]]
            if np.isfinite(one.report.clock_offset) and one.report.clock_offset != 0.0 and len(one.stamp) > 1:
                step = float(np.median(np.diff(one.stamp))) / SECOND
                arrivals["q_encoder" if key == "pose" else key] = (one.report.clock_offset, step)
        return arrivals

    def time(self, whole: Flags) -> tuple[Floats | None, float]:
        """Return the time of rows (N,) [s], from the first one on, and what its own clock said then [s]."""
        if not self.is_timed:
            return None, 0.0
        stamp = self._own_stamp[whole]
        began = int(stamp[0]) / SECOND + (self._began if stamp[0] < _FIRST_DATED_NS else 0.0)
        if self._seconds is None:
            return (stamp - stamp[0]) / SECOND, began
        seconds = self._seconds[whole]
        if self._mapping.time_zero == "file":
            return seconds, 0.0
        return seconds - seconds[0], began

    def rows(self, key: str) -> Floats:
        """Return a quantity at the stamps of q_nominal, (N, k); NaN in gaps."""
        for part in {part for part, _ in self._where[key]} - self._at.keys():
            series = self._series[part]
            same = part == (self.base, "")
            self._at[part] = series.values if same else interpolate(series, self.stamp, self._gap(series))
        return np.column_stack([self._at[part][:, column] for part, column in self._where[key]])

    def samples(self, key: str) -> Series | None:
        """Return a quantity at its own stamps; None where its columns are of several streams."""
        (first, _), *others = self._where[key]
        if any(part != first for part, _ in others):
            return None
        series = self._series[first]
        return Series(series.stamp, series.values[:, [column for _, column in self._where[key]]], series.report)

    def is_found(self, key: str) -> bool:
        """Whether the clock of a quantity was found by the motion."""
        return self._where[key][0][0][0] in self._by_motion_alone

    def gap(self, key: str) -> float:
        """Return the largest distance of two samples that are interpolated between [s]; more for a slow stream."""
        return self._gap(self._series[self._where[key][0][0]])

    def _gap(self, series: Series) -> float:
        steps = np.diff(series.stamp)
        limit = self._mapping.max_gap_s
        return max(limit, GAP_INTERVALS * float(np.median(steps)) / SECOND) if len(steps) else limit

    def _clean(self, streams: Mapping[str, Stream], stamps: Mapping[str, Integers]) -> dict[tuple[str, str], Series]:
        """Return the samples of each stream, or part of a table with rows of its own, the base first."""
        series_of: dict[tuple[str, str], Series] = {}
        self._columns: dict[tuple[str, str], list[str]] = {}
        span: tuple[int, int] | None = None
        steps: tuple[ClockStep, ...] = ()
        for name in (self.base, *(other for other in streams if other != self.base)):
            stream, stamp, arrival = streams[name], stamps[name], streams[name].arrival
            timed = stamp != _LOST
            if not timed.all():
                self.notes.append(f"{name}: {int((~timed).sum())} rows without time were left out")
            if name in self._tables and self._alone:
                stamp = self._in_a_row(stream, stamp, timed)
            for part, (columns, rows) in self._parts(stream, len(stamp)).items():
                rows = rows & timed
                index = np.flatnonzero(rows)
                if not len(index):
                    raise InputError(f"{name}: no row has a time")
                # the last column is the row as it was read
                values = [*(stream.columns[column][index] for column in columns), index]
                numbers, called = np.column_stack(values).astype(np.float64), f"{name} ({part})" if part else name
                came = None if arrival is None else arrival[index]
                known: dict[str, Any] = {"max_gap": self._mapping.max_gap_s, "span": span, "clock_steps": steps}
                series = clean_series(called, stamp[index], numbers, arrival=came, **known)
                gaps = tuple(gap for gap in series.report.gaps if gap[1] < 0.9 * _BETWEEN_RECORDINGS_S)
                series_of[name, part] = replace(series, report=replace(series.report, gaps=gaps))
                self._columns[name, part] = columns
                if name == self.base and not part:
                    span, steps = (int(series.stamp[0]), int(series.stamp[-1])), series.report.clock_steps
        return series_of

    def _parts(self, stream: Stream, count: int) -> dict[str, tuple[list[str], Flags]]:
        """Return the columns of a stream and their rows; those of a table at other rates apart, by quantity."""
        table, every = self._tables.get(stream.name), np.ones(count, dtype=bool)
        of: dict[str, list[str]] = {}
        for key, places in self._quantities.items():
            here = [place.column for place in places if place.stream == stream.name]
            if here:
                of[key] = list(dict.fromkeys(here))
        together = list(dict.fromkeys(column for columns in of.values() for column in columns))
        if table is None or table.column is None:
            return {"": (together, every)}
        there = {
            key: np.logical_or.reduce([np.isfinite(stream.columns[c].astype(np.float64)) for c in columns])
            for key, columns in of.items()
        }
        if _BASE not in of:
            parts = {key: (columns, there[key] if there[key].any() else every) for key, columns in of.items()}
            return parts or {"": (together, every)}
        base = there[_BASE]

        def lacks(some: Flags, others: Flags) -> bool:
            return bool((some & ~others).sum() > _OTHER_RATE_SHARE * some.sum())

        apart = [key for key, rows in there.items() if rows.any() and (lacks(base, rows) or lacks(rows, base))]
        if not apart or not base.any():
            return {"": (together, every)}
        self.notes.append(
            f"{stream.name}: {', '.join(apart)} were recorded at another rate than q_nominal, and brought onto its rows"
        )
        left = list(dict.fromkeys(column for key, columns in of.items() if key not in apart for column in columns))
        return {"": (left, base), **{key: (of[key], there[key]) for key in apart}}

    def _in_a_row(self, stream: Stream, stamp: Integers, timed: Flags) -> Integers:
        """Return stamps that rise where those of a table go back, far apart from the recording before."""
        known = stamp[timed]
        back = np.flatnonzero(np.diff(known) < 0) + 1
        begins = np.zeros(len(stamp), dtype=bool)
        begins[list(stream.starts[1:])] = True
        starts = np.flatnonzero(begins[timed][1:]) + 1
        unsaid = np.setdiff1d(back, starts)
        if len(unsaid):
            self.notes.append(
                f"{stream.name}: time goes back {len(unsaid)} time(s), first at row {unsaid[0]}; another recording "
                "begins there" + ("; are the rows shuffled?" if len(unsaid) > 5 else "")
            )
        back = np.union1d(back, starts[known[starts] <= known[starts - 1]])
        if not len(back):
            return stamp
        later = np.zeros(len(known), dtype=np.int64)
        later[back] = known[back - 1] - known[back] + min(_BETWEEN_RECORDINGS_S, 4 * 10**9 // len(back)) * SECOND
        moved = stamp.copy()
        moved[timed] = known + np.cumsum(later)
        return moved

    def _stamp_of(self, stream: Stream) -> Integers:
        """Return the stamps to go by [ns]: a table's time, a message's header where it has one, or its arrival."""
        name, own, came, mapping = stream.name, stream.stamp, stream.arrival, self._mapping
        if own is None:
            time = time_of(stream, mapping.time, mapping.time_unit, mapping.rate_hz, today=self._today)
            if time is None and not self._alone:
                raise InputError(
                    f"{name}: which column is the time? give time = ..., or rate_hz where rows are evenly apart; "
                    "streams with clocks of their own cannot be put together without"
                )
            note = "no column is the time: rows have none" if time is None else f"{name}: {time.said}"
            self.notes += [note] * (not mapping.name)
            self._tables[name] = time or TableTime(np.arange(stream.rows) * SECOND, None, "s", note)
            return self._tables[name].stamp
        if came is None:
            return own
        unset = own == 0
        if unset.all() or mapping.stamps == "arrival":
            if mapping.stamps == "header":
                raise InputError(f'{name}: its messages carry no stamps; give stamps = "arrival"')
            return np.zeros_like(came) if mapping.stamps == "auto" else came
        missing = unset & (came != 0)  # simulated time begins at zero, and what arrives then says so
        if missing.any():
            self.notes.append(f"{name}: {int(missing.sum())} messages carry no stamp; their arrival was taken")
        return np.where(missing, came, own)


def _restarts(stamp: Integers) -> list[int]:
    """Return the rows from which a file's clock may be another one: its first, and after steps back and pauses."""
    rows = np.flatnonzero(stamp != _LOST)
    steps = np.diff(stamp[rows])
    usual = float(np.median(np.abs(steps))) if len(steps) else 0.0
    edges = [0, *(1 + np.flatnonzero((steps < 0) | (steps > GAP_INTERVALS * usual))).tolist(), len(rows)]
    long = usual > 0.0 and min(np.diff(edges)) > _MIN_OVERLAP_S * SECOND / usual
    return [0, *rows[edges[1:-1]].tolist()] if long and len(edges) <= _MAX_PARTS + 1 else [0]


def _seconds(series: Series, origin: np.int64) -> str:
    first, last = (float(int(s) - int(origin)) / SECOND for s in (series.stamp[0], series.stamp[-1]))
    return f"{first:.3f} to {last:.3f} s"
