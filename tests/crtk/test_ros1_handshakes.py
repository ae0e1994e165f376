"""Peers that connect to a node and say nothing, or speak another language, keep nobody else out."""

import contextlib
import socket
import time
import xmlrpc.client
from collections.abc import Iterator

import pytest

from catenary.crtk.message import message_class
from catenary.crtk.ros1 import Ros1Transport
from catenary.crtk.wire import codec
from catenary.recording.messages import md5_sum
from ros import NODE, Master

TYPE = "crtk_msgs/StringStamped"
LIMIT = 30.0  # [s] for what does not wait for a strange peer; rospy waits for one for a minute


@pytest.fixture
def node(ros_master: Master, monkeypatch: pytest.MonkeyPatch) -> Iterator[Ros1Transport]:
    """A node with a latched topic, which waits for a peer's first bytes for longer than anything here takes."""
    with Ros1Transport(NODE) as transport:
        from catenary.crtk.ros1_handshakes import begins_as_ros  # imports rospy

        monkeypatch.setattr(begins_as_ros, "__defaults__", (600.0,))
        transport.publisher("/said", TYPE, latch=True).publish(message_class(TYPE)(string="hello"))
        yield transport


def address(master: Master) -> tuple[str, int]:
    """Where the node takes in connections."""
    with xmlrpc.client.ServerProxy(master.uri) as asked:
        _, _, uri = asked.lookupNode("/probe", f"/{NODE}")
    with xmlrpc.client.ServerProxy(uri) as asked:
        _, _, (_, host, port) = asked.requestTopic("/probe", "/said", [["TCPROS"]])
    return host, port


def whole(connection: socket.socket) -> bytes:
    """A block that begins with its length."""
    length = int.from_bytes(connection.recv(4, socket.MSG_WAITALL), "little")
    return connection.recv(length, socket.MSG_WAITALL)


def handshake() -> bytes:
    """What a subscriber says first."""
    fields = {"callerid": "/probe", "topic": "/said", "type": TYPE, "md5sum": md5_sum(TYPE)}
    lines = [f"{name}={value}".encode() for name, value in fields.items()]
    block = b"".join(len(line).to_bytes(4, "little") + line for line in lines)
    return len(block).to_bytes(4, "little") + block


def heard(place: tuple[str, int], parts: list[bytes]) -> str:
    """What a subscriber gets that sends its handshake in parts."""
    with socket.create_connection(place, LIMIT) as connection:
        for part in parts:
            connection.sendall(part)
            time.sleep(0.05)
        assert b"md5sum" in whole(connection)
        return str(codec(TYPE).decode(whole(connection)).string)


@pytest.mark.parametrize(
    "nonsense",
    [b"", b"POST / HTTP/1.1\r\n\r\n", b"\x10\x00", b"\x40\x00\x00\x00half of it"],
    ids=["nothing", "HTTP, as from a master that calls a dead node", "half a length", "half a handshake"],
)
def test_a_peer_that_does_not_say_what_it_wants_keeps_nobody_out(node, ros_master, nonsense):
    place = address(ros_master)
    with socket.create_connection(place) as strange:
        strange.sendall(nonsense)
        time.sleep(0.1)
        assert heard(place, [handshake()]) == "hello"


def test_a_peer_that_speaks_http_is_left(node, ros_master):
    with socket.create_connection(address(ros_master), LIMIT) as strange:
        strange.sendall(b"POST / HTTP/1.1\r\n\r\n")
        with contextlib.suppress(ConnectionResetError):  # also an end: it had sent more than anybody read
            assert strange.recv(1) == b""


def test_a_handshake_may_come_in_parts(node, ros_master):
    block = handshake()
    assert heard(address(ros_master), [block[:2], block[2:9], block[9:]]) == "hello"
