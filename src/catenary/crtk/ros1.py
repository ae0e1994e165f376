"""ROS 1 behind the transport protocol, by rospy, which is imported only when a transport is made.

rospy comes with ROS (noetic) or with Debian 12 (`apt install python3-rospy python3-rosmaster`). Where it lies outside
this environment's path but belongs to this version of Python, that path is appended: behind everything that is
installed here, so it hides nothing.

Topic and service names are taken as they are, from the root: no namespace and no remapping. Time is the machine's;
`/use_sim_time` is not looked at. When the master dies, connected topics go on, and everything is registered again when
it is back, which rospy alone does not do.
"""

import importlib
import importlib.util
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

from catenary.crtk.bundle import Bundle
from catenary.crtk.frames import LENGTH, SEQ, SEQ_AT, SEQ_MOST
from catenary.crtk.inbox import Callback, Origin, Request, Subscription
from catenary.crtk.message import Message, message_class
from catenary.crtk.ros1_master import master_uri
from catenary.crtk.sheet import Sheet
from catenary.crtk.transport import (
    DEPTH,
    QUEUE,
    Connections,
    Handler,
    PollingTransport,
    Publisher,
    absolute,
    other_type,
)
from catenary.crtk.wire import codec
from catenary.errors import MissingPackageError, TransportError
from catenary.recording.messages import current_name, service_md5_sum

# where Debian and ROS noetic put it, for the system's Python
_FOLDERS = (Path("/usr/lib/python3/dist-packages"), Path("/opt/ros/noetic/lib/python3/dist-packages"))
_open: "Ros1Transport | None" = None  # rospy has one node a process


def make_rospy_importable() -> None:
    """Find rospy, where need be outside this environment.

    Raises:
        MissingPackageError: There is none for this Python.
    """
    if importlib.util.find_spec("rospy") is not None:
        return
    if _system_python() == sys.version_info[:2]:
        for folder in _FOLDERS:
            if (folder / "rospy" / "__init__.py").is_file():
                sys.path.append(str(folder))
                importlib.invalidate_caches()
                return
    version = ".".join(map(str, sys.version_info[:2]))
    raise MissingPackageError(
        f"rospy: not found for Python {version}. On Debian 12, with its Python 3.11: apt install python3-rospy "
        "python3-rosmaster. Without ROS, the loopback transport carries messages within one process"
    )


def _system_python() -> tuple[int, int] | None:
    """Version of Python for which the system's packages are made."""
    try:
        name = Path("/usr/bin/python3").resolve(strict=True).name
        major, _, minor = name.removeprefix("python").partition(".")
        return int(major), int(minor)
    except (OSError, ValueError):
        return None


class Ros1Publisher:
    """Publisher of one topic; `publish` never waits for a peer."""

    def __init__(self, publication: Any, type_name: str, *, latch: bool) -> None:
        self.topic: str = publication.resolved_name
        self.type_name = type_name
        self._publication = publication
        self._encode = codec(type_name).encode
        self._latch = latch
        self._sent = 0
        self._closed = False

    @property
    def overflowed(self) -> int:
        """Messages that slow peers missed."""
        return int(self._publication.overflowed)

    def publish(self, message: Message) -> None:
        """Send a message; one that nobody listens to, and that is not latched, is not even encoded."""
        if self._closed:
            raise TransportError(f"publisher of {self.topic} is closed")
        self._sent += 1
        if self._latch or self._publication.connections:
            data = self._encode(message, self._sent)
            self._publication.send(LENGTH.pack(len(data)) + data)

    def publish_frame(self, frame: bytearray | memoryview) -> None:
        """Send a message in ROS 1's bytes."""
        if self._closed:
            raise TransportError(f"publisher of {self.topic} is closed")
        self._sent += 1
        if self._latch or self._publication.connections:
            SEQ.pack_into(frame, SEQ_AT, self._sent & SEQ_MOST)
            self._publication.send(bytes(frame))

    def lend(self) -> tuple[Any, int]:
        """Give what sends, and how many messages it has sent, to a bundle, which sends from now on."""
        if self._closed:
            raise TransportError(f"publisher of {self.topic} is closed")
        return self._publication, self._sent

    def close(self) -> None:
        """Publish no more."""
        if not self._closed:
            self._closed = True
            _links().end_topic(self._publication)


class _Topic:
    """What this process receives of one topic: one connection per publisher, for all subscriptions."""

    def __init__(self, name: str, type_name: str) -> None:
        self.type_name = current_name(type_name)
        self._subscriptions: list[Subscription] = []
        self._latched: dict[str, tuple[bytes, int, Origin]] = {}  # by publisher
        self._origins: dict[str, Origin] = {}  # the last one of each publisher
        self._lock = threading.Lock()
        self.rospy = _links().subscribe_topic(name, type_name, self._receive)

    def add(self, subscription: Subscription) -> None:
        with self._lock:
            for latched in self._latched.values():
                subscription.push(*latched)
            self._subscriptions.append(subscription)

    def remove(self, subscription: Subscription) -> bool:
        """Whether nobody is left."""
        with self._lock:
            self._subscriptions = [one for one in self._subscriptions if one is not subscription]
            return not self._subscriptions

    def _receive(self, data: bytes, time: int, connection: Any) -> None:
        with self._lock:
            origin = self._origin(connection.header)
            if origin.is_latching:
                name = origin.process.partition(" ")[0]
                self._latched[name] = data, time, origin
            for subscription in self._subscriptions:
                subscription.push(data, time, origin)

    def _origin(self, head: dict[str, str]) -> Origin:
        """Where a message came from; rospy makes a connection's header anew when it has connected again."""
        name = head.get("callerid", "")
        known = self._origins.get(name)
        if known is None or known.connection is not head:
            uris = (one.endpoint_id for one in self.rospy.connections or () if one.header is head)
            process = f"{name} {next(uris, '')}"
            known = self._origins[name] = Origin(process, head, head.get("latching") == "1")
        return known


class Ros1Transport(PollingTransport):
    """This process's ROS 1 node; one at a time, under one name until the process ends."""

    def __init__(self, name: str, uri: str | None = None) -> None:
        """Join a ROS 1 network.

        Args:
            name: Node name; one that runs already is left alone, and this one refused.
            uri: The master's; ROS_MASTER_URI when None.

        Raises:
            InputError: The name is none.
            MissingPackageError: There is no rospy.
            TransportError: There is no master (known within 3 s), the name is taken, or this process has another node.
        """
        global _open
        super().__init__(name)
        make_rospy_importable()
        if _open is not None:
            raise TransportError(f'this process has the ROS 1 transport "{_open.name}"; close that one first')
        self._node = importlib.import_module("catenary.crtk.ros1_node").node(name, master_uri(uri))
        self._publishers: dict[str, Ros1Publisher] = {}
        self._topics: dict[str, _Topic] = {}
        self._services: dict[str, Any] = {}
        self._node.on_shutdown = self.inbox.close  # ends `spin`
        _open = self

    def publisher(
        self, topic: str, type_name: str, *, latch: bool = False, queue: int = QUEUE
    ) -> Ros1Publisher:
        """Begin to publish; `queue` counts messages beyond what the system's socket holds."""
        self.require_open()
        topic = absolute(topic)
        codec(type_name)
        known = self._publishers.get(topic)
        if known is not None and not known._closed:
            raise TransportError(f'"{self.name}" publishes {topic} already')
        self._refuse_other_type(topic, type_name)
        publication = _links().publish_topic(topic, type_name, latch=latch, queue=queue)
        self._publishers[topic] = Ros1Publisher(publication, current_name(type_name), latch=latch)
        return self._publishers[topic]

    def bundle(self, publishers: Sequence[Publisher], sheet: Sheet) -> Bundle:
        """Give what sends frames into all sockets at once."""
        self.require_open()
        lent = [publisher.lend() for publisher in cast(Sequence[Ros1Publisher], publishers)]
        bundle: Bundle = importlib.import_module("catenary.crtk.ros1_bundle").SocketBundle(lent, sheet)
        return bundle

    def subscribe(
        self, topic: str, type_name: str, callback: Callback | None = None, *, depth: int = DEPTH
    ) -> Subscription:
        """Begin to receive."""
        self.require_open()
        topic = absolute(topic)
        subscription = Subscription(
            topic, current_name(type_name), self.inbox, codec(type_name).decode, callback, depth
        )
        found = self._topics.get(topic)
        if found is None:
            self._refuse_other_type(topic, type_name)
            found = self._topics[topic] = _Topic(topic, type_name)
        elif found.type_name != current_name(type_name):
            raise other_type(topic, type_name, found.type_name)
        found.add(subscription)
        subscription.on_close(lambda: self._unsubscribe(topic, subscription))
        return subscription

    def _unsubscribe(self, topic: str, subscription: Subscription) -> None:
        if self._topics[topic].remove(subscription):
            _links().end_topic(self._topics.pop(topic).rospy)

    def _refuse_other_type(self, topic: str, type_name: str) -> None:
        """Refuse what rospy would only mention in a log, while nothing arrives."""
        published = self._node.master.topics().get(topic)
        if published is None or current_name(published) == current_name(type_name):
            return
        if self._node.master.publishers(topic):  # not only one that crashed
            raise other_type(topic, type_name, published)

    def service(self, name: str, type_name: str, handler: Handler) -> None:
        """Offer a service."""
        self.require_open()
        name = absolute(name)
        service_md5_sum(type_name)
        if name in self._services or self._node.master.service_answers(name):
            raise TransportError(f"service {name} is offered already")
        rospy, links = importlib.import_module("rospy"), _links()
        asked, answer = codec(f"{type_name}Request"), codec(f"{type_name}Response")

        def serve(raw: Any) -> Any:
            request = Request(lambda: answer.encode(handler(asked.decode(raw.data)), 0))
            self.inbox.put(request.run)
            while not request.wait(0.1):
                if self.inbox.closed:
                    raise rospy.ServiceException("the server was closed")
            try:
                return links.raw_class(f"{type_name}Response")(request.result())
            except Exception as error:
                raise rospy.ServiceException(str(error)) from error

        self._services[name] = rospy.Service(name, links.service_class(type_name), serve)

    def call(
        self, name: str, type_name: str, request: Message | None = None, *, timeout: float = 5.0
    ) -> Message:
        """Call a service."""
        self.require_open()
        name = absolute(name)
        service_md5_sum(type_name)
        asked, answer = codec(f"{type_name}Request"), codec(f"{type_name}Response")
        data = asked.encode(message_class(f"{type_name}Request")() if request is None else request, 0)
        if self._node.master.service(name) is None:
            raise TransportError(f"service {name}: nobody offers it")
        rospy, links = importlib.import_module("rospy"), _links()
        proxy = rospy.ServiceProxy(name, links.service_class(type_name))
        raw = links.raw_class(f"{type_name}Request")(data)
        waiting = Request(lambda: answer.decode(proxy(raw).data))
        threading.Thread(target=waiting.run, daemon=True).start()  # rospy itself would wait for ever
        if not waiting.wait(timeout):
            raise TransportError(f"service {name}: no answer within {timeout} s")
        try:
            return waiting.result()
        except Exception as error:
            raise TransportError(f"service {name} failed: {error}") from error

    def connections(self, topic: str) -> Connections:
        """Peers over a topic, by node name."""
        topic = absolute(topic)
        publisher, received = self._publishers.get(topic), self._topics.get(topic)
        sending = [] if publisher is None else publisher._publication.connections or []
        receiving = [] if received is None else received.rospy.connections or []
        return Connections(
            tuple(sorted(getattr(one, "callerid_pub", None) or one.endpoint_id for one in receiving)),
            tuple(sorted(one.endpoint_id for one in sending)),
        )

    def topics(self) -> Mapping[str, str]:
        """Topics that anyone publishes, with their types in their present spelling."""
        return {topic: current_name(kind) for topic, kind in sorted(self._node.master.topics().items())}

    def publishing(self) -> Mapping[str, frozenset[str]]:
        """Processes that publish each topic, also those that do not answer."""
        found: dict[str, frozenset[str]] = self._node.master.publishing()
        return found

    def is_up(self) -> bool:
        """Whether it is open and the master answered when last asked, half a second ago at most."""
        return self._node.up and not self.inbox.closed

    def close(self) -> None:
        """End all topics and services; the node itself, without topics, lives as long as the process."""
        global _open
        was_shut_down = self.inbox.closed
        super().close()
        if _open is not self:
            return
        _open = None
        self._node.on_shutdown = lambda: None
        if was_shut_down:
            return  # rospy has ended everything
        ends: list[Callable[[], None]] = [one.close for one in self._publishers.values()]
        ends += [lambda topic=topic: _links().end_topic(topic.rospy) for topic in self._topics.values()]  # type: ignore[misc]
        ends += [service.shutdown for service in self._services.values()]
        for end in ends:
            end()


def _links() -> Any:
    """Module that imports rospy."""
    return importlib.import_module("catenary.crtk.ros1_links")
