"""A client that hears topics and moves the shoulder at 100 Hz: straight from ROS 1's sockets, by rospy, or over DDS.

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
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from catenary.crtk.message import message_class, stamp_of
from catenary.crtk.transport import Publisher, Transport
from catenary.recording.messages import fields, md5_sum

CALLER = "/socket_listener"
HEAD = struct.Struct("<IIII")  # length, seq, stamp
HEADER = "std_msgs/Header"
TIMED = "/arm1/setpoint_js"
SETTLE = 1.0  # [s] before counting
OFTEN = 0.5  # of the server's ticks: of topics that come less often without a count, losses cannot be told
RESUME, MOVE = 1.3, 1.5  # [s] from the beginning until the state command, and until commands
COMMANDS = 100.0  # [Hz]
STEP = 1e-5  # [rad] a command
MOST = 100  # messages of a topic that are read at a time
TURN = 1000  # commands, after which it goes the other way


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
        self.stamps: list[int] = []  # [ns], where messages have no counts
        self.latency: list[int] = []  # [ns], of the timed topic

    def add(self, seq: int | None, stamp: int, arrived: int) -> None:
        """Count a message, with its stamp and arrival [ns]; DDS has no seq."""
        self.count += 1
        if not self.has_header:
            return
        if seq is None:
            self.stamps.append(stamp)
        else:
            self.lost += 0 if self.seq is None else seq - self.seq - 1
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


class ClientTopic(Heard):
    """A topic of one of catenary's own clients."""

    def __init__(self, transport: Transport, topic: str, type_name: str, *, counts: bool) -> None:
        super().__init__(topic, type_name)
        self.counts = counts and self.has_header
        self.subscription = transport.subscribe(topic, type_name, depth=100_000)

    def take(self) -> None:
        """Take what has come, not all of it where it comes faster than it is read: else this would never end."""
        for message, arrived, *_ in self.subscription.take_arrivals(most=MOST):
            self.add(message[0].seq if self.counts else None, stamp_of(message) or 0, arrived)
            self.last = message
        self.overflowed = self.subscription.overflowed

    def shoulder(self) -> float:
        """First position of the last message."""
        return float(self.last.position[0])


class ShoulderCommands:
    """Increments of the first joint, sent when they are due."""

    def __init__(self, moving: Publisher, command: Publisher, resume: str) -> None:
        """Begin now; `resume` is the state command that lets the robot move."""
        self._moving, self._command, self._resume = moving, command, resume
        self._step, self._is_told, self._first = np.zeros(7), False, np.nan
        self.begin, self.sent = time.monotonic(), 0
        self._due = self.begin + MOVE

    def send(self, now: float, shoulder: float) -> None:
        """Send what is due at a time [s]; the robot's setpoint of the shoulder [rad] was heard last."""
        if not self._is_told and now >= self.begin + RESUME:
            self._is_told = True
            self._command.publish(message_class("crtk_msgs/StringStamped")(string=self._resume))
        if now >= self._due:
            self._first = shoulder if self.sent == 0 else self._first
            self._due = max(self._due + 1.0 / COMMANDS, now - 0.1)
            self._step[0] = STEP if self.sent // TURN % 2 == 0 else -STEP
            self._moving.publish(message_class("sensor_msgs/JointState")(position=self._step.copy()))
            self.sent += 1

    def pause(self, now: float) -> float:
        """Return how long [s] to wait for the next."""
        return min(max(0.0, self._due - now), 1.0 / COMMANDS)

    def error(self, shoulder: float) -> float:
        """Return how far [rad] a setpoint is from where the commands lead."""
        rest = self.sent % (2 * TURN)
        return abs(shoulder - self._first - STEP * min(rest, 2 * TURN - rest))


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


def by_client(
    transport: Transport, wanted: list[tuple[str, str]], *, counts: bool
) -> tuple[list[ClientTopic], Callable[[float], None]]:
    """Return the topics, and a function that waits some seconds and takes what has come."""
    heard = [ClientTopic(transport, topic, kind, counts=counts) for topic, kind in wanted]

    def wait(seconds: float) -> None:
        time.sleep(seconds)
        for one in heard:
            one.take()

    return heard, wait


def lost_by_stamps(heard: Sequence[Heard]) -> dict[str, int]:
    """Return the ticks that any topic tells of, and how many messages of the others lack."""
    often = [one.stamps for one in heard if len(one.stamps) > OFTEN * max(len(each.stamps) for each in heard)]
    begin, end = max(one[0] for one in often), min(one[-1] for one in often)
    within = [{stamp for stamp in one if begin <= stamp <= end} for one in often]
    ticks = set().union(*within)
    return {"topics": len(often), "ticks": len(ticks), "lost": sum(len(ticks) - len(one) for one in within)}


def main() -> None:
    """Hear topics (JSON) for some seconds, command, and print what was heard."""
    kind, topics, seconds, resume = sys.argv[1], json.loads(sys.argv[2]), float(sys.argv[3]), sys.argv[4]
    if kind == "dds":
        from catenary.crtk.dds.transport import DdsTransport as OwnTransport
    else:
        from catenary.crtk.ros1.transport import Ros1Transport as OwnTransport  # type: ignore[assignment]
    transport = OwnTransport("listener")
    moving = transport.publisher("/arm1/servo_jr", "sensor_msgs/JointState")
    command = transport.publisher("/arm1/state_command", "crtk_msgs/StringStamped", latch=kind != "dds")
    heard, wait = by_sockets(topics) if kind == "sockets" else by_client(transport, topics, counts=kind == "rospy")
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
        **(lost_by_stamps(heard) if kind == "dds" else {"lost": sum(one.lost for one in heard)}),
        "commands": commands.sent,
        "listener_cores": cpu / wall,
        "overflowed": sum(one.overflowed for one in heard),
        **quantiles,
    }
    end = time.monotonic() + 0.3
    while time.monotonic() < end:
        wait(0.01)
    print(json.dumps({**found, "command_error": commands.error(timed.shoulder())}))
