"""Nodes and ends of topics as ROS 2 finds them, read with types of another make."""

from typing import Any

import pytest

from catenary.crtk.dds.transport import DdsTransport
from catenary.crtk.message import message_class
from catenary.crtk.network import RosArguments
from patience import until


def told(reader: Any, program: bytes) -> Any:
    """The last that a program told of itself."""
    return next((one for one in reversed(reader.read(1000)) if bytes(one.gid.data)[:16] == program), None)


@pytest.mark.parametrize(("distro", "gid_bytes"), [("humble", 24), ("jazzy", 16)])
def test_a_program_tells_of_its_node_and_the_ends_of_its_topics(
    dds_domain: int, peer: Any, distro: str, gid_bytes: int
) -> None:
    from cyclonedds.qos import Policy

    from oracles.cyclone_peer import RELIABLE, discovery_type

    reader = peer.reader("ros_discovery_info", discovery_type(gid_bytes), RELIABLE, Policy.Durability.TransientLocal)
    with DdsTransport("robot", arguments=RosArguments(distro=distro), settle=0.05) as robot:
        publisher = robot.publisher("/said", "std_msgs/String")
        robot.subscribe("/heard", "std_msgs/String")
        gid = robot.program.gid

        def has_ends(readers: int, writers: int) -> bool:
            info = told(reader, gid)
            if info is None:
                return False
            (node,) = info.node_entities_info_seq
            return (len(node.reader_gid_seq), len(node.writer_gid_seq)) == (readers, writers)

        until(lambda: has_ends(1, 1))
        info = told(reader, gid)
        (node,) = info.node_entities_info_seq
        assert (node.node_namespace, node.node_name) == ("/", "robot")
        assert bytes(info.gid.data)[16:] == bytes(gid_bytes - 16)
        ends = {bytes(one.data)[:16] for one in (*node.reader_gid_seq, *node.writer_gid_seq)}
        directory = robot.program.directory
        heard = [end for end in directory.subscriptions.values() if end.topic == "rt/heard"]
        assert ends == {end.guid for end in (*directory.publishers("rt/said"), *heard)}
        publisher.close()
        until(lambda: has_ends(1, 0))


@pytest.mark.parametrize(("distro", "has_hashes"), [("humble", False), ("jazzy", True)])
def test_ends_of_topics_carry_their_types_hash_from_iron_on(dds_domain: int, distro: str, has_hashes: bool) -> None:
    from cyclonedds.qos import Policy

    with DdsTransport("robot", arguments=RosArguments(distro=distro), settle=0.05) as robot:
        publisher: Any = robot.publisher("/said", "std_msgs/String")
        said = publisher._writer.get_qos()[Policy.Userdata]
        assert (said is not None and said.data.startswith(b"typehash=RIHS01_df668c74")) is has_hashes


def test_programs_know_each_others_nodes_also_where_several_come_at_once(dds_domain: int) -> None:
    names = [f"robot{k}" for k in range(5)]
    transports = [DdsTransport(name, settle=0.0) for name in names]
    try:
        heard = [transport.subscribe("/t", "std_msgs/String") for transport in transports]
        sender = transports[0].publisher("/t", "std_msgs/String")
        until(lambda: transports[0].connections("/t").subscribers == tuple(f"/{name}" for name in names))
        until(lambda: all(one.connections("/t").publishers == ("/robot0",) for one in transports))
        sender.publish(message_class("std_msgs/String")(data="all"))
        for one in heard:
            until(lambda one=one: len(one) == 1)
            (arrival,) = one.take_arrivals()
            assert arrival.process in transports[1].publishing()["/t"]
            assert arrival.process.startswith("/robot0 ")
    finally:
        for transport in transports:
            transport.close()
