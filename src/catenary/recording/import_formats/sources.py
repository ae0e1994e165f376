"""The files of one recording, bags and tables, opened as streams."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.errors import FileFormatError, InputError
from catenary.recording.import_formats.columns import Stream
from catenary.recording.import_formats.message_columns import Bag
from catenary.recording.import_formats.tables import read_table_file
from catenary.recording.source import bags_in

BAG_ENDINGS = (".bag", ".mcap", ".db3")


class Sources:
    """Bags and tables of one recording."""

    def __init__(self, paths: Sequence[Path]) -> None:
        """Open them: a sample of each bag's topics, tables whole."""
        if not paths:
            raise FileFormatError("recording: expected at least one file, got none")
        self.paths = tuple(paths)
        self.notes: list[str] = []
        self._bags: list[Bag] = []
        streams: list[Stream] = []
        for path in paths:
            if not path.exists():
                raise FileFormatError(f"{path}: no such file")
            if is_bag(path):
                self._bags += [Bag(part) for part in bags_in(path)]
            else:
                streams += read_table_file(path)
        self._bags.sort(key=lambda bag: bag.first_arrival)
        streams += [stream for bag in self._bags for stream in bag.sample()]
        self.streams = _joined(streams)
        if not any(stream.columns for stream in self.streams):
            why = "; ".join(note for stream in self.streams for note in stream.notes)
            raise FileFormatError(
                f"{', '.join(map(str, paths))}: holds no numbers{f'; {why}' if why else ''}"
            )

    def read(self, wanted: Mapping[str, Collection[str]]) -> dict[str, Stream]:
        """Return streams with the columns wanted of each, whole."""
        found = [stream for stream in self.streams if stream.type == "table" and stream.name in wanted]
        for bag in self._bags:
            here = {name: columns for name, columns in wanted.items() if name in bag.counts}
            if here:
                found += bag.read(here)
            self.notes += [note for note in bag.problems if note not in self.notes]
        return {stream.name: stream for stream in _joined(found)}


def is_bag(path: Path) -> bool:
    """Return whether a file or folder is a bag, by its ending or its metadata."""
    return path.suffix in BAG_ENDINGS or path.is_dir()


def _joined(streams: Sequence[Stream]) -> list[Stream]:
    """Return streams with the parts of a topic that lie in several bags put one behind the other."""
    found: dict[str, Stream] = {}
    for stream in streams:
        if stream.name not in found:
            found[stream.name] = stream
        elif stream.type == "table" or found[stream.name].type != stream.type:
            raise InputError(
                f"{stream.name}: is there twice, as {found[stream.name].type} and as {stream.type}; "
                "expected parts of one recording"
            )
        else:
            found[stream.name] = _behind(found[stream.name], stream)
    return list(found.values())


def _behind(first: Stream, second: Stream) -> Stream:
    lengths = [0 if stream.arrival is None else len(stream.arrival) for stream in (first, second)]

    def column(name: str) -> NDArray[Any]:
        parts = zip((first, second), lengths, strict=True)
        return np.concatenate(
            [s.columns[name] if name in s.columns else np.full(n, np.nan) for s, n in parts]
        )

    def stamps(name: str) -> NDArray[np.int64]:
        return np.concatenate([getattr(first, name), getattr(second, name)])

    joints = {
        array: tuple(dict.fromkeys([*first.joints.get(array, ()), *second.joints.get(array, ())]))
        for array in {**first.joints, **second.joints}
    }
    return replace(
        first,
        columns={name: column(name) for name in {**first.columns, **second.columns}},
        rows=first.rows + second.rows,
        stamp=stamps("stamp"),
        arrival=stamps("arrival"),
        joints=joints,
        notes=tuple(dict.fromkeys([*first.notes, *second.notes])),
    )
