from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.crtk.message import header, message_class
from catenary.crtk.message_values import joint_state_message
from catenary.nodes.tool_node import WRENCH, ToolNode
from catenary.spatial import LEVEL
from catenary.topics import SECOND
from oracles.sensed_tool import ARM, POSE, RANGE, SensedTool
from oracles.ticking_clock import SetClock

XYZ, STRING = message_class("geometry_msgs/Vector3"), message_class("std_msgs/String")
RATE = 250  # [Hz] of sensor, joints and looks
PUSH = np.array([4.0, -2.0, 6.0, 0.1, 0.2, -0.1])


class World:
    """An arm with a sensor, the node, a gravity node's topic, and a listener, in a time that goes on by ticks."""

    def __init__(self, wrist: SensedTool, tool=None, *, gravity=False, shift=0, **options) -> None:
        network = LoopbackNetwork(clock=SetClock())
        self.wrist, self.arm, self.shift = wrist, Loopback("arm", network), shift
        self.time, listener, self.weighed = 0.0, Loopback("listener", network), []
        self.transport = Loopback("node", network)
        options = {"wait": 0.02, "inertia": True, **options}
        self.node = ToolNode(
            self.transport, ARM, tool, gravity="/gravity" if gravity else None, weighed=self.weighed.append, **options
        )
        self.wrenches, self.joints, self.commands, self.vectors = (
            self.arm.publisher(*of) for of in (
                ("/wrench", WRENCH), ("/joint_states", "sensor_msgs/JointState"),
                ("/tool/wrench/command", "std_msgs/String"), ("/gravity", "geometry_msgs/Vector3Stamped"),
            )
        )  # fmt: skip
        topic = "/tool/wrench"
        self.heard = {name: listener.subscribe(topic + name, WRENCH) for name in ("", "/deviation")}
        self.age = listener.subscribe(f"{topic}/age", "std_msgs/Float64")
        self.said = listener.subscribe(f"{topic}/status", "std_msgs/String")

    def run(self, seconds, at=None, *, push=np.zeros(6), joints=True, sensor=True, gravity=None):  # noqa: B008
        """Let time pass, in a motion or at rest; the sensor or the joints may be silent."""
        for _ in range(round(seconds * RATE)):
            motion = self.wrist.motion(self.time) if at is None else (at, 0.0 * at, 0.0 * at)
            stamp = self.arm.now() + self.shift
            if joints:
                q, qd = self.wrist.joints(self.time) if at is None else (at, 0.0 * at)
                names = (*reversed(ARM.joint_names), "gripper")
                self.joints.publish(joint_state_message(names, stamp, [*q[::-1], 0.0], [*qd[::-1], 0.0]))
            if gravity is not None:
                self.vectors.publish(
                    message_class("geometry_msgs/Vector3Stamped")(header(stamp, "base"), XYZ(*gravity))
                )
            if sensor:
                read = self.wrist.reads(self.wrist.load(*motion) + push, self.time)
                wrench = message_class("geometry_msgs/Wrench")(XYZ(*read[:3]), XYZ(*read[3:]))
                self.wrenches.publish(message_class(WRENCH)(header(stamp, "ft"), wrench))
            self.transport.sleep(1.0 / RATE)
            self.time += 1.0 / RATE
            self.node.step()

    def got(self, name=""):
        """Wrenches that came since, (N, 6)."""
        messages = [one.message.wrench for one in self.heard[name].take()]
        return np.array([[*message.force, *message.torque] for message in messages])

    def status(self):
        return [one.message.data for one in self.said.take()][-1]


def weigh(world: World, poses: int = 7, rng=None) -> None:
    rng = np.random.default_rng(0) if rng is None else rng
    for _ in range(poses):
        world.run(0.1)
        world.run(0.75, at=POSE + RANGE * rng.uniform(-1.0, 1.0, 6))


@pytest.fixture(scope="module")
def tool():
    """A tool that was weighed, and who carries it."""
    wrist = SensedTool(1)
    return wrist, wrist.weighed().weigh()[0]


def test_a_tool_is_weighed_over_topics_and_what_moves_it_taken_out():
    world = World(SensedTool(3), poses=7)
    world.run(0.1)
    assert world.status() == "weighing: 0 poses at rest of 7"
    weigh(world, 8)
    (found,) = world.weighed
    assert found.mass == pytest.approx(world.wrist.mass, rel=0.01)
    assert found.frame == ARM.tip
    world.got()
    world.run(2.0)
    assert np.sqrt(np.mean(world.got()[100:, :3] ** 2)) < 1.2 * world.wrist.noise[0]
    assert world.status() == "live"


def test_each_reading_goes_out_with_stamp_frame_age_and_deviation(tool):
    wrist, found = tool
    world = World(wrist, found, frame="base_link")
    world.run(0.5, at=POSE, push=PUSH)
    messages = [one.message for one in world.heard[""].take()]
    assert len(messages) == 120  # the last 20 ms wait for joints
    assert {message.header.frame_id for message in messages} == {"base_link"}
    assert_allclose(np.diff([message.header.stamp for message in messages]), SECOND / RATE)
    assert [one.message.data for one in world.age.take()][-1] == pytest.approx(0.024, abs=0.005)
    assert 0.0 < world.got("/deviation")[-1][0] < 0.2
    status = world.node.status(1.0)
    assert (status.published, status.subscribers, status.warnings) == (120, 1, ())
    assert status.as_data()["status"] == "live"


def test_zero_on_command_and_other_commands_are_told(tool):
    wrist, found = tool
    world = World(wrist, found)
    world.commands.publish(STRING("zero"))
    world.run(1.0, at=POSE, push=PUSH)
    world.got()
    world.run(0.5, at=POSE, push=PUSH)
    assert_allclose(world.got().mean(axis=0), 0.0, atol=0.05)
    world.commands.publish(STRING("tare"))
    world.run(0.1, at=POSE)
    assert 'command "tare": expected weigh, or zero' in world.status()
    world.commands.publish(STRING("weigh"))
    world.run(0.1, at=POSE)
    assert world.status() == "weighing: 0 poses at rest of 12"


def test_without_joints_or_gravity_nothing_is_published_and_the_status_says_so(tool):
    wrist, found = tool
    world = World(wrist, found, gravity=True)
    world.run(0.5, at=POSE, joints=False)
    assert (len(world.got()), world.status()) == (0, "no joints of ur10e on /joint_states")
    world.run(0.5, at=POSE)
    assert (len(world.got()), world.status()) == (0, "gravity is not live")
    world.run(0.5, at=POSE, gravity=LEVEL)
    assert len(world.got()) > 100
    assert world.status() == "live"
    world.run(1.0, at=POSE)
    assert world.status() == "gravity is not live"
    world.run(1.0, at=POSE, sensor=False)
    assert world.status() == "no wrenches on /wrench"


def test_a_tilted_base_is_taken_from_the_gravity_topic(tool):
    wrist, found = tool
    world = World(wrist, found, gravity=True)
    tilted = np.array([1.7, 0.0, -9.66])
    world.wrist = tilting = SensedTool(1)
    tilting.load = lambda *motion, load=tilting.load: load(*motion, tilted)
    world.run(1.0, at=POSE, gravity=tilted)
    assert_allclose(world.got()[50:].mean(axis=0), 0.0, atol=0.05)


@pytest.mark.parametrize("shift", [-3600 * SECOND, 3600 * SECOND])
def test_another_computers_clock_costs_nothing(tool, shift):
    wrist, found = tool
    world = World(wrist, found, shift=shift)
    world.run(0.5, at=POSE)
    assert len(world.got()) == 120


def test_a_left_handed_sensor_is_refused_and_says_why():
    world = World(SensedTool(5, axes=np.diag([1.0, 1.0, -1.0])), poses=6)
    weigh(world, 8)
    assert world.weighed == []
    assert "left-handed" in world.status()
    assert len(world.got()) == 0


def test_another_tool_than_the_files_is_told_after_some_poses(tool):
    wrist, found = tool
    world = World(wrist, replace(found, mass=0.8 * found.mass))
    weigh(world, 8)
    assert "the tool was changed" in world.status()
