"""The one rospy node that a process can have: started, watched, registered again when the master comes back.

Imports rospy, so it is imported only when a `Ros1Transport` is made. rospy keeps its state in module globals: a process
has one node with one name until it ends. Its signal handlers are not installed and it writes no log files; its loggers
(`rospy`, `rosout`) are the program's.

rospy carries messages whose bytes are made and read elsewhere: a class of genpy's protocol for each type has its name,
md5 sum and definition, by which ROS's programs tell types apart, and passes the bytes on.
"""

import atexit
import logging
import os
import threading
from collections.abc import Callable, Mapping
from functools import cache, partial
from typing import Any

import genpy
import rospy

from catenary.crtk.ros1 import peers
from catenary.crtk.ros1.master import Master, Refused, bound_to_all
from catenary.errors import TransportError
from catenary.recording.messages import full_definition, md5_sum, service_md5_sum


class RawMessage(genpy.Message):  # type: ignore[misc]  # genpy is not typed
    """A message as bytes."""

    __slots__ = ("data",)
    _slot_types: tuple[str, ...] = ()
    _has_header = False  # rospy would count in it; whoever makes the bytes does

    def __init__(self, data: bytes = b"") -> None:
        self.data = data

    def serialize(self, buffer: Any) -> None:
        """Write the bytes."""
        buffer.write(self.data)

    def deserialize(self, data: bytes) -> "RawMessage":
        """Keep the bytes."""
        self.data = data
        return self


@cache
def raw_class(name: str) -> type[RawMessage]:
    """Return the class that stands for a message type towards rospy and its peers, under the spelling given."""
    attributes = {"__slots__": (), "_type": name, "_md5sum": md5_sum(name), "_full_text": full_definition(name)}
    return type(name.rpartition("/")[2], (RawMessage,), attributes)


@cache
def service_class(name: str) -> type:
    """Return the class that stands for a service type towards rospy and its peers."""
    halves = {f"_{half.lower()}_class": raw_class(f"{name}{half}") for half in ("Request", "Response")}
    attributes = {"_type": name, "_md5sum": service_md5_sum(name), **halves}
    return type(name.rpartition("/")[2], (), attributes)


_LOOK_EVERY_S = 0.5  # [s] between looks at the master
_END_WITHIN_S = 5.0  # [s] a program waits at its end, and that of a topic, until the master has been informed
_logger = logging.getLogger(__name__)
_node: "Node | None" = None


class Node:
    """This process's node: its topics and services, and what it knows of its master."""

    def __init__(self, name: str, uri: str) -> None:
        caller = f"{os.environ.get('ROS_NAMESPACE', '').rstrip('/')}/{name}"
        self.name = caller if caller.startswith("/") else f"/{caller}"
        self.master = Master(uri, self.name)
        self.master_pid = self.master.pid()
        other = self.master.node(self.name)
        if other is not None and self.master.node_answers(other):
            raise TransportError(
                f"a node {self.name} runs already, at {other}; ROS would end it for one of the same name. "
                "Choose another name, or end that one first"
            )
        os.environ["ROS_MASTER_URI"] = uri  # rospy knows no other way, and asks again for services
        configure, rospy.core.configure_logging = rospy.core.configure_logging, lambda *_, **__: None
        peers.change_rospy()
        try:
            # no arguments of the program, whose names could otherwise be remapped
            rospy.init_node(name, argv=[], disable_signals=True, disable_rosout=True, disable_rostime=True)
        finally:
            rospy.core.configure_logging = configure
        # what rospy has to say of broken connections is no matter for a terminal
        logging.getLogger("rospy").addHandler(logging.NullHandler())
        warning = bound_to_all(os.environ)
        if warning is not None:
            _logger.warning("%s", warning)
        self.uri: str = rospy.get_node_uri()
        self.up = True
        self.on_shutdown: Callable[[], None] = lambda: None
        self._publishers: dict[str, peers.RosPublisher] = {}  # by topic
        self._topics: dict[str, peers.RosTopic] = {}
        self.services: dict[str, Any] = {}  # rospy's
        self.listed: Mapping[str, frozenset[str]] = {}  # who publishes each topic, when the master was last asked
        self._others: dict[str, frozenset[str]] = {}  # that publish topics, living ones, as last asked
        self._incomplete: frozenset[str] = frozenset()  # topics with publishers that were not connected
        rospy.on_shutdown(lambda: self.on_shutdown())
        atexit.register(_end)
        threading.Thread(target=self._watch, name="ROS master watch", daemon=True).start()

    def publisher(self, topic: str, type_name: str, *, latch: bool, queue: int) -> peers.RosPublisher:
        """Start publishing."""
        end = partial(self._forget, self._publishers)
        made = peers.RosPublisher(topic, type_name, raw_class(type_name), end, latch=latch, queue=queue)
        self._publishers[topic] = made
        return made

    def topic(self, topic: str, type_name: str, steady: Callable[[], int]) -> peers.RosTopic:
        """Start receiving."""
        end = partial(self._forget, self._topics)
        made = self._topics[topic] = peers.RosTopic(topic, type_name, raw_class(type_name), end, steady)
        return made

    def _forget(self, listed: dict[str, Any], ros: Any) -> None:
        listed.pop(ros.resolved_name, None)
        self._tell(ros.unregister)

    def serve(self, name: str, type_name: str, answer: Callable[[bytes], bytes]) -> None:
        """Offer a service by a `rospy.Service`; `answer` runs in rospy's threads, and its error is the caller's."""
        response = raw_class(f"{type_name}Response")

        def handle(request: Any) -> Any:
            try:
                return response(answer(request.data))
            except Exception as error:
                raise rospy.ServiceException(str(error)) from error

        self.services[name] = rospy.Service(name, service_class(type_name), handle)

    def end_services(self) -> None:
        """Offer none any more."""
        while self.services:
            self._tell(self.services.popitem()[1].shutdown)

    def _tell(self, end: Callable[[], None]) -> None:
        """End something, which tells the master, in a thread: rospy waits without limit, and loses a Ctrl-C then."""
        thread = threading.Thread(target=end, daemon=True)
        thread.start()
        thread.join(_END_WITHIN_S if self.up else _LOOK_EVERY_S)

    def _watch(self) -> None:
        while not rospy.is_shutdown():
            try:
                self._look()
            except (TransportError, Refused) as error:
                if self.up:
                    _logger.warning("%s; connected topics continue", error)
                self.up = False
            threading.Event().wait(_LOOK_EVERY_S)

    def _look(self) -> None:
        """Register again with a master that is another process, or that has forgotten this node."""
        pid, known = self.master.pid(), self.master.node(self.name)
        if rospy.is_shutdown():
            return  # it is being unregistered, and unknown for that
        if pid != self.master_pid or known is None:
            self._register()
            self.master_pid = pid
            _logger.warning("registered again with the ROS master at %s", self.master.uri)
        elif not self.up:
            _logger.warning("the ROS master at %s is back", self.master.uri)
        self.up = True
        self._connect_again()

    def _connect_again(self) -> None:
        """Connect again to publishers whose connections broke while they lived on; rospy alone gives them up."""
        listed = self.listed = self.master.publisher_names()
        for name in tuple(self._others):
            self._others[name] = self._living(name)
        incomplete = frozenset(
            topic
            for topic, heard in list(self._topics.items())
            if not listed.get(topic, frozenset()) <= set(heard.publishers())
        )
        # incomplete at two looks: a publisher that has only just come is being connected
        for topic in incomplete & self._incomplete:
            self._tell_publishers(topic, list(self.master.living(topic, listed[topic]).values()))
        self._incomplete = incomplete

    def others(self, topic: str) -> frozenset[str]:
        """Return the other living processes that publish a topic: asked for now, later half a second ago at most."""
        if topic not in self._others:
            self.listed = self.master.publisher_names()
            self._others[topic] = self._living(topic)
        return self._others[topic]

    def _living(self, topic: str) -> frozenset[str]:
        names = self.listed.get(topic, frozenset()) - {self.name}
        return frozenset(map(" ".join, self.master.living(topic, names).items()))

    def _tell_publishers(self, topic: str, uris: list[str]) -> None:
        """Tell this node who publishes a topic, as the master does; it connects to those that are new to it."""
        self.master.ask(self.uri, "publisherUpdate", topic, uris)

    def _register(self) -> None:
        register = partial(self.master.ask, self.master.uri)
        for topic, publisher in list(self._publishers.items()):
            register("registerPublisher", topic, publisher.ros.type, self.uri)
        for topic, heard in list(self._topics.items()):
            self._tell_publishers(topic, register("registerSubscriber", topic, heard.ros.type, self.uri))
        for name, service in list(self.services.items()):
            register("registerService", name, service.uri, self.uri)


def _end() -> None:
    """Shut the node down; where another thread does, as after `rosnode kill`, wait until the master is informed."""
    if _node is not None:
        _node._tell(lambda: rospy.signal_shutdown("the program ends"))
    if rospy.core._shutdown_lock.acquire(timeout=_END_WITHIN_S):
        rospy.core._shutdown_lock.release()


def node(name: str, uri: str) -> Node:
    """Return this process's node; it is started once."""
    global _node
    if _node is None:
        if rospy.core.is_initialized():
            raise TransportError(
                f"this process called rospy.init_node as {rospy.get_name()} itself; leave that to catenary"
            )
        _node = Node(name, uri)
    if rospy.is_shutdown():
        raise TransportError("the ROS node of this process was shut down, and rospy cannot start another")
    if _node.name.rpartition("/")[2] != name or _node.master.uri != uri:
        raise TransportError(
            f"this process is ROS node {_node.name} of {_node.master.uri} until it ends, and cannot be {name} of {uri}"
        )
    return _node
