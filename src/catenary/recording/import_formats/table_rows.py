"""Rows of one table that holds all quantities: they are one clock's already, and stay as they are."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.recording.import_formats.columns import Place, Stream
from catenary.recording.import_formats.mapping import RecordingMapping
from catenary.recording.import_formats.table_time import time_of
from catenary.recording.series import Series, clean_series
from catenary.recording.topics import SECOND

_LOST = np.iinfo(np.int64).min


class TableRows:
    """A table's rows in the order of the file; one whose time goes back begins another recording."""

    def __init__(self, stream: Stream, mapping: RecordingMapping) -> None:
        """Find the time of the rows; those without time, or whose time repeats the row's before, are left out."""
        self.notes: list[str] = []
        self._stream = stream
        self._keep = np.ones(stream.rows, dtype=bool)
        time = time_of(stream, mapping.time, mapping.time_unit, mapping.rate_hz)
        self.time: Floats | None = None
        self.stamp: NDArray[np.int64] = np.arange(stream.rows) * SECOND
        if time is None:
            self.notes.append("no column is the time: rows have none")
            return
        self.notes.append(f"{stream.name}: {time.said}")
        timed = time.stamp != _LOST
        repeated = np.zeros(len(timed), dtype=bool)
        repeated[1:] = np.diff(time.stamp) == 0
        for what, lost in (("without time", ~timed), ("with the time of the row before", timed & repeated)):
            if lost.any():
                self.notes.append(f"{stream.name}: {int(lost.sum())} rows {what} were left out")
        self._keep = timed & ~repeated
        self.stamp = time.stamp[self._keep]
        if len(self.stamp) == 0:
            raise InputError(f"{stream.name}: no row has a time")
        self.time = (self.stamp - self.stamp[0]) / SECOND
        back = np.flatnonzero(np.diff(self.stamp) < 0) + 1
        if len(back):
            self.notes.append(
                f"{stream.name}: time goes back {len(back)} time(s), first at row {back[0]}; another recording begins "
                "there" + ("; are the rows shuffled?" if len(back) > 5 else "")
            )

    def gap(self, name: str) -> float:
        """Return 0: rows are not interpolated between [s]."""
        return 0.0

    def rows(self, places: Sequence[Place]) -> Floats:
        """Return columns, (N, k)."""
        columns = [self._stream.columns[place.column][self._keep] for place in places]
        return np.column_stack(columns).astype(np.float64)

    def samples(self, places: Sequence[Place]) -> Series | None:
        """Return columns with their stamps, in order of time."""
        return clean_series(self._stream.name, self.stamp, self.rows(places), max_gap=1.0)
