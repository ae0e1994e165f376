"""What comes over ROS 1's connections, taken in by one thread for all of them.

rospy has a thread for each connection. Of a robot that publishes a thousand times a second every topic would wake one,
and all of them contend for Python's lock with the program that waits for the messages. Those threads are still there,
since rospy connects in them, and connects again; in between they sleep.

Imports rospy, so it is imported only when a `Ros1Transport` is made.
"""

import logging
import select
import socket
import threading
import time
from collections.abc import Callable
from functools import cache
from typing import Any

import rospy
from rospy.exceptions import TransportException, TransportTerminated

from catenary.crtk.frames import LENGTH

Take = Callable[[bytes, int, Any], None]  # message, time at which it came [ns], rospy's connection
_CHUNK = 65536  # bytes
_logger = logging.getLogger(__name__)


class Stream:
    """Messages of one connection, which takes them from here in the place of reading its socket itself."""

    def __init__(self, connection: Any, take: Take) -> None:
        """Stand in for a connection's reading; `take` gets its messages, in the receiver's thread."""
        self._connection, self._take = connection, take
        self._socket: socket.socket | None = None
        self._number = -1  # of the socket
        self._rest = bytearray()  # what has come of a message that is not whole
        self.is_closed = False
        self._ended = threading.Event()
        self._error: Exception | None = None
        self._end_connection = connection.close
        connection.receive_once = self.wait
        connection.close = self.close  # rospy calls it too

    def wait(self) -> list[Any]:
        """Have messages taken until the connection ends or breaks, in rospy's thread; no messages are left for rospy.

        Raises:
            TransportTerminated: The publisher ended it.
            TransportException: It broke; rospy connects again.
        """
        connection, buffer = self._connection, self._connection.read_buff
        sock = connection.socket
        if sock is None or buffer is None:
            raise TransportException("connection not initialized")
        sock.setblocking(False)
        self._socket, self._number, self._error = sock, sock.fileno(), None
        # what came together with the answer to the connection's header
        self._rest = bytearray(buffer.getvalue()[: buffer.tell()])
        buffer.seek(0)
        buffer.truncate()
        self._ended.clear()
        self._take_whole_ones()
        receiver().add(self._number, self)
        try:
            while not (connection.done or rospy.is_shutdown() or self._ended.wait(1.0)):
                pass
        finally:
            receiver().remove(self._number, self)
        if self._error is not None:
            raise self._error
        return []

    def receive(self) -> None:
        """Take what has come, in the receiver's thread."""
        assert self._socket is not None
        try:
            data = self._socket.recv(_CHUNK)
        except BlockingIOError:
            return
        except OSError as error:
            self._end(TransportException(str(error)))
            return
        if not data:
            self._end(TransportTerminated("the publisher ended the connection"))
            return
        self._connection.stat_bytes += len(data)
        self._rest += data
        self._take_whole_ones()

    def close(self) -> None:
        """End the connection."""
        # before its socket is closed: another may get that number then
        self.is_closed = True
        receiver().remove(self._number, self)
        self._end_connection()
        self._ended.set()
        for name in ("close", "receive_once"):
            vars(self._connection).pop(name, None)  # else the two would hold each other for ever

    def _take_whole_ones(self) -> None:
        rest, connection, place = self._rest, self._connection, 0
        while len(rest) - place >= LENGTH.size:
            (size,) = LENGTH.unpack_from(rest, place)
            begin = place + LENGTH.size
            if len(rest) - begin < size:
                break
            place = begin + size
            connection.stat_num_msg += 1
            try:
                self._take(bytes(rest[begin:place]), time.time_ns(), connection)
            except Exception:  # of whoever takes it: the messages behind it, and other connections', go on
                _logger.exception("message of %s", connection.name)
        del rest[:place]

    def _end(self, error: Exception) -> None:
        receiver().remove(self._number, self)
        self._error = error
        self._ended.set()


class Receiver:
    """Thread that takes what comes over all connections of a process."""

    def __init__(self) -> None:
        self._streams: dict[int, Stream] = {}  # by their sockets' numbers
        self._lock = threading.Lock()
        self._poll = select.epoll()
        threading.Thread(target=self._run, name="ROS receiver", daemon=True).start()

    def add(self, number: int, stream: Stream) -> None:
        """Begin to take what comes over a socket, unless it was closed meanwhile."""
        with self._lock:
            if stream.is_closed:
                return
            self._streams[number] = stream
            self._poll.register(number, select.EPOLLIN)

    def remove(self, number: int, stream: Stream) -> None:
        """Take no more of it, if it still is that stream's."""
        with self._lock:
            if self._streams.get(number) is stream:
                del self._streams[number]
                self._poll.unregister(number)

    def _run(self) -> None:
        while True:
            for number, _ in self._poll.poll():
                stream = self._streams.get(number)
                if stream is not None:  # removed meanwhile
                    stream.receive()


@cache
def receiver() -> Receiver:
    """Give this process's receiver."""
    return Receiver()
