"""Recordings into Parquet: a file per topic, a column per number, in SI, in bounded memory."""

import contextlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from catenary.documents import json_table, shortened
from catenary.errors import FileFormatError, InputError
from catenary.files import sha256_of
from catenary.raven2.topics import RAVEN_TOPICS
from catenary.recording.bag_chunks import Block
from catenary.recording.bag_reader import Source, open_recordings
from catenary.recording.journal import About, same_origin
from catenary.recording.layout import Encoding
from catenary.recording.losses import Rescue
from catenary.recording.messages import current_name, md5_sum
from catenary.recording.parquet_files import open_parquet, read_table
from catenary.recording.topic_samples import decode, require_topics, topic_named
from catenary.topics import Topic

FORMAT = "catenary.topic.1"
ROW_GROUP = 8192  # messages that are in memory at once, per topic


@dataclass(frozen=True)
class Extraction:
    """What was extracted from a recording."""

    folder: Path
    files: Mapping[str, Path]  # by topic
    messages: Mapping[str, int]  # by topic
    about: About | None  # None where the recording does not say
    problems: tuple[str, ...]  # what was damaged, missing or left out
    rescued: Rescue | None = None  # of a recording that was interrupted or damaged


def extract(
    paths: Sequence[Path], folder: Path, *, topics: Sequence[str] | None = None, salvage: bool = False
) -> Extraction:
    """Extract a recording, which may lie in several files (one bag per topic, or in a row), into a folder.

    Each file has the columns `stamp` (header) and `arrival` [ns] and those of the topic, such as
    `jpos:gold_shoulder`; the unit is in the column's metadata, what the recording is of in the schema's. Messages
    keep the order and the stamps in which they were found.

    Args:
        paths: Journal, bags, MCAP files, or folders of them.
        folder: Where the files go; made if it is not there.
        topics: Names of those to extract; None for all that catenary knows.
        salvage: Read bags, too, that were cut off or are damaged: what is whole in them.
    """
    sources = open_recordings(paths, salvage=salvage)
    if folder.is_dir() and any(folder.glob("*.parquet")):
        raise InputError(f"{folder}: holds an extraction already; give another folder, or empty this one")
    about = same_origin([source.about for source in sources])
    wanted, problems = _choose(sources, topics)
    metadata = {
        "format": FORMAT,
        **json.loads((about if about is not None else About()).as_json()),
        "sources": [{"name": file.name, "sha256": sha256_of(file)} for path in paths for file in _files(path)],
    }
    writers: dict[str, _TopicWriter] = {}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for source in sources:
            here = {t.name: wanted[t.name] for t in source.topics if t.name in wanted}
            for name, arrivals, block in source.blocks(tuple(here)):
                if name not in writers:
                    writers[name] = _TopicWriter(folder, here[name], metadata)
                writers[name].add(arrivals, block, source.encoding)
            for writer in writers.values():
                writer.write()  # the next file may be in another encoding
            problems += source.problems
        files = {name: writer.close() for name, writer in writers.items()}
    except BaseException as error:
        for writer in writers.values():
            writer.abort()
        if isinstance(error, OSError):
            raise FileFormatError(f"{folder}: cannot be written: {error.strerror or error}") from error
        raise
    problems += [f"topic {name}: no messages" for name in wanted if name not in writers]
    counts = {name: writer.messages for name, writer in writers.items()}
    return Extraction(folder, files, counts, about, tuple(problems), _rescue(sources, files))


class TopicFile:
    """An extracted topic."""

    def __init__(self, path: Path) -> None:
        """Open it."""
        self.path = path
        where = f"{path}: schema"
        try:
            self._file = open_parquet(path)
            text = (self._file.schema_arrow.metadata or {}).get(b"catenary", b"")
            self._metadata = json_table(text, where, finite=False)
        except FileFormatError as error:
            why = str(error).removeprefix(f"{path}: ")
            raise FileFormatError(f"{path}: cannot be read as an extracted topic: {why}") from error
        if self._metadata.get("format") != FORMAT:
            raise FileFormatError(f"{where}: format {shortened(self._metadata.get('format'))}, expected {FORMAT!r}")
        named = topic_named(str(self._metadata.get("topic")))
        if named is None:
            raise FileFormatError(f"{where}: topic {shortened(self._metadata.get('topic'))}: not one of ours")
        self.topic: Topic = named
        self.about = About.from_json(text, f"{path}: schema")
        self.rows: int = self._file.metadata.num_rows
        self.row_groups: int = self._file.num_row_groups

    def rows_of(self, group: int) -> int:
        """Return the number of rows of a row group."""
        return int(self._file.metadata.row_group(group).num_rows)

    def read(self, columns: Sequence[str], group: int | None = None) -> dict[str, NDArray[Any]]:
        """Read columns by name, such as `stamp` or `jpos:gold_shoulder`; of one row group, or of all."""
        groups = range(self.row_groups) if group is None else [group]
        table = read_table(self.path, self._file, columns, groups)
        wrong = [name for name in ("stamp", "arrival") if name in columns and table.schema.field(name).type != "int64"]
        if wrong:
            raise FileFormatError(f"{self.path}: column {wrong[0]}: expected whole numbers [ns]")
        return {name: table.column(name).to_numpy() for name in columns}


def is_extraction(path: Path) -> bool:
    """Return whether a folder holds what `extract` writes: a Parquet file for each topic."""
    return path.is_dir() and not (path / "metadata.yaml").is_file() and any(path.glob("*.parquet"))


def topic_file(folder: Path, topic: Topic) -> TopicFile:
    """Open a topic of an extraction."""
    path = folder / f"{topic.stem}.parquet"
    if not path.is_file():
        there = ", ".join(sorted(p.stem for p in folder.glob("*.parquet"))) or "none"
        raise FileFormatError(f"{folder}: topic {topic.name} ({path.name}) is not there; topics there: {there}")
    return TopicFile(path)


class _TopicWriter:
    """Decodes and writes one topic, a row group at a time."""

    def __init__(self, folder: Path, topic: Topic, metadata: Mapping[str, Any]) -> None:
        self.topic = topic
        self.messages = 0
        self.path = folder / f"{topic.stem}.parquet"
        self._part = folder / f"{topic.stem}.parquet.part"
        fields = [pa.field(name, pa.int64(), metadata={"unit": "ns"}) for name in ("stamp", "arrival")]
        for column in topic.columns:
            kind = pa.int32() if column.whole else pa.float64()
            fields += [
                pa.field(name, kind, metadata={"unit": unit})
                for name, unit in zip(column.names, column.units, strict=True)
            ]
        about = {**metadata, "topic": topic.name, "type": topic.type, "md5": md5_sum(topic.type)}
        self._schema = pa.schema(fields, metadata={"catenary": json.dumps(about)})
        self._writer: pq.ParquetWriter | None = None
        self._blocks: list[tuple[NDArray[np.int64], Block]] = []
        self._rows = 0  # in the blocks
        self._encoding: Encoding = "ros1"

    def add(self, arrivals: NDArray[np.int64], block: Block, encoding: Encoding) -> None:
        self._blocks.append((arrivals, block))
        self._rows += len(block)
        self._encoding = encoding
        if self._rows >= ROW_GROUP:
            self.write()

    def write(self) -> None:
        """Write what was added since the last time."""
        if not self._blocks:
            return
        messages = Block.joined([block for _, block in self._blocks])
        arrivals = np.concatenate([arrivals for arrivals, _ in self._blocks])
        self._blocks, self._rows = [], 0
        samples = decode(self.topic, messages, self._encoding)
        arrays = [pa.array(samples.stamp), pa.array(arrivals)]
        for column in self.topic.columns:
            values = np.ascontiguousarray(samples.columns[column.name].T)
            arrays += [pa.array(row) for row in values]
        table = pa.table(arrays, schema=self._schema)
        if self._writer is None:
            self._writer = self._open(table)
        self._writer.write_table(table, row_group_size=len(messages))
        self.messages += len(messages)

    def _open(self, first: pa.Table) -> pq.ParquetWriter:
        """Begin the file; columns that mostly stay as they are, by its first rows, are compressed.

        Dictionaries and ranges do not pay for measured numbers, nor does compression: a fifth smaller, half as quick.
        """
        compression = {}
        for name, column in zip(first.column_names, first.columns, strict=True):
            values = column.to_numpy()
            stays = 2 * np.count_nonzero(values[1:] == values[:-1]) > len(values)
            compression[name] = "lz4" if stays else "none"
        return pq.ParquetWriter(
            self._part, self._schema, compression=compression, use_dictionary=False, write_statistics=False
        )

    def close(self) -> Path:
        self.write()
        writer = self._open(self._schema.empty_table()) if self._writer is None else self._writer
        writer.close()
        self._part.rename(self.path)
        return self.path

    def abort(self) -> None:
        with contextlib.suppress(OSError):  # the disk may be full; what is left bears another name
            if self._writer is not None:
                self._writer.close()
        with contextlib.suppress(OSError):
            self._part.unlink(missing_ok=True)


def _choose(sources: Sequence[Source], topics: Sequence[str] | None) -> tuple[dict[str, Topic], list[str]]:
    """Choose the topics to extract, by the name they have in the recording, and say what is left out."""
    there = {t.name: t.type for source in sources for t in source.topics}
    names = {name.strip("/"): name for name in there}
    require_topics("recording", [name for name in topics or () if name.strip("/") not in names], there)
    asked = list(there) if topics is None else [names[name.strip("/")] for name in topics]
    wanted, problems = {}, []
    for name in asked:
        topic = topic_named(name)
        if topic is None:
            problems.append(f"topic {name} of type {there[name]}: catenary does not know it; left out")
            continue
        if current_name(there[name]) != topic.type:
            raise FileFormatError(f"topic {topic.name}: expected {topic.type}, got {there[name]}")
        wanted[name] = topic
    if not wanted:
        raise FileFormatError(
            f"recording: has none of the topics {', '.join(t.name for t in RAVEN_TOPICS)}; "
            f"it has {', '.join(there) or 'none'}"
        )
    return wanted, problems


def _rescue(sources: Sequence[Source], files: Mapping[str, Path]) -> Rescue | None:
    """Return what is missing of sources that have been read, where they were not whole."""
    if not any(source.damage for source in sources):
        return None
    arrivals = {name: TopicFile(path).read(["arrival"])["arrival"] for name, path in files.items()}
    there = {topic.name: np.zeros(0, dtype=np.int64) for source in sources for topic in source.topics}
    holes = [hole for source in sources for hole in source.holes]
    return Rescue.of(there | arrivals, holes, ends_early=any(source.ends_early for source in sources))


def _files(path: Path) -> list[Path]:
    return sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
