"""ROS 2 behind the transport protocol, by rclpy, which is imported only when a transport is made.

Messages pass rclpy as ROS 2's bytes (CDR), which rosbags makes from ROS 1's; so every transport has the same codec.

Not tried on a real ROS 2: rclpy comes neither by pip nor with Debian. Its tests run against a stand-in that keeps to
rclpy's documented interface (Humble). What differs from ROS 1: headers have no `seq`; types of raven_2 do not exist,
so only the `crtk` dialect works; two programs may have the same name; ROS 2 does not count what a peer misses, so
`overflowed` of a publisher stays 0; a service that fails says so in its response.
"""

import importlib
import logging
import threading
from collections.abc import Mapping
from functools import partial
from typing import Any

from catenary.crtk.codec import NO_MESSAGE, codec
from catenary.crtk.inbox import Request, Subscription
from catenary.crtk.message import Message, message_class, message_fields
from catenary.crtk.transport import DEPTH, Connections, Handler, Publisher, Transport, absolute, other_type
from catenary.errors import MissingPackageError, TransportError
from catenary.recording.messages import current_name, fields, ros2_name, typestore

_logger = logging.getLogger(__name__)


def ros2_class(name: str, kind: str = "msg") -> Any:
    """Return ROS 2's class of a message type (`kind` "msg") or service type ("srv").

    Raises:
        MissingPackageError: Its package is not installed for ROS 2; there is none for raven_2.
    """
    package, _, type_name = current_name(name).partition("/")
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), type_name)
    except (ImportError, AttributeError) as error:
        hint = (
            "the RAVEN-II's own messages exist for ROS 1 only, the crtk dialect does without them"
            if package == "raven_2"
            else f"install it (apt install ros-$ROS_DISTRO-{package.replace('_', '-')}) and source ROS 2's setup file"
        )
        raise MissingPackageError(f"{ros2_name(name)}: not found in ROS 2: {hint}") from error


class Ros2Publisher(Publisher):
    """Publisher of one topic."""

    def __init__(self, transport: "Ros2Transport", topic: str, type_name: str, handle: Any) -> None:
        super().__init__(topic, type_name)
        self._transport, self._handle = transport, handle

    def _send(self, message: Message) -> None:
        data = self._encode(message, 0)
        self._handle.publish(bytes(typestore(2).ros1_to_cdr(data, ros2_name(self.type_name))))

    def _end(self) -> None:
        self._transport.node.destroy_publisher(self._handle)


class Ros2Transport(Transport):
    """A ROS 2 node with a context of its own; a thread of its own receives."""

    def __init__(self, name: str) -> None:
        """Join the network that ROS_DOMAIN_ID names.

        Raises:
            InputError: A program cannot have this name.
            MissingPackageError: There is no rclpy.
        """
        super().__init__(name)
        try:
            rclpy = importlib.import_module("rclpy")
        except ImportError as error:
            raise MissingPackageError(
                "rclpy: not found. It comes with ROS 2 alone: source /opt/ros/DISTRO/setup.bash, and use the Python "
                "that ROS 2 was made for"
            ) from error
        self._rclpy = rclpy
        self._context = importlib.import_module("rclpy.context").Context()
        no_signals = importlib.import_module("rclpy.signals").SignalHandlerOptions.NO
        rclpy.init(args=[], context=self._context, signal_handler_options=no_signals)
        self.node = rclpy.create_node(name, context=self._context, use_global_arguments=False)
        self._executor = importlib.import_module("rclpy.executors").SingleThreadedExecutor(
            context=self._context
        )
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._receive, name=f"{name} receiver", daemon=True)
        self._thread.start()

    def _receive(self) -> None:
        while self._context.ok() and not self.inbox.closed:
            try:
                self._executor.spin_once(timeout_sec=0.1)
            except Exception:
                if not self._context.ok():
                    break
                _logger.exception("receiver of %s", self.name)
        self.inbox.close()  # ends `spin` where ROS 2 ended the context

    def _publisher(self, topic: str, type_name: str, *, latch: bool, queue: int) -> Ros2Publisher:
        self._refuse_other_type(topic, type_name)
        handle = self.node.create_publisher(
            ros2_class(type_name), topic, self._qos(1 if latch else queue, latch=latch)
        )
        return Ros2Publisher(self, topic, type_name, handle)

    def _subscribe(self, subscription: Subscription, type_name: str) -> None:
        """Begin to receive; latched messages come from publishers that are there already."""
        topic, depth = subscription.topic, subscription.depth
        self._refuse_other_type(topic, type_name)
        # a subscription that asks for latched messages gets none from publishers that do not latch
        durabilities = {one.qos_profile.durability for one in self.node.get_publishers_info_by_topic(topic)}
        latch = durabilities == {importlib.import_module("rclpy.qos").DurabilityPolicy.TRANSIENT_LOCAL}
        to_ros1 = partial(typestore(2).cdr_to_ros1, typename=ros2_name(type_name))

        def receive(data: bytes) -> None:
            # at most twice as many bytes as ROS 1's, which are what is bounded: padding, and an end of each text
            if not subscription.has_room_for(len(data) // 2):
                return
            try:
                message = bytes(to_ros1(data))
            except NO_MESSAGE:
                subscription.damaged += 1
                return
            subscription.push(message, self.steady())

        handle = self.node.create_subscription(
            ros2_class(type_name),
            topic,
            receive,
            # roomy: what ROS 2 itself drops, nobody counts
            self._qos(max(depth, DEPTH), latch=latch),
            raw=True,
        )
        subscription.on_close(partial(self.node.destroy_subscription, handle))

    def _qos(self, depth: int, *, latch: bool) -> Any:
        qos = importlib.import_module("rclpy.qos")
        durability = qos.DurabilityPolicy.TRANSIENT_LOCAL if latch else qos.DurabilityPolicy.VOLATILE
        return qos.QoSProfile(
            history=qos.HistoryPolicy.KEEP_LAST,
            depth=depth,
            reliability=qos.ReliabilityPolicy.RELIABLE,
            durability=durability,
        )

    def _refuse_other_type(self, topic: str, type_name: str) -> None:
        found = self.topics().get(topic)
        if found is not None and found != current_name(type_name):
            raise other_type(topic, type_name, found)

    def _serve(self, name: str, type_name: str, handler: Handler) -> None:
        """Offer a service; what fails is told by the response (`success`, `message`), ROS 2 has no other way."""
        if name in dict(self.node.get_service_names_and_types()):
            raise TransportError(f"service {name} is offered already")
        future = importlib.import_module("rclpy.task").Future

        async def serve(request: Any, response: Any) -> Any:
            """Let `poll` answer, while this thread goes on receiving."""
            done = future(executor=self._executor)
            waiting = Request(lambda: handler(_plain_message(f"{type_name}Request", request)))

            def answer() -> None:
                waiting.run()
                done.set_result(None)

            self.inbox.put(answer)
            await done
            try:
                _fill(f"{type_name}Response", waiting.result(), response)
            except Exception as error:  # it would end the receiver
                _logger.warning("service %s failed: %s", name, error)
                response.success, response.message = False, str(error)
            return response

        self.node.create_service(ros2_class(type_name, "srv"), name, serve)

    def _call(self, name: str, type_name: str, request: Message, timeout: float) -> Message:
        kind = ros2_class(type_name, "srv")
        client = self.node.create_client(kind, name)
        try:
            if not client.wait_for_service(timeout_sec=min(timeout, 1.0)):
                raise TransportError(f"service {name}: nobody offers it")
            asked = kind.Request()
            _fill(f"{type_name}Request", request, asked)
            done = threading.Event()
            answer = client.call_async(asked)
            answer.add_done_callback(lambda _: done.set())
            if not done.wait(timeout):
                raise TransportError(f"service {name}: no answer within {timeout} s")
            return _plain_message(f"{type_name}Response", answer.result())
        finally:
            self.node.destroy_client(client)

    def connections(self, topic: str) -> Connections:
        """Return the peers over a topic, as ROS 2 has discovered them."""
        topic, own = absolute(topic), f"/{self.name}"
        publishers = _names(self.node.get_publishers_info_by_topic(topic))
        subscribers = _names(self.node.get_subscriptions_info_by_topic(topic))
        return Connections(publishers if own in subscribers else (), subscribers if own in publishers else ())

    def topics(self) -> Mapping[str, str]:
        """Return the topics that anyone publishes, with their types."""
        found = {}
        for topic, kinds in sorted(self.node.get_topic_names_and_types()):
            if self.node.count_publishers(topic):
                found[topic] = current_name(kinds[0])
        return found

    def publishing(self) -> Mapping[str, frozenset[str]]:
        """Return nothing: messages of ROS 2 do not say where they came from."""
        return {}

    def is_up(self) -> bool:
        """Return whether it is open; ROS 2 has no master."""
        return not self.inbox.closed and self._context.ok()

    def close(self) -> None:
        """End the node."""
        if self.inbox.closed:
            return
        super().close()
        for publisher in self._publishers.values():
            publisher.close()
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        self._rclpy.shutdown(context=self._context)


def _names(endpoints: Any) -> tuple[str, ...]:
    return tuple(sorted({f"{one.node_namespace.rstrip('/')}/{one.node_name}" for one in endpoints}))


def _fill(name: str, message: Message, into: Any) -> None:
    """Write a message into rclpy's object of half a service, whose fields are plain; it demands exact types."""
    for field, value in message_fields(name, codec(name).decode(codec(name).encode(message, 0))):
        setattr(into, field.name, value)


def _plain_message(name: str, given: Any) -> Message:
    """Return a message from rclpy's object of half a service."""
    return message_class(name)(*(getattr(given, field.name) for field in fields(name)))
