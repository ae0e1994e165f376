"""What carries messages between programs: one interface for ROS 1, ROS 2 and a single process.

Every message that reaches a subscription is given once, in the order in which it came, with the time at which it came.
Nothing is repeated, also not what a latching publisher gives again after its connection was broken. Queues are bounded:
where a program does not keep up, the oldest message gives way and a counter says so
(`Subscription.overflowed`, `Publisher.overflowed`).

Services run where `poll` is called, in that thread and nowhere else.
"""

import math
import re
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future, wait
from typing import Any, NamedTuple, Self

from catenary.crtk.message import MESSAGE_BYTES, ROS1, Message, codec
from catenary.crtk.message_queues import Inbox, Origin, Subscription
from catenary.errors import InputError, TransportError
from catenary.operating_system import elapsed_ns
from catenary.recording.messages import current_name, service_md5_sum
from catenary.topics import SECOND

Handler = Callable[[Message], Message]
Answer = Callable[[bytes], bytes]  # to a request
_NAME = re.compile(r"/?[A-Za-z]\w*(/[A-Za-z]\w*)*", re.ASCII)
_QUEUE_MESSAGES = 100  # messages that wait for a slow peer: 0.1 s of a robot's topic
_WAITING_MESSAGES = 1000  # messages that wait for the program: 1 s
_READING_NS = SECOND // 1000  # [ns] that two readings of clocks are apart at most
UNNAMED_NODE = "participant_"  # before the number of a program of DDS whose node is not known, or not yet
SETTLE_S = 0.5  # [s] without news of other programs, until those of ROS 2 that are there count as known
_LONGEST_SETTLE_S = 3.0  # [s] to wait for that


class Clock:
    """The machine's own time, which is what transports keep to unless they are given another."""

    def __init__(self) -> None:
        self._ahead = 0
        self._ahead = self.set_by()

    def now(self) -> int:
        """Return the time of day [ns since 1970], which may be set back and forth."""
        return time.time_ns()

    def steady(self) -> int:
        """Return the time of day [ns since 1970], ignoring changes to the clock since this object was created."""
        return self._ahead + self.elapsed()

    def set_by(self) -> int:
        """Return the offset by which the time of day was set since construction [ns], negative if back."""
        while True:
            before, now, after = self.elapsed(), self.now(), self.elapsed()
            if after - before < _READING_NS:  # else this program stood still in between
                return now - self._ahead - (before + after) // 2

    def elapsed(self) -> int:
        """Return the time [ns] since an arbitrary moment, which only grows, also while the computer is suspended."""
        return elapsed_ns()

    def sleep(self, seconds: float) -> None:
        """Sleep for some seconds; return at once if not positive."""
        if seconds > 0.0:
            time.sleep(seconds)


class Rate:
    """Paces a loop on a grid; `late` counts ticks a period late or more: missed ones are not made up for."""

    def __init__(self, clock: Clock, hertz: float) -> None:
        if not 0.0 < hertz < float("inf"):
            raise InputError(f"rate: expected a positive number of Hz, got {hertz}")
        self._clock = clock
        self._period = SECOND / hertz
        self._begin, self._ticks = clock.elapsed(), 0
        self.late = 0

    def sleep(self) -> None:
        """Sleep until the next tick."""
        self._ticks += 1
        left = self._begin + self._ticks * self._period - self._clock.elapsed()
        if left > 0.0:
            self._clock.sleep(left / SECOND)
        elif left <= -self._period:
            self.late += 1
            self._begin, self._ticks = self._clock.elapsed(), 0


class Sending(NamedTuple):
    """How a program's messages are sent, where it says nothing else of a topic."""

    depth: int = _QUEUE_MESSAGES  # messages that wait for a peer that does not keep up
    is_reliable: bool = True  # of ROS 2, for what is not latched; else best effort, as of sensors


class Connections(NamedTuple):
    """Who is connected to this program over a topic."""

    publishers: tuple[str, ...]  # whose messages it gets
    subscribers: tuple[str, ...]  # who get its messages


class Publisher:
    """Sends messages of one type to one topic; as it is here, to nobody."""

    def __init__(self, topic: str, type_name: str) -> None:
        self.topic, self.type_name = topic, current_name(type_name)
        self.is_closed = False
        self._encode = codec(type_name).encode
        self._sent = 0  # messages so far: `seq` in their headers
        self._listeners: tuple[str, ...] = ()

    @property
    def missed(self) -> Mapping[str, int]:
        """Messages that slow peers missed, by the peer's name; empty if nothing waits, or nobody counts."""
        return {}

    @property
    def overflowed(self) -> int:
        """Messages that slow peers missed, over all peers."""
        return sum(self.missed.values())

    def publish(self, message: Message) -> None:
        """Send a message; it never waits for a peer. One that is not of the type raises InputError."""
        if self.is_closed:
            raise TransportError(f"publisher of {self.topic} is closed")
        self._sent += 1
        self._send(message)

    def subscribers(self) -> tuple[str, ...]:
        """Return the names of the nodes that listen."""
        return self._listeners

    def is_heard(self) -> bool:
        """Return True if there is a listener; cheap enough for a tick."""
        return bool(self.subscribers())

    def close(self) -> None:
        """Publish no more."""
        if not self.is_closed:
            self.is_closed = True
            self._end()

    def _send(self, message: Message) -> None:
        """Send it."""

    def _end(self) -> None:
        """End the topic."""


class HeardTopic:
    """What a program receives of one topic, by one connection per publisher, for all its subscriptions."""

    def __init__(self, type_name: str) -> None:
        self.type_name = current_name(type_name)
        self.subscriptions: tuple[Subscription, ...] = ()
        self._latched: dict[str, tuple[Any, int, Origin, int | None]] = {}  # by publisher
        self._lock = threading.RLock()

    def add(self, subscription: Subscription) -> None:
        """Give a subscription what comes from now on, and what publishers have latched."""
        with self._lock:
            for latched in self._latched.values():
                subscription.push(*latched)
            self.subscriptions = (*self.subscriptions, subscription)

    def remove(self, subscription: Subscription) -> bool:
        """Take a subscription away; return whether none is left."""
        with self._lock:
            self.subscriptions = tuple(one for one in self.subscriptions if one is not subscription)
        return not self.subscriptions

    def publishers(self) -> tuple[str, ...]:
        """Return the names of the nodes that it receives from."""
        return ()

    def end(self) -> None:
        """Receive no more: nobody listens."""

    def give(self, data: Any, time: int, origin: Origin | None, sent: int | None = None) -> None:
        """Give a message's bytes that came at `time` [ns] to all subscriptions, as `Subscription.push` has it."""
        with self._lock:
            if origin is not None and origin.is_latching:
                self._latched[origin.process.partition(" ")[0]] = data, time, origin, sent
            for subscription in self.subscriptions:
                subscription.push(data, time, origin, sent)


class Transport(ABC):
    """Carries messages, offers services; wrong names and types raise InputError, all else TransportError."""

    encoding = ROS1  # of the bytes that its subscriptions are given
    sending = Sending()
    has_services = True
    lapses: tuple[int, ...] = (0,)  # [ns] from the end of a program until it is no longer connected: these, about

    def __init__(self, name: str, clock: Clock | None = None) -> None:
        if not re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII):
            raise InputError(f'name "{name}": expected a letter, then letters, digits and underscores')
        self.name = name
        self.clock = clock or Clock()
        self.inbox = Inbox()
        self._publishers: dict[str, Publisher] = {}
        self._heard: dict[str, HeardTopic] = {}
        self._heard_lock = threading.RLock()

    def publisher(self, topic: str, type_name: str, *, latch: bool = False, queue: int | None = None) -> Publisher:
        """Return a publisher; `latch`: who comes later gets the last message; `queue` messages wait for slow peers."""
        self.require_open()
        topic = absolute(topic)
        codec(type_name)  # refuses unknown types
        known = self._publishers.get(topic)
        if known is not None and not known.is_closed:
            raise TransportError(f'"{self.name}" publishes {topic} already')
        self._refuse_other_type(topic, type_name)
        depth = self.sending.depth if queue is None else queue
        made = self._publishers[topic] = self._publisher(topic, type_name, latch=latch, queue=depth)
        return made

    def subscribe(
        self, topic: str, type_name: str, *, depth: int = _WAITING_MESSAGES, largest: int = MESSAGE_BYTES
    ) -> Subscription:
        """Begin to receive: the subscription's `take` gives what has come; beyond `largest` bytes it is dropped."""
        self.require_open()
        topic = absolute(topic)
        decode = codec(type_name, self.encoding).decode
        subscription = Subscription(topic, current_name(type_name), self.inbox, decode, depth, largest)
        self._subscribe(subscription, type_name)
        return subscription

    def service(self, name: str, type_name: str, handler: Handler) -> None:
        """Offer a service; `handler` makes the response from the request, in `poll`."""
        self.require_open()
        if not self.has_services:
            raise TransportError(f'transport "{self.name}" carries no services: programs of ROS 2 differ in theirs')
        service_md5_sum(type_name)  # refuses unknown types
        request, answer = (codec(f"{type_name}{half}", self.encoding) for half in ("Request", "Response"))
        name = absolute(name)
        self._serve(name, type_name, lambda data: answer.encode(handler(request.decode(data))))

    def poll(self, timeout: float = 0.0) -> int:
        """Run services for calls that have come; wait for the first up to `timeout` [s]; return how many ran."""
        self.require_open()
        return self.inbox.run(timeout)

    def connections(self, topic: str) -> Connections:
        """Return the peers that this transport is connected to over a topic."""
        publisher, heard = self._publishers.get(absolute(topic)), self._heard.get(absolute(topic))
        return Connections(
            () if heard is None else heard.publishers(), () if publisher is None else publisher.subscribers()
        )

    def topics(self) -> Mapping[str, str]:
        """Return the topics that anyone publishes, with their types."""
        return {topic: kind for topic, kind, _ in sorted(self._published())}

    def publishing(self) -> Mapping[str, frozenset[str]]:
        """Return the processes that publish each topic, as `Arrival.process` names them."""
        publishers: dict[str, set[str]] = {}
        for topic, _, process in self._published():
            publishers.setdefault(topic, set()).add(process)
        return {topic: frozenset(processes) for topic, processes in publishers.items()}

    def other_publishers(self, topic: str) -> frozenset[str]:
        """Return the other processes that publish a topic, half a second ago at most; crashed ones for `lapses`."""
        return self._others(absolute(topic))

    def lost(self, topic: str) -> frozenset[str]:
        """Return programs that went from a topic without ending it, as a crash does, where that is detectable."""
        return frozenset()

    def is_up(self) -> bool:
        """Return True if it is open, and its discovery (ROS 1's master) answers."""
        return not self.inbox.closed

    def now(self) -> int:
        """Return the time [ns], as it goes into stamps; it may be set back and forth."""
        return self.clock.now()

    def steady(self) -> int:
        """Return the time [ns] that messages come in by: the time of day as when this was made, and it only grows."""
        return self.clock.steady()

    def sleep(self, seconds: float) -> None:
        """Let time pass."""
        self.clock.sleep(seconds)

    def rate(self, hertz: float) -> Rate:
        """Return a pace for a loop."""
        return Rate(self.clock, hertz)

    def require_open(self) -> None:
        """Refuse a transport that has been closed."""
        if self.inbox.closed:
            raise TransportError(f'transport "{self.name}" is closed')

    def _polled(self, answer: Answer, data: bytes) -> bytes:
        """Return a service's answer, which `poll` finds in its own thread."""
        result: Future[bytes] = Future()

        def run() -> None:
            try:
                result.set_result(answer(data))
            except Exception as error:  # the caller gets it, the server lives on
                result.set_exception(error)

        self.inbox.put(run)
        while not wait([result], 0.1).done:
            if self.inbox.closed:
                raise TransportError("the server was closed")
        return result.result()

    def close(self) -> None:
        """End all publishers, subscriptions and services."""
        self.inbox.close()

    def _end_topics(self) -> None:
        for publisher in self._publishers.values():
            publisher.close()
        with self._heard_lock:
            while self._heard:
                self._heard.popitem()[1].end()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    # what a transport does of these, with names and types that have been checked

    @abstractmethod
    def _published(self) -> Iterable[tuple[str, str, str]]:
        """Return the topics that are published, by this program's names, their types, and who publishes."""

    @abstractmethod
    def _others(self, topic: str) -> frozenset[str]: ...

    @abstractmethod
    def _publisher(self, topic: str, type_name: str, *, latch: bool, queue: int) -> Publisher: ...

    def _subscribe(self, subscription: Subscription, type_name: str) -> None:
        """Have messages pushed into a subscription, as its decoder reads them; the type is as the program spells it."""
        topic = subscription.topic
        with self._heard_lock:
            heard = self._heard.get(topic)
            if heard is None:
                self._refuse_other_type(topic, type_name)
                heard = self._heard[topic] = self._hear(topic, type_name)
            elif heard.type_name != subscription.type_name:
                raise other_type(topic, type_name, heard.type_name)
            heard.add(subscription)
        subscription.leave = lambda: self._unsubscribe(topic, subscription)

    def _unsubscribe(self, topic: str, subscription: Subscription) -> None:
        with self._heard_lock:
            heard = self._heard.get(topic)
            if heard is not None and heard.remove(subscription):
                self._heard.pop(topic).end()

    @abstractmethod
    def _hear(self, topic: str, type_name: str) -> HeardTopic:
        """Begin to receive a topic that nobody in this program has subscribed to yet."""

    def _refuse_other_type(self, topic: str, type_name: str) -> None:
        """Refuse a topic that somebody publishes as another type."""
        published = self.topics().get(topic)
        if published is not None and published != current_name(type_name):
            raise other_type(topic, type_name, published)

    # of those that have services

    def _serve(self, name: str, type_name: str, answer: Answer) -> None:
        raise NotImplementedError


class Latest:
    """Keeps the newest message of a topic, for programs that look once a tick; older ones are dropped unread."""

    def __init__(self, transport: Transport, topic: str, type_name: str) -> None:
        self.topic = topic
        self._transport = transport
        self._subscription = transport.subscribe(topic, type_name, depth=1)
        self.senders = self._subscription.senders
        self._message: Message = None
        self.arrived: int | None = None  # [ns] by the transport's `steady`; None before the first message

    def message(self) -> Message:
        """Return the newest message, or None before the first."""
        for received in self._subscription.take():
            self._message, self.arrived = received
        return self._message

    def fresh(self, patience: float) -> Message:
        """Return the newest message, or None if none has come for `patience` [s]."""
        return self._message if self.age() <= patience else None

    def age(self) -> float:
        """Return seconds since the newest message came in, by our clock, not the robot's; infinite before the first."""
        self.message()
        if self.arrived is None:
            return math.inf
        return max(0, self._transport.steady() - self.arrived) / SECOND

    def close(self) -> None:
        """Receive no more."""
        self._subscription.close()


def wait_until_settled(seen: Callable[[], object], settle: float) -> None:
    """Wait until what a program sees of others has not changed for `settle` [s], a few seconds at most."""
    begin = last = time.monotonic()
    known = None
    while (now := time.monotonic()) - last < settle and now - begin < _LONGEST_SETTLE_S:
        if (state := seen()) != known:
            known, last = state, now
        time.sleep(0.02)


def absolute(name: str) -> str:
    """Return a topic's or service's name with its leading slash; ROS's namespaces and remapping do not apply."""
    if not _NAME.fullmatch(name):
        raise InputError(f'name "{name}": expected words of letters, digits and underscores between slashes')
    return "/" + name.strip("/")


def other_type(topic: str, expected: str, published: str) -> TransportError:
    """Return the error of a topic that carries another type than was asked for."""
    return TransportError(f"topic {topic} carries {published}, expected {expected}; one topic cannot carry two types")
