"""Parquet files of numbers, whose stated sizes are held against the file before their numbers are read."""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from catenary.archives import MOST, RATIO
from catenary.documents import cut, reading, shortened
from catenary.errors import FileFormatError

ARROW = (pa.ArrowException, OSError, MemoryError, ValueError, OverflowError)  # what Arrow raises over a file
MOST_COLUMNS = 5000  # a log of all that a RAVEN-II publishes has 400


def open_parquet(path: Path) -> pq.ParquetFile:
    """Open a file whose rows and pages take no more memory than a file of its size may."""
    with reading(path, "Parquet", ARROW):
        file = pq.ParquetFile(path, page_checksum_verification=True)
        about, size = file.metadata, path.stat().st_size
        if len(file.schema_arrow) > MOST_COLUMNS:
            raise ValueError(f"{len(file.schema_arrow)} columns, expected {MOST_COLUMNS} at most")
        most = max(MOST, RATIO * size)
        if 8 * about.num_rows * about.num_columns > most:
            raise ValueError(f"{about.num_rows} rows of {about.num_columns} columns in {size} bytes")
        if sum(about.row_group(i).total_byte_size for i in range(about.num_row_groups)) > most:
            raise ValueError(f"its pages would unpack to more than {most} bytes")
    return file


def read_table(path: Path, file: pq.ParquetFile) -> pa.Table:
    """Read columns that all hold numbers or truth values."""
    names = list(file.schema_arrow.names)
    for name in names:
        if names.count(name) != 1:
            raise FileFormatError(f"{path}: column {shortened(name)} is there {names.count(name)} times, expected once")
        kind = file.schema_arrow.field(name).type
        if not (pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_boolean(kind)):
            raise FileFormatError(f"{path}: column {cut(name)} holds {cut(str(kind))}, expected numbers")
    with reading(path, "Parquet", ARROW):
        table = file.read(use_threads=False)
        table.validate(full=True)
    for name, column in zip(table.column_names, table.columns, strict=True):
        if column.null_count and not pa.types.is_floating(column.type):  # these become NaN
            raise FileFormatError(f"{path}: column {cut(name)} lacks {column.null_count} of its numbers")
    return table
