"""What this program receives of one topic: from each publisher with the quality that it offers."""

from collections.abc import Callable
from functools import partial
from typing import Any

from cyclonedds.sub import DataReader

from catenary.crtk.dds.directory import HANDLES, MANY, Endpoint
from catenary.crtk.dds.distributions import message_hash
from catenary.crtk.dds.names import dds_type
from catenary.crtk.dds.program import Program
from catenary.crtk.dds.qualities import Quality
from catenary.crtk.dds.types import Raw, message_type
from catenary.crtk.inbox import Origin, Subscription
from catenary.crtk.message_bytes import NO_MESSAGE
from catenary.recording.messages import current_name, ros2_name, typestore

_USUAL = Quality()
_DEPTH = (
    4000  # messages that DDS keeps of a topic until the receiver takes them; what it drops, nobody counts
)


class ListenedTopic:
    """A topic and its subscriptions; its methods are called with the program's lock held.

    A reader that asks for more than a writer offers gets nothing of it: nothing of a sensor's best effort where it asks
    for reliability, nothing of a plain topic where it asks for latched messages. One that asks for less gets no latched
    messages, and loses some. So there is a reader for each quality that some publisher offers, and it gives what comes
    from those that offer just that.
    """

    def __init__(self, program: Program, dds_name: str, type_name: str, steady: Callable[[], int]) -> None:
        """Begin to receive."""
        self.type_name = current_name(type_name)
        self.dds_name = dds_name
        self._program, self._steady = program, steady
        self._subscriptions: list[Subscription] = []
        self._latched: dict[str, tuple[bytes, int, Origin, int]] = {}  # by publisher
        self._origins: dict[int, tuple[Endpoint, Origin]] = {}  # by Cyclone's handle of the writer
        self._readers: dict[Quality, DataReader[Any]] = {}
        self._to_ros1 = partial(typestore(2).cdr_to_ros1, typename=ros2_name(type_name))
        publishers = program.directory.publishers(self.dds_name)
        for publisher in publishers:
            self.hear(publisher)
        if not self._readers:
            self._listen(_USUAL)

    def hear(self, publisher: Endpoint) -> None:
        """Listen to a publisher of the topic, if it carries the type."""
        if publisher.topic == self.dds_name and publisher.type_name == dds_type(self.type_name):
            self._listen(_asked_of(publisher))

    def _listen(self, quality: Quality) -> None:
        if quality in self._readers:
            return
        program = self._program
        user_data = f"typehash={message_hash(self.type_name)};" if program.distribution.has_hashes else ""
        self._readers[quality] = program.reader(
            self.dds_name,
            message_type(self.type_name),
            quality,
            _DEPTH,
            user_data,
            partial(self._take, quality),
        )

    def add(self, subscription: Subscription) -> None:
        """Give a subscription what comes from now on, and what publishers have latched."""
        for latched in self._latched.values():
            self._give(subscription, *latched)
        self._subscriptions.append(subscription)

    def remove(self, subscription: Subscription) -> bool:
        """Take a subscription away; return whether none is left."""
        self._subscriptions = [one for one in self._subscriptions if one is not subscription]
        return not self._subscriptions

    def close(self) -> None:
        """Receive no more."""
        while self._readers:
            self._program.end(self._readers.popitem()[1])

    def matched(self) -> list[int]:
        """Return Cyclone's handles of the writers that some reader of it gets messages of."""
        readers = self._readers.values()
        return [handle % HANDLES for reader in readers for handle in reader.get_matched_publications()]

    def publishers(self) -> tuple[str, ...]:
        """Return the names of the nodes that it receives from."""
        known = self._program.directory.publications
        ends = {}
        for quality, reader in self._readers.items():
            for handle in reader.get_matched_publications():
                end = known.get(handle % HANDLES)
                if end is not None and _asked_of(end) == quality:
                    ends[end.guid] = end
        return self._program.directory.names(ends.values())

    def _take(self, quality: Quality, reader: DataReader[Any]) -> None:
        while True:
            samples = reader.take(MANY)
            for sample in samples:
                if sample.sample_info.valid_data:
                    self._receive(sample, quality)
            if len(samples) < MANY:
                return

    def _receive(self, sample: Raw, quality: Quality) -> None:
        info = sample.sample_info
        end, origin = self._origin(info.publication_handle)
        if (_USUAL if end is None else _asked_of(end)) != quality:
            return  # it comes to another reader, too
        time, sent = self._steady(), info.source_timestamp
        if origin is not None and origin.is_latching:
            self._latched[origin.process.partition(" ")[0]] = sample.data, time, origin, sent
        for subscription in self._subscriptions:
            self._give(subscription, sample.data, time, origin, sent)

    def _give(
        self, subscription: Subscription, data: bytes, time: int, origin: Origin | None, sent: int
    ) -> None:
        """Give a subscription a message: as it is, or where it has bounds as ROS 1's bytes, which these are about."""
        if subscription.largest is None:
            subscription.push(data, time, origin, sent)
            return
        # at most twice as many bytes as ROS 1's: padding, and an end of each text
        if not subscription.has_room_for(len(data) // 2):
            return
        try:
            subscription.push(bytes(self._to_ros1(data)), time, origin, sent)
        except NO_MESSAGE:
            subscription.damaged += 1

    def _origin(self, handle: int) -> tuple[Endpoint | None, Origin | None]:
        """Say where a message came from; nothing of a writer that came and went at once."""
        directory = self._program.directory
        end = directory.publications.get(handle)
        known = self._origins.get(handle)
        if known is not None and (end is None or known[0] is end):
            return known
        if end is None:
            return None, None
        made = self._origins[handle] = end, Origin(directory.process(end), end, end.quality.is_latched)
        return made


def _asked_of(publisher: Endpoint) -> Quality:
    """Return what to ask a publisher for, so that it gives what it offers."""
    offered = publisher.quality
    return Quality(is_latched=offered.is_latched) if offered.is_reliable else Quality(is_reliable=False)
