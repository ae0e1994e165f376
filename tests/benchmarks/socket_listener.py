"""A client that hears topics straight from its sockets: it takes little time, so a server beside it is measured alone.

rospy reads every topic in a thread of its own, and all of them share Python's lock: a client that hears fifteen
topics a thousand times a second is busy with itself, and on a machine of few cores with the server's core too.
"""

import json
import os
import select
import socket
import struct
import sys
import time
import xmlrpc.client
from typing import Any

import numpy as np

from catenary.crtk.message import message_class
from catenary.crtk.ros1.transport import Ros1Transport
from catenary.recording.messages import md5_sum

CALLER = "/socket_listener"
HEAD = struct.Struct("<IIII")  # length, seq, stamp
SETTLE, RESUME, MOVE = 0.5, 1.3, 1.5  # [s] before counting; after that, until commands
COMMANDS = 100.0  # [Hz]
STEP = 1e-5  # [rad] a command


class Heard:
    """A topic as it comes from its publisher."""

    def __init__(self, master: xmlrpc.client.ServerProxy, topic: str, type_name: str, node: str) -> None:
        """Connect to a topic's publisher, without a word to the master."""
        self.topic = topic
        uri: Any = master.lookupNode(CALLER, node)
        with xmlrpc.client.ServerProxy(uri[2]) as publisher:
            answer: Any = publisher.requestTopic(CALLER, topic, [["TCPROS"]])
        _, host, port = answer[2]
        self.socket = socket.create_connection((host, port))
        said = (
            f"callerid={CALLER}", f"topic={topic}", f"type={type_name}", f"md5sum={md5_sum(type_name)}", "tcp_nodelay=1",
        )  # fmt: skip
        fields = b"".join(struct.pack("<I", len(one)) + one.encode() for one in said)
        self.socket.sendall(struct.pack("<I", len(fields)) + fields)
        (size,) = struct.unpack("<I", self.socket.recv(4, socket.MSG_WAITALL))
        self.socket.recv(size, socket.MSG_WAITALL)
        self.socket.setblocking(False)
        self.rest = b""
        self.count = self.lost = 0
        self.seq: int | None = None
        self.latency: list[int] | None = None  # [ns], where it is asked for
        self.last = b""

    def take(self) -> None:
        """Take what has come."""
        data = self.rest + self.socket.recv(1 << 18)
        arrived, at = time.time_ns(), 0
        while len(data) - at >= HEAD.size:
            size, seq, seconds, nanoseconds = HEAD.unpack_from(data, at)
            if len(data) - at < 4 + size:
                break
            at += 4 + size
            self.count += 1
            if self.seq is not None:
                self.lost += seq - self.seq - 1
            self.seq = seq
            if self.latency is not None:
                self.latency.append(arrived - (10**9 * seconds + nanoseconds))
                self.last = data[at - size : at]
        self.rest = data[at:]


def main() -> None:
    """Hear topics (JSON) for some seconds, command, and print what was heard."""
    wanted, seconds, resume = json.loads(sys.argv[1]), float(sys.argv[2]), sys.argv[3]
    transport = Ros1Transport("listener")
    moving = transport.publisher("/arm1/servo_jr", "sensor_msgs/JointState")
    command = transport.publisher("/arm1/state_command", "crtk_msgs/StringStamped", latch=True)
    with xmlrpc.client.ServerProxy(os.environ["ROS_MASTER_URI"]) as master:
        state: Any = master.getSystemState(CALLER)
        nodes = {topic: names[0] for topic, names in state[2][0]}
        heard = [Heard(master, topic, kind, nodes[topic]) for topic, kind in wanted if topic in nodes]
    timed = next(one for one in heard if one.topic == "/arm1/setpoint_js")
    timed.latency = []
    while not transport.connections("/arm1/servo_jr").subscribers:
        time.sleep(0.01)
    poller = select.epoll()
    for one in heard:
        poller.register(one.socket, select.EPOLLIN)
    by_number = {one.socket.fileno(): one for one in heard}
    step, sent, joint_state = np.zeros(7), 0, message_class("sensor_msgs/JointState")
    begin = time.monotonic() + SETTLE
    due, is_settled, is_told = begin + MOVE, False, False
    cpu = time.process_time()
    first = np.nan
    while (now := time.monotonic()) < begin + seconds:
        if not is_settled and now >= begin:
            is_settled = True
            timed.latency.clear()
            for one in heard:
                one.count = one.lost = 0
        if not is_told and now >= begin + RESUME:
            is_told = True
            command.publish(message_class("crtk_msgs/StringStamped")(string=resume))
        if now >= due:
            first = _shoulder(timed) if sent == 0 else first
            due = max(due + 1.0 / COMMANDS, now - 0.1)
            step[0] = STEP if sent // 1000 % 2 == 0 else -STEP
            moving.publish(joint_state(position=step.copy()))
            sent += 1
        for number, _ in poller.poll(max(0.0, due - now)):
            by_number[number].take()
    wall = time.monotonic() - begin
    hertz, latency = timed.count / wall, np.array(timed.latency)
    end = time.monotonic() + 0.3
    while time.monotonic() < end:
        for number, _ in poller.poll(0.01):
            by_number[number].take()
    rest = sent % 2000
    error = abs(_shoulder(timed) - first - STEP * min(rest, 2000 - rest))
    print(
        json.dumps(
            {
                "hertz": hertz,
                "messages": sum(one.count for one in heard),
                "lost": sum(one.lost for one in heard),
                "commands": sent,
                "command_error": error,
                "listener_cores": (time.process_time() - cpu) / wall,
                **{f"p{100 * q:g}_ms": float(np.quantile(latency, q)) / 1e6 for q in (0.5, 0.9, 0.99, 0.999)},
            }
        )
    )


def _shoulder(timed: Heard) -> float:
    """First position of the last joint state: the numbers come last, seven positions, velocities and efforts."""
    (position,) = struct.unpack_from("<d", timed.last, len(timed.last) - 3 * 60 + 4)
    return float(position)


if __name__ == "__main__":
    main()
