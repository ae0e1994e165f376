"""Who is connected to a topic of rospy's, and what waits for peers that do not keep up.

The one place that reaches behind rospy's public methods, into a topic's list of connections (`Topic.impl.connections`),
for two things that they do not offer:

- The names of peers.
- A publisher that waits for nobody and serves a robot at 1 kHz. With `queue_size=None` rospy's `publish` waits for the
  slowest peer. With `queue_size=N` it does not, but wakes a thread per topic and peer: 14 topics at 1 kHz to one peer
  then take 1.1 cores and come at 500 to 780 Hz (without other load, two cores); by `publish` into sockets that do not
  wait, 0.33 of a core at 1,000 Hz.

So a publisher here has `queue_size=None`, and its connections write by a `PeerQueue`.
"""

import select
import socket
import threading
from collections import deque
from typing import Any

import rospy

_LOOK = 1.0  # [s] between two looks whether a peer that reads nothing has gone


class PeerQueue:
    """Writes to one peer without waiting; what its socket does not take is sent by a thread, while there is any."""

    def __init__(self, connection: Any, size: int) -> None:
        """Write for a connection of rospy's; at most `size` messages wait, then the oldest gives way."""
        self.overflowed = 0
        self._connection, self._size = connection, size
        if connection.socket is not None:  # else it has ended already
            connection.socket.setblocking(False)
        self._waiting: deque[bytes] = deque()
        self._rest = b""  # of a message that is partly sent
        self._is_draining = False
        self._lock = threading.Lock()

    def write(self, data: bytes) -> bool:
        """Send a message, or keep it for later; in the place of the connection's `write_data`.

        Raises:
            rospy.TransportTerminated: The connection has ended; rospy closes it then.
        """
        with self._lock:
            if self._is_draining:
                if len(self._waiting) == self._size:
                    self._waiting.popleft()
                    self.overflowed += 1
                self._waiting.append(data)
                return True
            sent = self._send(data)
            self._connection.stat_num_msg += 1
            if sent < len(data):
                self._rest, self._is_draining = data[sent:], True
                threading.Thread(target=self._drain, name="ROS slow peer", daemon=True).start()
        return True

    def end(self) -> int:
        """Let the connection go, which has ended; return how many messages its peer missed."""
        vars(self._connection).pop("write_data", None)  # else the two would hold each other
        return self.overflowed

    def _send(self, data: bytes) -> int:
        """Send what the socket takes at once; return how many bytes."""
        sock: socket.socket | None = self._connection.socket
        if sock is None or self._connection.done:
            raise rospy.TransportTerminated("the connection was closed")
        try:
            sent = sock.send(data)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise rospy.TransportTerminated(str(error)) from error
        self._connection.stat_bytes += sent
        return sent

    def _drain(self) -> None:
        """Send what waits until nothing does, or the connection has ended."""
        while True:
            try:
                select.select([], [self._connection.socket], [], _LOOK)
                with self._lock:
                    while self._rest or self._waiting:
                        if not self._rest:
                            self._rest = self._waiting.popleft()
                        sent = self._send(self._rest)
                        self._rest = self._rest[sent:]
                        if self._rest:
                            break
                    else:
                        self._is_draining = False
                        return
            except (OSError, TypeError, ValueError, rospy.TransportTerminated):  # closed, here or there
                self._connection.close()
                return


class PeerQueues(rospy.SubscribeListener):  # type: ignore[misc]  # rospy is not typed
    """Queues of all peers of one publisher."""

    def __init__(self, size: int) -> None:
        """Give each peer that connects a queue of `size` messages."""
        super().__init__()
        self._size = size
        self._queues: dict[int, PeerQueue] = {}  # by connection
        self._gone = 0  # messages that peers missed which have gone since
        self._publisher: rospy.Publisher | None = None
        self._lock = threading.Lock()

    def watch(self, publisher: Any) -> None:
        """Begin; peers that have connected already are given their queues here."""
        self._publisher = publisher
        self._look()

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
        """Give a peer that has just connected its queue; rospy calls this."""
        self._look()

    def peer_unsubscribe(self, topic_name: str, num_peers: int) -> None:
        """Forget the queue of a peer that has gone; rospy calls this."""
        self._look()

    @property
    def overflowed(self) -> int:
        """Messages that peers missed."""
        with self._lock:
            return self._gone + sum(queue.overflowed for queue in self._queues.values())

    def _look(self) -> None:
        if self._publisher is None:
            return
        with self._lock:
            connections = {id(one): one for one in _connections(self._publisher)}
            for key in set(self._queues) - set(connections):
                self._gone += self._queues.pop(key).end()
            for key in set(connections) - set(self._queues):
                queue = self._queues[key] = PeerQueue(connections[key], self._size)
                connections[key].write_data = queue.write


def subscribers(publisher: Any) -> tuple[str, ...]:
    """Return the names of the nodes that a publisher is connected to."""
    return tuple(sorted(one.endpoint_id for one in _connections(publisher)))


def publishers(subscriber: Any) -> tuple[str, ...]:
    """Return the names of the nodes that a subscriber is connected to; a URI where a name is not known yet."""
    return tuple(sorted(one.callerid_pub or one.endpoint_id for one in _connections(subscriber)))


def publisher_uri(subscriber: Any, header: dict[str, str]) -> str:
    """Return the URI of the node to which a connection with this header was made; empty when it has ended."""
    return next((str(one.endpoint_id) for one in _connections(subscriber) if one.header is header), "")


def _connections(topic: Any) -> list[Any]:
    return list(getattr(topic.impl, "connections", None) or ())  # none of a topic that has ended
