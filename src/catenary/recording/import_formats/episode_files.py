"""Containers of episodes: HDF5, and datasets of LeRobot.

Arrays of HDF5 (robomimic's, ALOHA's, MATLAB's version 7.3, any other) are called as their paths in the file,
`obs/robot0_joint_pos`, within an episode by what follows its name, those of MATLAB's structs `log.q`; nothing is
followed out of the file. LeRobot's versions 2 and 3 are a folder with meta/info.json, and Parquet of episodes.
"""

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catenary.archives import MAX_ARRAYS, MAX_UNPACKED_BYTES, MAX_UNPACKED_RATIO
from catenary.bounded_parsers import MAX_JSON_BYTES, MAX_LEVELS, cut, json_table, read_bounded, reading
from catenary.errors import FileFormatError
from catenary.recording.import_formats.columns import Stream, arrays_of, listed, natural
from catenary.recording.import_formats.table_files import read_parquet_table, streams_of_arrays
from catenary.recording.import_formats.table_time import RATES

if TYPE_CHECKING:
    import h5py

_MAX_NODES = 100_000  # groups and arrays of a file
_MAX_TEXTS = 1000  # of an array of texts, such as joints' names
_EPISODE = re.compile(
    r"(?:(?:demo|episode|ep|traj|trajectory|trial|run|rec|recording|session|take)[_ -]?)?\d{1,9}", re.I
)
_UNREADABLE = (OSError, LookupError, ValueError, TypeError, RuntimeError, MemoryError, OverflowError)
_INFO, _INDEX = "meta/info.json", "episode_index"  # of LeRobot
# what says when an episode began: ISO 8601, seconds since 1970, or robosuite's month-day-year beside "time"
_DATES = ("date", "recorded", "recorded_at", "created", "created_at", "start_time", "timestamp")
_FORMATS = ("", "%m-%d-%Y %H:%M:%S", "%m-%d-%Y")
_LETTERS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_- "


def read_hdf5(path: Path, requested: str = "") -> list[Stream]:
    """Read a file's arrays: of all its episodes one behind the other, or of the wanted one."""
    import h5py

    with reading(path, "HDF5", _UNREADABLE), h5py.File(path, "r") as file:
        return _Content(path, file).streams(requested)


class _Content:
    """What an open file holds."""

    def __init__(self, path: Path, file: "h5py.File") -> None:
        self._path, self._file, self._left = path, file, list[str]()
        self._nodes, self._seen = 0, set[int]()
        self._most = max(MAX_UNPACKED_BYTES, MAX_UNPACKED_RATIO * path.stat().st_size)  # [B] that are still read
        self._found: dict[str, h5py.Dataset] = {}
        self._units: dict[str, list[str]] = {}
        self._walk(file)
        self._is_matlab = any("MATLAB_class" in group.attrs for group in self._found.values())

    def streams(self, requested: str) -> list[Stream]:
        """Return the arrays that all episodes have; of a file without episodes, all."""
        of: dict[str, dict[str, str]] = {}  # paths of arrays by their names, by episode
        for path in self._found:
            steps = path.split("/")
            at = next((i for i, step in enumerate(steps[:-1]) if _EPISODE.fullmatch(step)), -1)
            of.setdefault("/".join(steps[: at + 1]), {})["/".join(steps[at + 1 :])] = path
        outside = of.pop("", {})
        if not of or not set[str].intersection(*map(set, of.values())):
            of, outside = {"": {path: path for path in self._found}}, {}
        chosen = chosen_episodes(self._path, sorted(of, key=natural), requested)
        parts = [self._arrays(of[name]) for name in chosen]
        alike = [name for name in parts[0] if len({part[name].shape[1:] if name in part else 0 for part in parts}) == 1]
        self._left += [f"{name} (not alike in all episodes)" for name in parts[0] if name not in alike]
        rows = [max((len(part[name]) for name in alike if part[name].ndim), default=0) for part in parts]
        attributes, begins = self._description(chosen[0]), [began_of(self._description(name)) for name in chosen]
        rate = next((float(attributes[key]) for key in RATES if isinstance(attributes.get(key), int | float)), None)
        whole = {name: np.concatenate([np.atleast_1d(part[name]) for part in parts]) for name in alike}
        arrays = self._arrays(outside) | (whole if len(chosen) > 1 else parts[0])
        if not any(array.dtype.kind in "biuf" for array in arrays.values()):
            raise FileFormatError(f"{self._path}: holds no row of numbers; left out: {', '.join(self._left[:10])}")
        first, *others = streams_of_arrays(self._path, arrays, self._units, rows_first=len(chosen) > 1)
        constants = dict(first.constants) | ({} if rate is None else {"rate_hz": rate})
        notes = [*in_a_row(self._path, chosen, begins), *[f"left out: {', '.join(self._left[:10])}"] * bool(self._left)]
        starts = tuple(np.cumsum([0, *rows[:-1]]).tolist()) if first.rows == sum(rows) else (0,)
        first = replace(first, starts=starts, constants=constants, began=begins[0], notes=(*notes, *first.notes))
        return [first, *others]

    def _walk(self, group: "h5py.Group", outer: str = "", depth: int = 0) -> None:
        """Find each group and array once, by hard links alone; name the links that lead out of the file."""
        import h5py

        self._seen.add(h5py.h5o.get_info(group.id).addr)
        if depth > MAX_LEVELS:
            raise FileFormatError(f"{self._path}: is nested more than {MAX_LEVELS} levels deep")
        for name in group:
            self._nodes += 1
            if self._nodes > _MAX_NODES:
                raise FileFormatError(f"{self._path}: more than {_MAX_NODES} groups and arrays")
            path, link = f"{outer}{name}", group.get(name, getlink=True)
            if isinstance(link, h5py.ExternalLink):
                self._left.append(f"{cut(path)} (stands in {cut(link.filename)}, which is not read)")
            if not isinstance(link, h5py.HardLink) or (about := h5py.h5o.get_info(group[name].id).addr) in self._seen:
                continue
            self._seen.add(about)
            if isinstance(node := group[name], h5py.Group):
                self._walk(node, f"{path}/", depth + 1)
            elif isinstance(node, h5py.Dataset) and not path.startswith("#"):  # MATLAB's #refs# are of cells
                self._found[path] = node

    def _arrays(self, paths: Mapping[str, str]) -> dict[str, NDArray[Any]]:
        if len(paths) > MAX_ARRAYS:
            raise FileFormatError(f"{self._path}: {len(paths)} arrays, expected {MAX_ARRAYS} at most")
        read = {name: self._array(path, self._found[path]) for name, path in paths.items()}
        join = "." if self._is_matlab else "/"
        there = {name.replace("/", join): name for name, array in read.items() if array is not None}
        self._units |= {plain: _units_of(self._found[paths[name]]) for plain, name in there.items()}
        return {plain: array for plain, name in there.items() if (array := read[name]) is not None}

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
        elif sum(length > 1 for length in shape) > 2 or (is_text and prod(shape) > _MAX_TEXTS):
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

    def _description(self, episode: str) -> dict[str, Any]:
        """Return the attributes of the episode, then of its parents; a simulator's own rate, too."""
        attributes: dict[str, Any] = {}
        inner = episode.split("/")
        for depth in range(len(inner) + 1):
            for key, value in self._file["/".join(inner[:depth]) or "/"].attrs.items():
                plain = value.decode(errors="replace") if isinstance(value, bytes) else value
                attributes[key] = (
                    plain.item() if isinstance(plain, np.generic | np.ndarray) and plain.size == 1 else plain
                )
        simulator = json_table(str(attributes.get("env_args", "{}")), f"{self._path}: env_args").get("env_kwargs")
        return (simulator if isinstance(simulator, dict) else {}) | attributes


def _units_of(data: "h5py.Dataset") -> list[str]:
    """Return the units that attributes of an array state, one or one for each of its columns; none if none does."""
    stated = np.ravel(next((data.attrs[key] for key in ("units", "Units", "unit") if key in data.attrs), [])).tolist()
    return [value.decode(errors="replace") if isinstance(value, bytes) else str(value) for value in stated]


def read_lerobot(path: Path, requested: str = "") -> list[Stream]:
    """Read a dataset: all its episodes one behind the other, or the wanted one, with its features' names of joints."""
    info = json_table(read_bounded(path / _INFO, MAX_JSON_BYTES), str(path / _INFO))
    files, version = sorted(path.glob("data/chunk-*/*.parquet")), str(info.get("codebase_version"))
    number = re.search(r"(\d{1,9})\Z", requested)
    files = [file for file in files if number and file.stem == f"episode_{int(number[1]):06d}"] or files
    if not re.match(r"v[23]\b", version) or not files:
        raise FileFormatError(
            f"{path}: is LeRobot's {cut(version)} with {len(files)} Parquet files below data/chunk-*; versions 2 and 3 "
            "are read, with their files (LeRobot converts older ones)"
        )
    parts = [part for file in files for part in read_parquet_table(file)]
    every = dict.fromkeys(name for part in parts for name in part.columns)
    shared = [name for name in every if all(name in part.columns for part in parts)]
    lost = [cut(name) for name in every if name not in shared]
    left_out = [f"left out, as not all files have them: {', '.join(lost[:10])}"] * bool(lost)
    if _INDEX not in shared:
        raise FileFormatError(f"{path}: not all its files have the column {_INDEX}")
    columns = {name: np.concatenate([part.columns[name] for part in parts]) for name in shared}
    numbers = columns[_INDEX].astype(np.int64)
    episodes = {f"episode_{number}": number for number in np.unique(numbers).tolist()}
    chosen = chosen_episodes(path, list(episodes), requested)
    rows = np.isin(numbers, [episodes[name] for name in chosen])
    numbers = numbers[rows]
    fps, starts = info.get("fps"), (0, *(np.flatnonzero(np.diff(numbers)) + 1).tolist())
    constants = {"fps": float(fps)} if isinstance(fps, int | float) else {}
    notes = dict.fromkeys([*in_a_row(path, chosen, ()), *left_out, *(note for part in parts for note in part.notes)])
    taken = {name: values[rows] for name, values in columns.items()}
    stream = Stream(path.name, "table", taken, len(numbers), constants=constants, starts=starts, notes=tuple(notes))
    return [_with_names(replace(stream, began=began_of(info)), info.get("features"))]


def _with_names(stream: Stream, features: Any) -> Stream:
    """Return a stream whose arrays have the names of the dataset's features, where these fit."""
    joints, new = dict[str, tuple[str, ...]](), dict[str, str]()
    for base, columns in arrays_of(stream).items():
        feature = features.get(base) if isinstance(features, dict) else None
        names = _flat(feature.get("names") if isinstance(feature, dict) else None)
        if len(names) == len(columns) == len(set(names)) and not any(set(name) & set("[]") for name in names):
            joints[base] = tuple(names)
            new |= {column: f"{base}[{name}]" for column, name in zip(columns, names, strict=True)}
    return replace(stream, columns={new.get(key, key): v for key, v in stream.columns.items()}, joints=joints)


def _flat(names: Any) -> list[str]:
    """Return the names in a list, or in lists by words of the maker's: {"motors": [...]}."""
    if isinstance(names, dict | list):
        return [name for inner in (names.values() if isinstance(names, dict) else names) for name in _flat(inner)]
    return [names] if isinstance(names, str) and names else []


def chosen_episodes(path: Path, names: Sequence[str], requested: str) -> list[str]:
    """Return the episodes that are meant: all, or the one of a name or its number, `demo_3`, `episode_000003`, `3`."""
    short = _short(requested)
    episodes = [
        name for name in names if requested in ("", name) or short in (_short(name), _short(name).lstrip(_LETTERS))
    ]
    if not episodes:
        raise FileFormatError(f'{path}: no episode "{cut(requested)}"; its episodes are {listed(names)}')
    return episodes


def _short(name: str) -> str:
    return re.sub(r"0+(?=\d+\Z)", "", name.rpartition("/")[2])


def in_a_row(path: Path, names: Sequence[str], begins: Sequence[float]) -> list[str]:
    """Return the note on concatenated episodes; they began then [s since 1970], or 0."""
    alone = f"{path}/{names[0]}"
    if all(begins) and len(set(begins)) > 1:
        dates = [datetime.fromtimestamp(began, UTC).isoformat(" ", "seconds")[:19] for began in begins]
        names = [f"{name} ({date})" for name, date in zip(names, dates, strict=True)]
    note = f"{len(names)} episodes, one behind the other: {listed(names)}; {alone} is one alone"
    return [note] * (len(names) > 1)


def began_of(attributes: Mapping[str, Any]) -> float:
    """Return when an episode began [s since 1970, UTC], by what its container tells; 0 where it does not."""
    for key in _DATES:
        value = attributes.get(key)
        if isinstance(value, int | float) and 1e9 < value < 3e9:
            return float(value)
        texts = [f"{value} {attributes.get('time')}", value] if key == "date" else [value]
        for text, form in ((text, form) for text in texts if isinstance(text, str) for form in _FORMATS):
            with suppress(ValueError):
                moment = datetime.strptime(text, form) if form else datetime.fromisoformat(text)
                return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    return 0.0
