import threading
import time
from typing import Any

import pytest

from catenary.crtk.clock import SECOND, ManualClock
from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.crtk.message import message_class
from catenary.crtk.transport import Spinner
from catenary.errors import InputError, TransportError
from patience import PATIENCE

TEXT = "std_msgs/String"


def text(data: str) -> Any:
    return message_class(TEXT)(data=data)


def pair(**options: Any) -> tuple[Loopback, Loopback]:
    network = LoopbackNetwork(**options)
    return Loopback("robot", network), Loopback("client", network)


def test_messages_are_stamped_by_the_networks_clock() -> None:
    robot, client = pair(clock=ManualClock(7 * SECOND))
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
    with pytest.raises(TransportError, match="offered are none"):
        client.call("/button", "std_srvs/Trigger")


def test_a_topic_that_nobody_uses_any_more_may_change_its_type() -> None:
    robot, _ = pair()
    robot.publisher("/mood", TEXT).close()
    robot.publisher("/mood", "std_msgs/Bool")


def test_one_thread_calls_and_serves_and_messages_sent_before_come_first() -> None:
    robot, client = pair()
    seen: list[str] = []

    def press(request: Any) -> Any:
        seen.append("pressed")
        return message_class("std_srvs/TriggerResponse")(success=True)

    robot.subscribe("/mood", TEXT, lambda one: seen.append(one.message.data))
    robot.service("/button", "std_srvs/Trigger", press)
    client.publisher("/mood", TEXT).publish(text("calm"))
    assert client.call("/button", "std_srvs/Trigger").success
    assert seen == ["calm", "pressed"]


def test_a_call_of_another_type_is_refused() -> None:
    robot, client = pair()
    robot.service("/button", "std_srvs/Trigger", lambda request: request)
    with pytest.raises(InputError, match="TriggerRequest, got String"):
        client.call("/button", "std_srvs/Trigger", text("press"))


def test_a_server_that_does_not_poll_is_not_waited_for() -> None:
    robot, client = pair(threaded=True)
    robot.service("/button", "std_srvs/Trigger", lambda request: request)
    with pytest.raises(TransportError, match=r"no answer within 0\.05 s"):
        client.call("/button", "std_srvs/Trigger", timeout=0.05)


def test_threads_exchange_messages_without_loss() -> None:
    robot, client = pair(threaded=True)
    echo = robot.publisher("/echo", TEXT)
    robot.subscribe("/say", TEXT, lambda one: echo.publish(one.message))
    heard, say = client.subscribe("/echo", TEXT, depth=5000), client.publisher("/say", TEXT)
    with Spinner(robot):
        sender = threading.Thread(target=lambda: [say.publish(text(str(i))) for i in range(900)])
        sender.start()
        got: list[int] = []
        end = time.monotonic() + PATIENCE
        while len(got) < 900 and time.monotonic() < end:
            got += [int(one.message.data) for one in heard.take(0.05)]
        sender.join()
    assert got == list(range(900))


def test_a_spinner_survives_a_callback_that_fails(caplog: pytest.LogCaptureFixture) -> None:
    robot, client = pair(threaded=True)
    got = threading.Event()

    def fail_first(one: Any) -> None:
        if one.message.data == "bad":
            raise RuntimeError("the callback is broken")
        got.set()

    robot.subscribe("/say", TEXT, fail_first)
    say = client.publisher("/say", TEXT)
    with Spinner(robot):
        say.publish(text("bad"))
        say.publish(text("good"))
        assert got.wait(PATIENCE)
    assert "the callback is broken" in caplog.text
