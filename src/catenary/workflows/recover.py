"""Write a whole recording from a damaged one: a journal from a journal, a bag from a bag; the damaged one stays."""

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as McapWriter

from catenary.errors import FileFormatError, InputError, RecordingError
from catenary.file_formats import format_named
from catenary.files import partial_folder
from catenary.operating_system import sync_file
from catenary.recording.bag_reader import JournalReader, Rescue, bags_in, open_recording, rescue_of
from catenary.recording.bag_stream import BagStream, Source
from catenary.recording.bag_writer import ROS2_VERSION, copy_messages
from catenary.recording.journal import JournalWriter

_UNKNOWN_HASH = "RIHS01_" + 64 * "0"  # of a type that only the bag defines


@dataclass(frozen=True)
class Recovery:
    """Result of a recovery."""

    source: Path
    written: Path | None  # None if nothing was damaged
    rescue: Rescue
    problems: tuple[str, ...]

    def as_data(self) -> dict[str, Any]:
        """Return plain data."""
        written = None if self.written is None else str(self.written)
        return {"from": str(self.source), "written": written, **self.rescue.as_data(), "problems": list(self.problems)}


def recover(path: Path, out: Path | None = None) -> Recovery:
    """Write the undamaged part of a recording as one of the same kind, in the same order; the original stays.

    Args:
        path: Journal or ROS 2 bag, a folder or one of its files, or ROS 1 bag.
        out: Folder, or .bag, to write; NAME.recovered beside `path` when None.

    Raises:
        FileFormatError: Nothing in it can be read.
        InputError: `out` exists, or is of another kind.
        RecordingError: It cannot be written.
    """
    bags = bags_in(path)
    if len(bags) != 1:
        raise FileFormatError(f"{path}: expected one recording, got a folder with {len(bags)} of them: name one")
    source = open_recording(bags[0])
    is_bag = isinstance(source, BagStream) and source.is_ros1
    place = _place(path, out, is_bag=is_bag)
    rescue = rescue_of([source])
    problems = tuple(source.problems)
    if not source.damage:
        return Recovery(path, None, rescue, problems)
    if not any(topic.kept for topic in rescue.topics):
        raise FileFormatError(f"{path}: no whole message is in it, nothing can be recovered: {problems[0]}")
    try:
        with partial_folder(place.parent) as folder:
            part = folder / place.name
            if isinstance(source, JournalReader):
                _write_journal(source, part, rescue)
            else:
                _write_bag(source, part, is_bag=is_bag)
            for written in part.rglob("*") if part.is_dir() else [part]:
                if written.is_file():
                    sync_file(written)  # the disk keeps it before it gets its name
            if place.exists():
                raise InputError(f"{place}: exists already, and is never overwritten")
            part.rename(place)
    except OSError as error:
        raise RecordingError(f"{place}: cannot be written: {error.strerror or error}; {path} is as it was") from error
    return Recovery(path, place, rescue, problems)


def _place(path: Path, out: Path | None, *, is_bag: bool) -> Path:
    stem = path.resolve().with_suffix("").name if format_named(path).holds == "messages" else path.resolve().name
    place = path.resolve().parent / f"{stem}.recovered{'.bag' if is_bag else ''}" if out is None else out
    if is_bag and place.suffix != ".bag":
        raise InputError(f"{place}: a ROS 1 bag is written; expected a name that ends in .bag")
    if not is_bag and format_named(place).holds == "messages":
        raise InputError(f"{place}: a folder is written; expected a name without {place.suffix}")
    if os.path.lexists(place):
        raise InputError(f"{place}: exists already, and is never overwritten; give another place with --out")
    if path.is_dir() and place.resolve().is_relative_to(path.resolve()):
        raise InputError(f"{place}: is inside the recording, which must not change; give another path")
    if not place.parent.is_dir():
        raise InputError(f"{place}: folder {place.parent} does not exist")
    return place


def _write_journal(source: JournalReader, part: Path, rescue: Rescue) -> None:
    about = source.about
    if about is not None:
        recovered = {"from": source.path.resolve().name, **rescue.as_data()}
        about = replace(about, configuration={**about.configuration, "recovered": recovered})
    with JournalWriter(part, source.topics, about) as journal:
        for remark in source.remarks:
            journal.note(remark)
        for message in source.messages():
            journal.append(*message)


def _write_bag(source: Source, part: Path, *, is_bag: bool) -> None:
    """Write a ROS 1 bag, or the folder of a ROS 2 bag, whose types are defined as in the source."""
    mcap: dict[str, Any] = {"version": ROS2_VERSION, "storage_plugin": StoragePlugin.MCAP}
    with BagWriter(part) if is_bag else McapWriter(part, **mcap) as bag:
        to = {}
        for topic, name, md5, definition in source.connections.values():
            how: dict[str, Any] = {"rihs01": _UNKNOWN_HASH, "serialization_format": source.encoding}
            how = {"md5sum": md5} if is_bag else how
            spelt = name.replace("/", "/msg/") if is_bag else name
            to[topic] = bag, bag.add_connection(topic, spelt, msgdef=definition, **how)
        copy_messages(source, to, "ros1" if source.encoding == "ros1" else "mcap", part)
