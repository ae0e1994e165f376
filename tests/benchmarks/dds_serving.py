"""`catenary serve` over ROS 2 (DDS) beside a client that hears every topic: rate, loss, latency, processor time, memory.

`make bench-dds`, or `python -m tests.benchmarks.dds_serving --seconds 600`; on this machine's loopback interface, in a
domain of its own. Percentiles, since a maximum measures the machine.
"""

import json
import time

from catenary.crtk.names import topics
from dds import Network
from ros import COMMAND, Program
from tests.benchmarks.measure import Tables, report
from tests.benchmarks.programs import memory

LISTENER = "from benchmarks.dds_listener import main; main()"


def measure(dialect: str, seconds: float) -> dict[str, float]:
    """Serve a homed robot to one client that hears everything and commands at 100 Hz."""
    wanted = [(topic.name, topic.type) for topic in topics(dialect) if topic.direction == "out"]  # type: ignore[arg-type]
    network, serve = Network(), ("serve", "--ros", "2", "--homed", "--json", "--dialect", dialect)
    with Program(network, COMMAND, *serve) as server:
        server.line()
        before = json.loads(server.line())["lost_ticks"]
        resume = "resume" if dialect == "raven" else "enable"
        with Program(network, LISTENER, json.dumps(wanted), str(seconds), resume) as client:
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
        "server_cores": cores[len(cores) // 2],
        "server_cores_p10": cores[len(cores) // 10],
        "server_cores_p90": cores[len(cores) * 9 // 10],
        "server_hertz": sum(row["rate_hz"] for _, row in settled) / len(settled),
        "ticks_lost": rows[-1][1]["lost_ticks"] - before,
        "memory_mb": settled[-1][0],
        "memory_growth_mb": settled[-1][0] - settled[0][0],
    }


def tables(seconds: float, dialect: tuple[str, ...]) -> Tables:
    """Measure every dialect."""
    return {"a served robot over DDS": {spoken: measure(spoken, seconds) for spoken in dialect}}


if __name__ == "__main__":
    report(tables, __doc__, seconds=20.0, dialect=("raven", "crtk"))
