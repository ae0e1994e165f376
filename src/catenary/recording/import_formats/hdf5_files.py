"""HDF5: robomimic's and ALOHA's demonstrations, MATLAB's version 7.3, and any other file's arrays of numbers.

Arrays are called as their paths in the file, `obs/robot0_joint_pos`, within an episode by what follows its name, those
of MATLAB's structs `log.q`. Nothing is followed out of the file, nor read that a file of its size cannot hold.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catenary.archives import MOST, MOST_ARRAYS, RATIO
from catenary.documents import cut, json_table, reading
from catenary.errors import FileFormatError, to_install
from catenary.recording.import_formats.columns import Stream, natural
from catenary.recording.import_formats.episodes import began_of, in_a_row, wanted_episodes
from catenary.recording.import_formats.table_files import streams_of_arrays
from catenary.recording.import_formats.table_time import RATES

if TYPE_CHECKING:
    import h5py

MAGIC = b"\x89HDF\r\n\x1a\n"
MOST_NODES = 100_000  # groups and arrays of a file
MOST_TEXTS = 1000  # of an array of texts, such as joints' names
_EPISODE = re.compile(
    r"(?:(?:demo|episode|ep|traj|trajectory|trial|run|rec|recording|session|take)[_ -]?)?\d{1,9}", re.I
)
_UNREADABLE = (OSError, LookupError, ValueError, TypeError, RuntimeError, MemoryError, OverflowError)


def is_hdf5(path: Path) -> bool:
    """Return whether a file is HDF5, by its first bytes or, as MATLAB writes it, those behind a head."""
    try:
        with path.open("rb") as file:
            head = file.read(520)
    except OSError:
        return False
    return MAGIC in (head[:8], head[512:])


def read_hdf5(path: Path, wanted: str = "") -> list[Stream]:
    """Read a file's arrays: of all its episodes one behind the other, or of the wanted one."""
    try:
        import h5py
    except ImportError as error:
        raise FileFormatError(
            f"{path}: is HDF5, which needs h5py: {to_install('hdf5')}; or save its arrays as .npz, "
            "or in MATLAB save('log.mat', '-v7')"
        ) from error
    with reading(path, "HDF5", _UNREADABLE), h5py.File(path, "r") as file:
        return _Content(path, file).streams(wanted)


class _Content:
    """What an open file holds."""

    def __init__(self, path: Path, file: "h5py.File") -> None:
        self._path, self._file, self._left = path, file, list[str]()
        self._nodes = 0
        self._most = max(MOST, RATIO * path.stat().st_size)  # [B] that are still read
        self._found: dict[str, h5py.Dataset] = {}
        file.visititems(self._keep)  # each group and array once, by hard links alone
        self._is_matlab = any("MATLAB_class" in each.attrs for each in self._found.values())

    def streams(self, wanted: str) -> list[Stream]:
        """Return the arrays that all episodes have; of a file without episodes, all."""
        of: dict[str, dict[str, str]] = {}  # paths of arrays by their names, by episode
        for path in self._found:
            steps = path.split("/")
            at = next((i for i, step in enumerate(steps[:-1]) if _EPISODE.fullmatch(step)), -1)
            of.setdefault("/".join(steps[: at + 1]), {})["/".join(steps[at + 1 :])] = path
        outside = of.pop("", {})
        if not of or not set[str].intersection(*map(set, of.values())):
            of, outside = {"": {path: path for path in self._found}}, {}
        chosen = wanted_episodes(self._path, sorted(of, key=natural), wanted)
        parts = [self._arrays(of[name]) for name in chosen]
        alike = [name for name in parts[0] if len({part[name].shape[1:] if name in part else 0 for part in parts}) == 1]
        self._left += [f"{name} (not alike in all episodes)" for name in parts[0] if name not in alike]
        rows = [max((len(part[name]) for name in alike if part[name].ndim), default=0) for part in parts]
        told, begins = self._told(chosen[0]), [began_of(self._told(name)) for name in chosen]
        rate = next((float(told[key]) for key in RATES if isinstance(told.get(key), int | float)), None)
        whole = {name: np.concatenate([np.atleast_1d(part[name]) for part in parts]) for name in alike}
        arrays = self._arrays(outside) | (whole if len(chosen) > 1 else parts[0])
        if not any(array.dtype.kind in "biuf" for array in arrays.values()):
            raise FileFormatError(f"{self._path}: holds no row of numbers; left out: {', '.join(self._left[:10])}")
        first, *others = streams_of_arrays(self._path, arrays, rows_first=len(chosen) > 1)
        constants = dict(first.constants) | ({} if rate is None else {"rate_hz": rate})
        notes = [*in_a_row(self._path, chosen, begins), *[f"left out: {', '.join(self._left[:10])}"] * bool(self._left)]
        starts = tuple(np.cumsum([0, *rows[:-1]]).tolist()) if first.rows == sum(rows) else (0,)
        first = replace(first, starts=starts, constants=constants, began=begins[0], notes=(*notes, *first.notes))
        return [first, *others]

    def _keep(self, path: str, node: "h5py.Group | h5py.Dataset") -> None:
        import h5py

        self._nodes += 1
        if self._nodes > MOST_NODES:
            raise FileFormatError(f"{self._path}: more than {MOST_NODES} groups and arrays")
        if isinstance(node, h5py.Dataset) and not path.startswith("#"):  # MATLAB's #refs# are of cells
            self._found[path] = node

    def _arrays(self, paths: Mapping[str, str]) -> dict[str, NDArray[Any]]:
        if len(paths) > MOST_ARRAYS:
            raise FileFormatError(f"{self._path}: {len(paths)} arrays, expected {MOST_ARRAYS} at most")
        read = {name: self._array(path, self._found[path]) for name, path in paths.items()}
        join = "." if self._is_matlab else "/"
        return {name.replace("/", join): array for name, array in read.items() if array is not None}

    def _array(self, path: str, data: "h5py.Dataset") -> NDArray[Any] | None:
        """Return an array's numbers or texts; None, and why, of what is neither, or stands in other files."""
        import h5py

        shape, is_text = data.shape, h5py.check_string_dtype(data.dtype) is not None
        why = ""
        if shape is None or 0 in shape:
            why = "empty"
        elif data.external or data.is_virtual:
            why = "its numbers stand in another file"
        elif not (is_text or data.dtype.kind in "biuf"):
            why = "neither numbers nor texts"
        elif sum(length > 1 for length in shape) > 2 or (is_text and prod(shape) > MOST_TEXTS):
            why = f"of shape {shape}, no rows of numbers"
        if why:
            self._left.append(f"{cut(path)} ({why})")
            return None
        self._most -= prod(shape) * max(8, data.dtype.itemsize)
        if self._most < 0:
            raise FileFormatError(f"{self._path}: {cut(path)}: an array of shape {shape}, more than its file can hold")
        values = np.asarray(data.asstr()[()].astype(str) if is_text else data[()])
        if data.attrs.get("MATLAB_class") == b"char":
            return np.array("".join(map(chr, values.ravel().tolist())))
        return np.squeeze(values.T if self._is_matlab else values)

    def _told(self, episode: str) -> dict[str, Any]:
        """Return what attributes say, of the episode above all, then of what it is in; a simulator's own rate, too."""
        told: dict[str, Any] = {}
        inner = episode.split("/")
        for depth in range(len(inner) + 1):
            for key, value in self._file["/".join(inner[:depth]) or "/"].attrs.items():
                plain = value.decode(errors="replace") if isinstance(value, bytes) else value
                told[key] = plain.item() if isinstance(plain, np.generic | np.ndarray) and plain.size == 1 else plain
        simulator = json_table(str(told.get("env_args", "{}")), f"{self._path}: env_args").get("env_kwargs")
        return (simulator if isinstance(simulator, dict) else {}) | told
