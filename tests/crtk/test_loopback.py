from typing import Any

import pytest

from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.crtk.message import message_class
from catenary.errors import InputError, TransportError
from catenary.topics import SECOND
from oracles.ticking_clock import SetClock

TEXT = "std_msgs/String"


def text(data: str) -> Any:
    return message_class(TEXT)(data=data)


def pair(**options: Any) -> tuple[Loopback, Loopback]:
    network = LoopbackNetwork(**options)
    return Loopback("robot", network), Loopback("client", network)


def test_messages_are_stamped_by_the_networks_clock() -> None:
    robot, client = pair(clock=SetClock(7 * SECOND))
    heard = client.subscribe("/mood", TEXT)
    robot.sleep(0.5)
    robot.publisher("/mood", TEXT).publish(text("calm"))
    client.sleep(0.5)
    assert heard.take()[0].time == 7 * SECOND + SECOND // 2
    assert client.now() == 8 * SECOND


def test_a_name_that_is_taken_is_refused_until_it_is_free() -> None:
    robot, _ = pair()
    with pytest.raises(TransportError, match='"robot" is taken'):
        Loopback("robot", robot.network)
    robot.close()
    Loopback("robot", robot.network)


@pytest.mark.parametrize("name", ["", "a b", "/robot", "9"])
def test_a_name_that_is_none_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="name"):
        Loopback(name)


def test_a_robot_that_leaves_takes_its_topics_and_services_along() -> None:
    robot, client = pair()
    client.subscribe("/mood", TEXT)
    robot.publisher("/mood", TEXT)
    robot.service("/button", "std_srvs/Trigger", lambda request: None)
    robot.close()
    assert client.connections("/mood") == ((), ())
    assert client.topics() == {}
    client.service("/button", "std_srvs/Trigger", lambda request: None)  # nobody offers it any more
