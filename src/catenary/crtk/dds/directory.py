"""Who is on the network: ends of topics, the quality they offer or ask for, and their ROS nodes.

Each program writes rmw_dds_common/ParticipantEntitiesInfo to DDS's topic `ros_discovery_info`: its own number, and for
each node its name and the numbers of its readers and writers (ROS 2 design 151). A number (Gid) is DDS's of 16 bytes,
followed by zeros up to 24 in distributions up to Humble.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
from cyclonedds.core import DDSStatus
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct
from cyclonedds.idl import types as idl
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader

from catenary.crtk.dds.types import array, ros_topic, ros_type, sequence
from catenary.crtk.transport import UNNAMED

_NEVER = 0  # [ns] that a publisher waits for its readers


class Quality(NamedTuple):
    """What peers have to agree on; a reader gets nothing of a writer that offers less than it asks for."""

    is_reliable: bool = True  # lost messages are sent again; else best effort, as of sensors
    is_latched: bool = False  # transient local: whoever comes later gets the last message; else volatile


def profile(quality: Quality, depth: int, user_data: str = "") -> Qos:
    """Return the policies of a reader or writer that keeps `depth` messages."""
    policies = [
        Policy.Reliability.Reliable(_NEVER) if quality.is_reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if quality.is_latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.WriterDataLifecycle(autodispose=False),  # the end of a writer is no message
    ]
    if quality.is_latched:
        # who comes later gets the last one, however many are kept for readers that are slow
        policies.append(Policy.DurabilityService(0, Policy.History.KeepLast(1), -1, -1, -1))
    if user_data:
        policies.append(Policy.Userdata(user_data.encode()))
    return Qos(*policies)


Gid = bytes  # 16 of them


@cache
def discovery_types(gid_bytes: int) -> tuple[Any, Any, Any]:
    """Return DDS's classes of a number, of what a program tells of a node, and of all that it tells."""
    gid = _struct("Gid", data=array[idl.uint8, gid_bytes])
    gids = sequence[gid]
    node = _struct("NodeEntitiesInfo", node_namespace=str, node_name=str, reader_gid_seq=gids, writer_gid_seq=gids)
    return gid, node, _struct("ParticipantEntitiesInfo", gid=gid, node_entities_info_seq=sequence[node])


def _struct(name: str, **members: Any) -> Any:
    return make_idl_struct(f"{name}_", f"rmw_dds_common::msg::dds_::{name}_", members)


def presence(
    gid_bytes: int, program: Gid, namespace: str, node: str, readers: Iterable[Gid], writers: Iterable[Gid]
) -> Any:
    """Return what a program of one node tells of itself; `namespace` begins with a slash."""
    number_type, node_type, program_type = discovery_types(gid_bytes)

    def gid(number: Gid) -> Any:
        return number_type(data=list(number.ljust(gid_bytes, b"\0")))

    ends = ([gid(number) for number in listed] for listed in (readers, writers))
    return program_type(gid(program), [node_type(namespace, node, *ends)])


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


class Directory:
    """What DDS has discovered, brought up to date by `refresh`; threads take turns."""

    def __init__(self, participant: DomainParticipant, discovery: DataReader[Any], own: tuple[Gid, str]) -> None:
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
            for sample in taken(reader):
                self.changes += 1
                handle = sample.sample_info.instance_handle % HANDLES
                if not sample.sample_info.valid_data:
                    known.pop(handle, None)
                elif handle not in known:
                    kept, reliable = sample.qos[Policy.Durability], sample.qos[Policy.Reliability]
                    is_reliable = isinstance(reliable, Policy.Reliability.Reliable)
                    quality = Quality(is_reliable, kept not in (None, Policy.Durability.Volatile))
                    ids = sample.key.bytes, sample.participant_key.bytes
                    known[handle] = Endpoint(*ids, sample.topic_name, sample.type_name, quality)
                    came.append(known[handle])
        for told in taken(self._discovery):
            if told.sample_info.valid_data:
                self.changes += 1
                self._nodes[bytes(told.gid.data)[:16]] = {
                    bytes(gid.data)[:16]: f"{node.node_namespace.rstrip('/')}/{node.node_name}"
                    for node in told.node_entities_info_seq
                    for gid in (*node.reader_gid_seq, *node.writer_gid_seq)
                }
        return came

    def node(self, end: Endpoint) -> str:
        """Return the name of the node that an end belongs to; its program's number where that is no ROS node."""
        if end.participant == self._own[0]:
            return self._own[1]
        return self._nodes.get(end.participant, {}).get(end.guid, f"{UNNAMED}{end.participant.hex()}")

    def process(self, end: Endpoint) -> str:
        """Return the node's name, a space, and what differs when it is started again."""
        return f"{self.node(end)} {end.participant.hex()}"

    def publishers(self, dds_name: str) -> list[Endpoint]:
        """Return who publishes a topic."""
        return [end for end in tuple(self.publications.values()) if end.topic == dds_name]

    def published(self) -> Iterator[tuple[str, str, Endpoint]]:
        """Return the topics of ROS that are published, each with its type and who publishes it."""
        for end in tuple(self.publications.values()):
            topic = ros_topic(end.topic)
            if topic is not None:
                yield topic, ros_type(end.type_name), end

    def names(self, ends: Iterable[Endpoint]) -> tuple[str, ...]:
        """Return the names of the nodes that ends belong to."""
        return tuple(sorted({self.node(end) for end in ends}))


def taken(reader: DataReader[Any]) -> Iterator[Any]:
    """Return all that a reader has."""
    while True:
        samples = reader.take(MANY)
        yield from samples
        if len(samples) < MANY:
            return
