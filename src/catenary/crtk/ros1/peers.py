"""Who is connected to a topic of rospy's, and what waits for peers that do not keep up.

The one place that reaches behind rospy's public methods, into a topic's list of connections (`Topic.impl.connections`)
and their sockets, and to its server of connections, for three things that they do not offer:

- The names of peers.
- A new peer that says nothing keeps no other out.
- A publisher that waits for nobody and serves a robot at 1 kHz. With `queue_size=None` rospy's `publish` waits for the
  slowest peer. With `queue_size=N` it does not, but wakes a thread per topic and peer: 14 topics at 1 kHz to one peer
  then take 1.1 cores and come at 500 to 780 Hz (without other load, two cores).

So rospy brings peers and topics together, and `Peers` writes the messages into the peers' sockets.
"""

import select
import struct
import threading
from collections import deque
from typing import Any

import rospy
from rospy.impl import tcpros_base

_LOOK = 1.0  # [s] between two looks whether a peer that reads nothing has gone
_LENGTH = struct.Struct("<I")  # in front of each message


def read_greetings_apart() -> None:
    """Have what a new peer says first read in a thread of its own.

    rospy reads it in the thread that accepts peers, so one that says nothing would keep all others out for a minute.
    """
    server = tcpros_base.init_tcpros_server()  # the only one, which `rospy.init_node` takes
    read = server._tcp_server_callback
    server._tcp_server_callback = lambda *peer: threading.Thread(target=read, args=peer, daemon=True).start()


class _Peer:
    """A connection that is written to without waiting; what its socket does not take is sent by a thread of its own.

    All but the thread is called with the lock held.
    """

    def __init__(self, connection: Any, size: int, lock: threading.Lock) -> None:
        """Write for a connection of rospy's; at most `size` messages wait, then the oldest gives way."""
        self.connection = connection
        self.overflowed = 0
        self._lock = lock
        self._rest = b""  # of the message that is partly sent; while there is any, the thread runs
        self._waiting: deque[bytes] = deque(maxlen=size)
        if connection.socket is not None:  # else it has ended already
            connection.socket.setblocking(False)

    def write(self, frame: bytes) -> bool:
        """Send a message or keep it for later; return whether the connection lives."""
        if self._rest:
            self.overflowed += len(self._waiting) == self._waiting.maxlen
            self._waiting.append(frame)
            return True
        try:
            sent = self._send(frame)
        except (OSError, AttributeError):
            return False
        if sent < len(frame):
            self._rest = frame[sent:]
            threading.Thread(target=self._drain, name="ROS slow peer", daemon=True).start()
        return True

    def _send(self, data: bytes) -> int:
        """Send what the socket takes at once, and return how many bytes; an ended connection has none."""
        try:
            sent: int = self.connection.socket.send(data)
        except BlockingIOError:
            return 0
        self.connection.stat_bytes += sent
        return sent

    def _drain(self) -> None:
        """Send what waits until nothing does, or the connection has ended."""
        try:
            while True:
                select.select([], [self.connection.socket], [], _LOOK)
                with self._lock:
                    self._rest = self._rest[self._send(self._rest) :]
                    while not self._rest and self._waiting:
                        frame = self._waiting.popleft()
                        self._rest = frame[self._send(frame) :]
                    if not self._rest:
                        return
        except (OSError, TypeError, ValueError, AttributeError):  # closed, here or there
            self.connection.close()


class Peers(rospy.SubscribeListener):  # type: ignore[misc]  # rospy is not typed
    """All peers of one publisher."""

    def __init__(self, size: int, *, latch: bool) -> None:
        """Let `size` messages wait for each peer; with `latch`, give the last message to each that connects."""
        super().__init__()
        self._size, self._latch = size, latch
        self._last = b""  # message that is latched
        self._peers: tuple[_Peer, ...] = ()
        self._gone = 0  # messages that peers missed which have gone since
        self._publisher: rospy.Publisher | None = None
        self._lock = threading.Lock()

    def watch(self, publisher: Any) -> None:
        """Begin; peers that have connected already are found here."""
        self._publisher = publisher
        self._look()

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
        """Take in a peer that has just connected; rospy calls this."""
        self._look()

    def peer_unsubscribe(self, topic_name: str, num_peers: int) -> None:
        """Forget a peer that has gone; rospy calls this."""
        self._look()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of their nodes."""
        return tuple(sorted(str(peer.connection.endpoint_id) for peer in self._peers))

    @property
    def need_messages(self) -> bool:
        """Return whether a message goes to anybody, now or later."""
        return self._latch or bool(self._peers)

    @property
    def overflowed(self) -> int:
        """Messages that peers missed."""
        with self._lock:
            return self._gone + sum(peer.overflowed for peer in self._peers)

    def publish(self, message: bytes) -> None:
        """Send a message to all peers, waiting for none."""
        frame = _LENGTH.pack(len(message)) + message
        with self._lock:
            if self._latch:
                self._last = frame
            ended = [peer for peer in self._peers if not peer.write(frame)]
        for peer in ended:
            peer.connection.close()  # rospy calls `peer_unsubscribe`

    def _look(self) -> None:
        if self._publisher is None:
            return
        with self._lock:
            connections = _connections(self._publisher)
            known = [peer.connection for peer in self._peers]
            new = [_Peer(one, self._size, self._lock) for one in connections if one not in known]
            if self._last:
                for peer in new:
                    peer.write(self._last)  # where that fails, the next message does too
            self._gone += sum(peer.overflowed for peer in self._peers if peer.connection not in connections)
            self._peers = (*(peer for peer in self._peers if peer.connection in connections), *new)


def publishers(subscriber: Any) -> tuple[str, ...]:
    """Return the names of the nodes that a subscriber is connected to; a URI where a name is not known yet."""
    return tuple(sorted(one.callerid_pub or one.endpoint_id for one in _connections(subscriber)))


def publisher_uri(subscriber: Any, header: dict[str, str]) -> str:
    """Return the URI of the node to which a connection with this header was made; empty when it has ended."""
    return next((str(one.endpoint_id) for one in _connections(subscriber) if one.header is header), "")


def _connections(topic: Any) -> list[Any]:
    return list(getattr(topic.impl, "connections", None) or ())  # none of a topic that has ended
