"""Topics over rospy without its costs: bytes of our own making, sent without waiting and without a thread per peer.

Imports rospy, so it is imported only when a `Ros1Transport` is made. rospy either waits in `publish` for the slowest
peer or wakes a thread per topic and peer; here a message goes straight into the peer's socket, and only what the socket
does not take at once waits for a thread that all topics share.
"""

import logging
import select
import socket
import threading
from collections import deque
from collections.abc import Callable
from functools import cache
from typing import Any

import genpy
import rospy
from rospy.impl.registration import Registration, get_topic_manager
from rospy.topics import _PublisherImpl, _SubscriberImpl, _TopicImpl

from catenary.crtk.ros1_receiver import Stream, Take
from catenary.crtk.sheet import Whole
from catenary.recording.messages import full_definition, md5_sum, service_md5_sum

_logger = logging.getLogger(__name__)


class RawMessage(genpy.Message):  # type: ignore[misc]  # rospy is not typed
    """A message as bytes."""

    __slots__ = ("data",)
    _slot_types: tuple[str, ...] = ()
    _has_header = False  # rospy would count in it; the codec does

    def __init__(self, data: bytes = b"") -> None:
        self.data = data

    def serialize(self, buffer: Any) -> None:
        """Write the bytes."""
        buffer.write(self.data)

    def deserialize(self, data: bytes) -> "RawMessage":
        """Keep the bytes."""
        self.data = bytes(data)
        return self


@cache
def raw_class(name: str) -> type[RawMessage]:
    """Class that stands for a message type towards rospy and its peers, under the spelling given."""
    attributes = {
        "__slots__": (),
        "_type": name,
        "_md5sum": md5_sum(name),
        "_full_text": full_definition(name),
    }
    return type(name.rpartition("/")[2], (RawMessage,), attributes)


@cache
def service_class(name: str) -> type:
    """Class that stands for a service type towards rospy and its peers."""
    halves = {f"_{half.lower()}_class": raw_class(f"{name}{half}") for half in ("Request", "Response")}
    attributes = {"_type": name, "_md5sum": service_md5_sum(name), **halves}
    return type(name.rpartition("/")[2], (), attributes)


class Link:
    """Connection to one peer, in the place of rospy's; `write_data` never waits."""

    def __init__(self, connection: Any, publication: "Publication", queue: int) -> None:
        connection.socket.setblocking(False)
        self._connection = connection
        self._publication = publication
        self._queue = queue
        self._lock = threading.Lock()
        self._waiting: deque[bytes] = deque()
        self._begun = False  # the first of them is partly sent
        self._end_connection = connection.close
        connection.close = self.close  # rospy calls it too
        self._is_closed = False
        self._socket_of: tuple[Whole, int] | None = None

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._connection, name)

    def __eq__(self, other: object) -> bool:
        return other is self or other is self._connection  # rospy removes the connection that it knows

    def __hash__(self) -> int:
        return hash(self._connection)

    def write_data(self, data: bytes) -> bool:
        """Send, or keep for later; the oldest that waits gives way when there are too many."""
        connection = self._connection
        with self._lock:
            if self._waiting:
                self._waiting.append(data)
                if len(self._waiting) > self._queue + self._begun:
                    del self._waiting[1 if self._begun else 0]
                    self._publication.overflowed += 1
                return True
            # `_send`, written out: this is done for every topic and peer in every tick
            if connection.done or connection.socket is None:
                raise rospy.exceptions.TransportTerminated("connection closed")
            try:
                sent = connection.socket.send(data)
            except BlockingIOError:
                sent = 0
            except OSError as error:
                raise rospy.exceptions.TransportTerminated(str(error)) from error
            connection.stat_bytes += sent
            connection.stat_num_msg += 1
            if sent < len(data):
                self._waiting.append(data[sent:])
                self._begun = sent > 0
                self._publication.sender.add(self)
                self._publication.sender.changes = object()
        return True

    def lend_socket(self, sockets: Whole, place: int) -> None:
        """Write the socket's number into an array, and -1 before it is closed: another may get that number then.

        Whoever sends by that array does so without giving up Python's lock, so nobody closes a socket meanwhile.
        """
        self._socket_of = sockets, place
        sockets[place] = self._connection.fileno()
        if self._is_closed:  # just now, perhaps before it knew of the array
            sockets[place] = -1

    def keep(self, data: bytes) -> None:
        """Have the rest of a message sent that somebody else has begun to send."""
        with self._lock:
            self._waiting.append(data)
            self._begun = True
        self._publication.sender.add(self)

    @property
    def is_waiting(self) -> bool:
        """Whether messages wait to be sent before any other."""
        return bool(self._waiting)

    def count(self, size: int, messages: int) -> None:
        """Count bytes and messages that somebody else has sent, for rospy's statistics."""
        self._connection.stat_bytes += size
        self._connection.stat_num_msg += messages

    def close(self) -> None:
        """End the connection."""
        self._is_closed = True
        if self._socket_of is not None:
            sockets, place = self._socket_of
            sockets[place] = -1
        self._end_connection()
        vars(self._connection).pop("close", None)  # else the two would hold each other for ever

    def flush(self) -> bool:
        """Send what waits; whether that was all."""
        with self._lock:
            while self._waiting:
                first = self._waiting[0]
                sent = self._send(first)
                if sent < len(first):
                    self._waiting[0] = first[sent:]
                    self._begun = self._begun or sent > 0
                    return False
                self._waiting.popleft()
                self._begun = False
        return True

    def _send(self, data: bytes) -> int:
        sock: socket.socket | None = self._connection.socket
        if sock is None or self._connection.done:
            raise rospy.exceptions.TransportTerminated("connection closed")
        try:
            sent = sock.send(data)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise rospy.exceptions.TransportTerminated(str(error)) from error
        self._connection.stat_bytes += sent
        self._connection.stat_num_msg += sent == len(data)
        return sent


class Sender:
    """Thread that sends what sockets did not take at once, for all topics of a process."""

    def __init__(self) -> None:
        # another one whenever a connection has come or gone, or has begun to wait, anywhere in the process
        self.changes = object()
        self._links: set[Link] = set()
        self._changed = threading.Condition()
        threading.Thread(target=self._run, name="ROS sender", daemon=True).start()

    def add(self, link: Link) -> None:
        """Take care of a link whose socket is full."""
        with self._changed:
            self._links.add(link)
            self._changed.notify()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._links)
                links = {link.fileno(): link for link in self._links}
            poller = select.poll()
            for number in links:
                poller.register(number, select.POLLOUT)
            for number, _ in poller.poll(10):  # [ms]; links may be added meanwhile
                self._flush(links[number])

    def _flush(self, link: Link) -> None:
        try:
            done = link.flush()
        except rospy.exceptions.TransportTerminated:
            done = True
            link.close()
        if done:
            with self._changed:
                self._links.discard(link)
            # written between the flush and here: nothing else would send it
            if link._waiting:
                self.add(link)


@cache
def sender() -> Sender:
    """Give this process's sender."""
    return Sender()


class Publication(_PublisherImpl):  # type: ignore[misc]
    """Publisher of a topic towards rospy, with links in the place of its connections."""

    def __init__(self, topic: str, data_class: type, *, latch: bool, queue: int) -> None:
        self.sender = sender()
        super().__init__(topic, data_class)
        self.is_latch = latch
        self.overflowed = 0
        self.latched: bytes | None = None
        self.settle: Callable[[], None] | None = None  # has what a bundle sent counted
        self._queue = queue

    @property
    def connections(self) -> list[Link]:
        """Links; rospy never changes the list, it makes another one, unless it has closed them all."""
        return self._links

    @connections.setter
    def connections(self, links: list[Link]) -> None:
        self._links = links
        self.sender.changes = object()

    def get_stats(self) -> Any:
        """Give what rospy tells of its connections."""
        if self.settle is not None:
            self.settle()
        return super().get_stats()

    def add_connection(self, c: Any) -> bool:
        """Connect a peer, and give it the latched message: once, even if another is published meanwhile."""
        link = Link(c, self, self._queue)
        with self.publock:
            added = bool(_TopicImpl.add_connection(self, link))
            if added and self.latched is not None:
                try:
                    link.write_data(self.latched)
                except rospy.exceptions.TransportTerminated as error:
                    self.end(link, error)
        return added

    def send(self, frame: bytes) -> None:
        """Send a message, with its length in front, to all peers."""
        with self.publock:
            if self.is_latch:
                self.latched = frame
            for link in self.connections:
                try:
                    link.write_data(frame)
                except rospy.exceptions.TransportTerminated as error:
                    self.end(link, error)

    def end(self, link: Link, error: Exception) -> None:
        """Close a link that an error has ended."""
        _logger.debug("%s: %s left: %s", self.resolved_name, link.endpoint_id, error)
        link.close()


class _Reception(_SubscriberImpl):  # type: ignore[misc]
    """Subscriber to a topic towards rospy, whose connections are read by the receiver."""

    def __init__(self, topic: str, data_class: type, take: Take) -> None:
        super().__init__(topic, data_class)
        self._take = take

    def add_connection(self, c: Any) -> bool:
        """Connect to a publisher; its thread has not begun yet."""
        Stream(c, self._take if self.statistics_logger is None else self._count_and_take)
        return bool(super().add_connection(c))

    def _count_and_take(self, data: bytes, time: int, connection: Any) -> None:
        """Take a message where rospy's statistics are asked for (/enable_statistics)."""
        logger = self.statistics_logger
        if logger is not None:
            logger.callback(self.data_class(data), connection.callerid_pub, connection.stat_bytes)
        self._take(data, time, connection)


def publish_topic(topic: str, type_name: str, *, latch: bool, queue: int) -> Publication:
    """Begin to publish; `end_topic` ends it."""
    made = Publication(topic, raw_class(type_name), latch=latch, queue=queue)
    _add(made, get_topic_manager().pubs, Registration.PUB)
    return made


def subscribe_topic(topic: str, type_name: str, take: Take) -> Any:
    """Begin to receive; `take` gets each message, in the receiver's thread."""
    made = _Reception(topic, raw_class(type_name), take)
    made.set_tcp_nodelay(True)  # a tick's message must not wait for the next one's
    _add(made, get_topic_manager().subs, Registration.SUB)
    return made


def _add(made: Any, where: dict[str, Any], registration: str) -> None:
    # before it is registered: a peer may connect at once
    manager = get_topic_manager()
    made.ref_count = 1
    manager._add(made, where, registration)


def end_topic(made: Any) -> None:
    """End a publication or a subscription."""
    registration = Registration.PUB if isinstance(made, Publication) else Registration.SUB
    get_topic_manager().release_impl(registration, made.resolved_name)
