"""Inbound connections, each taken in by a thread of its own.

rospy reads their handshakes one after the other, in the thread that accepts them: a peer that connects and does not say
what it wants keeps everybody else from connecting, for a minute. There are such peers. A master goes on calling nodes
that were killed, over HTTP, and their port may be this process's by now; networks stall, ports are scanned.

Imports rospy, so it is imported only when a `Ros1Transport` is made.
"""

import logging
import socket
import struct
import threading
import time
from collections.abc import Callable
from typing import Any

from rospy.impl import tcpros_base

PATIENCE = 5.0  # [s] for a peer's first bytes
LONGEST = 1 << 20  # [bytes] of a handshake; HTTP's first four bytes, taken for a length, are a gigabyte
_LENGTH = struct.Struct("<I")
_GLANCE = 0.005  # [s] between two looks at what has come
_logger = logging.getLogger(__name__)
Take = Callable[[socket.socket, Any], None]


def take_in_threads() -> None:
    """Have this process's node read every handshake in a thread; called before its first publisher or service."""
    server = tcpros_base._tcpros_server
    take = in_threads(server._tcp_server_callback)
    server._tcp_server_callback = take
    if server.tcp_ros_server is not None:
        server.tcp_ros_server.inbound_handler = take


def in_threads(take: Take) -> Take:
    """Give what calls `take` with a connection and its address in a thread, once a peer begins as ROS does."""

    def begin(connection: socket.socket, address: Any) -> None:
        threading.Thread(
            target=_take_if_ros, args=(take, connection, address), name="ROS handshake", daemon=True
        ).start()

    return begin


def _take_if_ros(take: Take, connection: socket.socket, address: Any) -> None:
    if begins_as_ros(connection):
        take(connection, address)
    else:
        _logger.info("%s connected, and said nothing that ROS says", address)
        connection.close()


def begins_as_ros(connection: socket.socket, patience: float = PATIENCE) -> bool:
    """Whether a peer sends the length of a handshake within `patience` [s]; nothing of it is taken from the socket."""
    before, end = connection.gettimeout(), time.monotonic() + patience
    head = b""
    try:
        while len(head) < _LENGTH.size:
            connection.settimeout(max(end - time.monotonic(), _GLANCE))
            head = connection.recv(_LENGTH.size, socket.MSG_PEEK)
            if not head or time.monotonic() > end:
                return False
            if len(head) < _LENGTH.size:
                time.sleep(_GLANCE)
        connection.settimeout(before)
    except OSError:  # the time is up, or the connection broke
        return False
    return bool(_LENGTH.unpack(head)[0] <= LONGEST)
