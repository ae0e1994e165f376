"""LeRobot's datasets, versions 2 and 3: a folder with meta/info.json, and Parquet of one episode or of many a file."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from catenary.documents import MOST_JSON, cut, json_table, read_bounded
from catenary.errors import FileFormatError
from catenary.recording.import_formats.columns import Stream, arrays_of
from catenary.recording.import_formats.episodes import began_of, in_a_row, wanted_episodes
from catenary.recording.import_formats.table_files import read_parquet_table

INFO = "meta/info.json"
_EPISODE = "episode_index"


def is_lerobot(path: Path) -> bool:
    """Return whether a folder is a dataset of LeRobot."""
    return (path / INFO).is_file()


def read_lerobot(path: Path, wanted: str = "") -> list[Stream]:
    """Read a dataset: all its episodes one behind the other, or the wanted one, with its features' names of joints."""
    info = json_table(read_bounded(path / INFO, MOST_JSON), str(path / INFO))
    files, version = sorted(path.glob("data/chunk-*/*.parquet")), str(info.get("codebase_version"))
    number = re.search(r"(\d{1,9})\Z", wanted)
    files = [file for file in files if number and file.stem == f"episode_{int(number[1]):06d}"] or files
    if not re.match(r"v[23]\b", version) or not files:
        raise FileFormatError(
            f"{path}: is LeRobot's {cut(version)} with {len(files)} Parquet files below data/chunk-*; versions 2 and 3 "
            "are read, with their files (LeRobot converts older ones)"
        )
    parts = [read_parquet_table(file) for file in files]
    every = dict.fromkeys(name for part in parts for name in part.columns)
    shared = [name for name in every if all(name in part.columns for part in parts)]
    lost = [cut(name) for name in every if name not in shared]
    said = [f"left out, as not all files have them: {', '.join(lost[:10])}"] * bool(lost)
    if _EPISODE not in shared:
        raise FileFormatError(f"{path}: not all its files have the column {_EPISODE}")
    columns = {name: np.concatenate([part.columns[name] for part in parts]) for name in shared}
    numbers = columns[_EPISODE].astype(np.int64)
    episodes = {f"episode_{number}": number for number in np.unique(numbers).tolist()}
    chosen = wanted_episodes(path, list(episodes), wanted)
    rows = np.isin(numbers, [episodes[name] for name in chosen])
    numbers = numbers[rows]
    fps = info.get("fps")
    stream = Stream(
        path.name,
        "table",
        {name: values[rows] for name, values in columns.items()},
        len(numbers),
        constants={"fps": float(fps)} if isinstance(fps, int | float) else {},
        starts=(0, *(np.flatnonzero(np.diff(numbers)) + 1).tolist()),
        began=began_of(info),
        notes=tuple(
            dict.fromkeys([*in_a_row(path, chosen, ()), *said, *(note for part in parts for note in part.notes)])
        ),
    )
    return [_with_names(stream, info.get("features"))]


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
