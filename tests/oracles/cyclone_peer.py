"""A program of DDS that is not ours: Cyclone's Python with types of its own, written by hand as ROS 2's IDL has them."""

from dataclasses import dataclass, field
from typing import Any

from cyclonedds.core import Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl import annotations as annotate
from cyclonedds.idl.types import array, float64, int32, sequence, uint8, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

PLAIN = Policy.DataRepresentation(use_cdrv0_representation=True)
RELIABLE = Policy.Reliability.Reliable(10**9)


@dataclass
@annotate.final
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
@annotate.final
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
@annotate.final
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    header: Header = field(default_factory=Header)
    name: sequence[str] = field(default_factory=list)
    position: sequence[float64] = field(default_factory=list)
    velocity: sequence[float64] = field(default_factory=list)
    effort: sequence[float64] = field(default_factory=list)


@dataclass
@annotate.final
class Text(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    data: str = ""


def discovery_type(gid_bytes: int) -> Any:
    """rmw_dds_common's ParticipantEntitiesInfo with numbers of so many bytes."""

    @dataclass
    @annotate.final
    class Gid(IdlStruct, typename="rmw_dds_common::msg::dds_::Gid_"):
        data: array[uint8, gid_bytes]

    @dataclass
    @annotate.final
    class Node(IdlStruct, typename="rmw_dds_common::msg::dds_::NodeEntitiesInfo_"):
        node_namespace: str
        node_name: str
        reader_gid_seq: sequence[Gid]
        writer_gid_seq: sequence[Gid]

    @dataclass
    @annotate.final
    class Program(IdlStruct, typename="rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"):
        gid: Gid
        node_entities_info_seq: sequence[Node]

    return Program


class CyclonePeer:
    """A participant with readers and writers."""

    def __init__(self, domain: int) -> None:
        self.participant = DomainParticipant(domain)
        self._ends: list[Any] = []  # which last as long as somebody refers to them

    def reader(self, topic: str, kind: Any, *policies: Any, depth: int = 1000) -> Any:
        qos = Qos(*(policies or (RELIABLE,)), PLAIN, Policy.History.KeepLast(depth))
        self._ends.append(DataReader(self.participant, Topic(self.participant, topic, kind), qos))
        return self._ends[-1]

    def writer(self, topic: str, kind: Any, *policies: Any) -> Any:
        qos = Qos(*(policies or (RELIABLE,)), PLAIN, Policy.History.KeepLast(1000))
        self._ends.append(DataWriter(self.participant, Topic(self.participant, topic, kind), qos))
        return self._ends[-1]
