"""ROS 2 behind the transport protocol by rclpy, where ROS 2 is installed: any RMW, and services that answer.

Messages pass rclpy as ROS 2's bytes (CDR), made and read by the codec that DDS has too; only services need rclpy's
objects. rclpy's executor answers services and parameters. It would hear 4,400 messages a second; a thread takes 14,000.
A type whose package is not built for this ROS 2 cannot be carried: its topics are left out, and a line says so.
"""

import importlib
import logging
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

import rclpy
from rcl_interfaces.msg import Log
from rclpy.callback_groups import CallbackGroup
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message

from catenary.crtk.message import CDR, HEADER, Message, codec
from catenary.crtk.message_queues import UNTAKEN_MESSAGES, Origin
from catenary.crtk.network import BEGIN, RosArguments
from catenary.crtk.transport import SETTLE_S, UNNAMED_NODE, Answer, HeardTopic, Publisher, Transport, wait_until_settled
from catenary.errors import TransportError
from catenary.recording.messages import current_name, fields
from catenary.topics import SECOND

_AGAIN = 1000  # messages among which one that came to two readers is known again
_IDLE = 0.0005  # [s] between two looks for messages where none came
_LOOK = 0.2  # [s] between two looks at who is there: a twentieth of a millisecond a topic
_NAMING = 1.0  # [s] until a program counts as one without a node
_NAMELESS = "_"  # with which rclpy's words of such a one begin
_PROGRAM = 12  # first bytes of the number of a topic's end, which DDS gives to all ends of a program
_logger = logging.getLogger(__name__)
_Quality = tuple[ReliabilityPolicy, DurabilityPolicy]
_USUAL = ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE
_LATCHED = ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL
_POOR = ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE
_Origins = dict[bytes, Origin]  # by the number of a topic's end


def _origins(listed: list[Any]) -> _Origins:
    origins = {}
    for one in listed:
        gid = bytes(one.endpoint_gid)
        node = f"{one.node_namespace.rstrip('/')}/{one.node_name}"
        if one.node_name.startswith(_NAMELESS):
            node = f"{UNNAMED_NODE}{gid[:_PROGRAM].hex()}"
        is_latching = one.qos_profile.durability == _LATCHED[1]
        origins[gid] = Origin(f"{node} {gid[:_PROGRAM].hex()}", sys.intern(gid.hex()), is_latching)
    return origins


def _names(origins: _Origins) -> tuple[str, ...]:
    return tuple(sorted({origin.process.partition(" ")[0] for origin in origins.values()}))


def _profile(depth: int, quality: _Quality) -> QoSProfile:
    return QoSProfile(depth=depth, reliability=quality[0], durability=quality[1])


class _Publisher(Publisher):
    """Publisher of one topic; a message is encoded only if there are subscribers or the topic is latched."""

    def __init__(self, node: Any, kind: Any, topic: str, type_name: str, profile: QoSProfile) -> None:
        super().__init__(topic, type_name)
        self._encode, self._node, self._lock = codec(type_name, CDR).encode, node, threading.Lock()
        self._is_latched = profile.durability == _LATCHED[1]
        self._made = node.create_publisher(kind, topic, profile)

    def is_heard(self) -> bool:
        return not self.is_closed and bool(self._made.get_subscription_count())

    def look(self) -> None:
        with self._lock:
            listed = self._node.get_subscriptions_info_by_topic(self._made.topic_name) if self.is_heard() else []
            self._listeners = _names(_origins(listed))

    def _send(self, message: Message) -> None:
        if self._is_latched or self.is_heard():
            self._made.publish(self._encode(message))

    def _end(self) -> None:
        with self._lock:
            self._node.destroy_publisher(self._made)
            self._listeners = ()


class _Rosout(logging.Handler):
    """Says on `/rosout` what catenary logs."""

    def __init__(self, node: Any) -> None:
        super().__init__(logging.INFO)
        self._node, self._publisher = node, node.create_publisher(Log, "/rosout", _profile(1000, _LATCHED))

    def emit(self, record: logging.LogRecord) -> None:
        where = {"file": record.pathname, "function": record.funcName or "", "line": record.lineno}
        what = {"name": self._node.get_name(), "level": record.levelno, "msg": record.getMessage()}
        self._publisher.publish(Log(stamp=self._node.get_clock().now().to_msg(), **what, **where))


class _Taken(CallbackGroup):  # type: ignore[misc]  # rclpy is not typed
    """What rclpy's executor is to leave alone, since the transport takes it."""

    def can_execute(self, entity: Any) -> bool:
        return False


class _ReadTopic(HeardTopic):
    """A topic that is heard, by a reader for each quality that some publisher offers; each message is given once."""

    def __init__(self, transport: "RclpyTransport", kind: Any, topic: str, type_name: str) -> None:
        super().__init__(type_name)
        self._node, self._kind, self._steady = transport.node, kind, transport.steady
        self._name = self._node.resolve_topic_name(topic)
        self._readers: dict[_Quality, Any] = {}
        self._publishers: _Origins = {}
        self._senders: _Origins = {}  # those whose node is not known yet too: a program's first command may come before
        self._seen: dict[bytes, float] = {}  # when
        self._came: deque[tuple[int, int]] = deque(maxlen=_AGAIN)  # when they were sent [ns], and their numbers
        self._is_ended = False
        self.look()

    def publishers(self) -> tuple[str, ...]:
        return _names(self._publishers)

    def look(self) -> None:
        now, listed = time.monotonic(), self._node.get_publishers_info_by_topic(self._name)
        listed = [one for one in listed if current_name(one.topic_type) == self.type_name]
        with self._lock:
            # one whose node is discovered later must not be two programs
            named = [one for one in listed if not one.node_name.startswith(_NAMELESS)]
            named += [one for one in listed if now - self._seen.setdefault(bytes(one.endpoint_gid), now) > _NAMING]
            self._publishers, self._senders = _origins(named), _origins(listed)
            qualities = [(one.qos_profile.reliability, one.qos_profile.durability) for one in named]
            offered = {one if one[0] == _USUAL[0] else _POOR for one in qualities} or {_USUAL}
            for quality in () if self._is_ended else offered - self._readers.keys():
                profile = _profile(UNTAKEN_MESSAGES, quality)
                self._readers[quality] = self._node.create_subscription(
                    self._kind, self._name, print, profile, callback_group=_Taken(), raw=True
                )

    def end(self) -> None:
        with self._lock:
            self._is_ended = True
            while self._readers:
                self._node.destroy_subscription(self._readers.popitem()[1])

    def take(self) -> None:
        with self._lock:
            for reader in tuple(self._readers.values()):
                while (came := reader.handle.take_message(self._kind, True)) is not None:
                    self._receive(*came)

    def _receive(self, data: bytes, info: Mapping[str, Any]) -> None:
        which = sent, _ = info["source_timestamp"], info["publication_sequence_number"] or 0
        if len(self._readers) > 1 and which in self._came:
            return
        self._came.append(which)
        self.give(data, self._steady(), self._origin(info.get("publisher_gid")), sent)

    def _origin(self, gid_field: Mapping[str, Any] | None) -> Origin | None:
        """Return the sender of a message: by rclpy since Kilted; before, it is known where one publishes alone."""
        gid = None if gid_field is None else bytes(gid_field["data"])
        if not self._senders or (gid is not None and gid not in self._senders):
            self.look()
        if gid is None:
            return next(iter(self._senders.values())) if len(self._senders) == 1 else None
        return self._senders.get(gid)


@cache
def _kind(name: str, part: str) -> Any:
    """Return rclpy's class of a type of messages ("msg") or services ("srv"), or None and say so once."""
    package, _, word = current_name(name).partition("/")
    try:
        kind = getattr(importlib.import_module(f"{package}.{part}"), word)
    except (ImportError, AttributeError) as error:
        _logger.warning("%s is skipped: this ROS 2 has no such type (%s); --transport dds has it", name, error)
        return None
    if part == "msg":
        theirs = list(kind.get_fields_and_field_types())
        ours = [field.name for field in fields(name)][int(name == HEADER) :]
        if theirs != ours:
            raise TransportError(f"{name}: this ROS 2 has the fields {theirs}, expected {ours}")
    return kind


class RclpyTransport(Transport):
    """A node of rclpy's: one thread receives, another answers services and parameters."""

    encoding = CDR
    lapses = (0, 10 * SECOND, 20 * SECOND)  # Cyclone's and Fast DDS's lease

    def __init__(self, name: str, *, arguments: RosArguments | None = None, settle: float = SETTLE_S) -> None:
        """Join ROS 2 as its environment variables say; arguments as of `DdsTransport`."""
        self._arguments = arguments or RosArguments()
        super().__init__(self._arguments.node or name)
        self._context = rclpy.Context()
        renamed = [word for pair in self._arguments.topics.items() for word in ("-r", ":=".join(pair))]
        words = [BEGIN, "--disable-external-lib-logs", *renamed]
        try:
            rclpy.init(args=words, context=self._context)  # signals stay the program's, as with any context of its own
            self.node = rclpy.create_node(self.name, context=self._context, namespace=self._arguments.namespace)
        except (RuntimeError, ValueError) as error:
            raise TransportError(f"rclpy: {error}") from error
        self._rosout = _Rosout(self.node)
        logging.getLogger("catenary").addHandler(self._rosout)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._threads = [threading.Thread(target=run, daemon=True) for run in (self._receive, self._executor.spin)]
        for thread in self._threads:
            thread.start()
        wait_until_settled(lambda: (self.node.get_node_names(), self.node.get_topic_names_and_types()), settle)

    def _receive(self) -> None:
        looked = 0.0
        while not self.inbox.closed:
            now, before = time.monotonic(), self.inbox.arrivals
            is_due = now > looked + _LOOK
            looked = now if is_due else looked
            try:
                for one in (*self._heard.values(), *self._publishers.values()):
                    if isinstance(one, _ReadTopic):
                        one.take()
                    if is_due and isinstance(one, _ReadTopic | _Publisher):
                        one.look()
            except Exception:  # one message, or one program, must not end it
                _logger.exception("receiver of %s", self.name)
            if self.inbox.arrivals == before:
                time.sleep(_IDLE)

    def _publisher(self, topic: str, type_name: str, *, latch: bool, queue: int) -> Publisher:
        kind, quality = _kind(type_name, "msg"), _LATCHED if latch else _USUAL if self.sending.is_reliable else _POOR
        if kind is None:
            return Publisher(topic, type_name)  # to nobody
        return _Publisher(self.node, kind, topic, type_name, _profile(1 if latch else queue, quality))

    def _hear(self, topic: str, type_name: str) -> HeardTopic:
        kind = _kind(type_name, "msg")
        return HeardTopic(type_name) if kind is None else _ReadTopic(self, kind, topic, type_name)

    def _serve(self, name: str, type_name: str, answer: Answer) -> None:
        kind = _kind(type_name, "srv")
        if kind is None:
            return
        if self.node.count_services(self.node.resolve_service_name(name)):
            raise TransportError(f"service {name} is offered already")

        def serve(request: Any, response: Any) -> Any:
            try:
                return deserialize_message(self._polled(answer, serialize_message(request)), kind.Response)
            except Exception as error:  # ROS 2 says so by the answer's own text
                _logger.error("service %s failed: %s", name, error)
                if hasattr(response, "message"):
                    response.message = str(error)
                return response

        self.node.create_service(kind, name, serve)

    def _published(self) -> Iterator[tuple[str, str, str]]:
        for topic, _ in self.node.get_topic_names_and_types():
            own, listed = self._arguments.own_name(topic), self.node.get_publishers_info_by_topic(topic)
            if own is not None:
                yield from ((own, current_name(listed[0].topic_type), one.process) for one in _origins(listed).values())

    def _others(self, topic: str) -> frozenset[str]:
        listed = self.node.get_publishers_info_by_topic(self.node.resolve_topic_name(topic))
        processes, ours = {one.process for one in _origins(listed).values()}, self._publishers.get(topic)
        if ours is not None and not ours.is_closed:  # it is one of its name; which one, rclpy does not say
            node = self.node.get_fully_qualified_name()
            processes.discard(next((one for one in processes if one.partition(" ")[0] == node), ""))
        return frozenset(processes)

    def close(self) -> None:
        """End the node."""
        if self.inbox.closed:
            return
        super().close()
        logging.getLogger("catenary").removeHandler(self._rosout)
        self._executor.shutdown()
        for thread in self._threads:
            thread.join()
        self._end_topics()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)
