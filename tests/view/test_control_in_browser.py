"""A served robot, taken for a real one over ROS 2's DDS, moved from a browser: while a button is held, and no longer."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from catenary.crtk.dds.transport import DdsTransport
from catenary.crtk.inbox import Subscription
from catenary.crtk.message import message_class
from catenary.crtk.topic_names import JOINT_STATE, find_topic
from dds import Network
from patience import PATIENCE, until
from ros import COMMAND, PATIENT_COMMAND, Program
from view.browser import LookedAtPage, looked_at

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1200)]

RATE = "100"  # Hz at which its state comes; a browser drawn in software is no real-time system
GOAL = find_topic("raven", "servo_jp", "gold", None).name


@pytest.fixture
def network(monkeypatch: pytest.MonkeyPatch) -> Iterator[Network]:
    network = Network()
    for name in ("CYCLONEDDS_URI", "ROS_DOMAIN_ID"):
        monkeypatch.setenv(name, network.environment[name])
    with Program(network, COMMAND, "serve", "--ros", "2", "--homed", "--start", "--rate", RATE, "--json") as server:
        server.line()
        yield network


@pytest.fixture
def listener(network: Network) -> Iterator[DdsTransport]:
    with DdsTransport("planner", settle=0.05) as transport:
        yield transport


@contextmanager
def view(network: Network, *options: str) -> Iterator[str]:
    """`catenary view` beside the robot; yields the address of its page."""
    arguments = ("view", "raven2", "--ros", "2", "--port", "18300", "--no-notes", *options)
    with Program(network, PATIENT_COMMAND, *arguments) as program:
        while not (found := re.search(r"http://127\.0\.0\.1:\d+/[\w-]+/", program.line())):
            pass
        yield found[0]
        program.interrupt()
        program.finish()


def taken(commands: Subscription) -> list[np.ndarray]:
    return [np.array(received.message.position) for received in commands.take()]


def press(looked: LookedAtPage, label: str) -> None:
    """Press the mouse's button on one of the page's, and keep it down."""
    button = looked.page.get_by_role("button", name=label, exact=True)
    button.scroll_into_view_if_needed(timeout=1e3 * PATIENCE)
    box = button.bounding_box()
    looked.page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    looked.page.mouse.down()


def test_nothing_leaves_without_control(network: Network, listener: DdsTransport) -> None:
    commands = listener.subscribe(GOAL, JOINT_STATE)
    with view(network) as url, looked_at(url) as looked:
        looked.page.wait_for_timeout(2000)
        assert looked.page.get_by_role("button", name="shoulder +").count() == 0
        assert looked.page.locator("text=PAUSED, homed").count() == 1
    assert taken(commands) == []


def test_held_button_moves_the_robot_and_letting_go_pausing_or_leaving_stops_it(
    network: Network, listener: DdsTransport
) -> None:
    commands = listener.subscribe(GOAL, JOINT_STATE, depth=100_000)
    with view(network, "--control", "--simulated") as url:
        with looked_at(url) as looked:
            start = looked.joint("shoulder")
            press(looked, "shoulder +")
            looked.page.locator("text=does not move: the robot is PAUSED").wait_for(timeout=1e3 * PATIENCE)
            looked.page.mouse.up()
            assert taken(commands) == []
            resume(looked)
            press(looked, "shoulder +")
            until(lambda: looked.joint("shoulder") > start + 0.5, every=0.2)
            looked.page.mouse.up()
            until(lambda: at_rest(looked, commands))
            sent = taken(commands)
            assert len(sent) > 10
            steps = np.diff([goal[0] for goal in sent])
            assert (steps >= -1e-9).all()
            looked.page.get_by_role("button", name="pause", exact=True).first.click()
            looked.page.locator("text=PAUSED, homed").wait_for(timeout=1e3 * PATIENCE)
            taken(commands)
            press(looked, "shoulder -")
            looked.page.wait_for_timeout(2000)
            assert taken(commands) == []
            looked.page.mouse.up()
            resume(looked)
            press(looked, "shoulder -")
            until(lambda: len(commands) > 20)
        # the browser is gone while the button was held
        state = listener.subscribe(
            find_topic("raven", "operating_state", "gold", None).name, "crtk_msgs/OperatingState"
        )
        until(lambda: any(received.message.state == "PAUSED" for received in state.take()))
        taken(commands)
        listener.sleep(1.0)
        assert taken(commands) == []


def resume(looked: LookedAtPage) -> None:
    looked.page.get_by_role("button", name="resume", exact=True).first.click()
    looked.page.locator("text=ENABLED, homed").wait_for(timeout=1e3 * PATIENCE)


def at_rest(looked: LookedAtPage, commands: Subscription) -> bool:
    before = len(commands), looked.joint("shoulder")
    looked.page.wait_for_timeout(1000)
    return len(commands) == before[0] and abs(looked.joint("shoulder") - before[1]) < 0.05


def test_robot_that_another_program_moves_is_refused(network: Network, listener: DdsTransport) -> None:
    publisher = listener.publisher(GOAL, JOINT_STATE)
    arguments = ("view", "raven2", "--ros", "2", "--port", "18300", "--control", "--simulated")
    with Program(network, PATIENT_COMMAND, *arguments) as program:
        goal = message_class(JOINT_STATE)()
        while program.process.poll() is None:
            publisher.publish(goal)
            listener.sleep(0.05)
        _, errors = program.finish()
    assert program.process.returncode != 0
    assert "planner holds the arm" in errors
