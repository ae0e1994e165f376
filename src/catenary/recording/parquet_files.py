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
_HEADER = 2**16  # [B] of a page's header, which may hold its least and largest value
# fields of a page's header [parquet.thrift, PageHeader]
_UNPACKED_SIZE, _PACKED_SIZE = 2, 3


def open_parquet(path: Path) -> pq.ParquetFile:
    """Open a file after a look at its directory and at the header of each page.

    Raises:
        FileFormatError: No Parquet, a page lies beyond the file, or rows and columns or pages would unpack to more than
            `archives.MOST` bytes and `archives.RATIO` times the file.
    """
    try:
        file = pq.ParquetFile(path, page_checksum_verification=True)
        _check(path, file.metadata)
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
    """Read columns that all hold numbers or truth values; None for all.

    Raises:
        FileFormatError: Damaged, a column is not there or twice, holds something else, or whole numbers have gaps.
    """
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


def _check(path: Path, metadata: Any) -> None:
    size = path.stat().st_size
    most = max(MOST, RATIO * size)
    if not 0 <= metadata.num_columns <= MOST_COLUMNS:
        raise ValueError(f"{metadata.num_columns} columns, expected {MOST_COLUMNS} at most")
    groups = [metadata.row_group(i) for i in range(metadata.num_row_groups)]
    rows = sum(group.num_rows for group in groups)
    if any(group.num_rows < 0 for group in groups) or rows != metadata.num_rows:
        raise ValueError(f"{metadata.num_rows} rows, and {rows} in its row groups")
    if 8 * rows * metadata.num_columns > most:
        raise ValueError(f"{rows} rows of {metadata.num_columns} columns in {size} bytes")
    if len(groups) * metadata.num_columns > size // 8:
        raise ValueError(f"{len(groups)} row groups of {metadata.num_columns} columns in {size} bytes")
    with path.open("rb") as file:
        for group in groups:
            for i in range(metadata.num_columns):
                for unpacked in _pages(file, group.column(i), size):
                    most -= unpacked
                    if most < 0:
                        raise ValueError(
                            f"its pages would unpack to more than {max(MOST, RATIO * size)} bytes"
                        )


def _pages(file: BinaryIO, column: Any, size: int) -> Iterator[int]:
    """Yield how many bytes each page of a column unpacks to."""
    position = column.data_page_offset
    if column.has_dictionary_page and column.dictionary_page_offset:
        position = min(position, column.dictionary_page_offset)
    end = position + column.total_compressed_size
    if not 4 <= position <= end <= size:
        raise ValueError(f"a column from byte {position} to {end}, the file has {size}")
    while position < end:
        file.seek(position)
        header = _Thrift(file.read(min(_HEADER, end - position)))
        fields = header.struct()
        unpacked, packed = fields.get(_UNPACKED_SIZE, -1), fields.get(_PACKED_SIZE, -1)
        position += header.position + packed
        if unpacked < 0 or packed < 0 or position > end:
            raise ValueError(
                f"a page of {packed} bytes, unpacked {unpacked}, that ends at byte {position} of {end}"
            )
        yield unpacked


class _Thrift:
    """Reads Thrift's compact protocol as far as lengths need it: whole numbers are kept, the rest is skipped.

    [thrift.apache.org, thrift-compact-protocol.md]
    """

    def __init__(self, data: bytes) -> None:
        self._data, self.position = data, 0

    def struct(self, depth: int = 0) -> dict[int, int]:
        """Return the whole numbers of a struct by the numbers of their fields."""
        if depth > 8:
            raise ValueError("a page's header is nested too deep")
        numbers: dict[int, int] = {}
        number = 0
        while head := self._byte():
            kind = head & 0x0F
            number = number + (head >> 4) if head >> 4 else self._whole()
            value = self._value(kind, depth)
            if value is not None:
                numbers[number] = value
        return numbers

    def _byte(self) -> int:
        if self.position >= len(self._data):
            raise ValueError("a page's header is cut off")
        self.position += 1
        return self._data[self.position - 1]

    def _unsigned(self) -> int:
        value = 0
        for shift in range(0, 70, 7):
            byte = self._byte()
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                return value
        raise ValueError("a number in a page's header is too long")

    def _whole(self) -> int:
        value = self._unsigned()
        return (value >> 1) ^ -(value & 1)

    def _value(self, kind: int, depth: int) -> int | None:
        if kind in (1, 2):  # true, false
            return None
        if kind == 3:
            self._byte()
        elif kind in (4, 5, 6):
            return self._whole()
        elif kind == 7:
            self.position += 8
        elif kind == 8:
            length = self._unsigned()
            self.position += length
        elif kind == 12:
            self.struct(depth + 1)
        else:
            raise ValueError(f"a page's header holds a value of kind {kind}")
        return None
