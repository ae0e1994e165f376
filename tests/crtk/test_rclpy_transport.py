"""The transport by rclpy: its part of the contract and what follows here run where a distribution's wheels are sourced."""

import importlib.util
import logging
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from typing import Any

import pytest

from catenary.crtk.message import message_class
from catenary.crtk.network import RosArguments, make_transport, say_ros_arguments
from catenary.crtk.transport import Sending, Transport
from catenary.errors import InputError, MissingPackageError
from dds import ROOT
from patience import polled, until
from ros2 import DISTRIBUTIONS, sourced

JOINT_STATE, TEXT, TRIGGER = "sensor_msgs/JointState", "std_msgs/String", "std_srvs/Trigger"
IS_SOURCED = importlib.util.find_spec("rclpy") is not None
beside_ros2 = pytest.mark.skipif(not IS_SOURCED, reason="ROS 2 is not sourced here: the first test runs this so")


@pytest.mark.slow
@pytest.mark.skipif(IS_SOURCED, reason="it is sourced")
@pytest.mark.parametrize("distro", DISTRIBUTIONS)
def test_contract_and_the_rest_hold_beside(distro: str) -> None:
    files = ["tests/contracts/test_transports.py", __file__]
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", "rclpy", *files],
        cwd=ROOT, env=sourced(distro), capture_output=True, text=True, timeout=400, check=False,
    )  # fmt: skip
    assert run.returncode == 0, run.stdout[-5000:]


@pytest.fixture
def said() -> Iterator[Callable[..., None]]:
    yield lambda **words: say_ros_arguments(RosArguments(**words))
    say_ros_arguments(RosArguments())


@pytest.mark.skipif(IS_SOURCED, reason="it is sourced")
def test_without_ros2_dds_is_taken_unless_rclpy_is_asked_for(said: Callable[..., None], dds_domain: int) -> None:
    with make_transport("2", "lab") as transport:
        assert type(transport).__name__ == "DdsTransport"
    said(transport="rclpy")
    with pytest.raises(MissingPackageError, match="rclpy"):
        make_transport("2", "lab")
    said(transport="rclpy", distro="humble")
    with pytest.raises(InputError, match="ros-distro"):
        make_transport("2", "lab")
    said(transport="dds")
    with pytest.raises(InputError, match="go with ROS 2"):
        make_transport("none", "lab")


@pytest.fixture
def domain(dds_domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


@pytest.fixture
def ours(domain: None) -> Iterator[Transport]:
    from catenary.crtk.rclpy_transport import RclpyTransport

    with RclpyTransport("ours", settle=0.05) as transport:
        yield transport


@pytest.fixture
def theirs(domain: None) -> Iterator[Transport]:
    from catenary.crtk.dds.transport import DdsTransport

    with DdsTransport("theirs", settle=0.05) as transport:
        yield transport


@pytest.fixture
def node(domain: None) -> Iterator[Any]:
    """A node of rclpy's own."""
    import rclpy

    context = rclpy.Context()
    rclpy.init(context=context)
    yield rclpy.create_node("peer", context=context)
    rclpy.shutdown(context=context)


@beside_ros2
def test_ros2_is_by_rclpy_where_it_is_sourced(said: Callable[..., None], domain: None) -> None:
    pytest.importorskip("crtk_msgs", reason="crtk_msgs is not built here: CRTK_MSGS=1 .ci/ros2")
    for words, kind in (
        ({}, "DdsTransport" if os.environ.get("ROS_DISTRO") == "jazzy" else "RclpyTransport"),  # which tells no sender
        ({"transport": "rclpy"}, "RclpyTransport"),
        ({"transport": "dds"}, "DdsTransport"),
        ({"distro": "jazzy"}, "DdsTransport"),
    ):
        said(**words)
        with make_transport("2", "lab") as transport:
            assert type(transport).__name__ == kind


@beside_ros2
def test_each_quality_is_heard_and_what_two_readers_get_is_given_once(
    ours: Transport, theirs: Transport, node: Any
) -> None:
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
    from std_msgs.msg import String

    latched = theirs.publisher("/mixed", TEXT, latch=True)
    latched.publish(message_class(TEXT)("latched"))
    poor = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE)
    plain = node.create_publisher(String, "/mixed", poor)
    heard = ours.subscribe("/mixed", TEXT)
    until(lambda: len(ours.connections("/mixed").publishers) == 2 and plain.get_subscription_count() >= 1)
    plain.publish(String(data="plain"))
    latched.publish(message_class(TEXT)("again"))
    until(lambda: len(heard) >= 3)
    time.sleep(0.3)  # for what should not come
    assert sorted(one.message.data for one in heard.take()) == ["again", "latched", "plain"]


@beside_ros2
def test_who_sent_a_first_message_is_known_before_its_node(ours: Transport, theirs: Transport) -> None:
    """To Kilted a program of DDS has none, which counts after a second; its first command is not to be a stranger's."""
    heard, publisher = ours.subscribe("/early", TEXT), theirs.publisher("/early", TEXT, latch=True)
    until(publisher.is_heard)
    publisher.publish(message_class(TEXT)("first"))
    until(lambda: len(heard))
    (arrival,) = heard.take_arrivals()
    assert arrival.is_first
    assert arrival.process


@beside_ros2
def test_programs_that_publish_one_topic_are_told_apart_where_rclpy_says_who(ours: Transport, domain: None) -> None:
    from catenary.crtk.rclpy_transport import RclpyTransport

    heard = ours.subscribe("/both", TEXT)
    with RclpyTransport("first", settle=0.05) as first, RclpyTransport("second", settle=0.05) as second:
        for transport in (first, second):
            publisher = transport.publisher("/both", TEXT)
            until(lambda publisher=publisher: publisher.subscribers())
            until(lambda transport=transport: f"/{transport.name}" in ours.connections("/both").publishers)
            publisher.publish(message_class(TEXT)(transport.name))
        until(lambda: len(heard) == 2)
        names = [one.process.partition(" ")[0] for one in heard.take_arrivals()]
        assert names[0] == "/first"  # it was alone
        assert names[1] == ("/second" if int(version("rclpy").split(".")[0]) >= 9 else "")  # since Kilted
        assert {one.partition(" ")[0] for one in ours.publishing()["/both"]} == {"/first", "/second"}


@beside_ros2
def test_best_effort_and_other_names_are_as_asked_for(domain: None, node: Any) -> None:
    from catenary.crtk.rclpy_transport import RclpyTransport

    arguments = RosArguments({"/a": "/b"}, node="other", namespace="/lab")
    with RclpyTransport("ours", arguments=arguments, settle=0.05) as ours:
        ours.sending = Sending(depth=1, is_reliable=False)
        ours.publisher("/a", TEXT)
        until(lambda: [end for end in node.get_publishers_info_by_topic("/b") if end.node_name == "other"])
        (end,) = node.get_publishers_info_by_topic("/b")
        assert (end.node_name, end.node_namespace) == ("other", "/lab")
        assert end.qos_profile.reliability.name == "BEST_EFFORT"
        assert ours.topics()["/a"] == TEXT


@beside_ros2
def test_rclpy_programs_call_its_services_and_read_its_parameters_and_log(ours: Transport, node: Any) -> None:
    import rclpy
    from rcl_interfaces.msg import Log
    from rcl_interfaces.srv import ListParameters
    from std_srvs.srv import Trigger

    said: list[str] = []
    node.create_subscription(Log, "/rosout", lambda message: said.append(f"{message.name}: {message.msg}"), 10)
    ours.service("/press", TRIGGER, lambda request: message_class(f"{TRIGGER}Response")(True, "pressed"))
    executor = rclpy.executors.SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    with polled(ours):
        for name, kind, claim in (
            ("/press", Trigger, lambda answer: (answer.success, answer.message) == (True, "pressed")),
            ("/ours/list_parameters", ListParameters, lambda answer: "use_sim_time" in answer.result.names),
        ):
            client = node.create_client(kind, name)
            assert client.wait_for_service(30.0)
            answer = client.call_async(kind.Request())
            executor.spin_until_future_complete(answer, 30.0)
            assert claim(answer.result())

    def is_told() -> bool:
        logging.getLogger("catenary.test").warning("something to say")
        executor.spin_once(0.1)
        return "ours: something to say" in said

    until(is_told)


@beside_ros2
def test_a_type_that_is_not_built_here_is_left_out_with_a_line(ours: Transport, caplog: Any) -> None:
    from catenary.crtk.rclpy_transport import _kind

    _kind.cache_clear()  # it is said once
    publisher = ours.publisher("/ravenstate", "raven_2/raven_state")
    publisher.publish(message_class("raven_2/raven_state")())
    assert ours.subscribe("/ravenstate", "raven_2/raven_state").take() == []
    assert ours.connections("/ravenstate") == ((), ())
    (line,) = [one.getMessage() for one in caplog.records if "is skipped" in one.getMessage()]
    assert "raven_2/raven_state is skipped" in line
