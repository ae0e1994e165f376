"""The files of one recording, whatever format they are in, opened as streams of columns."""

import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from copy import copy
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Self

import numpy as np

from catenary.errors import FileFormatError, InputError
from catenary.file_formats import format_of
from catenary.files import fingerprint, sha256_of
from catenary.recording.bag_reader import bags_in
from catenary.recording.import_formats.columns import Stream, joined
from catenary.recording.import_formats.csv_files import TextTable
from catenary.recording.import_formats.message_columns import Bag
from catenary.recording.import_formats.one_clock import DIFFERENT_CLOCKS_S
from catenary.recording.import_formats.table_files import read_table_file
from catenary.recording.journal import About, same_origin
from catenary.topics import SECOND

_LONG_FILE_BYTES = 64 << 20  # from which a file is not held whole, where its format is read in parts

Progress = Callable[[float], object]


class Sources:
    """Bags and tables of one recording."""

    def __init__(self, paths: Sequence[Path], progress: Progress = lambda done: None) -> None:
        """Open them: of topics a sample is looked at, of a long text the first rows; `progress` is told of both."""
        self.today = time.time()  # which bounds what their clocks read [s since 1970]
        if not paths:
            raise FileFormatError("recording: expected at least one file, got none")
        self.paths = tuple(paths)
        self.notes: list[str] = []
        self._bags: list[Bag | TextTable] = []
        self._whole: list[Stream] = []
        shares: dict[Path, float] = {}  # of the bags and long texts, that were read

        def share_of(path: Path) -> Progress:
            def told(done: float) -> None:
                shares[path] = done
                progress(sum(shares.values()) / len(self._bags))

            return told

        for path in paths:
            container, episode = container_of(path)
            form = format_of(container)
            if not container.exists():
                raise FileFormatError(f"{path}: no such file")
            if form.holds == "messages":
                self._bags += [Bag(part, share_of(part)) for part in bags_in(path)]
            elif form.reader_in_parts and path.stat().st_size > _LONG_FILE_BYTES:
                self._bags.append(form.reads(path, form.reader_in_parts)(path, share_of(path)))
            else:
                self._whole += read_table_file(container, episode)
        self._bags.sort(key=lambda bag: bag.first_arrival)
        self.about: About | None = same_origin([bag.about for bag in self._bags])
        every = [*self._whole, *(stream for bag in self._bags for stream in bag.sample())]
        first = {stream.name: stream for stream in reversed(every)}
        for stream in every:
            own = first[stream.name]
            if stream is not own and (stream.type == "table" or own.type != stream.type):
                twice = f"{stream.name}: is there twice, as {own.type} and as {stream.type}"
                raise InputError(f"{twice}; expected parts of one recording")
        self.streams = _joined(every)
        if not any(stream.columns for stream in self.streams):
            said = [note for stream in self.streams for note in stream.notes]
            why = "; ".join([*said, *self.problems])
            raise FileFormatError(f"{', '.join(map(str, paths))}: holds no numbers{f'; {why}' if why else ''}")

    @classmethod
    def of(cls, paths: Sequence[Path], streams: Sequence[Stream]) -> Self:
        """Return sources of streams that were read already."""
        made = cls.__new__(cls)
        made.paths, made.notes, made._bags, made.about, made.today = tuple(paths), [], [], None, time.time()
        made._whole = made.streams = list(streams)
        return made

    @property
    def problems(self) -> list[str]:
        """What was damaged; complete once they were read."""
        return [note for bag in self._bags for note in bag.problems]

    @property
    def is_in_parts(self) -> bool:
        """Whether it is read in parts: one long text table alone, or bags alone that were recorded by one clock."""
        texts = sum(isinstance(bag, TextTable) for bag in self._bags)
        if self._whole or not self._bags or (texts and len(self._bags) > 1):
            return False
        early = [
            float(np.median(one.arrival - one.stamp)) / SECOND
            for one in self.streams
            if one.stamp is not None and one.arrival is not None and one.stamp.any()
        ]
        return len(self._bags) == 1 or not early or max(early) - min(early) <= DIFFERENT_CLOCKS_S

    def parts(self, wanted: Mapping[str, Collection[str]]) -> Iterator[list[Stream]]:
        """Yield thousands of rows as they arrived; of the first topic only up to where all others were read."""
        base, reached = next(iter(wanted)), [bag.first_arrival for bag in self._bags]
        here = [{name: those for name, those in wanted.items() if name in bag.counts} for bag in self._bags]
        reading = {i: bag.parts(here[i]) for i, bag in enumerate(self._bags) if here[i]}
        waiting: dict[int, list[Stream]] = {}
        while reading:
            i = min(reading, key=reached.__getitem__)
            yield waiting.pop(i, [])
            some = next(reading[i], None)
            if some is None:
                del reading[i]
                continue
            came = [int(one.arrival[-1]) for one in some if one.arrival is not None and one.rows]
            reached[i] = max([reached[i], *came])
            waiting[i] = [one for one in some if one.name == base]
            yield [one for one in some if one.name != base]

    def holding(self, streams: Sequence[Stream]) -> Self:
        """Return it with these to be read in place of its own; what was told of its columns stays."""
        self.sha256  # noqa: B018  once for all pieces
        made = copy(self)
        made._whole, made._bags, made.notes = list(streams), [], []
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
            found += chain.from_iterable(bag.parts(here) if here else ())
            self.notes += [note for note in bag.problems if note not in self.notes]
        return {stream.name: stream for stream in _joined(found)}


def container_of(path: Path) -> tuple[Path, str]:
    """Return the file or folder of a recording and, of CONTAINER/EPISODE, the episode in it; "" for all."""
    for outer in path.parents if not path.exists() else ():
        if outer.exists():
            is_one = format_of(outer).has_episodes
            return (outer, path.relative_to(outer).as_posix()) if is_one else (path, "")
    return path, ""


def needs_mapping(path: Path) -> bool:
    """Return whether a file, folder or episode is a recording that needs a mapping, or advice, by its format alone."""
    container, episode = container_of(path)
    form = format_of(container)
    return bool(episode or form.advice) or (form.holds == "columns" and not form.has_layouts)


def _joined(streams: Sequence[Stream]) -> list[Stream]:
    """Return streams with the parts of a topic that lie in several bags put one behind the other."""
    found: dict[str, list[Stream]] = {}
    for stream in streams:
        found.setdefault(stream.name, []).append(stream)
    return list(map(joined, found.values()))
