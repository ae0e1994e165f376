"""HDF5: robomimic's and ALOHA's demonstrations, MATLAB's version 7.3, and any other file's arrays of numbers.

Arrays are called as their paths in the file, `obs/robot0_joint_pos`, within an episode by what follows its name, those
of MATLAB's structs `log.q`. Nothing is followed out of the file, nor read that a file of its size cannot hold.
"""

import re
from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catenary.archives import MOST, MOST_ARRAYS, RATIO
from catenary.documents import cut, json_table
from catenary.errors import FileFormatError
from catenary.recording.import_formats.columns import Stream
from catenary.recording.import_formats.episodes import Episode, began_of, streams_of_episodes, wanted_episodes
from catenary.recording.import_formats.table_files import DEEPEST
from catenary.recording.import_formats.table_time import RATES

if TYPE_CHECKING:
    import h5py

ENDINGS = (".hdf5", ".h5", ".hdf")
MAGIC = b"\x89HDF\r\n\x1a\n"
MOST_NODES = 100_000  # groups and arrays of a file
MOST_TEXTS = 1000  # of an array of texts, such as joints' names
_EPISODE = re.compile(
    r"(?:(?:demo|episode|ep|traj|trajectory|trial|run|rec|recording|session|take)[_ -]?)?\d{1,9}", re.I
)
_UNREADABLE = (OSError, KeyError, ValueError, TypeError, RuntimeError, MemoryError, OverflowError, NotImplementedError)


def is_hdf5(path: Path) -> bool:
    """Return whether a file is HDF5, by its first bytes or, as MATLAB writes it, those behind a head."""
    try:
        with path.open("rb") as file:
            head = file.read(520)
    except OSError:
        return False
    return MAGIC in (head[:8], head[512:])


def read_hdf5(path: Path, wanted: str = "") -> list[Stream]:
    """Read a file's arrays: of all its episodes one behind the other, or of the wanted one.

    Raises:
        FileFormatError: h5py is missing, the file is damaged or holds more than its size allows, no such episode.
    """
    try:
        import h5py
    except ImportError as error:
        raise FileFormatError(
            f'{path}: is HDF5, which needs h5py: pip install "catenary[hdf5]"; or save its arrays as .npz, '
            "or in MATLAB save('log.mat', '-v7')"
        ) from error
    try:
        with h5py.File(path, "r") as file:
            return _Content(path, file).streams(wanted)
    except FileFormatError:
        raise
    except _UNREADABLE as error:
        raise FileFormatError(f"{path}: cannot be read as HDF5: {cut(str(error) or repr(error))}") from error


class _Content:
    """What an open file holds."""

    def __init__(self, path: Path, file: "h5py.File") -> None:
        self._path, self._file = path, file
        self._most = max(MOST, RATIO * path.stat().st_size)  # [B] that are still read
        self._nodes, self._seen = 0, set[int]()  # those counted; addresses of groups
        self.left: list[str] = []
        self._found: dict[str, h5py.Dataset] = {}
        self._walk(file, "", 0)
        self._is_matlab = any("MATLAB_class" in each.attrs for each in self._found.values())

    def streams(self, wanted: str) -> list[Stream]:
        """Return the arrays of its episodes."""
        by_episode: dict[str, dict[str, str]] = {}  # path of an array by its name in the episode
        outside: dict[str, str] = {}
        for path in self._found:
            parts = path.split("/")
            at = next((i for i, part in enumerate(parts[:-1]) if _EPISODE.fullmatch(part)), None)
            own = outside if at is None else by_episode.setdefault("/".join(parts[: at + 1]), {})
            own["/".join(parts if at is None else parts[at + 1 :])] = path
        if not by_episode or not set[str].intersection(*map(set, by_episode.values())):
            by_episode, outside = {"": {path: path for path in self._found}}, {}
        names = sorted(by_episode, key=lambda name: [int(t) if t.isdigit() else t for t in re.split(r"(\d+)", name)])
        chosen = wanted_episodes(self._path, [name for name in names if name], wanted) if wanted or names[0] else names
        shared = self._arrays(outside)
        episodes = []
        for name in chosen:
            told = self._told(name)
            rate = next((float(told[key]) for key in RATES if isinstance(told.get(key), int | float)), None)
            episodes.append(Episode(name, shared | self._arrays(by_episode[name]), rate, began_of(told)))
        if not any(array.dtype.kind in "biuf" for episode in episodes for array in episode.arrays.values()):
            why = f"; {', '.join(self.left[:10])}" if self.left else ""
            raise FileFormatError(f"{self._path}: holds no array of numbers of one or two dimensions{why}")
        notes = [f"left out: {', '.join(dict.fromkeys(self.left[:10]))}"] * bool(self.left)
        return streams_of_episodes(self._path, episodes, notes)

    def _walk(self, group: "h5py.Group", prefix: str, depth: int) -> None:
        """Find the arrays, by hard links alone, which may lead to a group again, within itself even."""
        import h5py

        address = h5py.h5o.get_info(group.id).addr
        if address in self._seen:
            self.left.append(f"{cut(prefix)} (a group that is there under another name)")
            return
        self._seen.add(address)
        for name in group:
            self._nodes += 1
            if self._nodes > MOST_NODES:
                raise FileFormatError(f"{self._path}: more than {MOST_NODES} groups and arrays")
            path = f"{prefix}{name}"
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                self.left.append(f"{cut(path)} (a link)")
                continue
            node = group[name]
            if isinstance(node, h5py.Group) and depth < DEEPEST and not (depth == 0 and name.startswith("#")):
                self._walk(node, f"{path}/", depth + 1)
            elif isinstance(node, h5py.Dataset):
                self._found[path] = node

    def _arrays(self, paths: Mapping[str, str]) -> dict[str, NDArray[Any]]:
        if len(paths) > MOST_ARRAYS:
            raise FileFormatError(f"{self._path}: {len(paths)} arrays, expected {MOST_ARRAYS} at most")
        found = {}
        for name, path in paths.items():
            array = self._array(path, self._found[path])
            if array is not None:
                found[name.replace("/", ".") if self._is_matlab else name] = array
        return found

    def _array(self, path: str, data: "h5py.Dataset") -> NDArray[Any] | None:
        """Return an array's numbers or texts; None, and why, of what is neither, or stands in other files."""
        import h5py

        shape, kind = data.shape, data.dtype.kind
        text = h5py.check_string_dtype(data.dtype) is not None
        why = ""
        if shape is None:
            why = "empty"
        elif data.external or data.is_virtual:
            why = "its numbers stand in another file"
        elif not (text or kind in "biuf"):
            why = f"holds {cut(str(data.dtype)) if kind != 'O' else 'references or lists'}"
        elif sum(length > 1 for length in shape) > 2:
            why = f"of shape {shape}, no rows of numbers"
        elif text and prod(shape) > MOST_TEXTS:
            why = f"{prod(shape)} texts"
        if why:
            self.left.append(f"{cut(path)} ({why})")
            return None
        self._most -= prod(shape) * max(8, data.dtype.itemsize)
        if self._most < 0:
            raise FileFormatError(f"{self._path}: {cut(path)}: an array of shape {shape}, more than its file can hold")
        values = np.asarray(data.asstr()[()] if text else data[()])
        if text:
            return np.squeeze(values.astype(str))
        if data.attrs.get("MATLAB_class") == b"char":
            return np.array("".join(map(chr, values.ravel(order="C").tolist())))
        return np.squeeze(values.T if self._is_matlab else values)

    def _told(self, episode: str) -> dict[str, Any]:
        """Return what attributes say, of the episode above all, then of what it is in; a simulator's own rate, too."""
        told: dict[str, Any] = {}
        parts = episode.split("/") if episode else []
        for depth in range(len(parts), -1, -1):
            for key, value in self._file["/".join(parts[:depth]) or "/"].attrs.items():
                plain = value.decode(errors="replace") if isinstance(value, bytes) else value
                told.setdefault(
                    key, plain.item() if isinstance(plain, np.generic | np.ndarray) and plain.size == 1 else plain
                )
        if isinstance(told.get("env_args"), str):
            inner = json_table(told["env_args"], f"{self._path}: env_args").get("env_kwargs")
            told = (inner if isinstance(inner, dict) else {}) | told
        return told
