"""What is particular to ROS 2; what holds for every transport is in contracts."""

from typing import Any

import numpy as np
import pytest

from catenary.crtk.dds.transport import DdsTransport
from catenary.crtk.message import message_class
from catenary.crtk.network import RosArguments
from catenary.crtk.transport import Sending
from patience import PATIENCE, until

TEXT = "std_msgs/String"
TRIGGER = "std_srvs/Trigger"


def test_a_program_with_other_names_speaks_and_hears_by_them(robot: Any, dds_domain: int) -> None:
    arguments = RosArguments({"/said": "/lab/said", "/heard": "/lab/heard"}, "two", "/lab")
    with DdsTransport("one", arguments=arguments, settle=0.05) as other:
        said, heard = other.publisher("/said", TEXT), other.subscribe("/heard", TEXT)
        hears, says = robot.subscribe("/lab/said", TEXT), robot.publisher("/lab/heard", TEXT)
        until(lambda: other.connections("/said").subscribers == ("/robot",))
        until(lambda: robot.connections("/lab/heard").subscribers == ("/lab/two",))
        said.publish(message_class(TEXT)(data="out"))
        says.publish(message_class(TEXT)(data="in"))
        assert hears.take(PATIENCE)[0].message.data == "out"
        assert heard.take(PATIENCE)[0].message.data == "in"
        assert set(other.topics()) == set(other.publishing()) == {"/said", "/heard"}
        assert set(robot.topics()) == {"/lab/said", "/lab/heard"}


def test_a_topic_of_the_name_that_was_given_away_is_another_one(robot: Any, dds_domain: int) -> None:
    robot.publisher("/said", "sensor_msgs/JointState")
    with DdsTransport("one", arguments=RosArguments({"/said": "/mine"}), settle=0.05) as other:
        other.publisher("/said", TEXT)
        assert other.topics() == {"/said": TEXT}


def test_messages_for_which_there_is_no_room_are_counted_and_others_still_sent(robot: Any) -> None:
    from cyclonedds.core import DDSException

    heard, publisher = robot.subscribe("/t", TEXT), robot.publisher("/t", TEXT)
    until(lambda: robot.connections("/t").subscribers)

    def full(_: Any) -> None:
        raise DDSException(DDSException.DDS_RETCODE_TIMEOUT)

    publisher._writer.write = full
    publisher.publish(message_class(TEXT)(data="lost"))
    del publisher._writer.write
    publisher.publish(message_class(TEXT)(data="sent"))
    assert publisher.overflowed == 1
    assert heard.take(PATIENCE)[0].message.data == "sent"


def test_two_nodes_of_one_name_are_permitted(robot: Any, dds_domain: int) -> None:
    with DdsTransport("robot", settle=0.05) as other:
        heard, publisher = robot.subscribe("/t", TEXT), other.publisher("/t", TEXT)
        until(lambda: robot.connections("/t").publishers == ("/robot",))
        publisher.publish(message_class(TEXT)(data="a"))
        (got,) = heard.take_arrivals(PATIENCE)
        assert got.process.startswith("/robot ")


@pytest.mark.parametrize("quiet", [0.0, 0.2])
def test_those_who_are_there_are_known_at_the_beginning(robot: Any, dds_domain: int, quiet: float) -> None:
    robot.publisher("/t", TEXT)
    with DdsTransport("client", settle=quiet) as client:
        assert client.topics() == {"/t": TEXT}


def test_a_best_effort_publisher_is_heard_by_our_own_and_said_to_be_one(robot: Any, dds_domain: int) -> None:
    from catenary.crtk.dds.program import Quality

    robot.sending = Sending(depth=3, is_reliable=False)
    publisher, latched = robot.publisher("/a", TEXT), robot.publisher("/b", TEXT, latch=True)
    assert (publisher.quality, latched.quality) == (Quality(is_reliable=False), Quality(is_latched=True))
    with DdsTransport("lab", settle=0.05) as lab:
        heard = lab.subscribe("/a", TEXT)
        until(lambda: publisher.publish(message_class(TEXT)(data="a")) or len(heard) > 0, every=0.02)


def texts(subscription: Any, count: int) -> list[str]:
    """So many texts, and a moment for more."""
    got: list[str] = []
    until(lambda: got.extend(one.message.data for one in subscription.take(0.05)) or len(got) >= count)
    return got + [one.message.data for one in subscription.take(0.2)]


def policies(is_reliable: bool, is_latched: bool) -> tuple[Any, ...]:
    from cyclonedds.qos import Policy

    from oracles.cyclone_peer import RELIABLE

    return (
        RELIABLE if is_reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if is_latched else Policy.Durability.Volatile,
    )


QUALITIES = [(True, False), (True, True), (False, False), (False, True)]


@pytest.mark.parametrize("quality", QUALITIES)
@pytest.mark.parametrize("is_late", [False, True], ids=["before", "after"])
def test_publishers_of_every_quality_are_heard_once(robot: Any, peer: Any, quality: Any, is_late: bool) -> None:
    from oracles.cyclone_peer import Text

    if is_late:
        heard = robot.subscribe("/t", TEXT)
    writer = peer.writer("rt/t", Text, *policies(*quality))
    if not is_late:
        until(lambda: "/t" in robot.topics())
        heard = robot.subscribe("/t", TEXT)
    until(lambda: robot.connections("/t").publishers)
    until(lambda: len(writer.get_matched_subscriptions()) >= 1)
    for k in range(5):
        writer.write(Text(str(k)))
    assert texts(heard, 5) == list("01234")


def test_two_publishers_of_different_quality_are_heard_beside_each_other(robot: Any, peer: Any) -> None:
    from oracles.cyclone_peer import Text

    heard = robot.subscribe("/t", TEXT)
    writers = [peer.writer("rt/t", Text, *policies(*quality)) for quality in QUALITIES]
    until(lambda: len(robot._heard["/t"]._readers) == 3)  # nothing of a best effort is latched
    until(lambda: all(writer.get_matched_subscriptions() for writer in writers))
    for k, writer in enumerate(writers):
        writer.write(Text(str(k)))
    assert sorted(texts(heard, 4)) == list("0123")


def test_what_a_latching_publisher_said_before_is_heard_as_first_and_with_its_age(robot: Any, peer: Any) -> None:
    from oracles.cyclone_peer import Text

    writer = peer.writer("rt/t", Text, *policies(True, True))
    before = robot.now()
    writer.write(Text("old"))
    heard = robot.subscribe("/t", TEXT)
    (first,) = heard.take_arrivals(PATIENCE)
    assert (first.message.data, first.is_first, first.is_renewed) == ("old", True, False)
    assert before <= first.sent <= first.time
    writer.write(Text("new"))
    (second,) = heard.take_arrivals(PATIENCE)
    assert not second.is_first
    assert first.process == second.process


def test_messages_that_are_too_large_are_dropped_and_counted(robot: Any, peer: Any) -> None:
    from oracles.cyclone_peer import JointState

    heard = robot.subscribe("/joints", "sensor_msgs/JointState", largest=200)
    writer = peer.writer("rt/joints", JointState)
    until(lambda: robot.connections("/joints").publishers)
    writer.write(JointState(position=[0.0] * 100_000))
    writer.write(JointState(position=[1.0]))
    ((got, _),) = heard.take(PATIENCE)
    np.testing.assert_array_equal(got.position, [1.0])
    assert heard.oversized == 1


def test_bytes_that_are_no_message_of_the_type_reach_nobody(robot: Any, peer: Any) -> None:
    """A program that calls its type ours: DDS tells types apart by their names where it is told no more."""
    from catenary.crtk.dds.program import _raw

    heard = robot.subscribe("/t", TEXT)
    liar = _raw("std_msgs::msg::dds_::String_", {"data": int})
    writer = peer.writer("rt/t", liar)
    honest = robot.publisher("/t", TEXT)
    until(lambda: robot.connections("/t").subscribers)
    for data in (b"\0\1\0\0\xff\xff\xff\xff\0\0\0\0", b"\0\1\0\0" + bytes(8)):
        writer.write(liar(data))
    honest.publish(message_class(TEXT)(data="yes"))
    assert texts(heard, 1) == ["yes"]
