"""`catenary serve` over ROS 1 beside a client that hears every topic: rate, loss, latency, processor time, memory.

`make bench-serving`, or `python -m tests.benchmarks.serving --seconds 600`; needs rospy and its master, and starts a
master of its own. Percentiles, since a maximum measures the machine. Two listeners, one after the other: one that reads
its sockets and nothing else (socket_listener.py), and one of catenary's own clients, by rospy.
"""

import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))  # `ros`, as pytest finds it

from benchmarks.programs import CATENARY, memory, options, tell
from catenary.crtk.names import topics
from ros import Program, running_master

CLIENT = """
import json, sys, time
import numpy as np
from catenary.crtk.message import message_class
from catenary.crtk.ros1.transport import Ros1Transport
transport = Ros1Transport("listener")
heard = [transport.subscribe(topic, kind, depth=100_000) for topic, kind in json.loads(sys.argv[1])]
timed = next(one for one in heard if one.topic == "/arm1/setpoint_js")
jr = transport.publisher("/arm1/servo_jr", "sensor_msgs/JointState")
command = transport.publisher("/arm1/state_command", "crtk_msgs/StringStamped", latch=True)
while not (len(timed) and transport.connections("/arm1/servo_jr").subscribers):
    time.sleep(0.01)
time.sleep(1.5)
for one in heard:
    one.take()
command.publish(message_class("crtk_msgs/StringStamped")(string=sys.argv[3]))
time.sleep(0.2)
timed.take()
begin, end, counts, latency = time.monotonic(), float(sys.argv[2]), [0] * len(heard), []
seqs, lost, sent, cpu = [None] * len(heard), 0, 0, time.process_time()
step = np.zeros(7)
rate = transport.rate(100.0)
while time.monotonic() - begin < end:
    for i, one in enumerate(heard):
        for message, arrived in one.take():
            counts[i] += 1
            seq = message[0].seq
            if seqs[i] is not None:
                lost += seq - seqs[i] - 1
            seqs[i] = seq
            if one is timed:
                latency.append(arrived - message.header.stamp)
                last = message.position[0]
                if sent == 0:
                    first = last
    if latency:
        step[0] = 1e-5 if sent // 1000 % 2 == 0 else -1e-5
        jr.publish(message_class("sensor_msgs/JointState")(position=step.copy()))
        sent += 1
    rate.sleep()
wall = time.monotonic() - begin
time.sleep(0.3)
for message, _ in timed.take():
    last = message.position[0]
forth, rest = divmod(sent, 2000)
expected = 1e-5 * min(rest, 2000 - rest)
print(json.dumps({
    "hertz": len(latency) / wall, "messages": sum(counts), "lost": lost,
    "commands": sent, "command_error": abs(last - first - expected),
    "listener_cores": (time.process_time() - cpu) / wall, "overflowed": sum(one.overflowed for one in heard),
    **{f"p{100 * q:g}_ms": float(np.quantile(latency, q)) / 1e6 for q in (0.5, 0.9, 0.99, 0.999)}}))
"""

LISTENERS = {"sockets": "from benchmarks.socket_listener import main; main()", "rospy": CLIENT}


def measure(dialect: str, listener: str, seconds: float) -> dict[str, Any]:
    """Serve a homed robot to one client that hears everything and commands at 100 Hz."""
    wanted = [(topic.name, topic.type) for topic in topics(dialect) if topic.direction == "out"]  # type: ignore[arg-type]
    serve = ("serve", "--homed", "--json", "--dialect", dialect)
    with (
        tempfile.TemporaryDirectory() as folder,
        running_master(Path(folder)) as master,
        Program(master, CATENARY, *serve) as server,
    ):
        server.line()
        served = {json.loads(server.line())["lost_ticks"]}
        resume = "resume" if dialect == "raven" else "enable"
        with Program(master, LISTENERS[listener], json.dumps(wanted), str(seconds), resume) as client:
            rows = [(memory(server.process.pid), json.loads(server.line()))]
            end = time.monotonic() + seconds
            while time.monotonic() < end:
                row = json.loads(server.line())
                rows.append((memory(server.process.pid), row))
            found = json.loads(client.line())
            client.finish()
        server.interrupt()
        server.finish()
    settled = rows[min(10, len(rows) // 4) :]
    cores = sorted(row["cpu"] for _, row in settled)
    return {
        "seconds": seconds,
        **found,
        # medians and quiet seconds: other programs, and the listener itself, slow a server down
        "server_cores": cores[len(cores) // 2],
        "server_cores_p10": cores[len(cores) // 10],
        "server_cores_p90": cores[len(cores) * 9 // 10],
        "server_hertz": sum(row["rate_hz"] for _, row in settled) / len(settled),
        "ticks_lost": rows[-1][1]["lost_ticks"] - min(served),
        "overflowed_at_server": rows[-1][1]["overflowed"],
        "memory_mb": settled[-1][0],
        "memory_growth_mb": settled[-1][0] - settled[0][0],
    }


def main() -> None:
    """Measure, print, and write JSON where `--json FILE` says."""
    given = options(__doc__, dialect=("raven", "crtk"), listener=tuple(LISTENERS))
    tables = {
        f"{dialect}, {listener}": measure(dialect, listener, given.seconds)
        for listener in given.listener
        for dialect in given.dialect
    }
    tell(tables, given.json)


if __name__ == "__main__":
    main()
