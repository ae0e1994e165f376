"""Tables of text, with a line of names or without, as spreadsheets, MATLAB, NumPy, ROS and PlotJuggler write them.

Read in pieces, so that the memory that a table takes is that of the columns that are kept.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
from numpy.typing import NDArray

from catenary.documents import cut
from catenary.errors import FileFormatError
from catenary.recording.import_formats.text_dates import since_midnight
from catenary.recording.import_formats.text_head import COMMENT, NOTHING, TextColumn, TextHead, read_head
from catenary.topics import SECOND

MOST_LINE = 1_000_000  # characters
_LOOKED_AT = 200  # lines by which separator, decimal sign and kinds of columns are told
_END = 65_536  # [B] at the end of a file that are looked at, too
_BLOCK = 4 << 20  # [B] that are read at a time
_TYPES: Mapping[str, Any] = {"number": pa.float64(), "whole": pa.int64(), "truth": pa.bool_()}

Block = dict[str, NDArray[Any]]


class TextTable:
    """A table of text, opened: its head was read."""

    def __init__(self, path: Path) -> None:
        """Read its first and last lines."""
        self.path, self._size = path, path.stat().st_size
        lines, ends, last, is_torn = _lines(path)
        self.head: TextHead = read_head(str(path), lines, last)
        self._first_byte = ends[self.head.begins - 1] if self.head.begins else 0
        head, rows = self._first_byte, len(ends) - self.head.begins
        self.about_rows = round((self._size - head) / max(1.0, (ends[-1] - head) / rows)) if rows else 0
        self._torn = (last or lines or [""])[-1] if is_torn else ""
        self.notes = list(self.head.notes)  # and, once it was read, on rows that were passed over

    def blocks(
        self, wanted: Collection[str] | None = None, progress: Callable[[float], object] = lambda done: None
    ) -> Iterator[Block]:
        """Yield the columns of numbers, or those of them that are wanted, some thousand rows at a time.

        Dates become nanoseconds. Whole numbers that a float64 cannot hold, such as stamps in nanoseconds, stay whole.
        `progress` is told the share of the file that was read.
        """
        columns = [c for c in self.head.columns if c.kind != "text" and (wanted is None or c.name in wanted)]
        kinds = {str(place): _arrow_type(column) for column in columns for place in column.places}
        read = pa.csv.ReadOptions(column_names=[str(i) for i in range(self.head.width)], block_size=_BLOCK)
        comments, torn = [0], [0]

        def passed_over(row: Any) -> str:
            comments[0] += bool(COMMENT.match(row.text))
            torn[0] += row.text == self._torn
            return "skip" if COMMENT.match(row.text) or row.text == self._torn else "error"

        parse = pa.csv.ParseOptions(delimiter=self.head.dialect.separator, invalid_row_handler=passed_over)
        convert = pa.csv.ConvertOptions(
            column_types=kinds, include_columns=list(kinds), null_values=list(NOTHING), strings_can_be_null=True,
            decimal_point=self.head.dialect.decimal,
            true_values=["true", "True", "TRUE"], false_values=["false", "False", "FALSE"],
        )  # fmt: skip
        carried: dict[str, tuple[int, int | None]] = {}
        try:
            with pa.OSFile(str(self.path)) as file:
                file.seek(self._first_byte)
                source = file if self.head.dialect.separator != " " else pa.PythonFile(_OneBlank(file), "r")
                for batch in pa.csv.open_csv(source, read, parse, convert):
                    progress(min(1.0, file.tell() / self._size))
                    if batch.num_rows:
                        yield {column.name: _numbers(column, batch, carried) for column in columns}
        except (pa.ArrowException, OSError, MemoryError, ValueError) as error:
            raise FileFormatError(f"{self.path}: cannot be read as CSV: {cut(str(error))}") from error
        said = [f"{comments[0]} comment lines among the rows were passed over"] * bool(comments[0])
        said += ["its last line is torn, and was left out"] * bool(torn[0])
        self.notes += [note for note in said if note not in self.notes]


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


class _OneBlank:
    """A file whose rows are parted by any number of blanks and tabs, read as if by one."""

    def __init__(self, file: pa.OSFile) -> None:
        self._file, self._left, self.closed = file, b"", False

    def read(self, size: int = -1) -> bytes:
        """Return about as many bytes of whole lines; none at the end."""
        while True:
            block = self._file.read(size // 2)  # no more than was asked for, with what is left of the last one
            data = self._left + block
            cut_at = data.rfind(b"\n") + 1 if block else len(data)
            data, self._left = data[:cut_at], data[cut_at:]
            if data or not block:
                return b"\n".join(b" ".join(line.split()) for line in data.split(b"\n"))

    def readable(self) -> bool:
        """Return that it can be read."""
        return True


def _lines(path: Path) -> tuple[list[str], list[int], list[str], bool]:
    """Return a file's first lines, where each ends [B], its last lines, and whether the very last has no end."""
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
    ends = np.cumsum([len(line) for line in lines]).tolist()
    is_torn = not (behind or b"".join(lines)).endswith(b"\n") and size > 0
    last = behind.split(b"\n")[1 if size - _END > end else 0 :]
    try:
        first = [line.decode().rstrip("\r\n") for line in lines if line]
        texts = [line.decode(errors="replace").rstrip("\r\n") for line in last]
        return first, ends, [text for text in texts if text.strip()], is_torn
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path}: is no UTF-8 text: {error}") from error
