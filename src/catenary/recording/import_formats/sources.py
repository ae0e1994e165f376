"""The files of one recording, whatever container they are in, opened as streams of columns."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from catenary.errors import FileFormatError, InputError
from catenary.files import ADVICE, TEXT_ENDINGS, fingerprint, sha256_of, table_ending
from catenary.recording.bag_reader import bags_in, is_bag_file
from catenary.recording.extract import TopicFile, is_extraction
from catenary.recording.import_formats.columns import Stream
from catenary.recording.import_formats.csv_files import Block, TextTable, joined
from catenary.recording.import_formats.hdf5_files import is_hdf5, read_hdf5
from catenary.recording.import_formats.lerobot import is_lerobot, read_lerobot
from catenary.recording.import_formats.message_columns import SAMPLED, Bag
from catenary.recording.import_formats.table_files import read_table_file, stream_of_text
from catenary.recording.import_formats.tracker_files import is_tracker_file
from catenary.recording.journal import About, same_origin

LONG_TEXT = 64 << 20  # [B] from which a text table is not held whole
SAMPLED_NUMBERS = 4_000_000  # of it that are looked at
_NAMELESS = (".mat", ".npy", ".txt")  # tables that no layout is of

Progress = Callable[[float], object]


class ExtractedTopics:
    """What `extract` wrote: a Parquet file for each topic, its columns called as in the topic's messages."""

    def __init__(self, path: Path) -> None:
        """Open its files."""
        files = [TopicFile(file) for file in sorted(path.glob("*.parquet"))]
        self._files = {file.topic.name: file for file in files}
        self.counts = {name: file.rows for name, file in self._files.items() if file.rows}
        self.about = next((file.about for file in files), None)
        self.problems: list[str] = []

    def sample(self) -> list[Stream]:
        """Return the first messages of every topic."""
        return [self._stream(name, None) for name in self.counts]

    def read(self, wanted: Mapping[str, Collection[str]]) -> list[Stream]:
        """Return topics with the columns that are wanted of each, all messages."""
        return [self._stream(name, columns) for name, columns in wanted.items()]

    def _stream(self, name: str, wanted: Collection[str] | None) -> Stream:
        file = self._files[name]
        stored = dict(pair for c in file.topic.columns for pair in zip(c.paths, c.names, strict=True))
        chosen = [column for column in stored if wanted is None or column in wanted]
        groups = range(file.row_groups) if wanted is not None else range(1)
        rows = file.rows if wanted is not None else min(file.rows_of(0), SAMPLED)
        columns = {column: np.empty(rows) for column in chosen}
        stamp, arrival = np.empty((2, rows), dtype=np.int64)
        first = 0
        for group in groups:
            content = file.read(["stamp", "arrival", *(stored[column] for column in chosen)], group)
            here = slice(first, min(rows, first + len(content["stamp"])))
            count = here.stop - first
            stamp[here], arrival[here] = content["stamp"][:count], content["arrival"][:count]
            for column in chosen:
                columns[column][here] = content[stored[column]][:count]
            first = here.stop
        # a column of no number stands for a field that no message has
        there = {column: v for column, v in columns.items() if np.isfinite(v).any() or wanted is not None}
        joints = {
            column.path: tuple(label for label in column.labels if f"{column.path}[{label}]" in there)
            for column in file.topic.columns
            if column.width > 1
        }
        return Stream(name, file.topic.type, there, file.rows, stamp, arrival, joints)


class LongText:
    """A text table whose first rows are looked at, and of which columns are read when they are wanted."""

    def __init__(self, path: Path, progress: Progress) -> None:
        """Open it."""
        self.table, self._progress = TextTable(path), progress
        self.about, self.problems = None, list[str]()
        with path.open("rb") as file:
            lines = sum(block.count(b"\n") for block in iter(lambda: file.read(1 << 22), b""))
        self.counts = {path.stem: lines - self.table.head.begins}

    def sample(self) -> list[Stream]:
        """Return its first rows."""
        held, count = list[Block](), 0
        for block in self.table.blocks():
            held.append(block)
            count += sum(map(len, block.values()))
            if count >= SAMPLED_NUMBERS:
                break
        stream = stream_of_text(self.table, joined(held))
        (rows,) = self.counts.values()
        notes = (*stream.notes, f"of about {rows} rows the first {stream.rows} were looked at")
        return [replace(stream, rows=rows, notes=notes)]

    def blocks(self, wanted: Mapping[str, Collection[str]]) -> Iterator[Block]:
        """Yield columns, some thousand rows at a time."""
        return self.table.blocks(wanted[self.table.path.stem], self._progress)

    def read(self, wanted: Mapping[str, Collection[str]]) -> list[Stream]:
        """Return the columns that are wanted, whole."""
        return [stream_of_text(self.table, joined(list(self.blocks(wanted))))]


class Sources:
    """Bags and tables of one recording."""

    def __init__(self, paths: Sequence[Path], progress: Progress = lambda done: None) -> None:
        """Open them: a sample of each bag's topics, tables whole, but the first rows of a long text.

        Args:
            paths: Bags, tables, journals, extractions, or folders of bags.
            progress: Is told the share of a file that was read.
        """
        if not paths:
            raise FileFormatError("recording: expected at least one file, got none")
        self.paths = tuple(paths)
        self.notes: list[str] = []
        self._bags: list[Bag | ExtractedTopics | LongText] = []
        self._whole: list[Stream] = []
        bags: list[Bag] = []
        for path in paths:
            container, episode = container_of(path)
            if not container.exists():
                raise FileFormatError(f"{path}: no such file")
            if is_lerobot(container):
                self._whole += read_lerobot(container, episode)
            elif is_hdf5(container):
                self._whole += read_hdf5(container, episode)
            elif is_extraction(path):
                self._bags.append(ExtractedTopics(path))
            elif is_bag(path):
                bags += [Bag(part, progress) for part in bags_in(path)]
            elif table_ending(path) in TEXT_ENDINGS and path.stat().st_size > LONG_TEXT and not is_tracker_file(path):
                self._bags.append(LongText(path, progress))
            else:
                self._whole += read_table_file(path)
        bags.sort(key=lambda bag: bag.first_arrival)
        self._bags += bags
        self.about: About | None = same_origin([bag.about for bag in self._bags])
        self.streams = _joined([*self._whole, *(stream for bag in self._bags for stream in bag.sample())])
        if not any(stream.columns for stream in self.streams):
            said = [note for stream in self.streams for note in stream.notes]
            why = "; ".join([*said, *(note for bag in self._bags for note in bag.problems)])
            raise FileFormatError(f"{', '.join(map(str, paths))}: holds no numbers{f'; {why}' if why else ''}")

    @classmethod
    def of(cls, paths: Sequence[Path], streams: Sequence[Stream]) -> Self:
        """Return sources of streams that were read already."""
        made = cls.__new__(cls)
        made.paths, made.notes, made._bags, made.about = tuple(paths), [], [], None
        made._whole = made.streams = list(streams)
        return made

    @property
    def long_text(self) -> LongText | None:
        """The one long text table, where the recording is that alone."""
        only = self._bags[0] if len(self._bags) == 1 and not self._whole else None
        return only if isinstance(only, LongText) else None

    def holding(self, piece: Stream) -> Self:
        """Return it with a piece of its table to be read; what its first rows told stays."""
        self.sha256  # noqa: B018  once for all pieces
        made = copy(self)
        made._whole, made._bags, made.notes = [piece], [], []
        return made

    @property
    def name(self) -> str:
        """What the recording is called: as its first file, and its episode in it."""
        container, episode = container_of(self.paths[0])
        return " ".join([container.stem, *episode.split("/")[-1:]]).strip()

    @cached_property
    def sha256(self) -> str | None:
        """By which the recording is known again; None where it consists of several files."""
        container, episode = container_of(self.paths[0])
        if len(self.paths) > 1 or not container.is_file():
            return None
        return fingerprint([sha256_of(container), episode]) if episode else sha256_of(container)

    def read(self, wanted: Mapping[str, Collection[str]]) -> dict[str, Stream]:
        """Return streams with the columns wanted of each, whole."""
        found = [stream for stream in self._whole if stream.name in wanted]
        for bag in self._bags:
            here = {name: columns for name, columns in wanted.items() if name in bag.counts}
            if here:
                found += bag.read(here)
            self.notes += [note for note in bag.problems if note not in self.notes]
        return {stream.name: stream for stream in _joined(found)}


def container_of(path: Path) -> tuple[Path, str]:
    """Return the file or folder of a recording and, of CONTAINER/EPISODE, the episode in it; "" for all."""
    for outer in path.parents if not path.exists() else ():
        if outer.exists():
            is_one = is_hdf5(outer) if outer.is_file() else is_lerobot(outer)
            return (outer, path.relative_to(outer).as_posix()) if is_one else (path, "")
    return path, ""


def is_other_make(path: Path) -> bool:
    """Return whether a file, folder or episode is a recording that needs a mapping, or advice, by its kind alone."""
    container, episode = container_of(path)
    packed = container.suffix.lower() in (".gz", *ADVICE)
    return (
        bool(episode) or packed or is_lerobot(container) or is_hdf5(container) or table_ending(container) in _NAMELESS
    )


def is_bag(path: Path) -> bool:
    """Return whether a file or folder is a bag, by its ending or its metadata."""
    return is_bag_file(path) or (path.is_dir() and not is_lerobot(path))


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
    lengths = [0 if stream.stamp is None else len(stream.stamp) for stream in (first, second)]

    def column(name: str) -> NDArray[Any]:
        parts = zip((first, second), lengths, strict=True)
        return np.concatenate([s.columns[name] if name in s.columns else np.full(n, np.nan) for s, n in parts])

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
