"""Recordings and logs whose bytes were damaged: read to their end, or refused by a CatenaryError."""

import random
from functools import cache
from pathlib import Path

from tests.campaign.byte_part import files_part, sample
from tests.campaign.mutants import Place, mutant, same_length

Sample = tuple[bytes, tuple[Place, ...]]  # a whole file, and where lengths stand in it


@cache
def _journal_folder() -> Path:
    """A short recording."""
    from oracles.raven_recording import record

    return record(sample("journal"), 0.6)


def _whole(source: object) -> None:
    for _ in source.messages():  # type: ignore[attr-defined]
        pass


def _read_recording(rng: random.Random, path: Path, folder: Path, *, salvage: bool) -> None:
    """Read all messages; of every third file also extract them."""
    from catenary.errors import CatenaryError
    from catenary.recording.bag_reader import open_recording
    from catenary.recording.bag_stream import BagStream
    from catenary.recording.extract import extract

    try:
        _whole(open_recording(path))
    except CatenaryError:
        if not salvage:
            raise
        _whole(BagStream(path))
    if rng.random() < 0.3:
        extract([path], folder / "extracted", salvage=salvage)


# journal


@cache
def _journal() -> Sample:
    (path,) = _journal_folder().glob("*.mcap")
    content, position, places = path.read_bytes(), 8, []
    while position + 9 <= len(content) - 8:  # the length of every record, and what begins it
        places += [(position + 1, 8), (position + 9, 8), (position + 25, 8)]
        position += 9 + int.from_bytes(content[position + 1 : position + 9], "little")
    return content, tuple(places)


def journal_case(seed: int, folder: Path) -> None:
    rng = random.Random(seed)
    path = folder / "0000.mcap"
    path.write_bytes(mutant(rng, *_journal()))
    _read_recording(rng, path, folder, salvage=False)


# ROS 1 bags and MCAP


def _length_places(content: bytes, starts: list[int], at: tuple[Place, ...]) -> tuple[Place, ...]:
    return tuple((i + k, size) for i in starts for k, size in at if i + k + size <= len(content))


@cache
def _bag(compression: str) -> Sample:
    from rosbags.rosbag1 import Writer

    from catenary.recording.journal_reader import JournalReader
    from catenary.recording.messages import ros2_name, typestore

    path = sample("a.bag")
    source = JournalReader(_journal_folder())
    writer = Writer(path)
    if compression:
        writer.set_compression(getattr(Writer.CompressionFormat, compression))
    with writer as bag:
        connections = {
            topic: bag.add_connection(topic, ros2_name(kind), typestore=typestore(1)) for topic, kind in source.topics
        }
        for topic, stamp, data in source.messages():
            bag.write(connections[topic], stamp, data)
    content = path.read_bytes()
    return content, _bag_places(content)


def _bag_places(content: bytes) -> tuple[Place, ...]:
    """Lengths of records, of their headers and fields, and what fields count."""
    places: list[Place] = []

    def records(position: int, end: int) -> None:
        while position + 4 <= end:
            places.append((position, 4))
            length = int.from_bytes(content[position : position + 4], "little")
            field, stop = position + 4, position + 4 + length
            is_chunk = False
            while field + 4 <= stop:
                places.append((field, 4))
                size = int.from_bytes(content[field : field + 4], "little")
                text = content[field + 4 : field + 4 + size]
                key, _, value = text.partition(b"=")
                if len(value) in (1, 4, 8):
                    places.append((field + 4 + len(key) + 1, len(value)))
                is_chunk = is_chunk or text in (b"compression=none",)
                field += 4 + size
            places.append((stop, 4))
            size = int.from_bytes(content[stop : stop + 4], "little")
            if is_chunk:
                records(stop + 4, stop + 4 + size)
            position = stop + 4 + size

    records(13, len(content))
    return tuple(places)


def bag_case(seed: int, folder: Path) -> None:
    rng = random.Random(seed)
    path = folder / "a.bag"
    path.write_bytes(mutant(rng, *_bag(rng.choice(("", "", "BZ2", "LZ4")))))
    _read_recording(rng, path, folder, salvage=rng.random() < 0.5)


@cache
def _ros2_bag(kind: str, packed: bool) -> Path:
    """A ROS 2 bag: a folder."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    from catenary.recording.journal_reader import JournalReader
    from catenary.recording.messages import ros2_name, typestore

    path = sample("a")
    source = JournalReader(_journal_folder())
    writer = Writer(path, version=8, storage_plugin=StoragePlugin[kind])
    if packed:
        mode = CompressionMode.STORAGE if kind == "MCAP" else CompressionMode.MESSAGE
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer as bag:
        connections = {
            topic: bag.add_connection(topic, ros2_name(name), typestore=typestore(2)) for topic, name in source.topics
        }
        for topic, stamp, data in source.messages():
            bag.write(connections[topic], stamp, typestore(2).ros1_to_cdr(data, connections[topic].msgtype))
    return path


@cache
def _mcap(packed: bool) -> Sample:
    (path,) = _ros2_bag("MCAP", packed).glob("*.mcap")
    content = path.read_bytes()
    places: list[Place] = []

    def records(position: int, end: int) -> None:
        while position + 9 <= end:
            kind, length = content[position], int.from_bytes(content[position + 1 : position + 9], "little")
            places.append((position + 1, 8))
            places.extend((position + 9 + k, 4) for k in range(0, min(length, 80) - 4, 2))
            if kind == 6:
                name = int.from_bytes(content[position + 37 : position + 41], "little")
                if not name:
                    records(position + 49, position + 9 + length)
            position += 9 + length

    records(8, len(content) - 8)
    return content, tuple(places)


def mcap_case(seed: int, folder: Path) -> None:
    rng = random.Random(seed)
    path = folder / "a.mcap"
    path.write_bytes(mutant(rng, *_mcap(rng.random() < 0.5)))
    _read_recording(rng, path, folder, salvage=rng.random() < 0.5)


def ros2_bag_case(seed: int, folder: Path) -> None:
    """SQLite or the metadata of a ROS 2 bag."""
    rng = random.Random(seed)
    kind, packed = rng.choice((("SQLITE3", False), ("SQLITE3", True), ("MCAP", False)))
    bag = folder / "a"
    bag.mkdir()
    sample = _ros2_bag(kind, packed)
    for file in sample.iterdir():
        (bag / file.name).write_bytes(file.read_bytes())
    damaged = bag / ("metadata.yaml" if kind == "MCAP" or rng.random() < 0.2 else "a.db3")
    damaged.write_bytes(mutant(rng, damaged.read_bytes(), ((16, 2), (28, 4), (32, 4), (36, 4), (44, 4), (52, 4))))
    _read_recording(rng, bag, folder, salvage=False)


# logs


@cache
def _extraction() -> Path:
    from catenary.recording.extract import extract

    folder = sample("extracted")
    extract([_journal_folder()], folder)
    return folder


@cache
def _parquet(checked: bool) -> bytes:
    """A motion log; without checksums of its pages, damage reaches behind them."""
    import pyarrow.parquet as pq

    from catenary.recording.import_formats.raven_recordings import read_raven
    from catenary.recording.logs import write_parquet

    path = sample("log.parquet")
    write_parquet(read_raven([_csv_file()]).log, path)
    if not checked:
        pq.write_table(pq.read_table(path), path, compression="none", use_dictionary=False)
    return path.read_bytes()


def _damaged_parquet(rng: random.Random, whole: bytes) -> bytes:
    """Damage anything, or only the pages, so that the directory behind them is read; or only the directory."""
    begin = len(whole) - 8 - int.from_bytes(whole[-8:-4], "little")
    part = rng.random()
    if part < 0.3:
        return mutant(rng, whole)
    if part < 0.7:
        return whole[:4] + same_length(rng, whole[4:begin]) + whole[begin:]
    directory = bytearray(whole[begin:-8])
    for _ in range(rng.choice((1, 1, 2, 4))):
        directory[rng.randrange(len(directory))] ^= 1 << rng.randrange(8)
    return whole[:begin] + directory + whole[-8:]


def parquet_case(seed: int, folder: Path) -> None:
    from catenary.recording.logs import read_log

    rng = random.Random(seed)
    path = folder / "log.parquet"
    path.write_bytes(_damaged_parquet(rng, _parquet(rng.random() < 0.3)))
    read_log(path)


def topic_case(seed: int, folder: Path) -> None:
    """An extracted topic."""
    from catenary.raven2.topics import EXT_JPOS
    from catenary.recording.extract import topic_file

    rng = random.Random(seed)
    whole = (_extraction() / f"{EXT_JPOS.stem}.parquet").read_bytes()
    (folder / f"{EXT_JPOS.stem}.parquet").write_bytes(_damaged_parquet(rng, whole))
    names = [name for column in EXT_JPOS.columns for name in column.names]
    topic_file(folder, EXT_JPOS).read(["stamp", "arrival", *names])


@cache
def _csv_file() -> Path:
    from catenary.recording.import_formats.raven_recordings import write_raven_csv

    path = sample("raven.csv")
    write_raven_csv(_extraction(), path)
    return path


def csv_case(seed: int, folder: Path) -> None:
    from catenary.recording.logs import read_log

    rng = random.Random(seed)
    content = _csv_file().read_bytes()
    if rng.random() < 0.5:  # a cell becomes something else
        cells = content.split(b",")
        for _ in range(rng.choice((1, 1, 3))):
            cells[rng.randrange(len(cells))] = rng.choice(
                (b"", b"nan", b"inf", b"-1e308", b"1e400", b"9" * 5000, b'"', b"\n", b"x", b"0x10", b"-0", b"1e-320")
            )
        content = b",".join(cells)
    else:
        content = mutant(rng, content)
    path = folder / "raven.csv"
    path.write_bytes(content)
    read_log(path)


PARTS = tuple(
    files_part(name, case)
    for name, case in (
        ("journal", journal_case),
        ("ros1_bag", bag_case),
        ("mcap", mcap_case),
        ("ros2_bag", ros2_bag_case),
        ("parquet_log", parquet_case),
        ("parquet_topic", topic_case),
        ("csv", csv_case),
    )
)
