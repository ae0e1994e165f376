"""As test_renewed_connections, with rospy's own latched publishers and TCP connections that are broken."""

import time
from collections.abc import Callable, Iterator

import pytest

from catenary.crtk.ros1.transport import Ros1Transport
from catenary.crtk.serving.server import Server
from catenary.nodes.serve import ParkedArm, Serving, make_server
from catenary.simulation.cable_plant import JOINTS, UNITS
from oracles.cable_arms import homed_plant
from patience import PATIENCE
from ros import NODE, Master, Program

CLIENT = """
import socket, sys
from catenary.crtk.ros1.transport import make_rospy_importable
from catenary.recording.messages import full_definition
make_rospy_importable()
import rospy
from genpy.dynamic import generate_dynamic
def made(name):
    return generate_dynamic(name, full_definition(name))[name]
Command, JointState = made("crtk_msgs/StringStamped"), made("sensor_msgs/JointState")
rospy.init_node("latching", disable_signals=True)
state = rospy.Publisher("/arm1/state_command", Command, latch=True, queue_size=1)
jr = rospy.Publisher("/arm1/servo_jr", JointState, latch=True, queue_size=1)
print("ready")
for line in sys.stdin:
    word, *rest = line.split()
    if word == "end":  # or the master would list it still
        rospy.signal_shutdown("the test ends")
    elif word == "break":  # as a cable that is pulled, or a router that forgets; then what was said meanwhile
        for publisher in (state, jr):
            for connection in publisher.impl.connections:
                connection._connection.socket.shutdown(socket.SHUT_RDWR)
        if rest:
            state.publish(Command(string=rest[0]))
    elif word == "move":
        jr.publish(JointState(position=[float(rest[0])] + [0.0] * 14))
    else:
        state.publish(Command(string=word))
    print("done")
"""


class Served:
    """A robot in this process, and a client in another."""

    def __init__(self, transport: Ros1Transport) -> None:
        self.plant = homed_plant("left")
        self.plant.state_command("pause")
        parked = ParkedArm(JOINTS, UNITS, self.plant.firmware.home_value)
        self.server: Server = make_server(Serving(), transport, plants={"gold": self.plant, "green": parked})
        self.heard = {
            verb: transport.subscribe(f"/arm1/{verb}", kind)
            for verb, kind in (("state_command", "crtk_msgs/StringStamped"), ("servo_jr", "sensor_msgs/JointState"))
        }
        self.server.tick()  # what is compiled on first use is compiled before anybody waits

    def meet(self, client: Program) -> None:
        self.client = client
        client.line()

    def until(self, claim: Callable[[], object]) -> None:
        end = time.monotonic() + PATIENCE
        while not claim():
            assert time.monotonic() < end, "did not come true"
            self.run(5)

    def run(self, ticks: int) -> None:
        for _ in range(ticks):
            self.server.tick()
            time.sleep(0.001)

    def say(self, line: str) -> None:
        self.client.say(line)
        assert self.client.line() == "done"

    @property
    def state(self) -> str:
        return str(self.plant.operating_state().state)


@pytest.fixture
def served(ros_master: Master) -> Iterator[Served]:
    with Ros1Transport(NODE) as transport:
        server = Served(transport)
        with Program(ros_master, CLIENT) as client:  # after the robot, or it would be one from before
            server.meet(client)
            yield server
            server.say("end")


def test_when_tcp_connections_are_renewed_nothing_is_obeyed_twice_nor_what_was_said_meanwhile(served):
    served.say("resume")
    served.until(lambda: served.state == "ENABLED")
    served.say("move 0.001")
    served.until(lambda: len(served.heard["servo_jr"]))
    served.plant.state_command("pause")
    served.say("break")
    served.until(lambda: served.heard["state_command"].repeated and served.heard["servo_jr"].repeated)
    served.run(300)
    assert served.state == "PAUSED"
    assert [one.message.string for one in served.heard["state_command"].take()] == ["resume"]
    assert len(served.heard["servo_jr"].take()) == 1
    served.say("pause")
    served.until(lambda: len(served.heard["state_command"]))
    served.heard["state_command"].take()
    served.say("break resume")
    served.until(lambda: len(served.heard["state_command"]))
    served.run(300)
    assert served.state == "PAUSED"
    assert any(kind.endswith("after a break") for kind in served.server.reports.kinds)
    served.say("resume")  # a new one
    served.until(lambda: served.state == "ENABLED")
