"""Streams of a recording on one clock: cleaned as topics of a robot are, and read at the stamps of one of them."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.recording.clock_steps import ClockStep
from catenary.recording.import_formats.columns import Place, Stream
from catenary.recording.import_formats.mapping import RecordingMapping
from catenary.recording.import_formats.table_time import time_of
from catenary.recording.series import WIDE, Series, clean_series, interpolate
from catenary.recording.topics import SECOND

APART = 1.0  # [s] between the clocks of two topics' stamps from which on they are no one clock
_LOST = np.iinfo(np.int64).min  # stamp of a row without time


class StreamStamps(NamedTuple):
    """Stamps of streams on one clock."""

    stamp: dict[str, NDArray[np.int64]]  # [ns]
    arrival: dict[str, NDArray[np.int64] | None]
    notes: list[str]


def stamps_of(streams: Mapping[str, Stream], mapping: RecordingMapping) -> StreamStamps:
    """Return the stamps to go by: a table's time, a message's header where it has one, or its arrival.

    Headers are left for arrivals in all topics when the headers of two differ by more than a second from the arrivals,
    each by another time: they are then of clocks that nobody set.
    """
    notes: list[str] = []
    stamp: dict[str, NDArray[np.int64]] = {}
    arrival: dict[str, NDArray[np.int64] | None] = {}
    offsets: dict[str, float] = {}
    for name, stream in streams.items():
        if stream.arrival is None or stream.stamp is None:
            time = time_of(stream, mapping.time, mapping.time_unit, mapping.rate_hz)
            if time is None:
                raise InputError(
                    f"{name}: which column is the time? give time = ..., or rate_hz where rows are evenly apart; "
                    "streams with clocks of their own cannot be put together without"
                )
            stamp[name], arrival[name] = time.stamp, None
            notes.append(f"{name}: {time.said}")
            continue
        own, came = stream.stamp, stream.arrival
        missing = own == 0
        if missing.all() or mapping.stamps == "arrival":
            if mapping.stamps == "header":
                raise InputError(f'{name}: its messages carry no stamps; give stamps = "arrival"')
            stamp[name], arrival[name] = np.zeros_like(came) if mapping.stamps == "auto" else came, came
            continue
        if missing.any():
            own = np.where(missing, came, own)
            notes.append(f"{name}: {int(missing.sum())} messages carry no stamp; their arrival was taken")
        stamp[name], arrival[name] = own, came
        offsets[name] = float(np.median(came - own)) / SECOND
    unstamped = [n for n in streams if n not in offsets and arrival[n] is not None]
    spread = [*offsets.values(), *([0.0] if unstamped and offsets else [])]
    if mapping.stamps == "auto" and spread and max(spread) - min(spread) > APART:
        said = ", ".join(f"{name} {offset:.3f} s" for name, offset in offsets.items())
        notes.append(
            f"stamps lie before arrival by {said}: clocks that differ; arrivals were taken for all topics"
        )
        stamp |= {name: came for name, came in arrival.items() if came is not None}
    elif mapping.stamps == "arrival" and offsets == {} and any(c is not None for c in arrival.values()):
        notes.append("arrival times were taken, as asked")
    return StreamStamps(stamp, arrival, notes)


class OneClock:
    """Streams that can be read at the stamps of one of them."""

    def __init__(
        self,
        streams: Mapping[str, Stream],
        wanted: Mapping[str, Sequence[str]],
        base: str,
        mapping: RecordingMapping,
    ) -> None:
        """Clean the streams.

        Args:
            streams: By name.
            wanted: Columns of each.
            base: The stream whose samples are the rows.
            mapping: Clock and gaps.
        """
        stamps = stamps_of(streams, mapping)
        self.notes = stamps.notes
        self._index = {name: {column: i for i, column in enumerate(wanted[name])} for name in streams}
        self.series: dict[str, Series] = {}
        span: tuple[int, int] | None = None
        steps: tuple[ClockStep, ...] = ()
        for name in (base, *(other for other in streams if other != base)):
            stream, stamp, arrival = streams[name], stamps.stamp[name], stamps.arrival[name]
            values = np.column_stack([stream.columns[column] for column in wanted[name]]).astype(np.float64)
            timed = stamp != _LOST
            if not timed.all():
                self.notes.append(f"{name}: {int((~timed).sum())} rows without time were left out")
                stamp, values = stamp[timed], values[timed]
            self.series[name] = clean_series(
                name, stamp, values, max_gap=mapping.max_gap_s, arrival=arrival, span=span, clock_steps=steps
            )
            if name == base:
                clean = self.series[name]
                span, steps = (int(clean.stamp[0]), int(clean.stamp[-1])), clean.report.clock_steps
        self.base = base
        self.stamp = self.series[base].stamp
        self._max_gap = mapping.max_gap_s
        self._at: dict[str, Floats] = {}
        for name, series in self.series.items():
            self.notes += series.report.notes()
            if series.stamp[-1] < self.stamp[0] or series.stamp[0] > self.stamp[-1]:
                raise InputError(
                    f"{name}: is of another time than {base}: {_seconds(series, self.stamp[0])} after its first, "
                    f"{_seconds(self.series[base], self.stamp[0])}; are the clocks or units of time different?"
                )

    @property
    def time(self) -> Floats:
        """Stamps of the rows from the first one on (N,) [s]."""
        return np.asarray((self.stamp - self.stamp[0]) / SECOND, dtype=np.float64)

    def gap(self, name: str) -> float:
        """Return how far apart two samples may be that are interpolated between [s]; more for a slow stream."""
        steps = np.diff(self.series[name].stamp)
        return max(self._max_gap, WIDE * float(np.median(steps)) / SECOND) if len(steps) else self._max_gap

    def rows(self, places: Sequence[Place]) -> Floats:
        """Return columns at the stamps of the base, (N, k); NaN in gaps."""
        return np.column_stack([self._column(place) for place in places])

    def samples(self, places: Sequence[Place]) -> Series | None:
        """Return columns at their own stamps; None where they are of several streams."""
        names = {place.stream for place in places}
        if len(names) != 1:
            return None
        series = self.series[names.pop()]
        columns = [self._index[place.stream][place.column] for place in places]
        return Series(series.stamp, series.values[:, columns], series.report)

    def _column(self, place: Place) -> NDArray[Any]:
        if place.stream not in self._at:
            series = self.series[place.stream]
            same = place.stream == self.base
            self._at[place.stream] = (
                series.values if same else interpolate(series, self.stamp, self.gap(place.stream))[0]
            )
        column: NDArray[Any] = self._at[place.stream][:, self._index[place.stream][place.column]]
        return column


def _seconds(series: Series, origin: np.int64) -> str:
    first, last = (float(int(s) - int(origin)) / SECOND for s in (series.stamp[0], series.stamp[-1]))
    return f"{first:.3f} to {last:.3f} s"
