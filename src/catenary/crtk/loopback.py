"""Messages within one process, without ROS: for simulation, for tests, for a server and its client in one program.

Every message is turned into ROS's bytes and back, so what passes here passes a network.
"""

import threading
from itertools import count
from typing import cast

from catenary.crtk.message import Message
from catenary.crtk.message_queues import Origin
from catenary.crtk.transport import Answer, Clock, HeardTopic, Publisher, Transport
from catenary.errors import TransportError

_PROCESSES = count()  # tells transports of the same name apart


class LoopbackNetwork:
    """Names and time shared by the transports of one process; access requires the lock."""

    def __init__(self, *, clock: Clock | None = None) -> None:
        self.clock = clock or Clock()
        self.lock = threading.RLock()
        self.transports: dict[str, Loopback] = {}

    def publishers(self, topic: str) -> dict[str, "LoopbackPublisher"]:
        """Return who publishes a topic, by the transport's name."""
        by_node = {name: one.publishes.get(topic) for name, one in sorted(self.transports.items())}
        return {name: cast(LoopbackPublisher, one) for name, one in by_node.items() if one and not one.is_closed}

    def heard(self, topic: str) -> dict[str, HeardTopic]:
        """Return who receives a topic, by the transport's name."""
        return {name: one.hears[topic] for name, one in sorted(self.transports.items()) if topic in one.hears}


class LoopbackPublisher(Publisher):
    """Publisher of one transport on one topic; a message goes straight into the subscriptions, which count."""

    def __init__(self, transport: "Loopback", topic: str, type_name: str, *, latch: bool) -> None:
        super().__init__(topic, type_name)
        self.latched: bytes | None = None
        self._transport, self._latch = transport, latch
        self.is_connected = True  # a test may break its connections, and give it a new origin
        self.origin = Origin(f"{transport.name} {next(_PROCESSES)}", object(), latch)

    def _send(self, message: Message) -> None:
        self._transport.require_open()
        data = self._encode(message, self._sent)  # also for nobody: what is wrong is refused here and now
        network = self._transport.network
        with network.lock:
            if self._latch:
                self.latched = data
            for other in network.transports.values() if self.is_connected else ():
                heard = other.hears.get(self.topic)
                if heard is not None and heard.type_name == self.type_name:
                    heard.give(data, network.clock.steady(), self.origin)

    def subscribers(self) -> tuple[str, ...]:
        """Return the names of the nodes that listen."""
        return () if self.is_closed else tuple(self._transport.network.heard(self.topic))

    def is_heard(self) -> bool:
        """Return True if there is a listener."""
        others = tuple(self._transport.network.transports.values())
        return not self.is_closed and any(self.topic in one.hears for one in others)


class LoopbackTopic(HeardTopic):
    """Subscription of a transport to one topic."""

    def __init__(self, network: LoopbackNetwork, topic: str, type_name: str) -> None:
        super().__init__(type_name)
        self._network, self._topic = network, topic
        for publisher in self._connected().values():
            if publisher.latched is not None:
                self.give(publisher.latched, network.clock.steady(), publisher.origin)

    def _connected(self) -> dict[str, LoopbackPublisher]:
        return {name: one for name, one in self._network.publishers(self._topic).items() if one.is_connected}

    def publishers(self) -> tuple[str, ...]:
        """Return the names of the nodes that it receives from."""
        return tuple(self._connected())


class Loopback(Transport):
    """One program's part of a network within the process."""

    def __init__(self, name: str, network: LoopbackNetwork | None = None) -> None:
        """Join a network; one of its own when None."""
        self.network = network or LoopbackNetwork()
        super().__init__(name, self.network.clock)
        self._heard_lock = self.network.lock
        self.publishes, self.hears = self._publishers, self._heard
        self.services: dict[str, tuple[str, Answer]] = {}  # types and answers
        with self.network.lock:
            if name in self.network.transports:
                names = ", ".join(sorted(self.network.transports))
                raise TransportError(f'name "{name}" is taken; names on this network: {names}')
            self.network.transports[name] = self

    def _publisher(self, topic: str, type_name: str, *, latch: bool, queue: int) -> LoopbackPublisher:
        """Begin to publish; `queue` is not needed, since nothing waits between here and a subscription."""
        return LoopbackPublisher(self, topic, type_name, latch=latch)

    def _hear(self, topic: str, type_name: str) -> HeardTopic:
        return LoopbackTopic(self.network, topic, type_name)

    def _serve(self, name: str, type_name: str, answer: Answer) -> None:
        for other in tuple(self.network.transports.values()):
            if name in other.services:
                raise TransportError(f'service {name} is offered by "{other.name}" already')
        self.services[name] = type_name, answer

    def _published(self) -> list[tuple[str, str, str]]:
        with self.network.lock:
            topics = {topic for one in self.network.transports.values() for topic in tuple(one.publishes)}
            return [
                (topic, one.type_name, one.origin.process)
                for topic in topics
                for one in self.network.publishers(topic).values()
            ]

    def _others(self, topic: str) -> frozenset[str]:
        by_node = self.network.publishers(topic).items()
        return frozenset(one.origin.process for name, one in by_node if name != self.name)

    def close(self) -> None:
        """Leave the network."""
        if not self.inbox.closed:
            with self.network.lock:
                self._end_topics()
                self.network.transports.pop(self.name, None)
        super().close()
