"""What is particular to ROS 2; what holds for every transport is in contracts."""

from typing import Any

import pytest

from catenary.crtk.dds.arguments import RosArguments
from catenary.crtk.dds.transport import DdsTransport
from catenary.crtk.message import message_class
from catenary.crtk.transport import Spinner
from patience import PATIENCE, until

TEXT = "std_msgs/String"
TRIGGER = "std_srvs/Trigger"


def test_a_program_with_other_names_speaks_and_hears_by_them(robot: Any, dds_domain: int) -> None:
    arguments = RosArguments(
        {"/said": "/lab/said", "/heard": "/lab/heard", "/button": "/lab/button"}, "two", "/lab"
    )
    response = message_class("std_srvs/TriggerResponse")
    with DdsTransport("one", arguments=arguments, settle=0.05) as other:
        said, heard = other.publisher("/said", TEXT), other.subscribe("/heard", TEXT)
        other.service("/button", TRIGGER, lambda _: response(True, "pressed"))
        hears, says = robot.subscribe("/lab/said", TEXT), robot.publisher("/lab/heard", TEXT)
        until(lambda: other.connections("/said").subscribers == ("/robot",))
        until(lambda: robot.connections("/lab/heard").subscribers == ("/lab/two",))
        said.publish(message_class(TEXT)(data="out"))
        says.publish(message_class(TEXT)(data="in"))
        assert hears.take(PATIENCE)[0].message.data == "out"
        assert heard.take(PATIENCE)[0].message.data == "in"
        with Spinner(other):
            assert robot.call("/lab/button", TRIGGER, timeout=PATIENCE).success
            assert other.call("/button", TRIGGER, timeout=PATIENCE).success
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
