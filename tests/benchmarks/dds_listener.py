"""A client that hears every topic over DDS and moves the shoulder at 100 Hz, as `listener` does over ROS 1."""

import json
import sys
import time

import numpy as np

from benchmarks.shoulder_commands import ShoulderCommands
from catenary.crtk.dds.transport import DdsTransport
from catenary.crtk.message import stamp_of

SETTLE = 1.0  # [s] before counting
OFTEN = 0.5  # of the server's ticks: topics that come less often are not counted


def lost_of(stamps: dict[str, list[int]]) -> tuple[int, int]:
    """Return the ticks that any topic tells of, and how many messages of the others lack; headers have no counts."""
    begin, end = max(one[0] for one in stamps.values()), min(one[-1] for one in stamps.values())
    within = [{stamp for stamp in one if begin <= stamp <= end} for one in stamps.values()]
    ticks = set().union(*within)
    return len(ticks), sum(len(ticks) - len(one) for one in within)


def main() -> None:
    """Hear topics (JSON) for some seconds, command, and print what was heard."""
    topics, seconds, timed = json.loads(sys.argv[1]), float(sys.argv[2]), "/arm1/setpoint_js"
    transport = DdsTransport("listener")
    moving = transport.publisher("/arm1/servo_jr", "sensor_msgs/JointState")
    command = transport.publisher("/arm1/state_command", "crtk_msgs/StringStamped")
    heard = {topic: transport.subscribe(topic, kind, depth=100_000) for topic, kind in topics}
    stamps: dict[str, list[int]] = {topic: [] for topic in heard}
    delays: list[int] = []
    last = None

    def take() -> None:
        nonlocal last
        for topic, subscription in heard.items():
            for message, arrived in subscription.take():
                stamp = stamp_of(message)
                if stamp:
                    stamps[topic].append(stamp)
                if topic == timed:
                    delays.append(arrived - stamp)
                    last = message

    while last is None or not transport.connections(moving.topic).subscribers:
        take()
        time.sleep(0.01)
    time.sleep(SETTLE)
    take()
    for one in stamps.values():
        one.clear()
    delays.clear()
    cpu, commands = time.process_time(), ShoulderCommands(moving, command, sys.argv[3])
    while (now := time.monotonic()) < commands.begin + seconds:
        commands.send(now, last.position[0])
        take()
        time.sleep(commands.pause(time.monotonic()))
    wall, cpu = time.monotonic() - commands.begin, time.process_time() - cpu
    often = {topic: one for topic, one in stamps.items() if len(one) > OFTEN * len(stamps[timed])}
    ticks, lost = lost_of(often)
    quantiles = {f"p{100 * q:g}_ms": 1e-6 * float(np.quantile(delays, q)) for q in (0.5, 0.9, 0.99, 0.999)}
    found = {
        "hertz": len(stamps[timed]) / wall,
        "topics": len(often),
        "messages": sum(map(len, often.values())),
        "ticks": ticks,
        "lost": lost,
        "commands": commands.sent,
        "listener_cores": cpu / wall,
        "overflowed": sum(one.overflowed for one in heard.values()),
        **quantiles,
    }
    time.sleep(0.3)
    take()
    print(json.dumps({**found, "command_error": commands.error(last.position[0])}))


if __name__ == "__main__":
    main()
