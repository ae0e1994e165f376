"""Messages within one process, without ROS: for simulation, for tests, for a server and its client in one program.

Every message is turned into ROS's bytes and back, so what passes here passes a network.
"""

import threading
import time
from dataclasses import dataclass, field
from itertools import count

from catenary.crtk.clock import Clock
from catenary.crtk.inbox import Origin, Request
from catenary.crtk.message import Message
from catenary.crtk.transport import Answer, Connections, HeardTopic, Publisher, Transport, absolute, other_type
from catenary.errors import TransportError
from catenary.recording.messages import current_name

_PROCESSES = count()  # tells transports of the same name apart


@dataclass
class _LocalTopic:
    type_name: str
    publishers: dict[str, "LoopbackPublisher"] = field(default_factory=dict)  # by name of transport
    heard: dict[str, HeardTopic] = field(default_factory=dict)  # likewise


@dataclass(frozen=True)
class _Service:
    transport: "Loopback"
    type_name: str
    answer: Answer


class LoopbackNetwork:
    """What transports of one process share: topics, services, names, time; a call polls the server."""

    def __init__(self, *, clock: Clock | None = None) -> None:
        self.clock = clock or Clock()
        self.lock = threading.RLock()
        self.transports: dict[str, Loopback] = {}
        self.services: dict[str, _Service] = {}
        self.topics: dict[str, _LocalTopic] = {}

    def topic(self, name: str, type_name: str) -> _LocalTopic:
        """Return the topic of that name, begun anew if nobody uses it."""
        found = self.topics.get(name)
        if found is None or not (found.publishers or found.heard):
            found = self.topics[name] = _LocalTopic(current_name(type_name))
        return found


class LoopbackPublisher(Publisher):
    """Publisher of one transport on one topic; a message goes straight into the subscriptions, which count."""

    def __init__(self, transport: "Loopback", topic: str, shared: _LocalTopic, *, latch: bool) -> None:
        super().__init__(topic, shared.type_name)
        self.latched: bytes | None = None
        self._transport = transport
        self._shared = shared
        self._latch = latch
        self.is_connected = True  # a test may break its connections, and give it a new origin
        self.origin = Origin(f"{transport.name} {next(_PROCESSES)}", object(), latch)

    def _send(self, message: Message) -> None:
        self._transport.require_open()
        data = self._encode(message, self._sent)  # also for nobody: what is wrong is refused here and now
        network = self._transport.network
        with network.lock:
            if self._latch:
                self.latched = data
            if self.is_connected:
                for heard in self._shared.heard.values():
                    heard.give(data, network.clock.steady(), self.origin)

    def subscribers(self) -> tuple[str, ...]:
        """Return the names of the nodes that listen."""
        return () if self.is_closed else tuple(self._shared.heard)

    def _end(self) -> None:
        with self._transport.network.lock:
            self._shared.publishers.pop(self._transport.name, None)


class Loopback(Transport):
    """One program's part of a network within the process."""

    def __init__(self, name: str, network: LoopbackNetwork | None = None) -> None:
        """Join a network; one of its own when None."""
        self.network = network or LoopbackNetwork()
        super().__init__(name, self.network.clock)
        with self.network.lock:
            if name in self.network.transports:
                names = ", ".join(sorted(self.network.transports))
                raise TransportError(f'name "{name}" is taken; names on this network: {names}')
            self.network.transports[name] = self

    def _publisher(self, topic: str, type_name: str, *, latch: bool, queue: int) -> LoopbackPublisher:
        """Begin to publish; `queue` is not needed, since nothing waits between here and a subscription."""
        with self.network.lock:
            shared = self.network.topic(topic, type_name)
            publisher = LoopbackPublisher(self, topic, shared, latch=latch)
            shared.publishers[self.name] = publisher
        return publisher

    def _hear(self, topic: str, type_name: str) -> HeardTopic:
        with self.network.lock:
            shared = self.network.topic(topic, type_name)
            heard = shared.heard[self.name] = HeardTopic(type_name, lambda: self._leave(shared))
            for publisher in shared.publishers.values():
                if publisher.latched is not None and publisher.is_connected:
                    heard.give(publisher.latched, self.steady(), publisher.origin)
        return heard

    def _leave(self, shared: _LocalTopic) -> None:
        with self.network.lock:
            shared.heard.pop(self.name, None)

    def _refuse_other_type(self, topic: str, type_name: str) -> None:
        with self.network.lock:
            found = self.network.topic(topic, type_name).type_name
        if found != current_name(type_name):
            raise other_type(topic, type_name, found)

    def _serve(self, name: str, type_name: str, answer: Answer) -> None:
        with self.network.lock:
            if name in self.network.services:
                raise TransportError(
                    f'service {name} is offered by "{self.network.services[name].transport.name}" already'
                )
            self.network.services[name] = _Service(self, type_name, answer)

    def _call(self, name: str, type_name: str, data: bytes, timeout: float) -> Request:
        service = self.network.services.get(name)
        if service is None:
            offered = ", ".join(sorted(self.network.services)) or "none"
            raise TransportError(f"service {name}: nobody offers it; offered are {offered}")
        if service.type_name != type_name:
            raise TransportError(f"service {name} is a {service.type_name}, expected {type_name}")
        called = Request(lambda: service.answer(data))
        service.transport.inbox.put(called.run)
        end = time.monotonic() + timeout
        while not called.done() and time.monotonic() < end:
            service.transport.poll()
        return called

    def connections(self, topic: str) -> Connections:
        """Return the peers over a topic."""
        with self.network.lock:
            found = self.network.topics.get(absolute(topic))
            if found is None:
                return Connections((), ())
            publishers = tuple(sorted(name for name, one in found.publishers.items() if one.is_connected))
            subscribers = tuple(sorted(found.heard))
        return Connections(
            publishers if self.name in subscribers else (), subscribers if self.name in publishers else ()
        )

    def _published(self) -> list[tuple[str, str, str]]:
        with self.network.lock:
            topics = self.network.topics.items()
            return [
                (name, one.type_name, who.origin.process) for name, one in topics for who in one.publishers.values()
            ]

    def close(self) -> None:
        """Leave the network."""
        if not self.inbox.closed:
            self._end_topics()
            with self.network.lock:
                self.network.transports.pop(self.name, None)
                services = self.network.services.items()
                self.network.services = {key: one for key, one in services if one.transport is not self}
        super().close()
