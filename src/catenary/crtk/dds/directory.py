"""Who is on the network: ends of topics, with what they offer or ask for, and the ROS nodes that they belong to."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
from cyclonedds.core import DDSStatus
from cyclonedds.domain import DomainParticipant
from cyclonedds.sub import DataReader

from catenary.crtk.dds.discovery import Gid, node_names
from catenary.crtk.dds.names import ros_topic, ros_type
from catenary.crtk.dds.qualities import Quality, quality_of, user_data_of

MANY = 1000  # of anything that is taken at once
HANDLES = 2**64  # what Cyclone calls ends of topics by; its Python gives half of them as negative numbers


@dataclass(frozen=True, eq=False)
class Endpoint:
    """An end of a topic: a writer or a reader, of this program or another. One that comes back is another object."""

    guid: Gid
    participant: Gid  # program's
    topic: str  # DDS's name
    type_name: str  # DDS's
    quality: Quality  # that it offers, or asks for
    user_data: dict[str, str]


class Directory:
    """What DDS has discovered, brought up to date by `refresh`; threads take turns."""

    def __init__(
        self, participant: DomainParticipant, discovery: DataReader[Any], own: tuple[Gid, str]
    ) -> None:
        """Begin to look; `discovery` reads ros_discovery_info, `own` are this program's number and node."""
        self._own = own
        self._ends = (
            BuiltinDataReader(participant, BuiltinTopicDcpsPublication),
            BuiltinDataReader(participant, BuiltinTopicDcpsSubscription),
        )
        self._discovery = discovery
        self.publications: dict[int, Endpoint] = {}  # by Cyclone's handle
        self.subscriptions: dict[int, Endpoint] = {}
        self._nodes: dict[Gid, dict[Gid, str]] = {}  # of a program: its endpoints, and its nodes' names
        self.changes = 0  # seen so far
        self.readers: tuple[DataReader[Any], ...] = (*self._ends, discovery)
        for reader in self.readers:
            reader.set_status_mask(DDSStatus.DataAvailable)

    def refresh(self) -> list[Endpoint]:
        """Take in what is new; return the ends of topics that have come."""
        came: list[Endpoint] = []
        for reader, known in zip(self._ends, (self.publications, self.subscriptions), strict=True):
            for sample in _taken(reader):
                self.changes += 1
                handle = sample.sample_info.instance_handle % HANDLES
                if not sample.sample_info.valid_data:
                    known.pop(handle, None)
                elif handle not in known:
                    known[handle] = _endpoint(sample)
                    came.append(known[handle])
        for sample in _taken(self._discovery):
            if sample.sample_info.valid_data:
                self.changes += 1
                gid, names = node_names(sample)
                self._nodes[gid] = names
        return came

    def node(self, end: Endpoint) -> str:
        """Return the name of the node that an end belongs to; its program's number where that is no ROS node."""
        if end.participant == self._own[0]:
            return self._own[1]
        return self._nodes.get(end.participant, {}).get(end.guid, f"participant_{end.participant.hex()}")

    def is_named(self, end: Endpoint) -> bool:
        """Return whether the node that an end belongs to is known."""
        return end.guid in self._nodes.get(end.participant, {})

    def process(self, end: Endpoint) -> str:
        """Return the node's name, a space, and what differs when it is started again."""
        return f"{self.node(end)} {end.participant.hex()}"

    def publishers(self, dds_name: str) -> list[Endpoint]:
        """Return who publishes a topic."""
        return [end for end in tuple(self.publications.values()) if end.topic == dds_name]

    def subscribers(self, dds_name: str) -> list[Endpoint]:
        """Return who listens to a topic."""
        return [end for end in tuple(self.subscriptions.values()) if end.topic == dds_name]

    def published(self) -> Iterator[tuple[str, str, Endpoint]]:
        """Return the topics of ROS that are published, each with its type and who publishes it."""
        for end in tuple(self.publications.values()):
            topic = ros_topic(end.topic)
            if topic is not None:
                yield topic, ros_type(end.type_name), end

    def names(self, ends: Iterable[Endpoint]) -> tuple[str, ...]:
        """Return the names of the nodes that ends belong to."""
        return tuple(sorted({self.node(end) for end in ends}))


def _taken(reader: DataReader[Any]) -> Iterator[Any]:
    while True:
        samples = reader.take(MANY)
        yield from samples
        if len(samples) < MANY:
            return


def _endpoint(sample: Any) -> Endpoint:
    return Endpoint(
        sample.key.bytes,
        sample.participant_key.bytes,
        sample.topic_name,
        sample.type_name,
        quality_of(sample.qos),
        user_data_of(sample.qos),
    )
