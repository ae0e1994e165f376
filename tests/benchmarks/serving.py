"""`catenary serve` beside a client that hears every topic: rate, loss, latency, processor time, memory.

`make bench-serving` over ROS 1, `make bench-dds` over ROS 2's DDS on this machine's loopback interface, or `python -m
tests.benchmarks.serving --listener dds --seconds 600`. ROS 1 needs rospy and its master, of which it starts one of its
own: its listeners are one that reads its sockets and nothing else, and one of catenary's own clients, by rospy.
Percentiles, since a maximum measures the machine.
"""

import json
import time
from contextlib import ExitStack

from catenary.crtk.topic_names import topics
from dds import Network
from ros import COMMAND, Program
from tests.benchmarks.measure import Tables, report
from tests.benchmarks.programs import master_and_folder, memory, require_rospy

LISTENER = "from benchmarks.listener import main; main()"


def measure(dialect: str, listener: str, seconds: float) -> dict[str, float]:
    """Serve a homed robot for some seconds to one client that hears everything and commands at 100 Hz."""
    wanted = [(topic.name, topic.type) for topic in topics(dialect) if topic.direction == "out"]  # type: ignore[arg-type]
    with ExitStack() as stack:
        if listener == "dds":
            network, options = Network(), ("--ros", "2")
        else:
            require_rospy()
            network, options = stack.enter_context(master_and_folder())[0], ()
        serve = ("serve", *options, "--homed", "--json", "--dialect", dialect)
        server = stack.enter_context(Program(network, COMMAND, *serve))
        server.line()
        before = json.loads(server.line())["lost_ticks"]
        resume = "resume" if dialect == "raven" else "enable"
        with Program(network, LISTENER, listener, json.dumps(wanted), str(seconds), resume) as client:
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
        "ticks_lost": rows[-1][1]["lost_ticks"] - before,
        "overflowed_at_server": rows[-1][1]["overflowed"],
        "memory_mb": settled[-1][0],
        "memory_growth_mb": settled[-1][0] - settled[0][0],
    }


def tables(seconds: float, dialect: tuple[str, ...], listener: tuple[str, ...]) -> Tables:
    """Measure every dialect beside every listener."""
    rows = {f"{spoken}, {by}": measure(spoken, by, seconds) for by in listener for spoken in dialect}
    return {"a served robot": rows}


if __name__ == "__main__":
    report(tables, __doc__, seconds=20.0, dialect=("raven", "crtk"), listener=("sockets", "rospy", "dds"))
