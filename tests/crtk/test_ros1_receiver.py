"""Reading of connections by one thread, over real sockets, without a master."""

import socket
import struct
import threading
from io import BytesIO
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ros import require_ros1

PATIENCE = 60.0  # [s] for a thread on a busy machine


class Connection:
    """What of rospy's connection a stream uses."""

    def __init__(self, sock: socket.socket, begun: bytes = b"") -> None:
        self.socket: socket.socket | None = sock
        self.read_buff: BytesIO | None = BytesIO()
        self.read_buff.write(begun)
        self.name = "/topic"
        self.done = False
        self.stat_bytes = self.stat_num_msg = 0

    def close(self) -> None:
        assert self.socket is not None
        self.socket.shutdown(socket.SHUT_RDWR)
        self.socket.close()
        self.done = True


class Reading:
    """A stream between two sockets, and the thread in which rospy would have it wait."""

    def __init__(self, begun: bytes = b"", refuse: bytes | None = None, pair: Any = None) -> None:
        require_ros1()
        from catenary.crtk.ros1_receiver import Stream

        sock, self.publisher = pair or socket.socketpair()
        self.connection: Any = Connection(sock, begun)
        self.refuse = refuse
        self.taken: list[bytes] = []
        self.error: BaseException | None = None
        self._more = threading.Condition()
        Stream(self.connection, self._take)
        self._thread = threading.Thread(target=self._wait)
        self._thread.start()

    def _take(self, data: bytes, time: int, connection: Any) -> None:
        assert time > 0
        assert connection is self.connection
        if data == self.refuse:
            raise ValueError("refused")
        with self._more:
            self.taken.append(data)
            self._more.notify()

    def _wait(self) -> None:
        try:
            assert self.connection.receive_once() == []
        except Exception as error:
            self.error = error

    def take(self, count: int) -> list[bytes]:
        """Messages, once there are so many."""
        with self._more:
            self._more.wait_for(lambda: len(self.taken) >= count, PATIENCE)
        return self.taken

    def end(self) -> str:
        """Name of the error with which waiting ended, empty without one."""
        self._thread.join(PATIENCE)
        assert not self._thread.is_alive()
        return type(self.error).__name__ if self.error else ""


def framed(*messages: bytes) -> bytes:
    return b"".join(struct.pack("<I", len(message)) + message for message in messages)


@settings(deadline=None, max_examples=50)
@given(
    messages=st.lists(st.binary(max_size=40), min_size=1, max_size=8),
    cuts=st.lists(st.integers(0, 400), max_size=8),
    begun=st.integers(0, 400),
)
def test_messages_come_whole_however_the_bytes_are_cut(
    messages: list[bytes], cuts: list[int], begun: int
) -> None:
    stream = framed(*messages)
    places = sorted({0, len(stream), *(min(cut, len(stream)) for cut in (begun, *cuts))})
    reading = Reading(begun=stream[:begun])
    for first, last in pairwise(places):
        if first >= begun:
            reading.publisher.sendall(stream[first:last])
    assert reading.take(len(messages)) == messages
    assert reading.connection.stat_num_msg == len(messages)
    reading.publisher.close()
    assert reading.end() == "TransportTerminated"


def test_a_message_longer_than_a_chunk_comes_whole() -> None:
    reading, message = Reading(), bytes(range(256)) * 4000
    reading.publisher.sendall(framed(message, b"next"))
    assert reading.take(2) == [message, b"next"]
    reading.publisher.close()
    reading.end()


def test_a_broken_connection_is_one_that_rospy_makes_again() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        reading = Reading(pair=(socket.create_connection(listening.getsockname()), listening.accept()[0]))
    linger = struct.pack("ii", 1, 0)
    reading.publisher.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
    reading.publisher.close()  # with a reset
    assert reading.end() == "TransportException"


def test_closing_from_another_thread_ends_the_wait_and_leaves_the_connection_as_it_was() -> None:
    reading = Reading()
    reading.publisher.sendall(framed(b"one"))
    reading.take(1)
    reading.connection.close()
    assert reading.end() == ""
    assert reading.connection.done
    assert set(vars(reading.connection)).isdisjoint({"close", "receive_once"})


def test_a_message_that_cannot_be_taken_holds_up_no_other_connection(
    caplog: pytest.LogCaptureFixture,
) -> None:
    bad, good = Reading(refuse=b"bad"), Reading()
    bad.publisher.sendall(framed(b"bad", b"next"))
    good.publisher.sendall(framed(b"good"))
    assert good.take(1) == [b"good"]
    bad.publisher.sendall(framed(b"fine"))
    assert bad.take(2) == [b"next", b"fine"]
    assert "message of /topic" in caplog.text
    for one in (bad, good):
        one.publisher.close()
        one.end()


def test_a_number_that_a_closed_socket_leaves_to_another_is_the_others() -> None:
    for k in range(20):
        reading = Reading()
        reading.publisher.sendall(framed(bytes([k])))
        assert reading.take(1) == [bytes([k])]
        reading.connection.close()
        reading.publisher.close()
        assert reading.end() == ""
