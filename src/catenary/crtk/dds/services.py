"""Services as rmw_cyclonedds carries them: requests over one topic, answers over another, each behind who asked.

A request begins with a number of the client (Cyclone's handle of its writer) and one that counts its requests; the
answer begins with the same two. Ends of topics say in their user data which client or service they are of, so that
either side knows when the other hears it. rmw_fastrtps puts who asked beside the message instead, which Cyclone's
Python does not show: its programs cannot call these services.
"""

import logging
import struct
import threading
import time
from collections import deque
from functools import partial
from itertools import count
from typing import Any, NamedTuple

from catenary.crtk.dds.directory import HANDLES, Endpoint, Quality
from catenary.crtk.dds.program import Program
from catenary.crtk.dds.types import dds_half, half_hash, half_type, reply_topic, request_topic
from catenary.crtk.inbox import Inbox, Request
from catenary.crtk.message import Message, message_class
from catenary.crtk.message_bytes import CDR, codec
from catenary.crtk.transport import Handler
from catenary.errors import FileFormatError, TransportError

_ASKED = struct.Struct("<Qq")  # client, number of its request
_QUEUE = 10  # requests or answers that wait, as in ROS 2
_PRESENT = 1.0  # [s] to wait for a service to be found
_HEARD = 1.0  # [s] to wait for a client to be able to hear its answer
_logger = logging.getLogger(__name__)


class _Answer(NamedTuple):
    """An answer that waits for its client to be connected."""

    offer: "_Offer"
    client: str  # as in its user data; empty where it has none
    data: bytes
    until: float


class _Offer:
    """A service of this program."""

    def __init__(self, services: "Services", name: str, type_name: str, handler: Handler) -> None:
        self.name, self.type_name, self._handler = name, type_name, handler
        self._services = services
        self.writer, self.reader = services.ends(name, type_name, "service", self._take)

    def _take(self, reader: Any) -> None:
        for sample in reader.take(_QUEUE * 10):
            if sample.sample_info.valid_data:
                end = self._services.program.directory.publications.get(sample.sample_info.publication_handle)
                client = "" if end is None else end.user_data.get("clientid", "")
                self._services.inbox.put(partial(self._run, sample.data, client))

    def _run(self, data: bytes, client: str) -> None:
        """Answer a request, in the thread that polls."""
        asked, body = _split(data)
        try:
            request = _decoded(f"{self.type_name}Request", body)
        except FileFormatError as error:
            _logger.warning("service %s: %s", self.name, error)
            return
        waiting = Request(lambda: self._handler(request))
        waiting.run()
        try:
            answer = _encoded(f"{self.type_name}Response", waiting.result())
        except Exception as error:  # the caller gets it, in the only way there is
            _logger.warning("service %s failed: %s", self.name, error)
            answer = _encoded(f"{self.type_name}Response", _failure(self.type_name, str(error)))
        self._services.answer(_Answer(self, client, _joined(asked, answer), time.monotonic() + _HEARD))

    def can_hear(self, client: str) -> bool:
        """Return whether a client is connected to the answers."""
        known = self._services.program.directory.subscriptions
        ends = [known.get(handle % HANDLES) for handle in self.writer.get_matched_subscriptions()]
        return any(end is not None and (not client or end.user_data.get("clientid") == client) for end in ends)

    def send(self, data: bytes) -> None:
        """Send an answer."""
        self.writer.write(half_type(self.type_name, "Response")(data))


class _Call:
    """A request of this program, and its answer once it has come."""

    def __init__(self, services: "Services", name: str, type_name: str) -> None:
        self._type_name = type_name
        self._program = services.program
        self._came = threading.Event()
        self._answer = b""
        self._asked: tuple[int, int] | None = None
        self.writer, self.reader = services.ends(name, type_name, "client", self._take)

    def _take(self, reader: Any) -> None:
        for sample in reader.take(_QUEUE * 10):
            if sample.sample_info.valid_data and self._asked is not None:
                asked, body = _split(sample.data)
                if asked == self._asked:
                    self._answer = body
                    self._came.set()

    def is_offered(self) -> bool:
        """Return whether one service hears the request and can be heard."""
        directory = self._program.directory
        hear = [directory.subscriptions.get(one % HANDLES) for one in self.writer.get_matched_subscriptions()]
        speak = [directory.publications.get(one % HANDLES) for one in self.reader.get_matched_publications()]
        return bool(_services(hear) & _services(speak))

    def send(self, number: int, body: bytes) -> None:
        """Send the request."""
        self._asked = self.writer.instance_handle % HANDLES, number
        self.writer.write(half_type(self._type_name, "Request")(_joined(self._asked, body)))

    def wait(self, timeout: float) -> bytes | None:
        """Return the answer's bytes, or None where it does not come in time."""
        return self._answer if self._came.wait(timeout) else None

    def end(self) -> None:
        """Let go of its topics."""
        self._program.end(self.reader)
        self._program.end(self.writer)
        del self.reader, self.writer


class Services:
    """Services that this program offers and calls."""

    def __init__(self, program: Program, inbox: Inbox) -> None:
        self.program, self.inbox = program, inbox
        self._offers: dict[str, _Offer] = {}
        self._answers: deque[_Answer] = deque()
        self._numbers = count(1)  # of requests, and of clients and services

    def serve(self, name: str, type_name: str, handler: Handler) -> None:
        """Offer a service; what fails is told by the response (`success`, `message`), ROS 2 has no other way."""
        self.program.look()
        if self.program.directory.subscribers(request_topic(name)):
            raise TransportError(f"service {name} is offered already")
        self._offers[name] = _Offer(self, name, type_name, handler)

    def call(self, name: str, type_name: str, request: Message, timeout: float) -> Message:
        """Call a service; see `Transport.call`."""
        body = _encoded(f"{type_name}Request", request)
        self._refuse_other_type(name, type_name)
        calling = _Call(self, name, type_name)
        try:
            end = time.monotonic() + min(timeout, _PRESENT)
            while not calling.is_offered():
                if time.monotonic() > end:
                    raise TransportError(f"service {name}: nobody offers it")
                time.sleep(0.005)
            calling.send(next(self._numbers), body)
            answer = calling.wait(timeout)
        finally:
            calling.end()
        if answer is None:
            raise TransportError(f"service {name}: no answer within {timeout} s")
        try:
            return _decoded(f"{type_name}Response", answer)
        except FileFormatError as error:
            raise TransportError(f"service {name}: {error}") from error

    def ends(self, name: str, type_name: str, role: str, take: Any) -> tuple[Any, Any]:
        """Return the writer and the reader of a service or a client of one."""
        number = self.program.gid[:12] + struct.pack(">I", next(self._numbers))
        said = f"{role}id={'.'.join(f'{byte:x}' for byte in number)};"
        halves = [(request_topic(name), "Request"), (reply_topic(name), "Response")]
        if role == "service":
            halves.reverse()
        hashes = [self.program.distribution.said_of(half_hash(type_name, half)) for _, half in halves]
        (sent, sent_half), (heard, heard_half) = halves
        kinds = half_type(type_name, sent_half), half_type(type_name, heard_half)
        writer = self.program.writer(sent, kinds[0], Quality(), _QUEUE, said + hashes[0])
        reader = self.program.reader(heard, kinds[1], Quality(), _QUEUE, said + hashes[1], take)
        return writer, reader

    def answer(self, answer: _Answer) -> None:
        """Send an answer as soon as its client hears it."""
        self._answers.append(answer)
        self.send_answers()

    def close(self) -> None:
        """End all services."""
        self._answers.clear()
        for offer in self._offers.values():
            self.program.end(offer.reader)
            self.program.end(offer.writer)
        self._offers.clear()

    def send_answers(self) -> None:
        """Send those whose clients hear them; called often."""
        if not self._answers:
            return
        with self.program.lock:
            waiting = [self._answers.popleft() for _ in range(len(self._answers))]
            for answer in waiting:
                if answer.offer.can_hear(answer.client):
                    answer.offer.send(answer.data)
                elif time.monotonic() < answer.until:
                    self._answers.append(answer)

    def _refuse_other_type(self, name: str, type_name: str) -> None:
        found = {end.type_name for end in self.program.directory.subscribers(request_topic(name))}
        if found and dds_half(type_name, "Request") not in found:
            raise TransportError(f"service {name} is a {', '.join(sorted(found))}, expected {type_name}")


def _services(ends: list[Endpoint | None]) -> set[str]:
    """Return the services that ends of topics are of; those that do not say count as one of their program's."""
    return {end.user_data.get("serviceid", end.participant.hex()) for end in ends if end is not None}


def _failure(type_name: str, text: str) -> Message:
    """Return the answer of a service that failed: whether it succeeded is False, and its text says why."""
    kind = message_class(f"{type_name}Response")
    return kind(message=text) if "message" in kind._fields else kind()


def _encoded(name: str, message: Message) -> bytes:
    """Return a half of a service as CDR, without the bytes in front; who asked has 16, which changes no place."""
    return codec(name, CDR).encode(message)[len(CDR.front) :]


def _decoded(name: str, body: bytes) -> Message:
    return codec(name, CDR).decode(CDR.front + body)


def _joined(asked: tuple[int, int], body: bytes) -> bytes:
    return CDR.front + _ASKED.pack(*asked) + body


def _split(data: bytes) -> tuple[tuple[int, int], bytes]:
    client, number = _ASKED.unpack_from(data, len(CDR.front))
    return (client, number), data[len(CDR.front) + _ASKED.size :]
