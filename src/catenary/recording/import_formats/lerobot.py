"""LeRobot's datasets, versions 2 and 3: a folder with meta/info.json, and Parquet of one episode or of many a file."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from catenary.config import Recorded, parse_settings
from catenary.documents import MOST_JSON, cut, json_table, read_bounded
from catenary.errors import FileFormatError
from catenary.recording.import_formats.columns import Stream, arrays_of
from catenary.recording.import_formats.episodes import Episode, began_of, streams_of_episodes, wanted_episodes
from catenary.recording.import_formats.table_files import read_parquet_table

INFO = "meta/info.json"
MOST_FILES = 100_000
_EPISODE = "episode_index"
_NUMBERS = ("frame_index", _EPISODE, "index", "task_index")  # of rows, which are no quantity


class _Feature(Recorded):
    names: Any = None  # a list, or lists by a word of the maker's


class _Info(Recorded):
    codebase_version: str = ""
    fps: float | None = None
    features: dict[str, _Feature] = Field(default_factory=dict)


def is_lerobot(path: Path) -> bool:
    """Return whether a folder is a dataset of LeRobot."""
    return path.is_dir() and (path / INFO).is_file()


def read_lerobot(path: Path, wanted: str = "") -> list[Stream]:
    """Read a dataset: all its episodes one behind the other, or the wanted one, with the joints' names of its features.

    Raises:
        FileFormatError: No version that is read, a file is damaged, no such episode.
    """
    content = json_table(read_bounded(path / INFO, MOST_JSON), str(path / INFO))
    info = parse_settings(content, _Info, str(path / INFO))
    files = sorted(path.glob("data/chunk-*/*.parquet"))[:MOST_FILES]
    if not re.match(r"v[23]\b", info.codebase_version) or not files:
        raise FileFormatError(
            f"{path}: is LeRobot's {cut(info.codebase_version) or 'without a version'} with {len(files)} Parquet files "
            "below data; versions 2 and 3 are read, with their files (LeRobot converts older ones)"
        )
    number = re.search(r"(\d{1,9})\Z", wanted)
    own = [file for file in files if number and file.stem == f"episode_{int(number[1]):06d}"]
    rows: dict[int, dict[str, list[NDArray[Any]]]] = {}
    notes: list[str] = []
    for file in own or files:
        stream = read_parquet_table(file)
        notes += [note for note in stream.notes if note not in notes]
        if _EPISODE not in stream.columns:
            raise FileFormatError(f"{file}: has no column {_EPISODE}, by which LeRobot tells its episodes apart")
        arrays = _arrays(stream)
        numbers = stream.columns[_EPISODE].astype(np.int64)
        for episode in np.unique(numbers).tolist():
            parts = rows.setdefault(episode, {})
            for name, values in arrays.items():
                parts.setdefault(name, []).append(values[numbers == episode])
    began = began_of(content)
    named = {f"episode_{episode}": rows[episode] for episode in sorted(rows)}
    episodes = [
        Episode(name, {key: np.concatenate(parts) for key, parts in named[name].items()}, info.fps, began)
        for name in wanted_episodes(path, list(named), wanted)
    ]
    return [_with_names(stream, info) for stream in streams_of_episodes(path, episodes, notes)]


def _arrays(stream: Stream) -> dict[str, NDArray[Any]]:
    """Return a file's columns, those of a list as one array."""
    lists = arrays_of(stream)
    taken = {column for columns in lists.values() for column in columns}
    plain = {name: values for name, values in stream.columns.items() if name not in (*taken, *_NUMBERS)}
    return plain | {base: np.column_stack([stream.columns[c] for c in columns]) for base, columns in lists.items()}


def _with_names(stream: Stream, info: _Info) -> Stream:
    """Return a stream whose arrays have the names of the dataset's features, where these fit."""
    renamed, joints = dict(stream.columns), dict[str, tuple[str, ...]]()
    for base, columns in arrays_of(stream).items():
        names = _flat(info.features[base].names) if base in info.features else []
        if len(names) == len(columns) == len(set(names)) and not any("[" in name or "]" in name for name in names):
            joints[base] = tuple(names)
            new = dict(zip(columns, names, strict=True))
            renamed = {f"{base}[{new[key]}]" if key in new else key: values for key, values in renamed.items()}
    return replace(stream, columns=renamed, joints=joints)


def _flat(names: Any) -> list[str]:
    if isinstance(names, dict):
        return [name for inner in names.values() for name in _flat(inner)]
    if isinstance(names, list):
        return [name for inner in names for name in _flat(inner)]
    return [names] if isinstance(names, str) and names else []
