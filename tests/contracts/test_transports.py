"""What every transport of TRANSPORTS keeps to. Each talks to itself here, over its own network."""

import time
from collections.abc import Callable, Iterator
from contextlib import closing
from functools import partial
from typing import Any

import numpy as np
import pytest

from catenary.crtk.client import CrtkClient
from catenary.crtk.message import CDR, header, message_class
from catenary.crtk.message_queues import Received, Subscription
from catenary.crtk.network import BY_ROS2, CARRIERS, TRANSPORTS
from catenary.crtk.transport import Publisher, Transport
from catenary.errors import CatenaryError, InputError, MissingPackageError, NotReadyError, TransportError
from catenary.nodes.serve import ParkedArm, Serving, make_server
from catenary.plant import JointRanges
from catenary.simulation.cable_plant import JOINTS as RAVEN_JOINTS
from catenary.simulation.cable_plant import UNITS
from patience import PATIENCE
from rival_robot import Rivals
from ros import NODE

JOINT_STATE = "sensor_msgs/JointState"
TEXT = "std_msgs/String"
TRIGGER = "std_srvs/Trigger"
JOINTS = ("shoulder", "elbow", "insertion")


def is_ros2(transport: Transport) -> bool:
    return transport.encoding is CDR


NEEDED = {"1": "ros_master", "2": "dds_domain", "none": None}  # fixture of the network that a transport joins


@pytest.fixture(params=TRANSPORTS)
def transport(request: pytest.FixtureRequest) -> Iterator[Transport]:
    kind = TRANSPORTS[request.param]
    if (needed := NEEDED[kind.ros]) is not None:
        request.getfixturevalue(needed)
    try:
        made = kind.make(NODE, **({"settle": 0.05} if kind.ros == "2" else {}))
    except MissingPackageError as error:
        pytest.skip(str(error))  # tests/crtk/test_rclpy_transport.py runs this file where ROS 2 is sourced
    with made:
        yield made


def test_each_is_told_in_words_and_only_ros_2_leaves_a_choice() -> None:
    assert all(str(kind) == f"{name}: {kind.words}" and kind.words for name, kind in TRANSPORTS.items())
    assert set(NEEDED) == set(CARRIERS)
    assert [kind.ros for kind in TRANSPORTS.values() if kind.name not in BY_ROS2] == ["1", "none"]


@pytest.fixture
def topic(request: pytest.FixtureRequest) -> str:
    """A topic of the test's own."""
    return "/" + "".join(c if c.isalnum() else "_" for c in request.node.name)


def text(data: str) -> Any:
    return message_class(TEXT)(data=data)


def eventually(claim: Callable[[], object], transport: Transport) -> None:
    """Poll until the claim is true."""
    end = time.monotonic() + PATIENCE
    while not claim():
        assert time.monotonic() < end, "did not come true"
        transport.poll(0.01)


def connected(transport: Transport, topic: str, subscribers: int = 1) -> None:
    eventually(lambda: len(transport.connections(topic).subscribers) >= subscribers, transport)


def pair(transport: Transport, topic: str, *, queue: int = 100, **options: Any) -> tuple[Subscription, Publisher]:
    """A subscription of texts, and a publisher that is connected to it."""
    subscription = transport.subscribe(topic, TEXT, **options)
    publisher = transport.publisher(topic, TEXT, queue=queue)
    connected(transport, topic)
    return subscription, publisher


def taken(subscription: Any, count: int, seconds: float = PATIENCE) -> list[Received]:
    """That many messages, and a moment for more that should not come."""
    got: list[Received] = []
    end = time.monotonic() + seconds
    while len(got) < count and time.monotonic() < end:
        got += subscription.take(0.05)
    return got + subscription.take(0.05)


def test_a_message_arrives_as_it_was_sent_stamped_on_its_way(transport: Transport, topic: str) -> None:
    subscription = transport.subscribe(topic, JOINT_STATE)
    publisher = transport.publisher(topic, JOINT_STATE)
    connected(transport, topic)
    sent = message_class(JOINT_STATE)(
        header(1_700_000_000_123_456_789, "base"), JOINTS, np.array([0.1, -0.2, 0.3]), (), np.ones(3)
    )
    before = transport.now()
    publisher.publish(sent)
    ((got, arrived),) = taken(subscription, 1)
    assert before <= arrived <= transport.now()
    assert got.header.stamp == sent.header.stamp
    assert got.header.frame_id == "base"
    assert got.name == JOINTS
    np.testing.assert_array_equal(got.position, sent.position)
    assert got.velocity.shape == (0,)


def test_every_message_arrives_once_and_in_order(transport: Transport, topic: str) -> None:
    subscription, publisher = pair(transport, topic, queue=1000)
    for i in range(1000):
        publisher.publish(text(str(i)))
    assert [int(one.message.data) for one in taken(subscription, 1000)] == list(range(1000))
    assert subscription.overflowed == publisher.overflowed == 0


def test_two_subscriptions_each_get_every_message(transport: Transport, topic: str) -> None:
    subscriptions = [transport.subscribe(topic, TEXT) for _ in range(2)]
    publisher = transport.publisher(topic, TEXT)
    connected(transport, topic)
    publisher.publish(text("a"))
    publisher.publish(text("b"))
    for subscription in subscriptions:
        assert [one.message.data for one in taken(subscription, 2)] == ["a", "b"]


def test_the_oldest_gives_way_and_is_counted_when_nobody_takes(transport: Transport, topic: str) -> None:
    subscription, publisher = pair(transport, topic, depth=3)
    for i in range(10):
        publisher.publish(text(str(i)))
    eventually(lambda: subscription.overflowed == 7, transport)
    assert [one.message.data for one in taken(subscription, 3)] == ["7", "8", "9"]


def test_a_late_subscription_gets_the_latched_message_once(transport: Transport, topic: str) -> None:
    publisher = transport.publisher(topic, TEXT, latch=True)
    publisher.publish(text("old"))
    publisher.publish(text("last"))
    for _ in range(2):
        subscription = transport.subscribe(topic, TEXT)
        assert [one.message.data for one in taken(subscription, 1)] == ["last"]


def test_a_late_subscription_gets_nothing_that_was_not_latched(transport: Transport, topic: str) -> None:
    transport.publisher(topic, TEXT).publish(text("gone"))
    assert taken(transport.subscribe(topic, TEXT), 1, 0.3) == []


def test_seq_counts_the_publishers_messages(transport: Transport, topic: str) -> None:
    if is_ros2(transport):
        return  # which has none
    subscription = transport.subscribe(topic, "crtk_msgs/StringStamped")
    publisher = transport.publisher(topic, "crtk_msgs/StringStamped")
    connected(transport, topic)
    for _ in range(3):
        publisher.publish(message_class("crtk_msgs/StringStamped")())
    numbers = [one.message.header.seq for one in taken(subscription, 3)]
    assert np.diff(numbers).tolist() == [1, 1]


def test_connections_name_the_peers(transport: Transport, topic: str) -> None:
    assert transport.connections(topic) == ((), ())
    transport.subscribe(topic, TEXT)
    publisher = transport.publisher(topic, TEXT)
    connected(transport, topic)
    eventually(lambda: transport.connections(topic).publishers, transport)
    assert NODE in transport.connections(topic).subscribers[0]
    publisher.close()
    eventually(lambda: not transport.connections(topic).subscribers, transport)


def test_topics_are_those_that_are_published(transport: Transport, topic: str) -> None:
    publisher = transport.publisher(topic.strip("/"), "crtk_msgs/operating_state")
    eventually(lambda: topic in transport.topics(), transport)
    assert transport.topics()[topic] == "crtk_msgs/OperatingState"
    publisher.close()
    eventually(lambda: topic not in transport.topics(), transport)


def test_a_closed_subscription_gets_nothing_more(transport: Transport, topic: str) -> None:
    closed, left = transport.subscribe(topic, TEXT), transport.subscribe(topic, TEXT)
    publisher = transport.publisher(topic, TEXT)
    connected(transport, topic)
    closed.close()
    publisher.publish(text("a"))
    assert len(taken(left, 1)) == 1
    assert closed.take() == []


def test_a_topic_can_be_published_again_after_its_publisher_is_closed(transport, topic) -> None:
    subscription = transport.subscribe(topic, TEXT)
    for data in ("first", "second"):
        publisher = transport.publisher(topic, TEXT)
        connected(transport, topic)
        publisher.publish(text(data))
        assert [one.message.data for one in taken(subscription, 1)] == [data]
        publisher.close()
        with pytest.raises(TransportError, match="closed"):
            publisher.publish(text("too late"))
        eventually(lambda: not transport.connections(topic).subscribers, transport)


def test_a_topic_of_another_type_is_refused(transport: Transport, topic: str) -> None:
    transport.publisher(topic, TEXT)
    eventually(lambda: topic in transport.topics(), transport)
    with pytest.raises(TransportError, match=f"{TEXT}, expected {JOINT_STATE}"):
        transport.subscribe(topic, JOINT_STATE)
    with pytest.raises(TransportError, match=r"already|expected"):
        transport.publisher(topic, JOINT_STATE)


@pytest.mark.parametrize("name", ["", "/", "a b", "9a", "/a//b", "a/", "~a", "{x}"])
def test_a_name_that_is_none_is_refused(transport: Transport, name: str) -> None:
    with pytest.raises(InputError, match="name"):
        transport.publisher(name, TEXT)
    with pytest.raises(InputError, match="name"):
        transport.subscribe(name, TEXT)


@pytest.mark.parametrize(
    ("use", "complaint"),
    [
        (lambda transport, topic: transport.publisher(topic, "raven_2/raven_mood"), "unknown"),
        (lambda transport, topic: transport.service(topic, "std_srvs/Mood", lambda request: request), "unknown"),
        (lambda transport, topic: [transport.publisher(topic, TEXT) for _ in range(2)], "already"),
        (lambda transport, topic: [transport.service(topic, TRIGGER, print) for _ in range(2)], "already"),
        (lambda transport, topic: transport.subscribe(topic, TEXT, depth=0), "depth"),
    ],
    ids=["unknown message", "unknown service", "published twice", "served twice", "no depth"],
)
def test_misuse_is_refused(transport: Transport, topic: str, use: Any, complaint: str) -> None:
    if not transport.has_services and complaint in ("unknown", "already"):
        complaint = f"{complaint}|no services"
    with pytest.raises(CatenaryError, match=complaint):
        use(transport, topic)


def test_a_wrong_message_is_refused_by_its_field(transport: Transport, topic: str) -> None:
    transport.subscribe(topic, JOINT_STATE)
    publisher = transport.publisher(topic, JOINT_STATE)
    connected(transport, topic)
    with pytest.raises(InputError, match="position"):
        publisher.publish(message_class(JOINT_STATE)(position=["a"]))
    with pytest.raises(InputError, match="JointState"):
        publisher.publish(text("a"))


def test_a_transport_that_carries_no_services_says_so(transport: Transport, topic: str) -> None:
    if transport.has_services:
        return
    with pytest.raises(TransportError, match="carries no services"):
        transport.service(topic, TRIGGER, print)


def test_a_closed_transport_refuses_and_is_not_up(transport: Transport, topic: str) -> None:
    assert transport.is_up()
    publisher = transport.publisher(topic, TEXT)
    transport.close()
    transport.close()
    assert not transport.is_up()
    for use in (
        lambda: transport.publisher(topic + "2", TEXT),
        lambda: transport.subscribe(topic, TEXT),
        lambda: transport.service(topic, TRIGGER, print),
        lambda: publisher.publish(text("a")),
        transport.poll,
    ):
        with pytest.raises(TransportError, match="closed"):
            use()


@pytest.fixture
def rivals(transport: Transport, request: pytest.FixtureRequest) -> Iterator[Rivals]:
    with closing(Rivals(transport, request.node.callspec.params["transport"])) as programs:
        yield programs


@pytest.mark.parametrize("name", ["rival", NODE])
def test_other_programs_that_publish_a_topic_are_known_while_they_live(transport, topic, rivals, name) -> None:
    if name == NODE and not is_ros2(transport):
        return  # names are unique there
    ours = transport.publisher(topic, JOINT_STATE)
    assert transport.other_publishers(topic) == frozenset()
    rivals.begin(topic, every=0.0, name=name)
    eventually(lambda: transport.other_publishers(topic), transport)
    ours.close()
    # over DDS a program is known before its name is
    eventually(
        lambda: [k.partition(" ")[0][-len(name) :] for k in transport.other_publishers(topic)] == [name], transport
    )
    rivals.kill(name)
    eventually(lambda: not transport.other_publishers(topic), transport)  # over DDS when its lease has run out


def served(transport: Transport) -> Any:
    """Return a server of a RAVEN-II whose arms are parked."""
    arm = ParkedArm(RAVEN_JOINTS, UNITS, np.zeros(7))
    return make_server(Serving(), transport, plants={"gold": arm, "green": arm})


def test_a_second_robot_of_a_name_is_refused_and_a_crashed_one_keeps_nobody_out_for_ever(transport, rivals) -> None:
    rivals.begin("/arm2/measured_js")
    eventually(lambda: transport.other_publishers("/arm2/measured_js"), transport)
    with pytest.raises(TransportError, match=r"/arm2/measured_js is published by /?rival: two robots of one name"):
        served(transport)
    assert "/arm1/setpoint_js" not in transport.topics()  # nobody has heard of it
    rivals.kill()
    begin = time.monotonic()
    served(transport).require_alone()
    assert time.monotonic() - begin < 1e-9 * transport.lapses[-1] + 5.0


def test_of_two_robots_that_begin_at_once_none_goes_on(transport, rivals) -> None:
    server = served(transport)
    rivals.begin("/arm2/measured_js", every=0.0)  # its ticks have not begun
    eventually(lambda: transport.other_publishers("/arm2/measured_js"), transport)
    with pytest.raises(TransportError, match="rival"):
        server.require_alone()


@pytest.mark.parametrize("name", ["/arm2/calibrated/measured_js", "/PSM1/measured_js"])
def test_joints_of_another_name_keep_no_robot_out(transport, rivals, name) -> None:
    rivals.begin(name)
    eventually(lambda: transport.other_publishers(name), transport)
    served(transport).require_alone()


def test_a_client_moves_no_arm_whose_joints_two_programs_publish(transport, rivals) -> None:
    rivals.begin("/arm1/measured_js", name="robot")
    joints = JointRanges(("a",), ("rad",), np.full(1, -1.0), np.full(1, 1.0))
    limits = {"connect_timeout": PATIENCE, "stale_after": PATIENCE}
    with CrtkClient(transport, dialect="crtk", joints=joints, **limits) as client:
        client.require_free()
        client.servo_jp([0.1])
        client.wait()
        rivals.begin("/arm2/measured_js", name="green")
        client.state_command("resume")
        rivals.begin("/arm1/measured_js")
        heard = client._latest["measured_js"].senders
        # by address: a program's node may be known late
        eventually(lambda: len({process.rpartition(" ")[2] for process in heard}) == 2, transport)
        doings: list[Callable[[], object]] = [
            client.require_free,
            lambda: client.servo_jp([0.2]),
            client.wait,  # sends the goal again
            *(partial(client.state_command, word) for word in ("resume", "enable", "home")),
        ]
        for do in doings:
            with pytest.raises(TransportError, match=r"published by /?rival and /?robot: two robots of one name"):
                do()
        with pytest.raises(NotReadyError, match="not confirmed"):  # they are said to both, who do not obey here
            client.state_command("pause", timeout=0.1)
        rivals.kill()
        client.transport.sleep(0.6)
        if (
            "" in heard
        ):  # rclpy before Kilted says of no message who sent it: a killed one is there until its lease ends
            eventually(lambda: len(transport.other_publishers("/arm1/measured_js")) < 2, transport)
        client.servo_jp([0.2])
