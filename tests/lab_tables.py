"""Columns of a recording as tables of many makes."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat


def as_csv(path: Path, table: dict[str, np.ndarray]) -> Path:
    rows = zip(*(column.tolist() for column in table.values()), strict=True)
    path.with_suffix(".csv").write_text(
        "\n".join([",".join(table), *(",".join(map(repr, row)) for row in rows)]) + "\n"
    )
    return path.with_suffix(".csv")


def as_hdf5(path: Path, table: dict[str, np.ndarray]) -> Path:
    h5py = pytest.importorskip("h5py", reason="needs h5py, which the extra hdf5 brings")
    with h5py.File(path.with_suffix(".h5"), "w") as file:
        for name, values in table.items():
            file[name] = values
    return path.with_suffix(".h5")


def as_parquet(path: Path, table: dict[str, np.ndarray]) -> Path:
    pq.write_table(pa.table(table), path.with_suffix(".parquet"))
    return path.with_suffix(".parquet")


def as_numpy(path: Path, table: dict[str, np.ndarray]) -> Path:
    np.savez(path.with_suffix(".npz"), **table)
    return path.with_suffix(".npz")


def as_matlab(path: Path, table: dict[str, np.ndarray]) -> Path:
    savemat(path.with_suffix(".mat"), table)
    return path.with_suffix(".mat")


TABLES: dict[str, Callable[[Path, dict[str, np.ndarray]], Path]] = {
    "CSV": as_csv, "NumPy": as_numpy, "MATLAB": as_matlab, "HDF5": as_hdf5, "Parquet": as_parquet
}  # fmt: skip
