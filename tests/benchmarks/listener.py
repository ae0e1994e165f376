"""A client that hears topics and moves the shoulder at 100 Hz, straight from its sockets or by rospy.

rospy reads every topic in a thread of its own, and all of them share Python's lock: a client that hears fifteen
topics a thousand times a second is busy with itself, and on a machine of few cores with the server's core too. By
its sockets it takes little time, so a server beside it is measured alone.
"""

import json
import os
import select
import socket
import struct
import sys
import time
import xmlrpc.client
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.shoulder_commands import ShoulderCommands
from catenary.crtk.ros1.transport import Ros1Transport
from catenary.recording.messages import fields, md5_sum

CALLER = "/socket_listener"
HEAD = struct.Struct("<IIII")  # length, seq, stamp
HEADER = "std_msgs/Header"
TIMED = "/arm1/setpoint_js"
SETTLE = 0.5  # [s] before counting


class Heard:
    """What has come of a topic."""

    def __init__(self, topic: str, type_name: str) -> None:
        self.is_timed = topic == TIMED
        self.has_header = fields(type_name)[0].type == HEADER  # without, losses of it cannot be told
        self.seq: int | None = None
        self.last: Any = None  # message of the timed topic
        self.overflowed = 0  # messages that gave way before they were taken
        self.forget()

    def forget(self) -> None:
        """Count from nothing."""
        self.count = self.lost = 0
        self.latency: list[int] = []  # [ns], of the timed topic

    def add(self, seq: int, stamp: int, arrived: int) -> None:
        """Count a message, with its stamp and arrival [ns]."""
        self.count += 1
        if not self.has_header:
            return
        if self.seq is not None:
            self.lost += seq - self.seq - 1
        self.seq = seq
        if self.is_timed:
            self.latency.append(arrived - stamp)


class SocketTopic(Heard):
    """A topic as it comes from its publisher."""

    def __init__(self, master: xmlrpc.client.ServerProxy, topic: str, type_name: str, node: str) -> None:
        """Connect to a topic's publisher, without a word to the master."""
        super().__init__(topic, type_name)
        uri: Any = master.lookupNode(CALLER, node)
        with xmlrpc.client.ServerProxy(uri[2]) as publisher:
            answer: Any = publisher.requestTopic(CALLER, topic, [["TCPROS"]])
        _, host, port = answer[2]
        self.socket = socket.create_connection((host, port))
        fields = {"callerid": CALLER, "topic": topic, "type": type_name, "tcp_nodelay": 1}
        fields["md5sum"] = md5_sum(type_name)
        texts = [f"{name}={value}".encode() for name, value in fields.items()]
        said = b"".join(struct.pack("<I", len(text)) + text for text in texts)
        self.socket.sendall(struct.pack("<I", len(said)) + said)
        (size,) = struct.unpack("<I", self.socket.recv(4, socket.MSG_WAITALL))
        self.socket.recv(size, socket.MSG_WAITALL)
        self.socket.setblocking(False)
        self.rest = b""

    def take(self) -> None:
        """Take what has come."""
        data = self.rest + self.socket.recv(1 << 18)
        arrived, at = time.time_ns(), 0
        while len(data) - at >= HEAD.size:
            size, seq, seconds, nanoseconds = HEAD.unpack_from(data, at)
            if len(data) - at < 4 + size:
                break
            at += 4 + size
            self.add(seq, 10**9 * seconds + nanoseconds, arrived)
            if self.is_timed:
                self.last = data[at - size : at]
        self.rest = data[at:]

    def shoulder(self) -> float:
        """First position of the last message: the numbers come last, seven positions, velocities and efforts."""
        (position,) = struct.unpack_from("<d", self.last, len(self.last) - 3 * 60 + 4)
        return float(position)


class RospyTopic(Heard):
    """A topic of one of catenary's own clients."""

    def __init__(self, transport: Ros1Transport, topic: str, type_name: str) -> None:
        super().__init__(topic, type_name)
        self.subscription = transport.subscribe(topic, type_name, depth=100_000)

    def take(self) -> None:
        """Take what has come."""
        for one in self.subscription.take():
            header = one.message[0] if self.has_header else None
            self.add(*((0, 0) if header is None else (header.seq, header.stamp)), one.time)
            self.last = one.message
        self.overflowed = self.subscription.overflowed

    def shoulder(self) -> float:
        """First position of the last message."""
        return float(self.last.position[0])


def by_sockets(wanted: list[tuple[str, str]]) -> tuple[list[SocketTopic], Callable[[float], None]]:
    """Return the topics, and a function that waits up to some seconds and takes what has come."""
    with xmlrpc.client.ServerProxy(os.environ["ROS_MASTER_URI"]) as master:
        state: Any = master.getSystemState(CALLER)
        nodes = {topic: names[0] for topic, names in state[2][0]}
        heard = [SocketTopic(master, topic, kind, nodes[topic]) for topic, kind in wanted if topic in nodes]
    poller = select.epoll()
    for one in heard:
        poller.register(one.socket, select.EPOLLIN)
    by_number = {one.socket.fileno(): one for one in heard}

    def wait(seconds: float) -> None:
        for number, _ in poller.poll(seconds):
            by_number[number].take()

    return heard, wait


def by_rospy(
    transport: Ros1Transport, wanted: list[tuple[str, str]]
) -> tuple[list[RospyTopic], Callable[[float], None]]:
    """Return the topics, and a function that waits some seconds and takes what has come."""
    heard = [RospyTopic(transport, topic, kind) for topic, kind in wanted]

    def wait(seconds: float) -> None:
        time.sleep(seconds)
        for one in heard:
            one.take()

    return heard, wait


def main() -> None:
    """Hear topics (JSON) for some seconds, command, and print what was heard."""
    kind, topics, seconds, resume = sys.argv[1], json.loads(sys.argv[2]), float(sys.argv[3]), sys.argv[4]
    transport = Ros1Transport("listener")
    moving = transport.publisher("/arm1/servo_jr", "sensor_msgs/JointState")
    command = transport.publisher("/arm1/state_command", "crtk_msgs/StringStamped", latch=True)
    heard, wait = by_sockets(topics) if kind == "sockets" else by_rospy(transport, topics)
    timed = next(one for one in heard if one.is_timed)
    while not (timed.count and transport.connections("/arm1/servo_jr").subscribers):
        wait(0.01)
    end = time.monotonic() + SETTLE
    while time.monotonic() < end:
        wait(0.01)
    for one in heard:
        one.forget()
    cpu, commands = time.process_time(), ShoulderCommands(moving, command, resume)
    while (now := time.monotonic()) < commands.begin + seconds:
        commands.send(now, timed.shoulder())
        wait(commands.pause(now))
    wall, cpu = time.monotonic() - commands.begin, time.process_time() - cpu
    delays = 1e-6 * np.array(timed.latency)
    quantiles = {f"p{100 * q:g}_ms": float(np.quantile(delays, q)) for q in (0.5, 0.9, 0.99, 0.999)}
    found = {
        "hertz": timed.count / wall,
        "messages": sum(one.count for one in heard),
        "lost": sum(one.lost for one in heard),
        "commands": commands.sent,
        "listener_cores": cpu / wall,
        "overflowed": sum(one.overflowed for one in heard),
        **quantiles,
    }
    end = time.monotonic() + 0.3
    while time.monotonic() < end:
        wait(0.01)
    print(json.dumps({**found, "command_error": commands.error(timed.shoulder())}))
