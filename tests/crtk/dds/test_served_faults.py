"""What happens to a robot served over DDS when programs are killed, meet over one arm, or lose their network."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from catenary.crtk.dds.transport import DdsTransport
from catenary.crtk.message import header, message_class
from dds import Network
from network_namespaces import ENTER, cable
from patience import until
from ros import COMMAND, Program

JointState, StringStamped = message_class("sensor_msgs/JointState"), message_class("crtk_msgs/StringStamped")
SPEED = 0.1  # [rad/s] of the shoulder, of the client that moves it
HOLDS = 1.0  # [s] after its last command until an arm stands: a tenth, and what a busy machine is late
LATE = 0.25  # [s] between two setpoints on a busy machine; without room to send, half a second to two
# moves the shoulder 100 times a second, steadily from where it is; on a line it begins anew
CLIENT = f"""
import sys, threading, time
import numpy as np
from catenary.crtk.dds.transport import DdsTransport
from catenary.crtk.message import header, message_class
transport = DdsTransport("first")
publisher = transport.publisher("/arm1/servo_jp", "sensor_msgs/JointState")
heard = transport.subscribe("/arm1/setpoint_js", "sensor_msgs/JointState", depth=1)
anew = threading.Event()
anew.set()
threading.Thread(target=lambda: [anew.set() for _ in sys.stdin], daemon=True).start()
start = None
while True:
    came = heard.take()
    if anew.is_set() and came:
        anew.clear()
        start, begin = came[-1].message.position.copy(), time.monotonic()
    if start is not None:
        goal = start.copy()
        goal[0] += {SPEED} * (time.monotonic() - begin)
        publisher.publish(message_class("sensor_msgs/JointState")(header(transport.now()), (), goal))
    time.sleep(0.01)
"""
# on the robot's side: enables it, keeps its setpoints and what it says until a line comes
OBSERVER = """
import json, sys, threading, time
from catenary.crtk.dds.transport import DdsTransport
from catenary.crtk.message import message_class
transport = DdsTransport("observer")
command = transport.publisher("/arm1/state_command", "crtk_msgs/StringStamped")
setpoints = transport.subscribe("/arm1/setpoint_js", "sensor_msgs/JointState", depth=100_000)
states = transport.subscribe("/arm1/operating_state", "crtk_msgs/OperatingState")
warnings = transport.subscribe("/arm1/warning", "std_msgs/String")
state = ""
while state != "ENABLED":
    command.publish(message_class("crtk_msgs/StringStamped")(string="enable"))
    time.sleep(0.5)
    state = ([state] + [one.message.state for one in states.take()])[-1]
print("enabled")
for line in sys.stdin:
    state = ([state] + [one.message.state for one in states.take()])[-1]
    print(json.dumps([state, [[1e-9 * m.header.stamp, m.position[0], 1e-9 * came] for m, came in setpoints.take()],
                      [m.data for m, _ in warnings.take()]]))
"""


@contextmanager
def served(network: Any, before: str = "") -> Iterator[Program]:
    """A homed robot, with nothing compiled on its way."""
    with Program(network, before + COMMAND, "serve", "--ros", "2", "--dialect", "crtk", "--homed", "--json") as server:
        server.line()
        yield server


def look(observer: Program) -> tuple[str, np.ndarray, list[str]]:
    """Last state, setpoints of the shoulder as rows of time [s], angle [rad], arrival [s], and warnings, since the last look."""
    observer.say("look")
    state, setpoints, warnings = json.loads(observer.line())
    return state, np.array(setpoints).reshape(-1, 3), warnings


def moves(observer: Program) -> None:
    """Wait until the shoulder moves in steps; enabling, which sets the setpoint to where the arm is, is one step."""

    def is_moving() -> bool:
        _, setpoints, _ = look(observer)
        return np.count_nonzero(np.diff(setpoints[:, 1])) > 5

    until(is_moving, every=0.2)


@pytest.mark.slow
def test_the_second_program_is_told_who_holds_the_arm_and_a_killed_one_leaves_it_standing_and_paused() -> None:
    network = Network()
    with pytest.MonkeyPatch.context() as patch:
        for name in ("CYCLONEDDS_URI", "ROS_DOMAIN_ID"):
            patch.setenv(name, network.environment[name])
        with served(network), Program(network, OBSERVER) as observer, DdsTransport("second") as second:
            assert observer.line() == "enabled"
            publisher = second.publisher("/arm1/servo_jp", "sensor_msgs/JointState")
            heard = second.subscribe("/arm1/setpoint_js", "sensor_msgs/JointState", depth=1)
            with Program(network, CLIENT) as first:
                moves(observer)
                until(lambda: len(heard) and second.connections("/arm1/servo_jp").subscribers)
                told: list[str] = []

                def is_told() -> bool:
                    for message, _ in heard.take():
                        back = message.position - np.array([0.1, *np.zeros(6)])
                        publisher.publish(JointState(header(second.now()), (), back))
                    _, setpoints, said = look(observer)
                    assert (np.diff(setpoints[:, 1]) >= 0.0).all()  # never towards the second one's goals
                    told.extend(line for line in said if "has to wait" in line)
                    return bool(told)

                until(is_told, every=0.05)
                assert "/second has to wait: /first holds the arm (/arm1/servo_jp)" in told[0]
                moves(observer)
                killed = time.time()
                first.process.kill()
                first.process.wait()
                said, rows, state = list[str](), list[np.ndarray](), ""

                def is_paused() -> bool:
                    nonlocal state
                    state, setpoints, new = look(observer)
                    rows.append(setpoints)
                    said.extend(new)
                    return state == "PAUSED" and any(
                        "/first was moving it and has disconnected" in line for line in said
                    )

                until(is_paused, every=0.1)  # ten seconds of its lease, and three
            after = np.concatenate(rows)
            standing = after[after[:, 0] > killed + HOLDS, 1]
            assert len(standing) > 1000
            assert np.ptp(standing) == 0.0


@pytest.mark.slow
def test_a_network_that_is_gone_for_three_seconds_leaves_the_arm_standing_and_makes_it_leap_nowhere() -> None:
    with cable() as (robot, client), served(robot, ENTER), Program(robot, ENTER + OBSERVER) as observer:
        assert observer.line() == "enabled"
        with Program(client, ENTER + CLIENT) as mover:
            moves(observer)
            look(observer)
            cut = time.time()
            client.set("down")
            time.sleep(3.0)
            client.set("up")
            said: list[str] = []
            rows = []

            def is_refused() -> bool:
                _, setpoints, new = look(observer)
                rows.append(setpoints)
                said.extend(new)
                return any("/arm1/servo_jp" in line for line in said)

            until(is_refused, every=0.1)  # the client went on in the dark, and is far away
            time.sleep(1.0)
            state, setpoints, _ = look(observer)
            after = np.concatenate([*rows, setpoints])
            assert state == "ENABLED"
            standing = after[after[:, 0] > cut + HOLDS]
            assert np.diff(after[:, 2]).max() < LATE  # who cannot be reached keeps nobody else waiting
            assert np.ptp(standing[:, 1]) == 0.0
            assert any("from its setpoint" in line or "old" in line for line in said), said
            mover.say("begin anew")  # both ways are open again
            moves(observer)
            _, setpoints, _ = look(observer)
            assert np.abs(np.diff(setpoints[:, 1])).max(initial=0.0) < 0.0026
