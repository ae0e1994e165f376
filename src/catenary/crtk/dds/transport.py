"""ROS 2 behind the transport protocol, by DDS alone: no ROS has to be installed.

Messages pass DDS as ROS 2's bytes (CDR).
What differs from ROS 1: headers have no `seq`; two programs may have the same name; DDS does not count what a peer
misses, so `overflowed` of a publisher counts only what was not sent at all. There are no services: each RMW carries
them in its own way, Fast DDS's by what Cyclone's Python cannot say, and one that is announced but never answers is
worse than none.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

from cyclonedds.core import DDSException
from cyclonedds.sub import DataReader

from catenary.crtk.dds.program import (
    Endpoint,
    Program,
    Quality,
    Raw,
    dds_topic,
    dds_type,
    distribution,
    message_type,
    taken,
)
from catenary.crtk.message import CDR, Message, codec
from catenary.crtk.message_queues import UNTAKEN_MESSAGES, Origin
from catenary.crtk.network import RosArguments
from catenary.crtk.transport import SETTLE_S, HeardTopic, Publisher, Transport, wait_until_settled
from catenary.errors import TransportError
from catenary.topics import SECOND

_USUAL = Quality()


class ListenedTopic(HeardTopic):
    """A topic and its subscriptions; its methods are called with the program's lock held.

    DDS matches a reader with writers that offer at least what it asks for, so there is a reader for each quality that
    some publisher offers, and it gives what comes from those that offer just that.
    """

    def __init__(self, program: Program, dds_name: str, type_name: str, steady: Callable[[], int]) -> None:
        super().__init__(type_name)
        self.dds_name = dds_name
        self._program, self._steady = program, steady
        self._origins: dict[int, tuple[Endpoint, Origin]] = {}  # by Cyclone's handle of the writer
        self._readers: dict[Quality, DataReader[Any]] = {}
        for publisher in program.directory.publishers(self.dds_name):
            self.hear(publisher)
        if not self._readers:
            self._listen(_USUAL)

    def hear(self, publisher: Endpoint) -> None:
        """Listen to a publisher of the topic, if it carries the type."""
        if publisher.topic == self.dds_name and publisher.type_name == dds_type(self.type_name):
            self._listen(_requested_quality(publisher))

    def _listen(self, quality: Quality) -> None:
        if quality in self._readers:
            return
        taker = partial(self._take, quality)
        self._readers[quality] = self._program.reader(self.dds_name, self.type_name, quality, UNTAKEN_MESSAGES, taker)

    def end(self) -> None:
        """Receive no more: nobody listens."""
        while self._readers:
            self._program.end(self._readers.popitem()[1])

    def publishers(self) -> tuple[str, ...]:
        """Return the names of the nodes that it receives from."""
        program = self._program
        with program.lock:
            return program.directory.names(
                end
                for quality, reader in tuple(self._readers.items())
                for end in program.ends(program.directory.publications, reader.get_matched_publications())
                if _requested_quality(end) == quality
            )

    def _take(self, quality: Quality, reader: DataReader[Any]) -> None:
        for sample in taken(reader):
            if sample.sample_info.valid_data:
                self._receive(sample, quality)

    def _receive(self, sample: Raw, quality: Quality) -> None:
        info = sample.sample_info
        end, origin = self._origin(info.publication_handle)
        if (_USUAL if end is None else _requested_quality(end)) != quality:
            return  # it comes to another reader, too
        self.give(sample.data, self._steady(), origin, info.source_timestamp)

    def _origin(self, handle: int) -> tuple[Endpoint | None, Origin | None]:
        """Return the sender of a message; empty for a writer that has left already."""
        directory = self._program.directory
        end = directory.publications.get(handle)
        known = self._origins.get(handle)
        if known is not None and (end is None or known[0] is end):
            return known
        if end is None:
            return None, None
        made = self._origins[handle] = end, Origin(directory.process(end), end, end.quality.is_latched)
        return made


def _requested_quality(publisher: Endpoint) -> Quality:
    offered = publisher.quality
    return Quality(is_latched=offered.is_latched) if offered.is_reliable else Quality(is_reliable=False)


_ASK = 100  # messages that are sent before DDS is asked again whether anybody listens still


class DdsPublisher(Publisher):
    """Publisher of one topic; a message is encoded only if there are subscribers or the topic is latched."""

    def __init__(
        self, program: Program, topic: str, dds_name: str, type_name: str, quality: Quality, queue: int
    ) -> None:
        super().__init__(topic, type_name)
        self.dds_name, self.quality, self._program = dds_name, quality, program
        self._missed = 0
        self._matched = 0  # readers, when last asked; DDS is asked of each message while there were none
        self._kind = message_type(type_name)
        self._encode_cdr = codec(type_name, CDR).encode
        self._writer: Any = program.writer(dds_name, type_name, quality, queue)

    @property
    def missed(self) -> Mapping[str, int]:
        """Messages that were not sent to anybody, since DDS had no room for them."""
        return {"all": self._missed} if self._missed else {}

    def subscribers(self) -> tuple[str, ...]:
        """Return the names of the nodes that listen."""
        program = self._program
        with program.lock:
            handles = () if self.is_closed else self._writer.get_matched_subscriptions()
            self._matched = len(handles)
            return program.directory.names(program.ends(program.directory.subscriptions, handles))

    def is_heard(self) -> bool:
        """Return True if there is a listener."""
        return not self.is_closed and bool(self._writer.get_publication_matched_status().current_count)

    def _send(self, message: Message) -> None:
        if self._sent % _ASK == 0 or not self._matched:
            self._matched = self._writer.get_publication_matched_status().current_count
        if not (self.quality.is_latched or self._matched):
            return
        data = self._encode_cdr(message)
        try:
            self._writer.write(self._kind(data))
        except DDSException as error:
            if error.code != DDSException.DDS_RETCODE_TIMEOUT:
                raise TransportError(f"topic {self.topic}: {error}") from error
            self._missed += 1

    def _end(self) -> None:
        self._program.end(self._writer)
        self._writer = None


class DdsTransport(Transport):
    """A node of ROS 2, in a program of DDS; a thread of its own receives."""

    encoding = CDR
    has_services = False
    # one that ends says so; one that is killed is missed when its lease has run out, Cyclone's or Fast DDS's
    lapses = (0, 10 * SECOND, 20 * SECOND)

    def __init__(self, name: str, *, arguments: RosArguments | None = None, settle: float = SETTLE_S) -> None:
        """Join the domain of ROS_DOMAIN_ID, and wait until nothing new is known of others for `settle` [s]."""
        self._arguments = arguments or RosArguments()
        super().__init__(self._arguments.node or name)
        others = distribution(self._arguments.distro)
        self.program = Program(self.name, self._arguments.namespace, others, self._come)
        self._heard_lock = self.program.lock  # which the receiver holds
        wait_until_settled(lambda: self.program.directory.changes, settle)

    def _come(self, end: Endpoint) -> None:
        for topic in tuple(self._heard.values()):
            if isinstance(topic, ListenedTopic):
                topic.hear(end)

    def _publisher(self, topic: str, type_name: str, *, latch: bool, queue: int) -> DdsPublisher:
        quality = Quality(latch or self.sending.is_reliable, is_latched=latch)
        return DdsPublisher(self.program, topic, self._dds_name(topic), type_name, quality, queue)

    def _dds_name(self, topic: str) -> str:
        return dds_topic(self._arguments.network_name(topic))

    def _hear(self, topic: str, type_name: str) -> ListenedTopic:
        return ListenedTopic(self.program, self._dds_name(topic), type_name, self.steady)

    def _published(self) -> Iterator[tuple[str, str, str]]:
        self.program.look()
        for topic, kind, end in self.program.directory.published():
            own = self._arguments.own_name(topic)
            if own is not None:
                yield own, kind, self.program.directory.process(end)

    def _others(self, topic: str) -> frozenset[str]:
        directory, ours = self.program.directory, self.program.gid
        ends = directory.publishers(self._dds_name(topic))
        return frozenset(directory.process(end) for end in ends if end.participant != ours)

    def close(self) -> None:
        """End the node."""
        if self.inbox.closed:
            return
        super().close()
        self._end_topics()
        self.program.close()
