"""Tables of text, with a line of names or without, as spreadsheets, MATLAB, NumPy, ROS and PlotJuggler write them.

Read in pieces, so that the memory that a table takes is that of the columns that are kept.
"""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
from numpy.typing import NDArray

from catenary.documents import reading
from catenary.errors import FileFormatError
from catenary.recording.import_formats.columns import Stream, joined
from catenary.recording.import_formats.text_dates import since_midnight
from catenary.recording.import_formats.text_head import NOTHING, TextColumn, TextHead, read_head
from catenary.recording.journal import About
from catenary.recording.parquet_files import ARROW
from catenary.topics import SECOND

MOST_LINE = 1_000_000  # characters
SAMPLED_NUMBERS = 4_000_000  # of a table that is not held whole that are looked at
_LOOKED_AT = 200  # lines by which separator, decimal sign and kinds of columns are told
_END = 65_536  # [B] at the end of a file that are looked at, too
_BLOCK = 4 << 20  # [B] that are read at a time
_COMMENTS = "comment lines among the rows were passed over"
_BEGINS = (b"#", b"%", b"//")  # of comments
_TYPES: Mapping[str, Any] = {"number": pa.float64(), "whole": pa.int64(), "truth": pa.bool_()}

Block = dict[str, NDArray[Any]]


class TextTable:
    """A table of text whose head was read; its rows are read when they are wanted."""

    about: About | None = None
    first_arrival = 0

    def __init__(self, path: Path, progress: Callable[[float], object] = lambda done: None) -> None:
        """Read its first and last lines; `progress` is told the share of the file that was read."""
        self.path, self._size, self._progress = path, path.stat().st_size, progress
        lines, ends, last, unended = _lines(path)
        self.head: TextHead = read_head(str(path), lines, last, unended)
        self._first_byte = ends[self.head.begins - 1] if self.head.begins else 0
        head, rows = self._first_byte, len(ends) - self.head.begins
        self._about_rows = round((self._size - head) / max(1.0, (ends[-1] - head) / rows)) if rows else 0
        self.counts = {path.stem: self._about_rows}
        self.notes = list(self.head.notes)  # and, once it was read, on rows that were passed over

    @property
    def problems(self) -> list[str]:
        """What was found among the rows; complete once they were read."""
        return [f"{self.path.stem}: {note}" for note in self.notes[len(self.head.notes) :]]

    def sample(self) -> list[Stream]:
        """Return its first rows."""
        held, count = list[Stream](), 0
        for part in self.streams():
            held.append(part)
            count += part.rows * len(part.columns)
            if count >= SAMPLED_NUMBERS:
                break
        stream = joined(held)
        notes = (*stream.notes, f"of about {self._about_rows} rows the first {stream.rows} were looked at")
        return [replace(stream, rows=self._about_rows, notes=notes)]

    def parts(self, wanted: Mapping[str, Collection[str]]) -> Iterator[list[Stream]]:
        """Yield columns, some thousand rows at a time."""
        return ([part] for part in self.streams(wanted[self.path.stem]))

    def streams(self, wanted: Collection[str] | None = None) -> Iterator[Stream]:
        """Yield the columns of numbers, or those of them that are wanted, some thousand rows at a time."""
        dates = tuple(column.name for column in self.head.columns if column.date is not None)
        told: dict[str, Any] = {"joints": self.head.joints, "dates": dates, "notes": tuple(self.head.notes)}
        for block in self.blocks(wanted):
            columns = {name: v if v.dtype.kind == "i" else v.astype(np.float64) for name, v in block.items()}
            yield Stream(self.path.stem, "table", columns, len(next(iter(columns.values()))), **told)

    def blocks(self, wanted: Collection[str] | None = None) -> Iterator[Block]:
        """Yield the same as plain arrays: dates as nanoseconds, whole numbers that no float64 can hold as such."""
        columns = [c for c in self.head.columns if c.kind != "text" and (wanted is None or c.name in wanted)]
        kinds = {str(place): _arrow_type(column) for column in columns for place in column.places}
        names = [str(i) for i in range(self.head.width)]
        # Arrow's pool of threads aborts one process in a hundred as it ends
        read = pa.csv.ReadOptions(use_threads=False, column_names=names, block_size=4 * _BLOCK)
        passed = Counter[str]()
        parse = pa.csv.ParseOptions(delimiter=self.head.dialect.separator)
        convert = pa.csv.ConvertOptions(
            column_types=kinds, include_columns=list(kinds), null_values=list(NOTHING), strings_can_be_null=True,
            decimal_point=self.head.dialect.decimal,
            true_values=["true", "True", "TRUE"], false_values=["false", "False", "FALSE"],
        )  # fmt: skip
        carried: dict[str, tuple[int, int | None]] = {}
        with reading(self.path, "CSV", ARROW), self.path.open("rb") as file:
            file.seek(self._first_byte)
            for rows in self._rows(file, passed):
                batches = pa.csv.read_csv(pa.BufferReader(rows), read, parse, convert).combine_chunks().to_batches()
                if wanted is not None:  # not of a sample
                    self._progress(min(1.0, file.tell() / self._size))
                for batch in batches:
                    yield {column.name: _numbers(column, batch, carried) for column in columns}
        said = [f"{count} {what}" for what, count in passed.items() if count]
        said += ["its last line is torn, and was left out"] * bool(self.head.torn)
        self.notes += [note for note in said if note not in self.notes]

    def _rows(self, file: BinaryIO, passed: Counter[str]) -> Iterator[bytes]:
        """Yield some MB of rows at a time: without comments, heads that come again, and a torn last line."""
        heads = {head.encode() for head in self.head.heads}
        begins = [b"\n" + begin for begin in (*_BEGINS, *heads)]
        is_blank, left = self.head.dialect.separator == " ", b""
        while True:
            block = file.read(_BLOCK)
            data = left + block
            end = data.rfind(b"\n") + 1 if block or self.head.torn else len(data)
            data, left = data[:end], data[end:]
            if is_blank or any(begin in data for begin in begins) or data.startswith((*_BEGINS, *heads)):
                lines = []
                for line in data.split(b"\n"):
                    bare = line.strip()
                    if bare.startswith(_BEGINS):
                        passed[_COMMENTS] += 1
                    elif bare in heads:
                        passed["lines of names among the rows were passed over"] += 1
                    else:
                        lines.append(b" ".join(line.split()) if is_blank else line)
                data = b"\n".join(lines)
            if data.strip():
                yield data
            if not block:
                return


def _arrow_type(column: TextColumn) -> pa.DataType:
    if column.date is not None:
        zone = "UTC" if column.date.has_zone else None
        return pa.timestamp("ns", tz=zone) if column.date.is_iso and len(column.places) == 1 else pa.string()
    return _TYPES[column.kind]


def _numbers(column: TextColumn, batch: pa.RecordBatch, carried: dict[str, tuple[int, int | None]]) -> NDArray[Any]:
    """Return a column's cells in a batch as numbers; NaN where there is none."""
    cells = [batch.column(str(place)) for place in column.places]
    one = cells[0]
    if column.kind == "whole" and len(cells) == 2:  # seconds and nanoseconds
        one = pc.add(pc.multiply(cells[0], SECOND), cells[1])
    elif column.date is not None and pa.types.is_timestamp(one.type):
        one = one.cast(pa.int64())
    elif column.date is not None:
        one = column.date.nanoseconds(one if len(cells) == 1 else pc.binary_join_element_wise(*cells, " "))
        one, carried[column.name] = since_midnight(one, column.date, carried.get(column.name, (0, None)))
    values: NDArray[Any] = one.to_numpy(zero_copy_only=False)
    return values.astype(np.float64) if values.dtype.kind == "O" else values  # truth values, and some missing


def _lines(path: Path) -> tuple[list[str], list[int], list[str], str]:
    """Return a file's first lines, where each ends [B], its last lines, and apart the very last if it has no end."""
    try:
        with path.open("rb") as file:
            lines = [file.readline(MOST_LINE + 1) for _ in range(_LOOKED_AT)]
            end, size = file.tell(), path.stat().st_size
            file.seek(max(end, size - _END))
            behind = file.read()
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be read: {error.strerror}") from error
    if any(len(line) > MOST_LINE for line in lines):
        raise FileFormatError(f"{path}: a line of more than {MOST_LINE} bytes; is this a CSV?")
    if lines[0][:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise FileFormatError(f"{path}: is UTF-16, expected UTF-8")
    if any(b"\0" in line for line in lines):
        raise FileFormatError(f"{path}: holds bytes that are no text, expected CSV")
    if any(b"\r" in line.rstrip(b"\r\n") for line in lines):
        raise FileFormatError(f"{path}: its lines end in carriage returns alone, expected line feeds")
    ends = np.cumsum([len(line) for line in lines]).tolist()
    last = behind.split(b"\n")[1 if size - _END > end else 0 :]
    try:
        first = [line.decode().rstrip("\r\n") for line in lines if line]
        texts = [line.decode(errors="replace").rstrip("\r\n") for line in last]
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path}: is no UTF-8 text: {error}") from error
    is_unended, where = not (behind or b"".join(lines)).endswith(b"\n"), texts if behind else first
    unended = where.pop() if is_unended and where else ""
    return first, ends, [text for text in texts if text.strip()], unended
