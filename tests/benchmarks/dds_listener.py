"""A client that hears every topic over DDS and moves the shoulder at 100 Hz, as `listener` does over ROS 1."""

import json
import sys
import time

import numpy as np

from catenary.crtk.dds.transport import DdsTransport
from catenary.crtk.message import message_class, stamp_of

SETTLE, RESUME, MOVE = 1.0, 1.3, 1.5  # [s] before counting; after that, until commands
COMMANDS = 100.0  # [Hz]
STEP = 1e-5  # [rad] a command
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
    step, sent, joint_state = np.zeros(7), 0, message_class("sensor_msgs/JointState")
    begin, cpu, is_told, first = time.monotonic(), time.process_time(), False, np.nan
    due = begin + MOVE
    while (now := time.monotonic()) < begin + seconds:
        if not is_told and now >= begin + RESUME:
            is_told = True
            command.publish(message_class("crtk_msgs/StringStamped")(string=sys.argv[3]))
        if now >= due:
            first = last.position[0] if sent == 0 else first
            due = max(due + 1.0 / COMMANDS, now - 0.1)
            step[0] = STEP if sent // 1000 % 2 == 0 else -STEP
            moving.publish(joint_state(position=step.copy()))
            sent += 1
        take()
        time.sleep(min(max(0.0, due - time.monotonic()), 1.0 / COMMANDS))
    wall, cpu = time.monotonic() - begin, time.process_time() - cpu
    often = {topic: one for topic, one in stamps.items() if len(one) > OFTEN * len(stamps[timed])}
    ticks, lost = lost_of(often)
    quantiles = {f"p{100 * q:g}_ms": 1e-6 * float(np.quantile(delays, q)) for q in (0.5, 0.9, 0.99, 0.999)}
    found = {
        "hertz": len(stamps[timed]) / wall,
        "topics": len(often),
        "messages": sum(map(len, often.values())),
        "ticks": ticks,
        "lost": lost,
        "commands": sent,
        "listener_cores": cpu / wall,
        "overflowed": sum(one.overflowed for one in heard.values()),
        **quantiles,
    }
    time.sleep(0.3)
    take()
    rest = sent % 2000
    error = abs(last.position[0] - first - STEP * min(rest, 2000 - rest))
    print(json.dumps({**found, "command_error": error}))


if __name__ == "__main__":
    main()
