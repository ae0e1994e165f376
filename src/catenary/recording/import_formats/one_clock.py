"""The synchroniser: what was recorded at rates and by clocks of its own, at the stamps of q_nominal.

Topics of a bag, tables beside one another and the columns of one table are alike: samples with stamps, put in order,
and read on the straight line between their two neighbours in time. Steps of their clock are taken out, and files with
clocks of their own are brought onto that of q_nominal's.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from catenary.arrays import Flags, Floats, Integers
from catenary.errors import InputError
from catenary.recording.import_formats.columns import Place, Stream
from catenary.recording.import_formats.mapping import RecordingMapping
from catenary.recording.import_formats.series import GAP_INTERVALS, ClockStep, Series, clean_series, interpolate
from catenary.recording.import_formats.table_time import TableTime, time_of
from catenary.recording.import_formats.two_clocks import FileClock, NothingInCommonError, clock_by_motion
from catenary.topics import SECOND
from catenary.verdict.delay import TOLERANCE_S

DIFFERENT_CLOCKS_S = 1.0  # [s] between the clocks of two topics' stamps from which they are no one clock
_FIRST_DATED_NS = 10**9 * SECOND  # [ns] below which stamps count from a zero of their own
_BASE = "q_nominal"  # the quantity whose samples are the rows
# of a quantity's rows, or of q_nominal's: a table that lacks more of them has the two at rates of their own
_OTHER_RATE_SHARE = 0.5
_LOST = np.iinfo(np.int64).min  # stamp of a row without time
_BETWEEN_RECORDINGS_S = 10 * 24 * 3600  # [s] between recordings that stand one behind the other in a table


InSi = Callable[[Floats], Floats]  # makes of a quantity's columns (N, n) joints in rad, m, Nm and N


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
        in_si: Mapping[str, InSi],  # of joints' quantities
        units: tuple[str, ...],  # of the joints then
    ) -> None:
        """Clean the streams, by name; those that no quantity has columns of are only reported on."""
        self._quantities, self._mapping, self._today = quantities, mapping, today
        self.base = quantities[_BASE][0].stream
        self._alone = len(streams) == 1 and streams[self.base].stamp is None
        self._tables, self.notes = dict[str, TableTime](), list[str]()
        stamps = {name: self._stamp_of(stream) for name, stream in streams.items()}
        found = self._clean(streams, stamps)
        arrivals = {name: one.arrival for name, one in streams.items() if one.arrival is not None}
        headed = {name for name, one in streams.items() if one.stamp is not None and one.stamp.any()}
        headed = headed & arrivals.keys() if mapping.stamps != "arrival" else set[str]()
        offsets = {name: found[name, ""].report.clock_offset for name in arrivals if name in headed}
        spread = [*offsets.values(), *([0.0] if offsets and headed < arrivals.keys() else [])]
        if mapping.stamps == "auto" and spread and max(spread) - min(spread) > DIFFERENT_CLOCKS_S:
            said = ", ".join(f"{name} {offset:.3f} s" for name, offset in offsets.items())
            self.notes.append(
                f"stamps lie before arrival by {said}: clocks that differ; arrivals were taken for all topics"
            )
            found = self._clean(streams, stamps | arrivals)
        elif mapping.stamps == "arrival" and arrivals:
            self.notes.append("arrival times were taken, as asked")
        self._take(found)
        if clocks := self._clocks(streams, in_si, units):
            origin = int(found[self.base, ""].stamp[0])
            for name, clock in clocks.items():
                timed, came = stamps[name] != _LOST, streams[name].arrival
                stamps[name] = np.where(timed, clock.onto_base(stamps[name], origin), _LOST)
                moved = None if came is None else clock.onto_base(came, origin)
                streams = {**streams, name: replace(streams[name], arrival=moved)}
            found = self._clean(streams, stamps)
            self._take(found)
        series = found[self.base, ""]
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
        self.reports = tuple(one.report for one in found.values())
        self.notes += [note for report in self.reports for note in report.notes()]
        used = {place.stream for places in quantities.values() for place in places}
        for (name, _), one in found.items():
            if name in used and (one.stamp[-1] < self.stamp[0] or one.stamp[0] > self.stamp[-1]):
                raise InputError(
                    f"{name}: is of another time than {self.base}: {_seconds(one, self.stamp[0])} after its first, "
                    f"{_seconds(series, self.stamp[0])}; are the units of time different? --clock SECONDS,PPM says by "
                    "how much its clock is ahead, and gains"
                )

    def _take(self, found: dict[tuple[str, str], Series]) -> None:
        """Keep series, and of which part each column of a quantity is, with its place in it."""
        self._series = found
        self._where: dict[str, list[tuple[tuple[str, str], int]]] = {}
        for key, places in self._quantities.items():
            parts = [(place.stream, key if (place.stream, key) in found else "") for place in places]
            columns = [self._columns[part].index(place.column) for part, place in zip(parts, places, strict=True)]
            self._where[key] = list(zip(parts, columns, strict=True))

    def _clocks(
        self, streams: Mapping[str, Stream], in_si: Mapping[str, InSi], units: tuple[str, ...]
    ) -> dict[str, FileClock]:
        """Return the clocks of streams of other files than q_nominal's, as given, or by the motion; say them."""
        # topics of bags share a clock
        file_of = {name: name if stream.type == "table" else "bag" for name, stream in streams.items()}
        others = dict.fromkeys(file for file in file_of.values() if file != file_of[self.base])
        given, of = self._mapping.clocks, dict[str, FileClock]()
        if unknown := [file for file in given if not others or file not in ("", *others)]:
            known = f"expected {', '.join(others)}" if others else "none is read beside q_nominal's"
            named = " ".join(["no file", *filter(None, unknown[:1])])
            raise InputError(f"--clock: {named}: {known}")
        for file in others:
            stated = given.get(file, given.get(""))
            keys = [k for k in ("q_encoder", "q_reported") if k in in_si and file_of[self._where[k][0][0][0]] == file]
            if stated is not None:
                of[file] = FileClock(*stated)
                self.notes.append(f"{file}: {of[file]}")
            elif keys and (clock := self._by_motion(keys[0], file, in_si, units)) is not None:
                of[file] = clock
                self.notes.append(f"{file}: {clock}; taken onto q_nominal's (--clock 0,0 leaves it)")
        return {name: of[file_of[name]] for name in streams if file_of[name] in of}

    def _by_motion(self, key: str, file: str, in_si: Mapping[str, InSi], units: tuple[str, ...]) -> FileClock | None:
        """Return the clock of a file that saw the joints; None if it may well be that of q_nominal's."""
        base, its = self.samples(_BASE), self.samples(key)
        if base is None or its is None:
            return None
        base, its = (replace(one, values=in_si[k](one.values)) for one, k in ((base, _BASE), (its, key)))
        # two that count from zeros of their own are hardly one; of dated ones the motion must say so
        is_dated = min(base.stamp[0], its.stamp[0]) >= _FIRST_DATED_NS
        try:
            clock = clock_by_motion(base, its, units, file)
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
        found = {}
        for key, where in self._where.items():
            one = self._series[where[0][0]]
            if np.isfinite(one.report.clock_offset) and one.report.clock_offset != 0.0 and len(one.stamp) > 1:
                step = float(np.median(np.diff(one.stamp))) / SECOND
                found["q_encoder" if key == "pose" else key] = (one.report.clock_offset, step)
        return found

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

    def gap(self, key: str) -> float:
        """Return the largest distance of two samples that are interpolated between [s]; more for a slow stream."""
        return self._gap(self._series[self._where[key][0][0]])

    def _gap(self, series: Series) -> float:
        steps = np.diff(series.stamp)
        most = self._mapping.max_gap_s
        return max(most, GAP_INTERVALS * float(np.median(steps)) / SECOND) if len(steps) else most

    def _clean(self, streams: Mapping[str, Stream], stamps: Mapping[str, Integers]) -> dict[tuple[str, str], Series]:
        """Return the samples of each stream, or part of a table with rows of its own, the base first."""
        found: dict[tuple[str, str], Series] = {}
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
                found[name, part] = replace(series, report=replace(series.report, gaps=gaps))
                self._columns[name, part] = columns
                if name == self.base and not part:
                    span, steps = (int(series.stamp[0]), int(series.stamp[-1])), series.report.clock_steps
        return found

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
            said = "no column is the time: rows have none" if time is None else f"{name}: {time.said}"
            self.notes += [said] * (not mapping.name)
            self._tables[name] = time or TableTime(np.arange(stream.rows) * SECOND, None, "s", said)
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


def _seconds(series: Series, origin: np.int64) -> str:
    first, last = (float(int(s) - int(origin)) / SECOND for s in (series.stamp[0], series.stamp[-1]))
    return f"{first:.3f} to {last:.3f} s"
