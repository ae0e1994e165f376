"""Served robots and rclpy itself, both ways: Kilted on Fast DDS 3, Jazzy on Fast DDS 2, their defaults."""

import threading
from collections.abc import Iterator

import numpy as np
import pytest

from catenary.crtk.dds.program import message_hash
from catenary.crtk.dds.transport import DdsTransport
from catenary.dvrk_psm import PSM_JOINTS
from catenary.nodes.serve import ParkedArm, Serving, make_server
from catenary.simulation.cable_plant import JOINTS, UNITS
from oracles.cable_arms import homed_plant
from oracles.psm_arms import homed_psm
from patience import until
from ros2 import DISTRIBUTIONS, Peer, python_of

pytestmark = pytest.mark.slow
JOINT_STATE = "sensor_msgs/JointState"


class Ticking:
    """A server that ticks in a thread, at its robot's rate where the machine has the time."""

    def __init__(self, serving: Serving, transport: DdsTransport) -> None:
        self.plant = homed_psm() if serving.kind.dvrk else homed_plant("left")
        plants = {"PSM1": self.plant}
        if not serving.kind.dvrk:
            plants = {"gold": self.plant, "green": ParkedArm(JOINTS, UNITS, self.plant.firmware.home_value)}
        self.server = make_server(serving, transport, plants=plants)
        self.transport, self._ends = transport, threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        rate = self.transport.rate(1000.0)
        while not self._ends.is_set():
            self.server.tick()
            rate.sleep()

    def end(self) -> None:
        self._ends.set()
        self._thread.join()


@pytest.fixture(scope="module", params=DISTRIBUTIONS)
def distro(request: pytest.FixtureRequest) -> str:
    python_of(request.param)  # skips where it is not installed
    return str(request.param)


@pytest.fixture(scope="module")
def peer(distro: str, dds_domain: int) -> Iterator[Peer]:
    with Peer(distro, dds_domain) as running:
        yield running


@pytest.fixture(scope="module", params=["raven", "crtk"])
def robot(request: pytest.FixtureRequest, peer: Peer, dds_domain: int) -> Iterator[Ticking]:
    """A RAVEN-II in its own dialect, a PSM in the present one."""
    serving = Serving() if request.param == "raven" else Serving(robot="dvrk_psm", dialect="crtk")
    with DdsTransport("catenary_robot", settle=0.05) as transport:
        running = Ticking(serving, transport)
        try:
            yield running
        finally:
            running.end()


def test_rclpy_hears_every_kind_of_message(robot: Ticking, peer: Peer) -> None:
    psm = robot.server.arms.keys() == {"PSM1"}
    place = "/PSM1" if psm else "/arm1"
    kinds = {
        f"{place}/setpoint_js": JOINT_STATE,
        f"{place}/setpoint_cv": "geometry_msgs/TwistStamped",
        "/diagnostics": "diagnostic_msgs/DiagnosticArray",
        f"{place}/setpoint_cp": f"geometry_msgs/{'PoseStamped' if psm else 'TransformStamped'}",
    }
    if psm:
        kinds |= {f"{place}/trajectory_j/ratio": "std_msgs/Float64", f"{place}/desired_state": "std_msgs/String"}
    for topic, kind in kinds.items():
        peer("hear", topic=topic, type=kind, latched="ratio" in topic or "desired" in topic)
    until(lambda: all(peer("count", topic=topic) for topic in kinds), every=0.1)
    joints = peer("last", topic=f"{place}/setpoint_js")
    assert tuple(joints["name"]) == (PSM_JOINTS if psm else JOINTS)
    assert len(joints["position"]) == len(joints["effort"]) == len(joints["name"])
    assert peer("last", topic="/diagnostics")["status"][0]["name"].startswith("catenary: ")
    if psm:
        assert peer("last", topic=f"{place}/trajectory_j/ratio") == {"data": 1.0}
        assert peer("last", topic=f"{place}/desired_state") == {"data": "HOMED"}


@pytest.mark.parametrize("reliable", [True, False])
def test_a_command_of_rclpy_moves_the_arm(robot: Ticking, peer: Peer, reliable: bool) -> None:
    psm = robot.server.arms.keys() == {"PSM1"}
    if psm:
        topic, values = "/PSM1/move_jr", {"name": ["outer_roll"], "position": [0.1]}
    else:
        robot.plant.state_command("enable")
        topic, values = "/arm1/servo_jr", {"name": ["shoulder"], "position": [0.001]}
    before = robot.plant.setpoint_js().q.copy()

    def moved_by_what_is_said() -> bool:
        # again and again: what is published before the reader on the other side knows of its writer is lost, as in any ROS 2
        assert peer("say", topic=topic, type=JOINT_STATE, values=values, reliable=reliable) >= 1
        return bool(np.abs(robot.plant.setpoint_js().q - before).max() > 5e-4)

    until(moved_by_what_is_said, every=0.5)


def test_states_and_state_commands_are_real_ones(robot: Ticking, peer: Peer) -> None:
    if not peer("has", package="crtk_msgs"):
        pytest.skip("crtk_msgs is not built for it: make test-ros2 does")
    place = "/PSM1" if robot.server.arms.keys() == {"PSM1"} else "/arm1"
    peer("hear", topic=f"{place}/operating_state", type="crtk_msgs/OperatingState", latched=True)
    until(lambda: peer("count", topic=f"{place}/operating_state"), every=0.1)
    asked = [("disable", "DISABLED", True), ("pause", "DISABLED", True)]
    if place == "/PSM1":  # which homes by command, in seconds
        asked += [("unhome", "DISABLED", False), ("enable", "ENABLED", False), ("home", "ENABLED", True)]
    said = {"topic": f"{place}/state_command", "type": "crtk_msgs/StringStamped"}
    peer("say", times=0, values={}, **said)
    until(lambda: robot.transport.connections(said["topic"]).publishers, every=0.05)

    def is_heard() -> bool:
        peer("say", values={"string": "disable"}, **said)
        return bool(peer("last", topic=f"{place}/operating_state")["state"] == "DISABLED")

    until(is_heard, every=0.5)  # what a writer says before it knows of our reader is lost
    for command, *wanted in asked:
        peer("say", values={"string": command}, **said)

        def is_so(wanted: list[object] = wanted) -> bool:
            state = peer("last", topic=f"{place}/operating_state")
            return [state["state"], state["is_homed"]] == wanted

        until(is_so, every=0.1)
    before = peer("count", topic=f"{place}/operating_state")
    if place == "/PSM1":  # a command that changes nothing is answered too
        peer("say", values={"string": "disable"}, **said)
        peer("say", values={"string": "disable"}, **said)
        until(lambda: peer("count", topic=f"{place}/operating_state") >= before + 4, every=0.1)
    robot.plant.state_command("enable")


def test_the_graph_names_the_node_the_types_and_the_qualities(robot: Ticking, peer: Peer, distro: str) -> None:
    psm = robot.server.arms.keys() == {"PSM1"}
    topic = "/PSM1/measured_js" if psm else "/arm1/setpoint_js"
    until(lambda: "/catenary_robot" in peer("nodes"), every=0.1)
    until(lambda: peer("ends", topic=topic), every=0.1)
    name, kind, found_hash, reliability, durability = peer("ends", topic=topic)[-1]
    # Fast DDS 3 lists the node, and does not see that its topics are its own
    known = "_CREATED_BY_BARE_DDS_APP_" if distro == "kilted" else "catenary_robot"
    assert (name, kind) == (known, "sensor_msgs/msg/JointState")
    assert message_hash(JOINT_STATE).partition("RIHS01_")[2] in found_hash
    assert (reliability, durability) == ("RELIABLE", "VOLATILE")
    state = peer("ends", topic="/PSM1/operating_state" if psm else "/arm1/operating_state")[-1]
    assert state[4] == ("TRANSIENT_LOCAL")
    assert [name for name in peer("services") if not name.startswith("/rosout")] == []


def test_what_ours_hear_of_rclpy_is_each_message_once(peer: Peer, dds_domain: int) -> None:
    with DdsTransport("lab", settle=0.05) as lab:
        for quality in ({}, {"reliable": False}, {"latched": True}):
            topic = f"/theirs/joints_{len(quality)}_{'_'.join(quality)}"
            heard = lab.subscribe(topic, JOINT_STATE)
            values = {"name": ["a", "b"], "position": [1.5, -2.0]}
            # a publisher of a depth of 10 drops the oldest of 20 while a busy machine does not receive
            said = {"topic": topic, "type": JOINT_STATE, "values": values, "depth": 100, **quality}

            # what a writer says before it knows of our reader is lost, and it knows later than we do
            first = said | {"values": values | {"position": [0.0, 0.0]}}

            def is_heard(first=first, heard=heard) -> bool:
                peer("say", **first)
                return len(heard) > 0

            until(is_heard, every=0.5)
            peer("say", times=20, **said)
            least = 20 if quality.get("reliable", True) else 1  # best effort may lose some
            found = []

            def are_there(heard=heard, found=found, least=least) -> bool:
                found.extend(one.message for one in heard.take() if one.message.position[0] != 0.0)
                return len(found) >= least

            until(are_there, every=0.05)
            assert len(found) <= 20
            assert all((m.name, list(m.position)) == (("a", "b"), [1.5, -2.0]) for m in found)
