"""Telemetry of an arm on exact sinusoids, and recordings of it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from catenary.raven2.topics import _GOLD_MEASURED_JS, EXT_JPOS, RAVENSTATE, raven_topics
from catenary.recording.bag_reader import JournalReader
from catenary.recording.journal import About, JournalTopic, JournalWriter
from catenary.recording.layout import ABOUT_TOPIC, ABOUT_TYPE, encode
from catenary.recording.messages import ros2_name, typestore
from catenary.recording.recorder import Recorder
from catenary.topics import Topic

START_NS = 1_600_000_000_000_000_000
CENTRE, AMPLITUDE, RATE = (0.7, 1.4, 0.37), (0.3, 0.4, 0.04), (0.2, 0.31, 0.25)  # rad|m, rad|m, rad/s
ABOUT = About(robot="raven2", simulated=True, seed=7, configuration={"trajectory": "sinusoids"})


def nominal(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Positions of shoulder, elbow, insertion (N, 3)."""
    return np.column_stack([c + a * np.sin(w * time) for c, a, w in zip(CENTRE, AMPLITUDE, RATE, strict=True)])


def encoder(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where they really are: a little off (N, 3)."""
    return 1.01 * nominal(time) + np.array([0.01, -0.02, 0.001])


def telemetry(time: NDArray[np.float64], rng: np.random.Generator) -> dict[str, NDArray[np.float64]]:
    """Every column of a RAVEN, gold arm on sinusoids, the rest random numbers in SI."""
    n = len(time)
    columns: dict[str, NDArray[np.float64]] = {
        c.name: rng.integers(-1000, 1000, (n, c.width)).astype(float) if c.whole else rng.normal(size=(n, c.width))
        for c in RAVENSTATE.columns
    }
    columns["dt"] = np.full((n, 1), 0.001)
    columns["jpos"][:, :3] = nominal(time)
    columns["ext_jpos"] = encoder(time)
    columns["measured_js"] = columns["jpos"][:, [0, 1, 2, 4, 5, 6, 7]]
    columns["joint_enc"] = np.rint(1e4 * columns["ext_jpos"])
    return columns


def record(folder: Path, seconds: float, *, max_bytes: int = 2**28, topics: Sequence[Topic] | None = None) -> Path:
    """Record that long at 1 kHz."""
    time = 0.001 * np.arange(round(1000 * seconds))
    columns = telemetry(time, np.random.default_rng(1))
    with Recorder(
        folder,
        topics if topics is not None else raven_topics(),
        columns,
        np.random.default_rng(2),
        about=ABOUT,
        start_ns=START_NS,
        max_bytes=max_bytes,
    ) as recorder:
        recorder.observe_many(time, columns)
    return folder


def write_journal(
    folder: Path, streams: Sequence[tuple[Topic, NDArray[np.int64], dict[str, NDArray[np.float64]]]]
) -> Path:
    """Write given messages with given stamps [ns], in the order given, stamped by arrival in that order."""
    with JournalWriter(folder, [JournalTopic(t.name, t.type) for t, _, _ in streams], ABOUT) as journal:
        for topic, stamp, columns in streams:
            for message, arrival in zip(encode(topic, stamp, columns), np.sort(stamp), strict=True):
                journal.append(topic.name, int(arrival), message.tobytes())
    return folder


def write_bag(journal: Path, path: Path, packing: str = "") -> Path:
    """Write a recording as one bag of all its topics, by rosbags: a `.bag`, whose chunks may be packed by BZ2 or LZ4, or
    a ROS 2 bag (a folder), with MCAP or, where its name ends in `.sqlite`, SQLite."""
    source, about = JournalReader(journal), ABOUT.as_json().encode()
    ros = 1 if path.suffix == ".bag" else 2
    storage = StoragePlugin.SQLITE3 if path.suffix == ".sqlite" else StoragePlugin.MCAP
    writer = Writer1(path) if ros == 1 else Writer2(path, version=8, storage_plugin=storage)
    if packing:
        writer.set_compression(Writer1.CompressionFormat[packing])
    with writer as bag:
        connections = {
            topic: bag.add_connection(topic, ros2_name(kind), typestore=typestore(ros))
            for topic, kind in ((ABOUT_TOPIC, ABOUT_TYPE), *source.topics)
        }
        stated = (ABOUT_TOPIC, START_NS, len(about).to_bytes(4, "little") + about)
        for topic, stamp, data in (stated, *source.messages()):
            to = connections[topic]
            bag.write(to, stamp, data if ros == 1 else typestore(2).ros1_to_cdr(data, to.msgtype))
    return path


# raven_state's fields as a row of the published CSV has them, behind its stamp
PUBLISHED = [
    "jpos", "runlevel", "sublevel", "last_seq", "type", "pos", "ori", "ori_d", "pos_d", "encVals", "dac_val",
    "tau", "mpos", "mvel", "jvel", "mpos_d", "jpos_d", "grasp_d", "encoffsets", "jac_vel", "jac_f",
]  # fmt: skip


def write_csv(journal: Path, path: Path, *, farthest: float = 0.05) -> Path:
    """Write a recording as RAVEN's group publishes it, 252 columns: a state, and the samples nearest to it in time."""
    read = {topic.name: [] for topic in (RAVENSTATE, EXT_JPOS, _GOLD_MEASURED_JS)}
    for name, _, data in JournalReader(journal).messages(tuple(read)):
        kind = RAVENSTATE.type if name == RAVENSTATE.name else EXT_JPOS.type
        message = typestore(1).deserialize_ros1(data, ros2_name(kind))
        stamp = (message.hdr if name == RAVENSTATE.name else message.header).stamp
        read[name].append((stamp.sec * 10**9 + stamp.nanosec, message))
    origin, rows = read[RAVENSTATE.name][0][0], []
    for stamp, state in read[RAVENSTATE.name]:
        row: list[object] = []
        for topic, zero in ((EXT_JPOS, origin), (_GOLD_MEASURED_JS, 0)):
            at, message = min(read[topic.name], key=lambda one: abs(one[0] - stamp))
            near = abs(at - stamp) <= farthest * 1e9
            row += [(at - zero) / 1e9, *message.position] if near else ["nan"] * (1 + len(topic.joint_names))
        row += [stamp / 1e9, *(value for name in PUBLISHED for value in np.atleast_1d(getattr(state, name)))]
        rows.append(",".join(map(str, row)))
    path.write_text("\n".join(rows) + "\n")
    return path
