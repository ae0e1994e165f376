"""Parquet files of numbers, whose sizes are held against the file before pyarrow reads them."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import pyarrow as pa
import pyarrow.parquet as pq

from catenary.archives import MOST, RATIO
from catenary.documents import cut, shortened
from catenary.errors import FileFormatError

MOST_COLUMNS = 5000  # a log of all that a RAVEN-II publishes has 400
DEEPEST = 16  # structs and lists within each other in its directory
_HEADER = 2**16  # [B] of a page's header, which may hold its least and largest value
# numbers of fields [parquet.thrift]: of FileMetaData, RowGroup, ColumnChunk, ColumnMetaData, PageHeader
_ALL_ROWS, _ROW_GROUPS = 3, 4
_COLUMNS, _ROWS = 1, 3
_ABOUT = 3
_CHUNK_LENGTH, _PAGES_AT, _DICTIONARY_AT = 7, 9, 11
_UNPACKED_SIZE, _PACKED_SIZE = 2, 3
_TRUE, _FALSE = 1, 2  # kinds of values in Thrift's compact protocol


def open_parquet(path: Path) -> pq.ParquetFile:
    """Open a file after a look at its directory and at the header of each page."""
    try:
        _check(path)
        file = pq.ParquetFile(path, page_checksum_verification=True)
        if len(file.schema_arrow) > MOST_COLUMNS:  # its directory counts those that hold rows
            raise ValueError(f"{len(file.schema_arrow)} columns, expected {MOST_COLUMNS} at most")
    except (pa.ArrowException, OSError, MemoryError, ValueError, OverflowError) as error:
        if isinstance(error, FileFormatError):
            raise
        raise FileFormatError(f"{path}: cannot be read as Parquet: {cut(str(error))}") from error
    return file


def read_table(
    path: Path,
    file: pq.ParquetFile,
    columns: Sequence[str] | None = None,
    groups: Sequence[int] | None = None,
) -> pa.Table:
    """Read columns that all hold numbers or truth values; None for all."""
    names = list(file.schema_arrow.names)
    wanted = names if columns is None else list(columns)
    for name in wanted:
        if names.count(name) != 1:
            raise FileFormatError(
                f"{path}: column {shortened(name)} is there {names.count(name)} times, expected once"
            )
        kind = file.schema_arrow.field(name).type
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind)):
            raise FileFormatError(f"{path}: column {cut(name)} holds {cut(str(kind))}, expected numbers")
    try:
        table = file.read_row_groups(range(file.num_row_groups) if groups is None else groups, columns=wanted)
        table.validate(full=True)
    except (pa.ArrowException, OSError, MemoryError, ValueError, OverflowError) as error:
        raise FileFormatError(f"{path}: cannot be read as Parquet: {cut(str(error))}") from error
    for name, column in zip(table.column_names, table.columns, strict=True):
        if column.null_count and not pa.types.is_floating(column.type):  # these become NaN
            raise FileFormatError(f"{path}: column {cut(name)} lacks {column.null_count} of its numbers")
    return table


def _check(path: Path) -> None:
    """Check the directory at a file's end and the head of each page; pyarrow itself can end the program over these."""
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(max(0, size - 8))
        end = file.read(8)
        length = int.from_bytes(end[:4], "little")
        if end[4:] != b"PAR1" or length + 12 > size:
            raise ValueError("no Parquet ends like that")
        file.seek(size - 8 - length)
        directory = _Thrift(file.read(length)).struct()
        most = max(MOST, RATIO * size)
        for unpacked in _pages(file, directory, size, most):
            most -= unpacked
            if most < 0:
                raise ValueError(f"its pages would unpack to more than {max(MOST, RATIO * size)} bytes")


def _pages(file: BinaryIO, directory: dict[int, Any], size: int, most: int) -> Iterator[int]:
    """Yield how many bytes each page unpacks to, once rows and columns were checked."""
    groups = [_struct(group) for group in _list(directory.get(_ROW_GROUPS))]
    chunks = [[_struct(chunk) for chunk in _list(group.get(_COLUMNS))] for group in groups]
    rows = [_length(group.get(_ROWS)) for group in groups]
    if sum(rows) != directory.get(_ALL_ROWS):
        raise ValueError(f"{directory.get(_ALL_ROWS)} rows, and {sum(rows)} in its row groups")
    width = max(map(len, chunks), default=0)
    if width > MOST_COLUMNS:
        raise ValueError(f"{width} columns, expected {MOST_COLUMNS} at most")
    if 8 * sum(rows) * width > most:
        raise ValueError(f"{sum(rows)} rows of {width} columns in {size} bytes")
    for chunk in (chunk for group in chunks for chunk in group):
        about = _struct(chunk.get(_ABOUT))
        begin = _length(about.get(_PAGES_AT))
        if about.get(_DICTIONARY_AT):
            begin = min(begin, _length(about[_DICTIONARY_AT]))
        yield from _column_pages(file, begin, begin + _length(about.get(_CHUNK_LENGTH)), size)


def _column_pages(file: BinaryIO, position: int, end: int, size: int) -> Iterator[int]:
    if not 4 <= position <= end <= size:
        raise ValueError(f"a column from byte {position} to {end}, the file has {size}")
    while position < end:
        file.seek(position)
        header = _Thrift(file.read(min(_HEADER, end - position)))
        fields = header.struct()
        unpacked, packed = _length(fields.get(_UNPACKED_SIZE)), _length(fields.get(_PACKED_SIZE))
        position += header.position + packed
        if position > end:
            raise ValueError(f"a page that ends at byte {position}, its column at {end}")
        yield unpacked


def _struct(value: object) -> dict[int, Any]:
    if not isinstance(value, dict):
        raise ValueError("its directory lacks a part")
    return value


def _list(value: object) -> list[Any]:
    if not isinstance(value, list):
        raise ValueError("its directory lacks a list")
    return value


def _length(value: object) -> int:
    if not isinstance(value, int) or value < 0:
        raise ValueError(f"a length of {shortened(value)}")
    return value


class _Thrift:
    """Reads Thrift's compact protocol as far as lengths need it: whole numbers, structs and lists; the rest is skipped.

    [thrift.apache.org, thrift-compact-protocol.md]
    """

    def __init__(self, data: bytes) -> None:
        self._data, self.position = data, 0

    def struct(self, depth: int = 0) -> dict[int, Any]:
        """Return the values of a struct by the numbers of their fields."""
        if depth > DEEPEST:
            raise ValueError(f"its directory is nested more than {DEEPEST} levels deep")
        values: dict[int, Any] = {}
        number = 0
        while head := self._byte():
            number = number + (head >> 4) if head >> 4 else self._whole()
            kind = head & 0x0F
            if kind not in (_TRUE, _FALSE):
                values[number] = self._value(kind, depth)
        return values

    def _byte(self) -> int:
        if self.position >= len(self._data):
            raise ValueError("its directory, or a page's header, is cut off")
        self.position += 1
        return self._data[self.position - 1]

    def _unsigned(self) -> int:
        value = 0
        for shift in range(0, 70, 7):
            byte = self._byte()
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value
        raise ValueError("a number in its directory is too long")

    def _whole(self) -> int:
        value = self._unsigned()
        return (value >> 1) ^ -(value & 1)

    def _skip(self, length: int) -> None:
        if length > len(self._data) - self.position:
            raise ValueError(f"{length} bytes in its directory go beyond it")
        self.position += length

    def _value(self, kind: int, depth: int) -> Any:
        if kind in (_TRUE, _FALSE, 3):  # a byte each, in lists
            self._skip(1)
        elif kind in (4, 5, 6):
            return self._whole()
        elif kind == 7:
            self._skip(8)
        elif kind == 8:
            self._skip(self._unsigned())
        elif kind in (9, 10):
            if depth > DEEPEST:
                raise ValueError(f"its directory is nested more than {DEEPEST} levels deep")
            head = self._byte()
            count = head >> 4 if head >> 4 < 15 else self._unsigned()
            self._skip(0 if count <= len(self._data) - self.position else count)  # a byte each, at least
            return [self._value(head & 0x0F, depth + 1) for _ in range(count)]
        elif kind == 12:
            return self.struct(depth + 1)
        else:
            raise ValueError(f"its directory holds a value of kind {kind}")
        return None
