"""What programs of ROS 2 tell each other of their nodes, so that `ros2 node list` and `ros2 topic info` name them.

Each program writes rmw_dds_common/ParticipantEntitiesInfo to DDS's topic `ros_discovery_info`: its own number, and for
each node its name and the numbers of its readers and writers (ROS 2 design 151). A number (Gid) is DDS's of 16 bytes,
followed by zeros up to 24 in distributions up to Humble.
"""

from collections.abc import Iterable
from functools import cache
from typing import Any, NamedTuple

from cyclonedds.idl import make_idl_struct
from cyclonedds.idl import types as idl
from cyclonedds.qos import Qos

from catenary.crtk.dds.qualities import Quality, profile
from catenary.crtk.dds.types import array, sequence

Gid = bytes  # 16 of them


class _Types(NamedTuple):
    gid: Any
    node: Any
    program: Any


@cache
def _types(gid_bytes: int) -> _Types:
    """Return DDS's classes, with numbers of so many bytes."""
    gid = _struct("Gid", data=array[idl.uint8, gid_bytes])
    gids = sequence[gid]
    node = _struct(
        "NodeEntitiesInfo", node_namespace=str, node_name=str, reader_gid_seq=gids, writer_gid_seq=gids
    )
    return _Types(
        gid, node, _struct("ParticipantEntitiesInfo", gid=gid, node_entities_info_seq=sequence[node])
    )


def _struct(name: str, **members: Any) -> Any:
    return make_idl_struct(f"{name}_", f"rmw_dds_common::msg::dds_::{name}_", members)


def discovery_type(gid_bytes: int) -> Any:
    """Return DDS's class of what a program tells, with numbers of so many bytes."""
    return _types(gid_bytes).program


def discovery_profile(depth: int = 1) -> Qos:
    """Return the policies of `ros_discovery_info`; a reader keeps more than one, since programs are not told apart."""
    return profile(Quality(is_latched=True), depth)


def presence(
    gid_bytes: int, program: Gid, namespace: str, node: str, readers: Iterable[Gid], writers: Iterable[Gid]
) -> Any:
    """Return what a program of one node tells of itself; `namespace` begins with a slash."""
    types = _types(gid_bytes)

    def gid(number: Gid) -> Any:
        return types.gid(data=list(number.ljust(gid_bytes, b"\0")))

    ends = ([gid(number) for number in listed] for listed in (readers, writers))
    return types.program(gid(program), [types.node(namespace, node, *ends)])


def node_names(told: Any) -> tuple[Gid, dict[Gid, str]]:
    """Return a program's number, and the names of the nodes that its ends of topics belong to."""
    names: dict[Gid, str] = {}
    for node in told.node_entities_info_seq:
        name = f"{node.node_namespace.rstrip('/')}/{node.node_name}"
        for gid in (*node.reader_gid_seq, *node.writer_gid_seq):
            names[bytes(gid.data)[:16]] = name
    return bytes(told.gid.data)[:16], names
