"""The one place that reaches behind rospy's public methods: what it changes, and what each change is for.

Tried against Debian 12's python3-rospy 1.15.15 and python3-rosgraph 1.15.15, which need them all.

- `TCPROSServer._tcp_server_callback`: a new peer that says nothing keeps no other out. rospy reads what it says first
  in the thread that accepts peers, for as long as it takes.
- `read_ros_handshake_header`: what a new peer says first takes 64 KiB at most. rospy keeps as much as it announces.
- `TCPROSTransportProtocol.read_messages`: a message larger than its topic takes (`_takes`) is passed over. Beyond
  64 MiB it can hardly be one, and the connection is closed; the node connects again. rospy keeps up to 2 GB.
- `SilenceableXMLRPCRequestHandler.do_POST` and `timeout`: a call of the node takes 64 KiB at most, and 30 s.

`Topic.impl.connections` is only read: the names of peers, and their sockets, into which `RosPublisher` writes, since
that of a robot at 1 kHz must wait for nobody. With `queue_size=None` rospy's `publish` waits for the slowest peer. With
`queue_size=N` it does not, but wakes a thread per topic and peer: 14 topics at 1 kHz to one peer then take 1.1 cores
and come at 500 to 780 Hz (without other load, two cores).
"""

import select
import socket
import struct
import threading
import warnings
from collections import Counter, deque
from collections.abc import Callable, Iterable
from io import BytesIO
from typing import Any

import rosgraph.network
import rosgraph.xmlrpc
import rospy
from rospy.exceptions import TransportTerminated
from rospy.impl import tcpros_base

from catenary.crtk.message import MESSAGE_BYTES, Message
from catenary.crtk.message_queues import Origin
from catenary.crtk.transport import HeardTopic, Publisher

_LOOK = 1.0  # [s] between two looks whether a peer that reads nothing has gone
_LENGTH = struct.Struct("<I")  # in front of each message
_GREETING = 2**16  # bytes of what a new peer says first, at most
_REQUEST = 2**16  # bytes of a call to the node, at most: some hundred publishers of a topic
_PATIENCE = 30.0  # [s] for the rest of a call, and between two
_takes: dict[str, Callable[[int], bool]] = {}  # whether a topic takes a message of so many bytes, by its name


def change_rospy() -> None:
    """Make the changes that are listed above; called before the node is started."""
    server = tcpros_base.init_tcpros_server()  # the only one, which `rospy.init_node` takes
    greeted = server._tcp_server_callback
    server._tcp_server_callback = lambda *peer: threading.Thread(target=greeted, args=peer, daemon=True).start()
    tcpros_base.read_ros_handshake_header = _read_greeting
    read = tcpros_base.TCPROSTransportProtocol.read_messages

    def read_messages(protocol: Any, buffer: BytesIO, messages: list[Any], sock: Any) -> None:
        _pass_over(protocol.resolved_name, buffer, sock)
        if buffer.tell() >= _LENGTH.size:
            read(protocol, buffer, messages, sock)

    tcpros_base.TCPROSTransportProtocol.read_messages = read_messages
    calls = rosgraph.xmlrpc.SilenceableXMLRPCRequestHandler
    answer = calls.do_POST

    def do_post(call: Any) -> None:
        length = call.headers.get("content-length", "")
        if length.isascii() and length.isdigit() and len(length) < 10 and int(length) <= _REQUEST:
            answer(call)
        else:
            call.close_connection = True
            call.send_error(413)

    calls.do_POST, calls.timeout = do_post, _PATIENCE


def _pass_over(topic: str, buffer: BytesIO, sock: Any) -> None:
    """Drop the message that a buffer begins with if it is too large, with what of it has not come yet."""
    end = buffer.tell()
    buffer.seek(0)
    (size,) = _LENGTH.unpack(buffer.read(_LENGTH.size))
    buffer.seek(end)
    takes = _takes.get(topic)
    if takes(size) if takes is not None else size <= MESSAGE_BYTES:
        return
    remaining = buffer.getvalue()[_LENGTH.size + size : end]
    buffer.seek(0)
    buffer.truncate()
    if size > MESSAGE_BYTES:
        raise TransportTerminated(f"{topic}: a message of {size} bytes was announced")
    left = _LENGTH.size + size - end
    while left > 0:
        came = len(sock.recv(min(left, 65536)))
        if not came:
            raise TransportTerminated(f"{topic}: ended within a message")
        left -= came
    buffer.write(remaining)


def _read_greeting(sock: Any, buffer: BytesIO, size: int) -> dict[str, str]:
    """Return a new peer's first message from a blocking socket, as rospy does, within bounds."""
    head = sock.recv(_LENGTH.size, socket.MSG_WAITALL)
    if len(head) < _LENGTH.size:
        raise rosgraph.network.ROSHandshakeException("the connection ended before its header had come")
    (length,) = _LENGTH.unpack(head)
    if length > _GREETING:
        raise rosgraph.network.ROSHandshakeException(f"a header of {length} bytes was announced")
    greeting = head + sock.recv(length, socket.MSG_WAITALL)  # one that is cut off is refused
    return rosgraph.network.decode_ros_handshake_header(greeting)


class _Peer:
    """A connection, called with the lock held; what its socket does not take at once is sent by a thread of its own."""

    def __init__(self, connection: Any, size: int, lock: threading.Lock) -> None:
        """Write for a connection of rospy's; at most `size` messages wait, then the oldest gives way."""
        self.connection = connection
        self.overflowed = 0
        self._lock = lock
        self._rest = b""  # of the message that is partly sent; while there is any, the thread runs
        self._waiting: deque[bytes] = deque(maxlen=size)
        if connection.socket is not None:  # else it has ended already
            connection.socket.setblocking(False)
            # a message goes out when it is written, also to a subscriber whose greeting asks for no such thing, as
            # rospy's own does by default: rospy would do as it asks, and messages would wait for each other
            connection.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

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


class RosPublisher(Publisher, rospy.SubscribeListener):  # type: ignore[misc]  # rospy is not typed
    """Publisher of one topic; a message is encoded only if there are subscribers or the topic is latched."""

    def __init__(
        self, topic: str, type_name: str, kind: type, end: Callable[[Any], None], *, latch: bool, queue: int
    ) -> None:
        """Begin by a `rospy.Publisher` of a kind, which `end` ends; `queue` messages wait for each peer."""
        super().__init__(topic, type_name)
        self._queue, self._latch, self._ended = queue, latch, end
        self._last = b""  # message that is latched
        self._peers: tuple[_Peer, ...] = ()
        self._gone: Counter[str] = Counter()  # messages that peers missed which have gone since, by name
        self._lock = threading.Lock()
        self.ros: Any = None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)  # rospy recommends a queue; see above
            self.ros = rospy.Publisher(topic, kind, self, tcp_nodelay=True, latch=latch, queue_size=None)
        self._look()  # peers may have connected already

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
        """Take in a peer that has just connected; rospy calls this."""
        self._look()

    def peer_unsubscribe(self, topic_name: str, num_peers: int) -> None:
        """Forget a peer that has gone; rospy calls this."""
        self._look()

    @property
    def missed(self) -> Counter[str]:
        """Messages that slow peers missed, by the peer's name."""
        with self._lock:
            return self._gone + _missed(self._peers)

    def subscribers(self) -> tuple[str, ...]:
        """Return the names of the nodes that listen."""
        return () if self.is_closed else tuple(sorted(str(peer.connection.endpoint_id) for peer in self._peers))

    def _send(self, message: Message) -> None:
        if not (self._latch or self._peers):
            return
        data = self._encode(message, self._sent)
        frame = _LENGTH.pack(len(data)) + data
        with self._lock:
            if self._latch:
                self._last = frame
            ended = [peer for peer in self._peers if not peer.write(frame)]
        for peer in ended:
            peer.connection.close()  # rospy calls `peer_unsubscribe`

    def _end(self) -> None:
        self._ended(self.ros)

    def _look(self) -> None:
        if self.ros is None:
            return
        with self._lock:
            connections = _connections(self.ros)
            known = [peer.connection for peer in self._peers]
            new = [_Peer(one, self._queue, self._lock) for one in connections if one not in known]
            if self._last:
                for peer in new:
                    peer.write(self._last)  # where that fails, the next message does too
            self._gone += _missed(peer for peer in self._peers if peer.connection not in connections)
            self._peers = (*(peer for peer in self._peers if peer.connection in connections), *new)


class RosTopic(HeardTopic):
    """Subscription to one topic by a `rospy.Subscriber`."""

    def __init__(
        self, name: str, type_name: str, kind: type, end: Callable[[Any], None], steady: Callable[[], int]
    ) -> None:
        super().__init__(type_name)
        self._origins: dict[str, Origin] = {}  # the last one of each publisher
        self._steady, self._name, self._ended = steady, name, end
        _takes[name] = self._has_room_for
        with self._lock:  # a message may come before it is known
            self.ros: Any = rospy.Subscriber(name, kind, self._receive, tcp_nodelay=True)

    def end(self) -> None:
        """End the subscription, as there are no listeners."""
        _takes.pop(self._name, None)
        self._ended(self.ros)

    def publishers(self) -> tuple[str, ...]:
        """Return the names of the nodes that it is connected to; a URI where a name is not known yet."""
        return tuple(sorted(str(one.callerid_pub or one.endpoint_id) for one in _connections(self.ros)))

    def _has_room_for(self, size: int) -> bool:
        """Return True if a subscriber takes a message of this many bytes; those without room count it."""
        return max((one.has_room_for(size) for one in self.subscriptions), default=True)

    def _receive(self, message: Any) -> None:
        time = self._steady()
        with self._lock:
            # documented: wiki.ros.org/rospy/Overview/Messages
            self.give(message.data, time, self._origin(message._connection_header))

    def _origin(self, head: dict[str, str]) -> Origin:
        """Return the sender of a message; rospy renews a connection's header when it reconnects."""
        name = head.get("callerid", "")
        known = self._origins.get(name)
        if known is None or known.connection is not head:
            uri = next((str(one.endpoint_id) for one in _connections(self.ros) if one.header is head), "")
            known = self._origins[name] = Origin(f"{name} {uri}", head, head.get("latching") == "1")
        return known


def _missed(peers: Iterable[_Peer]) -> Counter[str]:
    missed: Counter[str] = Counter()
    for peer in peers:
        missed[str(peer.connection.endpoint_id)] += peer.overflowed
    return missed


def _connections(topic: Any) -> list[Any]:
    return list(getattr(topic.impl, "connections", None) or ())  # none of a topic that has ended
