import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from catenary.errors import FileFormatError
from catenary.recording import parquet_files
from catenary.recording.import_formats.table_files import read_parquet_table
from catenary.recording.logs import FORMAT, read_log
from catenary.recording.parquet_files import open_parquet

ABOUT = {"format": FORMAT, "joint_names": ["a"], "joint_units": ["rad"]}


def _written(path: Path, columns: dict[str, object], about: object = ABOUT, **options: object) -> Path:
    table = pa.table(columns).replace_schema_metadata({"catenary": json.dumps(about)})
    pq.write_table(table, path, **options)
    return path


def test_columns_of_every_packing_are_read_as_pyarrow_does(tmp_path: Path) -> None:
    values = np.repeat(np.random.default_rng(1).normal(size=300), 20)
    for compression in ("none", "snappy", "zstd", "lz4", "gzip"):
        for version, dictionary in (("1.0", True), ("2.0", False)):
            path = tmp_path / "log.parquet"
            _written(
                path,
                {"x": values, "n": np.arange(6000)},
                compression=compression,
                data_page_version=version,
                use_dictionary=dictionary,
                data_page_size=2000,
                row_group_size=2500,
            )
            columns = read_parquet_table(path).columns
            np.testing.assert_array_equal(columns["x"], values)
            np.testing.assert_array_equal(columns["n"], np.arange(6000))


def test_rows_that_unpack_to_gigabytes_are_refused_before_they_do(tmp_path: Path) -> None:
    columns = {f"q_nominal:{i}": pa.DictionaryArray.from_arrays(np.zeros(2_000_000, np.int8), [0.5]) for i in range(9)}
    path = _written(tmp_path / "log.parquet", columns)
    assert path.stat().st_size < 100_000  # by runs: a few bytes for millions
    with pytest.raises(FileFormatError, match="2000000 rows of 9 columns in"):
        read_log(path)


def test_pages_that_unpack_too_far_are_refused_before_they_do(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(parquet_files, "MOST", 100_000)
    path = _written(tmp_path / "log.parquet", {"x": ["a" * 100_000, "b" * 100_000]}, compression="zstd")
    assert path.stat().st_size < 5000
    with pytest.raises(FileFormatError, match="its pages would unpack to more than 100000 bytes"):
        open_parquet(path)


def test_a_file_of_nonsense_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    for content in (b"", b"PAR1", b"PAR1" * 20, (2**32 - 1).to_bytes(4, "little") + b"PAR1"):
        path.write_bytes(content)
        with pytest.raises(FileFormatError, match="cannot be read as Parquet"):
            open_parquet(path)


def test_whole_numbers_with_gaps_are_refused(tmp_path: Path) -> None:
    columns = {"q_nominal:a": np.zeros(3), "ok": np.ones(3, dtype=bool), "stamp": pa.array([1, None, 3])}
    with pytest.raises(FileFormatError, match="column stamp lacks 1"):
        read_log(_written(tmp_path / "x.parquet", columns))
