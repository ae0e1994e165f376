"""A robot served to one client that hears every topic: what server and client say of it."""

import json
import time

from catenary.crtk.topic_names import topics
from dds import Network
from ros import COMMAND, Master, Program
from tests.benchmarks.programs import memory


def served_to(
    network: Master | Network,
    options: tuple[str, ...],
    dialect: str,
    listener: str,
    words: tuple[str, ...],
    seconds: float,
) -> dict[str, float]:
    """Serve a homed robot for some seconds.

    Args:
        network: What both programs are connected by.
        options: Of `catenary serve`, beside the dialect.
        dialect: raven or crtk.
        listener: Program of the client, in Python.
        words: Its first arguments; topics, seconds and the state command that lets the robot move follow.
        seconds: How long.
    """
    wanted = [(topic.name, topic.type) for topic in topics(dialect) if topic.direction == "out"]  # type: ignore[arg-type]
    serve = ("serve", *options, "--homed", "--json", "--dialect", dialect)
    with Program(network, COMMAND, *serve) as server:
        server.line()
        before = json.loads(server.line())["lost_ticks"]
        resume = "resume" if dialect == "raven" else "enable"
        with Program(network, listener, *words, json.dumps(wanted), str(seconds), resume) as client:
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
