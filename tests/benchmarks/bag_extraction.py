"""A long ROS 1 bag to Parquet, beside one Python object per message: messages a second, and peak memory.

`make bench-bags`, or `python -m tests.benchmarks.bag_extraction --hours 0.5`. The bag holds raven_state, measured_js and
ext_jpos at 100 Hz: ten minutes, repeated with their stamps moved on. The peer is rosbags' AnyReader, which gives every
message as an object whose fields are stacked into the same columns and written; it reads the bag's first minutes, since
its speed does not depend on the length but for its index. Each runs in a process of its own, by CPU time.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer

from catenary.raven2.topics import EXT_JPOS, GOLD_MEASURED_JS, RAVENSTATE_100HZ
from catenary.recording.messages import ros2_name, typestore
from catenary.recording.topic_samples import encode
from oracles.raven_recording import START_NS, telemetry
from tests.benchmarks.measure import Tables, report

TOPICS = (RAVENSTATE_100HZ, GOLD_MEASURED_JS, EXT_JPOS)
PERIOD = 10_000_000  # [ns]
PIECE = 600  # [s] that are repeated
PEER_SECONDS = 300
BEGIN = """
import json, sys, time
from pathlib import Path
def tell(messages, wall, cpu):
    # peak in GiB; getrusage would tell the parent's
    line = next(l for l in open("/proc/self/status") if l.startswith("VmHWM"))
    cpu = time.process_time() - cpu
    print(json.dumps({"messages": messages, "wall_s": time.perf_counter() - wall, "cpu_s": cpu,
                      "peak_gb": int(line.split()[1]) / 2**20, "messages_per_cpu_s": messages / cpu}))
"""
OURS = """
from catenary.recording.extract import extract
extract([Path(sys.argv[2])], Path(sys.argv[3]) / "warm")  # a short bag: imports, compiled code
wall, cpu = time.perf_counter(), time.process_time()
found = extract([Path(sys.argv[1])], Path(sys.argv[3]) / "out")
tell(sum(found.messages.values()), wall, cpu)
"""
PEER = """
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from rosbags.highlevel import AnyReader
from catenary.recording.topic_samples import topic_named
wall, cpu, count = time.perf_counter(), time.process_time(), 0
stamps, values = {}, {}
with AnyReader([Path(sys.argv[1])]) as reader:
    known = {c.topic: topic_named(c.topic) for c in reader.connections}
    for connection, arrival, data in reader.messages():
        topic = known[connection.topic]
        message = reader.deserialize(data, connection.msgtype)
        stamp = getattr(message, topic.header).stamp
        stamps.setdefault(topic.name, []).append((arrival, stamp.sec * 10**9 + stamp.nanosec))
        for column in topic.columns:
            if column.path != "dt":
                values.setdefault((topic.name, column.name), []).append(getattr(message, column.path))
        count += 1
for name, pairs in stamps.items():
    arrays = list(np.array(pairs).T)
    for column in topic_named(name).columns:
        if column.path != "dt":
            rows = np.array(values[name, column.name], dtype=float).reshape(len(pairs), -1) * column.to_si
            arrays += list(np.ascontiguousarray(rows.T))
    table = pa.table(arrays, names=[str(i) for i in range(len(arrays))])
    pq.write_table(table, Path(sys.argv[2]) / "peer.parquet", compression="lz4", use_dictionary=False)
tell(count, wall, cpu)
"""


def write_long_bag(path: Path, seconds: int) -> None:
    """Write a bag of that length, ordered by arrival."""
    rows = min(PIECE, seconds) * 100
    columns = telemetry(0.01 * np.arange(rows), np.random.default_rng(1))
    pieces = []
    for topic in TOPICS:
        own = {column.name: columns[column.name] for column in topic.columns if column.name in columns}
        pieces.append(encode(topic, START_NS + PERIOD * np.arange(rows), own))
    done = 0
    with Writer(path) as writer:
        known = typestore()
        connections = [writer.add_connection(t.name, ros2_name(t.type), typestore=known) for t in TOPICS]
        while done < seconds * 100:
            stamp = START_NS + PERIOD * (done + np.arange(rows))
            for topic, piece in zip(TOPICS, pieces, strict=True):
                place = f"{topic.header}.stamp"
                piece[f"{place}.sec"], piece[f"{place}.nsec"] = np.divmod(stamp, 10**9)
            for i in range(min(rows, seconds * 100 - done)):
                for k, connection in enumerate(connections):
                    writer.write(connection, int(stamp[i]) + k * 1_000_000, pieces[k][i].tobytes())
            done += rows


def measured(code: str, *arguments: Path) -> dict[str, float]:
    """Run a program of its own; what it printed."""
    command = [sys.executable, "-c", BEGIN + code, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found: dict[str, float] = json.loads(done.stdout)
    return found


def tables(hours: float, folder: str) -> Tables:
    """Time a long bag by catenary, and its first minutes by objects before and after."""
    with tempfile.TemporaryDirectory(dir=folder) as text:
        here = Path(text)
        long, short = here / "long.bag", here / "short.bag"
        write_long_bag(long, round(3600 * hours))
        write_long_bag(short, min(PEER_SECONDS, round(3600 * hours)))
        size = long.stat().st_size
        # before and after: what else the machine does changes within the minutes that a long bag takes
        before = measured(PEER, short, here)
        ours = measured(OURS, long, short, here)
        after = measured(PEER, short, here)
    speed, *peers = (row["messages_per_cpu_s"] for row in (ours, before, after))
    ours["times_faster"] = speed / float(np.mean(peers))
    rows = {"catenary": ours, "objects, before": before, "objects, after": after}
    return {f"{hours:g} hours, {size / 2**30:.2f} GiB": rows}


if __name__ == "__main__":
    report(tables, __doc__, hours=6.0, folder=tempfile.gettempdir())  # about 0.75 GB an hour
