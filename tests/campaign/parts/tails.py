"""Recordings whose end a power cut or a failing disk left as zeros, as old bytes, as random ones, or not at all.

Whatever is behind the tear: the recording is read, no trusted row is another than the intact recording's, and what was
whole before the tear is there, of what is packed up to the chunk. `recover` writes just that.
"""

import random
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from tests.campaign.part import Fell, Part

SECONDS, STATE, CAMERA = 12.0, "/arm/state", "/camera/joints"
TYPE = "sensor_msgs/msg/JointState"
MAPPING = {
    "q_nominal": {"columns": f"{STATE}.position", "units": ["rad", "rad", "m"]},
    "q_encoder": {"columns": f"{CAMERA}.position", "units": ["rad", "rad", "m"]},
}
CHUNK = 16_000  # [B]
Sent = tuple[str, int, bytes]


@cache
def messages(ros: int) -> tuple[Sent, ...]:
    """An arm's joints at 50 Hz with jitter, a camera's at 30 Hz: topic, arrival [ns], bytes."""
    from rosbags.typesys import Stores, get_typestore

    from lab_bags import JOINTS, START, header, joint_state, true_q

    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
    serialise = store.serialize_ros1 if ros == 1 else store.serialize_cdr
    rng, found = random.Random(1), []
    for topic, period in ((STATE, 0.02), (CAMERA, 1 / 30)):
        time = 0.0
        while time < SECONDS:
            stamp = START + round(time * 1e9)
            noise = [rng.gauss(0.0, 1e-4) for _ in range(3)]
            made = joint_state(JOINTS, true_q(time) + noise)(store, header(store, stamp, ros1=ros == 1))
            found.append((topic, stamp + rng.randrange(1000, 2_000_000), bytes(serialise(made, TYPE))))
            time += period * rng.uniform(0.9, 1.1)
    return tuple(sorted(found, key=lambda message: message[1]))


def _journal(folder: Path, sent: tuple[Sent, ...], after: Any = None) -> Path:
    """Write a journal that reaches the disk every half second of its own time."""
    from catenary.recording.journal import JournalTopic, JournalWriter

    topics = [JournalTopic(topic, "sensor_msgs/JointState") for topic in (STATE, CAMERA)]
    with JournalWriter(folder, topics, after=after, flush_interval=600.0) as journal:
        flushed = 0
        for message in sent:
            if message[1] - flushed > 500_000_000:
                journal.flush()
                flushed = message[1]
            journal.append(*message)
    return max(folder.glob("*.mcap"))


def _mcap(path: Path, *, packing: str = "NONE", **options: Any) -> Path:
    from mcap.writer import CompressionType, Writer
    from rosbags.typesys import Stores, get_typestore

    with path.open("wb") as file:
        writer = Writer(file, **{"chunk_size": CHUNK, **options, "compression": CompressionType[packing]})
        writer.start("ros2", "another's")
        text = get_typestore(Stores.ROS2_HUMBLE).generate_msgdef(TYPE, ros_version=2)[0]
        schema = writer.register_schema(TYPE, "ros2msg", text.encode())
        channels = {topic: writer.register_channel(topic, "cdr", schema) for topic in (STATE, CAMERA)}
        for topic, stamp, data in messages(2):
            writer.add_message(channels[topic], stamp, data, stamp)
        writer.finish()
    return path


def _ros1(path: Path, *, packing: str = "", chunk: int = CHUNK) -> Path:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    writer, store = Writer(path), get_typestore(Stores.ROS1_NOETIC)
    writer.chunk_threshold = chunk
    if packing:
        writer.set_compression(Writer.CompressionFormat[packing])
    with writer:
        to = {topic: writer.add_connection(topic, TYPE, typestore=store) for topic in (STATE, CAMERA)}
        for topic, stamp, data in messages(1):
            writer.write(to[topic], stamp, data)
    return path


def _active(path: Path) -> Path:
    """Make of a bag of one chunk what rosbag leaves when it is killed: the chunk's lengths are not written yet."""
    data = bytearray(path.read_bytes())
    place = data.index(b"op=\x05") - 4
    head = data.index(b"size=") + 5
    end = max(head + 4, place + 8, data.index(b"compression=none") + 16)
    data[head : head + 4] = data[end : end + 4] = bytes(4)
    path.write_bytes(data[: data.index(b"ver=")])
    return path


KINDS: dict[str, Callable[[Path], Path]] = {
    "journal": lambda folder: _journal(folder / "run", messages(1)),
    "resumed": lambda folder: _journal(folder / "run", messages(1)),
    "mcap": lambda folder: _mcap(folder / "a.mcap"),
    "mcap.lz4": lambda folder: _mcap(folder / "a.mcap", packing="LZ4"),
    "mcap.zstd": lambda folder: _mcap(folder / "a.mcap", packing="ZSTD"),
    "mcap.unchecked": lambda folder: _mcap(folder / "a.mcap", enable_crcs=False),
    "mcap.unchecked.lz4": lambda folder: _mcap(folder / "a.mcap", packing="LZ4", enable_crcs=False),
    "mcap.unchunked": lambda folder: _mcap(folder / "a.mcap", use_chunking=False),
    "mcap.one": lambda folder: _mcap(folder / "a.mcap", chunk_size=2**22),
    "bag": lambda folder: _ros1(folder / "a.bag"),
    "bag.bz2": lambda folder: _ros1(folder / "a.bag", packing="BZ2"),
    "bag.lz4": lambda folder: _ros1(folder / "a.bag", packing="LZ4"),
    "bag.one": lambda folder: _ros1(folder / "a.bag", chunk=2**22),
    "bag.active": lambda folder: _active(_ros1(folder / "a.bag", chunk=2**22)),
}


def _rows(path: Path) -> dict[int, tuple[float, ...]]:
    """Return the trusted rows of a recording: positions by their stamp [ns], from its first row on."""
    from catenary.workflows.import_recording import import_recording

    log = import_recording(path, MAPPING)
    rows = zip(log.time.tolist(), log.q_nominal.tolist(), log.q_encoder.tolist(), log.ok.tolist(), strict=True)
    return {round(time * 1e9): (*nominal, *measured) for time, nominal, measured, ok in rows if ok}


@cache
def whole(kind: str) -> tuple[bytes, dict[int, tuple[float, ...]], list[tuple[int, int]]]:
    """An intact file, its rows, and behind which byte how many messages of the arm are whole, or packed in whole chunks."""
    from mcap.reader import make_reader
    from rosbags.rosbag1 import Reader

    file = KINDS[kind](Path(tempfile.mkdtemp(prefix="campaign-tails-")))
    data, found = file.read_bytes(), list[tuple[int, int]]()
    sent = messages(1 if file.suffix == ".bag" or "run" in file.parts else 2)
    if file.suffix == ".bag" and "." in kind and kind not in ("bag.one", "bag.active"):
        with Reader(file) as reader:
            ends = [info.pos for info in reader.chunk_infos[1:]]
            spans = [info.end_time for info in reader.chunk_infos]
        found = [
            (end, sum(m[0] == STATE and m[1] <= last for m in sent)) for end, last in zip(ends, spans, strict=False)
        ]
    elif "lz4" in kind or "zstd" in kind:
        with file.open("rb") as opened:
            chunks = make_reader(opened).get_summary().chunk_indexes
        found = [
            (c.chunk_start_offset + c.chunk_length, sum(m[0] == STATE and m[1] <= c.message_end_time for m in sent))
            for c in chunks
        ]
    else:
        place, count = 0, 0
        for topic, _, content in sent:
            place = data.index(content, place) + len(content)
            count += topic == STATE
            found.append((place, count))
    return data, _rows(file.parent if "run" in file.parts else file), found


def tail(rng: random.Random, data: bytes, tear: int) -> tuple[str, bytes]:
    """Return what is behind the tear, and its kind."""
    left = len(data) - tear
    size = rng.choice((left, rng.randrange(1, left + 1), 4096 - tear % 4096, rng.randrange(1, 20_000), 8192))
    kind = rng.choice(("nothing", "zeros", "zeros", "old", "old", "random"))
    if kind == "old":
        back = rng.choice((rng.randrange(1, tear), 512, 4096, 8192, CHUNK))
        period = data[tear : tear + 20]
        if rng.random() < 0.3 and (before := data.rfind(period[:9], 0, tear)) > 0:  # as if records lay one on the other
            back = tear - before
        begin = max(0, tear - back)
        return kind, (data[begin:tear] * (size // max(1, tear - begin) + 1))[:size]
    return kind, {"nothing": b"", "zeros": bytes(size), "random": rng.randbytes(size)}[kind]


def case(seed: int, folder: Path) -> None:
    """Tear a file of any kind."""
    rng = random.Random(seed)
    name = rng.choice(sorted(KINDS))
    data, _, _ = whole(name)
    tear = rng.randrange(len(data) // 5, len(data))
    if rng.random() < 0.3:
        tear -= tear % rng.choice((512, 4096))
    kind, behind = tail(rng, data, tear)
    torn(name, tear, behind, folder, f"{kind}, ", recovers=seed % 3 == 0)


def torn(name: str, tear: int, behind: bytes, folder: Path, said: str = "", *, recovers: bool = True) -> None:
    """Read a file with these bytes behind a tear, and hold its rows against the intact one's."""
    from catenary.recording.bag_reader import JournalReader, open_recording
    from catenary.workflows.recover import recover

    data, true, ends = whole(name)
    is_journal = name in ("journal", "resumed")
    path = folder / ("run" if is_journal else f"a{'.bag' if name.startswith('bag') else '.mcap'}")
    file = path / "0000.mcap" if is_journal else path
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(data[:tear] + behind)
    what = f"{name}, {said}{len(behind)} bytes from {tear} of {len(data)} on"
    if name == "resumed":
        left = JournalReader(path).left_off()
        _journal(path, tuple(m for m in messages(1) if m[1] > left.last + 300_000_000), left)
    source = open_recording(path)
    kept = sum(topic == STATE for topic, _, _ in source.messages())
    least = max([count for end, count in ends if end <= tear], default=0)
    if kept < least - 1:
        raise Fell(f"{what}: {kept} messages, of {least} that were whole")
    read = _rows(path)
    wrong = [time for time, row in read.items() if true.get(time) != row]
    if wrong:
        raise Fell(f"{what}: {len(wrong)} wrong rows, the first at {wrong[0] / 1e9:.3f} s")
    if kept < sum(m[0] == STATE for m in messages(1)) and not source.problems:
        raise Fell(f"{what}: nothing was said of what is lost")
    if not recovers:
        return
    found = recover(path, folder / f"saved{'.bag' if name.startswith('bag') else ''}")
    if found.written is None:
        if found.problems and kept < max(count for _, count in ends):
            raise Fell(f"{what}: recover wrote nothing")
    elif _rows(found.written) != read or {t.topic: t.kept for t in found.rescue.topics}[STATE] != kept:
        raise Fell(f"{what}: recover wrote other rows, or counts others than {kept}")


PARTS = (Part("tails.recordings", 500, case, processor_time=120.0),)
