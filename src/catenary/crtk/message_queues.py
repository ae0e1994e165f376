"""Queues of messages that have arrived at a transport: bounded, with one order of arrival for all of them."""

import threading
from collections import deque
from collections.abc import Callable
from typing import Any, NamedTuple

from catenary.crtk.message import MESSAGE_BYTES, Message, has_header
from catenary.errors import FileFormatError, InputError

UNTAKEN_MESSAGES = 4000  # that ROS 2 keeps of a topic until the receiver takes them; what it drops, nobody counts


class Received(NamedTuple):
    """A message as it came."""

    message: Message
    time: int  # [ns] by the transport's `steady`, when it came in


class Origin(NamedTuple):
    """The program that a message came from, and the connection."""

    process: str  # program's name, a space, and what differs when a program of that name is started again
    connection: object  # another one once it was broken and made again
    is_latching: bool


class Arrival(NamedTuple):
    """A message as it came, and whether it may be an old one that a latching publisher gives to whoever connects."""

    message: Message
    time: int  # [ns] by the transport's `steady`
    process: str  # of the publisher, as in `Origin`; empty if the transport does not tell
    is_first: bool  # the first over a connection to a latching publisher
    is_renewed: bool  # and that publisher has been heard over an earlier connection
    sent: int | None = None  # [ns] by the publisher's clock of the day, where the transport tells


class Inbox:
    """What the subscriptions of a transport share, and calls of its services. Any thread may put in."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.changed = threading.Condition(self.lock)  # a job has come, or it was closed
        self._waiting: list[threading.Condition] = []  # what else its end wakes
        self._jobs: deque[Callable[[], None]] = deque()
        self.arrivals = 0  # messages that have come in, of all subscriptions
        self.closed = False

    def put(self, job: Callable[[], None]) -> None:
        """Add what `run` is to do."""
        with self.changed:
            self._jobs.append(job)
            self.changed.notify_all()

    def run(self, timeout: float = 0.0) -> int:
        """Run the jobs that have come and return their number; wait for the first up to `timeout` [s]."""
        if timeout <= 0.0 and not self._jobs:
            return 0  # as in nearly every millisecond
        with self.changed:
            if timeout > 0.0:
                self.changed.wait_for(lambda: self._jobs or self.closed, timeout)
            jobs, self._jobs = self._jobs, deque()
        for job in jobs:
            job()
        return len(jobs)

    def wait_for(self, came: threading.Condition, seconds: float, so: Callable[[], object]) -> None:
        """Wait, with the lock held, until `so` holds (`came` says when to look), this is closed, or time is up."""
        self._waiting.append(came)
        try:
            came.wait_for(lambda: so() or self.closed, seconds)
        finally:
            self._waiting.remove(came)

    def close(self) -> None:
        """Wake whoever waits, and forget what has not been run."""
        with self.lock:
            self.closed = True
            self._jobs.clear()
            for condition in (self.changed, *self._waiting):
                condition.notify_all()


class Subscription:
    """Messages of one topic, each once and in order, which `take` gives.

    Counts what it left out: `overflowed` beyond `depth`, the oldest; `damaged`, no message of the type; `oversized`,
    more than `largest` bytes; `repeated`, given again by a latching publisher whose connection had been broken.
    """

    def __init__(
        self,
        topic: str,
        type_name: str,
        inbox: Inbox,
        decode: Callable[[Any], Message],
        depth: int = 1000,
        largest: int = MESSAGE_BYTES,
    ) -> None:
        """Prepare to receive; transports call this, not users."""
        if depth < 1:
            raise InputError(f"subscription of {topic}: depth: expected 1 or more, got {depth}")
        self.topic, self.type_name, self.depth, self.largest = topic, type_name, depth, largest
        self.overflowed = self.oversized = self.damaged = self.repeated = 0
        self.senders: dict[str, int] = {}  # by `Arrival.process`, when its newest message came [ns]
        # last message of each latching publisher, by process
        self._latched: dict[str, tuple[object, Any]] = {}
        self._behind_seq = 4 if has_header(type_name) else 0  # a publisher renumbers a latched message
        self._inbox = inbox
        # its own: a message of another topic wakes nobody who waits for this one
        self._came = threading.Condition(inbox.lock)
        self._decode = decode
        self._waiting: deque[Arrival] = deque()  # not decoded yet
        self._closed = False
        self.leave: Callable[[], None] | None = None  # of its transport, called once when it is closed

    def has_room_for(self, size: int) -> bool:
        """Return True if messages of this many bytes fit; one that does not is counted."""
        if size <= self.largest:
            return True
        with self._inbox.lock:
            self.oversized += 1
        return False

    def push(self, data: Any, time: int, origin: Origin | None = None, sent: int | None = None) -> None:
        """Take in a message's bytes at `time` [ns], `sent` [ns] by its publisher's clock; in any thread."""
        if not self.has_room_for(len(data)):
            return
        with self._inbox.lock:
            if self._closed:
                return
            process, first, renewed = "", False, False
            if origin is not None:
                process = origin.process
                if origin.is_latching:
                    last = self._latched.get(origin.process)
                    self._latched[origin.process] = origin.connection, data
                    first = last is None or last[0] is not origin.connection
                    renewed = first and last is not None
                    if last is not None and renewed and data[self._behind_seq :] == last[1][self._behind_seq :]:
                        self.repeated += 1
                        return
            self.senders[process] = time
            self._waiting.append(Arrival(data, time, process, first, renewed, sent))
            if len(self._waiting) > self.depth:
                self._waiting.popleft()
                self.overflowed += 1
            self._inbox.arrivals += 1  # last: who sees it finds the message
            self._came.notify_all()

    def take(self, timeout: float = 0.0) -> list[Received]:
        """Return new messages, oldest first; wait for the first up to `timeout` [s]."""
        return [Received(one.message, one.time) for one in self.take_arrivals(timeout)]

    def take_arrivals(self, timeout: float = 0.0, limit: int | None = None) -> list[Arrival]:
        """As `take`, with what is known about where each message came from; `limit` at a time, where given."""
        if timeout <= 0.0 and not self._waiting:
            return []  # as nearly always when asked again in a tick
        with self._inbox.lock:
            if timeout > 0.0:
                self._inbox.wait_for(self._came, timeout, lambda: self._waiting or self._closed)
            if limit is None or limit >= len(self._waiting):
                waiting, self._waiting = self._waiting, deque()
            else:
                waiting = deque(self._waiting.popleft() for _ in range(limit))
        return [decoded for arrival in waiting if (decoded := self._decoded(arrival)) is not None]

    def forget(self) -> int:
        """Drop what waits, and return how many messages that were."""
        with self._inbox.lock:
            count = len(self._waiting)
            self._waiting.clear()
        return count

    def __len__(self) -> int:
        return len(self._waiting)

    def close(self) -> None:
        """Receive no more, and forget what waits."""
        with self._inbox.lock:
            self._closed = True
            self._waiting.clear()
            self._came.notify_all()
            leave, self.leave = self.leave, None
        if leave is not None:
            leave()

    def _decoded(self, arrival: Arrival) -> Arrival | None:
        try:
            return arrival._replace(message=self._decode(arrival.message))
        except FileFormatError:
            self.damaged += 1
            return None
