"""Parquet files of numbers, whose stated sizes are held against the file before their numbers are read."""

import os
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from catenary.archives import MAX_UNPACKED_BYTES, MAX_UNPACKED_RATIO
from catenary.bounded_parsers import reading

ARROW = (pa.ArrowException, OSError, MemoryError, ValueError, OverflowError)  # what Arrow raises over a file
MOST_COLUMNS = 5000  # a log of all that a RAVEN-II publishes has 400


def open_parquet(path: Path) -> pq.ParquetFile:
    """Open a file whose rows and pages take no more memory than a file of its size may."""
    with reading(path, "Parquet", ARROW):
        file = pq.ParquetFile(pa.OSFile(os.fsencode(path)), page_checksum_verification=True)
        about, size = file.metadata, path.stat().st_size
        if len(file.schema_arrow) > MOST_COLUMNS:
            raise ValueError(f"{len(file.schema_arrow)} columns, expected {MOST_COLUMNS} at most")
        limit = max(MAX_UNPACKED_BYTES, MAX_UNPACKED_RATIO * size)
        if 8 * about.num_rows * about.num_columns > limit:
            raise ValueError(f"{about.num_rows} rows of {about.num_columns} columns in {size} bytes")
        if sum(about.row_group(i).total_byte_size for i in range(about.num_row_groups)) > limit:
            raise ValueError(f"its pages would unpack to more than {limit} bytes")
    return file
