"""Files of a few hundred bytes that state counts of millions are refused at once, in little memory."""

import json
import resource
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.typing import NDArray
from scipy.io import savemat

from catenary.errors import CatenaryError
from catenary.robots.catalog import load_robot

SECONDS, MEMORY = 20, 2**31  # of CPU for one file, where two are usual; [B] beyond what the imports take
WIDTHS = (2**23, 2**40)  # columns


def none(width: int) -> NDArray[np.float64]:
    return np.empty((0, width))


def command_log(path: Path, width: int) -> Path:
    np.savez(path, q_des=none(width), q_act=none(width), ok=np.empty(0, dtype=bool))
    return path


def torque_log(path: Path, width: int) -> Path:
    np.savez(path, q=none(width), tau=none(width), fs=100.0)
    return path


def parquet_without_rows(path: Path, width: int) -> Path:
    path = path.with_suffix(".parquet")
    pq.ParquetWriter(path, pa.schema([(f"c{i}", pa.float64()) for i in range(20_000)])).close()
    return path


def cells(path: Path, width: int) -> Path:
    path = path.with_suffix(".mat")
    content = np.empty((1, 3), dtype=object)
    content[:] = [[1.0, 2.0, 3.0]]
    savemat(path, {"c": content})
    path.write_bytes(path.read_bytes().replace(struct.pack("<ii", 1, 3), struct.pack("<ii", 2**15, 2**15)))
    return path


def seconds_as_stamps(path: Path, width: int) -> Path:
    """Stamps in another unit than s, which a filter's own rate turns into millions of rows."""
    t = np.arange(3000) * 10.0
    panda = load_robot("panda")
    q = 0.5 * (panda.lower + panda.upper) + 0.3 * np.sin(0.01 * t[:, None] + np.arange(7))
    np.savez(path, q=q, tau=np.cos(q), t=t)
    return path


FILES = {
    "commands": (command_log, "q_des is empty: (0, 8388608)"),
    "torques": (torque_log, "holds no array of numbers"),
    "schema": (parquet_without_rows, "20000 columns, expected 5000 at most"),
    "cells": (cells, "an array of shape (32768, 32768)"),
    "seconds": (seconds_as_stamps, "is time in ms, us or ns?"),
}


def read_within_bounds(path: Path) -> str:
    """Read a file by every reader of recordings, in little memory and time; what they said of it."""
    import pyarrow.compute  # noqa: F401  its libraries take more memory than is left below

    from catenary.identification.identify_options import IdentifyOptions
    from catenary.identification.samples import prepare
    from catenary.recording.import_formats.table_files import read_table_file
    from catenary.recording.logs import read_log, read_torque_log

    robot = load_robot("panda")
    taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (taken + MEMORY, resource.RLIM_INFINITY))
    used = resource.getrusage(resource.RUSAGE_SELF).ru_utime
    resource.setrlimit(resource.RLIMIT_CPU, (int(used) + SECONDS, resource.RLIM_INFINITY))
    said = []
    for read in (
        read_log,
        lambda path: prepare(read_torque_log(path, robot), robot, IdentifyOptions()),
        read_table_file,
    ):
        try:
            read(path)
        except CatenaryError as error:
            said.append(str(error))
    return "; ".join(said)


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("files")
    paths = {
        f"{name} {width}": make(folder / f"{name}{width}.npz", width)
        for name, (make, _) in FILES.items()
        for width in WIDTHS
    }
    ended = subprocess.run(
        [sys.executable, __file__, *map(str, paths.values())], capture_output=True, text=True, timeout=300, check=False
    )
    assert ended.returncode == 0, ended.stderr[-2000:]
    return dict(zip(paths, json.loads(ended.stdout), strict=True))


@pytest.mark.parametrize("name", FILES)
def test_a_small_file_that_states_large_counts_is_refused_at_once(name: str, answers: dict[str, str]) -> None:
    assert FILES[name][1] in answers[f"{name} {WIDTHS[0]}"]


@pytest.mark.parametrize("name", ["commands", "torques"])
def test_columns_without_rows_are_counted_before_they_are_named(name: str, answers: dict[str, str]) -> None:
    assert "an array of shape (0, 1099511627776)" in answers[f"{name} {WIDTHS[1]}"]


if __name__ == "__main__":
    sys.stdout.write(json.dumps([read_within_bounds(Path(path)) for path in sys.argv[1:]]))
