"""A recording to read, whatever kind of file it is in: each kind from its first message to its last, by no index."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePath

import numpy as np

from catenary.errors import FileFormatError
from catenary.recording.bag_stream import BagStream
from catenary.recording.journal_reader import FilesInARow, JournalReader, is_journal
from catenary.recording.losses import Rescue
from catenary.recording.sqlite_bag import SqliteBag

METADATA = "metadata.yaml"
FILES = (".mcap", ".db3")  # that a ROS 2 bag consists of
_MOST_YAML = 2**18  # [B] of metadata.yaml; that of 500 topics has 200 kB
_LISTED = re.compile(r"""(?m)^\s*-\s+(?:&\w+\s+)?["']?([^\s"']+\.(?:mcap|db3)(?:\.zstd)?)["']?\s*$""")
_COUNTED = re.compile(r"(?m)^  message_count:\s*(\d+)\s*$")


class BagFolder(FilesInARow):
    """A ROS 2 bag (folder): its files in the order of time, what is whole of each."""

    def __init__(self, path: Path) -> None:
        """Open its files."""
        stated = _metadata(path)
        listed = listed_files(stated)
        there = sorted(file.name for file in path.iterdir() if file.suffix in FILES)
        missing = [name for name in listed if not (path / name).is_file()]
        is_listed = bool(listed) and not missing
        chosen = [name for name in there if name in listed] if is_listed else there
        damage = [f"{path / name}: is listed in {METADATA} and missing" for name in missing]
        packed = sorted(path.glob("*.zstd"))
        damage += [f"{file}: is packed, and was not read; `zstd -d {file.name}` unpacks it" for file in packed]
        self.warnings = list[str]()
        if (path / METADATA).is_file() and not listed:
            read = ", ".join(chosen)
            self.warnings.append(f"{path}/{METADATA}: lists no file; its files were read one by one: {read}")
        self.warnings += [
            f"{path / name}: lies in the folder, and {METADATA} does not list it: it was not read"
            for name in there
            if name not in chosen
        ]
        parts = list[BagStream | SqliteBag]()
        for name in chosen:
            try:
                parts.append(_file(path / name))
            except FileFormatError as error:
                damage.append(str(error))
        if not parts:
            inside = ", ".join(sorted(file.name for file in path.iterdir())[:5]) or "nothing"
            none = f"{path}: has no file of a bag; it holds {inside}, expected {', '.join(FILES)}"
            older = "; an earlier version wrote .journal: record it again" if ".journal" in inside else ""
            raise FileFormatError("; ".join(damage) or none + older)
        super().__init__(path, sorted(parts, key=_start))
        self.damage = [*damage, *(problem for part in self.parts for problem in part.damage)]
        self.counts = Counter[str]()
        for part in self.parts:
            self.counts.update(part.counts)
        held = sum(self.counts.values()) + sum(part.about is not None for part in self.parts)
        counted = _COUNTED.search(stated)
        if counted and held < int(counted[1]) and not self.damage:
            self.warnings.append(f"{path}: {METADATA} counts {counted[1]} messages, its files hold {held}")
        self.ends_early = self.parts[-1].ends_early or listed[-1:] == missing[-1:] != []

    @property
    def problems(self) -> list[str]:
        """What was said of the folder, and what is missing."""
        return [f"warning: {problem}" for problem in dict.fromkeys([*self.warnings, *self.damage])]

    def _each(self) -> Iterator[tuple[BagStream | SqliteBag, list[str]]]:
        """Yield the files; where one is missing or damaged, nobody knows what lies between it and the next."""
        self.holes = []
        for part, topics in super()._each():
            yield part, topics
            self.holes += [*part.holes, *([(part.last, None)] if self.damage else [])]


Source = BagStream | SqliteBag | BagFolder | JournalReader  # of messages, in the order of arrival


def _start(source: Source) -> int:
    return 2**63 if source.first is None else source.first


def _metadata(path: Path) -> str:
    try:
        with (path / METADATA).open("rb") as file:
            return file.read(_MOST_YAML).decode(errors="replace")
    except OSError:
        return ""


def listed_files(metadata: str) -> list[str]:
    """Return the names of the files that a ROS 2 bag's metadata list, as far as they can be read."""
    return [PurePath(name).name for name in _LISTED.findall(metadata)]


def bags_in(path: Path) -> list[Path]:
    """Return the bag, or those in a folder that is none itself."""
    if not path.is_dir() or (path / METADATA).is_file() or is_journal(path):
        return [path]
    inside = [p for p in path.iterdir() if is_bag_file(p) or (p / METADATA).is_file()]
    return sorted(inside) or [path]


def is_bag_file(path: Path) -> bool:
    """Return whether a file is a bag by its name; rosbag's while it records is NAME.bag.active."""
    return path.suffix in (".bag", *FILES) or path.name.endswith(".bag.active")


def _file(path: Path) -> BagStream | SqliteBag:
    return (SqliteBag if path.suffix == ".db3" else BagStream)(path)


def open_recording(path: Path) -> Source:
    """Open a journal (folder or file), a ROS 1 bag, an MCAP file, a SQLite file or a ROS 2 bag (folder).

    Of one that was cut off or is damaged what is whole is read; `damage` says what is not.
    """
    if not path.exists():
        raise FileFormatError(f"{path}: no such recording")
    if is_journal(path):
        return JournalReader(path)
    if path.is_dir():
        return BagFolder(path)
    if not is_bag_file(path):
        raise FileFormatError(f"{path}: expected a journal, a .bag, an .mcap, a .db3 or a folder with {METADATA}")
    source = _file(path)
    others = [name for name in listed_files(_metadata(path.parent)) if name != path.name]
    if others:
        source.warnings.append(f"warning: {path}: is one file of a bag; not read were {', '.join(others)}")
    return source


def open_recordings(paths: Sequence[Path]) -> tuple[Source, ...]:
    """Open several files of one recording, such as one bag per topic; a folder of bags stands for all of them."""
    found = [bag for path in paths for bag in bags_in(path)]
    if not found:
        raise FileFormatError("recording: expected at least one file, got none")
    return tuple(sorted(map(open_recording, found), key=_start))


def rescue_of(sources: Sequence[Source]) -> Rescue:
    """Read when all messages of a recording's files arrived, and what is missing; the files' `damage` is then known."""
    arrivals = {topic.name: [np.zeros(0, dtype=np.int64)] for source in sources for topic in source.topics}
    for source in sources:
        for topic, arrived, _ in source.blocks([topic.name for topic in source.topics]):
            arrivals[topic].append(arrived)
    holes = [hole for source in sources for hole in source.holes]
    each = {topic: np.concatenate(there) for topic, there in arrivals.items()}
    return Rescue.of(each, holes, ends_early=any(source.ends_early for source in sources))
