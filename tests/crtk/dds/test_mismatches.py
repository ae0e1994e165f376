import logging
from typing import Any

import pytest

from catenary.crtk.dds.transport import DdsTransport
from patience import until

TEXT = "std_msgs/String"


def test_a_listener_that_asks_for_more_than_is_offered_is_named_once_with_what_lacks(
    robot: Any, dds_domain: int, caplog: pytest.LogCaptureFixture
) -> None:
    robot.publisher("/t", TEXT)
    with DdsTransport("asker", settle=0.05) as asker:
        from catenary.crtk.dds.qualities import Quality
        from catenary.crtk.dds.types import message_type

        asker.program.reader("rt/t", message_type(TEXT), Quality(is_latched=True), 1, "", lambda _: None)
        until(lambda: caplog.records)
        asker.publisher("/other", TEXT)
        until(lambda: "/other" in robot.topics())
    (record,) = caplog.records
    assert record.getMessage() == (
        "topic /t: /asker hears nothing of /robot: it asks for reliable, transient local, "
        "offered is reliable, volatile (durability)"
    )
    assert record.levelno == logging.WARNING


def test_a_program_without_a_node_is_named_by_its_number(robot: Any, peer: Any, caplog) -> None:
    from cyclonedds.qos import Policy

    from oracles.cyclone_peer import RELIABLE, Text

    robot.publisher("/t", TEXT)
    peer.reader("rt/t", Text, RELIABLE, Policy.Durability.TransientLocal)
    until(lambda: caplog.records)
    assert f"participant_{peer.participant.guid.hex} hears nothing of /robot" in caplog.text


def test_programs_that_speak_of_other_types_are_named(robot: Any, peer: Any, caplog) -> None:
    from oracles.cyclone_peer import JointState

    robot.publisher("/said", TEXT)
    robot.subscribe("/heard", TEXT)
    peer.reader("rt/said", JointState)
    peer.writer("rt/heard", JointState)
    until(lambda: len(caplog.records) >= 2)
    number = peer.participant.guid.hex
    assert f"/said: participant_{number} takes sensor_msgs/JointState, /robot publishes {TEXT}" in caplog.text
    assert (
        f"/heard: participant_{number} publishes sensor_msgs/JointState, /robot takes {TEXT}" in caplog.text
    )


def test_programs_that_speak_version_2_alone_are_named(robot: Any, peer: Any, caplog) -> None:
    from cyclonedds.core import Qos
    from cyclonedds.pub import DataWriter
    from cyclonedds.qos import Policy
    from cyclonedds.topic import Topic

    from oracles.cyclone_peer import RELIABLE, Text

    robot.subscribe("/t", TEXT)
    newer = Qos(RELIABLE, Policy.DataRepresentation(use_xcdrv2_representation=True))
    writer = DataWriter(peer.participant, Topic(peer.participant, "rt/t", Text), newer)
    until(lambda: caplog.records)
    assert "which offers reliable, volatile, CDR version 2 only" in caplog.text
    del writer
