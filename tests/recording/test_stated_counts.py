"""Files of a few hundred bytes that state counts of millions are refused before room is made for them."""

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.typing import NDArray
from scipy.io import savemat

from catenary.errors import CatenaryError
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.samples import prepare
from catenary.recording.import_formats.table_files import read_table_file
from catenary.recording.logs import read_log, read_torque_log
from catenary.robots.catalog import load_robot

PANDA = load_robot("panda")


def none(width: int) -> NDArray[np.float64]:
    return np.empty((0, width))


def saved(folder: Path, **arrays: Any) -> Path:
    np.savez(folder / "log.npz", **arrays)
    return folder / "log.npz"


def many_columns(folder: Path) -> Path:
    pq.ParquetWriter(folder / "log.parquet", pa.schema([(f"c{i}", pa.float64()) for i in range(20_000)])).close()
    return folder / "log.parquet"


def cells(folder: Path) -> Path:
    content = np.empty((1, 3), dtype=object)
    content[:] = [[1.0, 2.0, 3.0]]
    savemat(folder / "log.mat", {"c": content})
    data = (folder / "log.mat").read_bytes()
    (folder / "log.mat").write_bytes(data.replace(struct.pack("<ii", 1, 3), struct.pack("<ii", 2**15, 2**15)))
    return folder / "log.mat"


def seconds_as_stamps(folder: Path) -> Path:
    """Stamps in another unit than s, which a filter's own rate would turn into millions of rows."""
    t = np.arange(3000) * 10.0
    q = 0.5 * (PANDA.lower + PANDA.upper) + 0.3 * np.sin(0.01 * t[:, None] + np.arange(7))
    return saved(folder, q=q, tau=np.cos(q), t=t)


def samples_of(path: Path) -> object:
    return prepare(read_torque_log(path, PANDA), PANDA, IdentifyOptions())


def commands_of(width: int) -> Callable[[Path], Path]:
    return lambda folder: saved(folder, q_des=none(width), q_act=none(width), ok=np.empty(0, dtype=bool))


@pytest.mark.parametrize(
    ("make", "read", "said"),
    [
        (commands_of(2**23), read_log, "q_des is empty: (0, 8388608)"),
        (commands_of(2**40), read_log, "an array of shape (0, 1099511627776)"),
        (lambda folder: saved(folder, q=none(2**23), tau=none(2**23)), read_table_file, "holds no array of numbers"),
        (lambda folder: saved(folder, q=none(2**40), tau=none(2**40)), samples_of, "an array of shape (0, 10995"),
        (many_columns, read_table_file, "20000 columns, expected 5000 at most"),
        (cells, read_table_file, "an array of shape (32768, 32768)"),
        (seconds_as_stamps, samples_of, "is time in ms, us or ns?"),
    ],
)
def test_a_small_file_that_states_large_counts_is_refused(make, read, said, tmp_path: Path) -> None:
    with pytest.raises(CatenaryError) as caught:
        read(make(tmp_path))
    assert said in str(caught.value)
