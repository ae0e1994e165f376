from collections.abc import Iterator
from pathlib import Path

import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.crtk.message_values import joint_values, operating_state_message
from catenary.crtk.transport import Clock
from catenary.nodes.sensor_nodes import STATE_TOPIC, EncoderNode
from catenary.plant import OperatingState
from catenary.topics import SECOND
from oracles.encoder_bench import AWAY, EncoderBench

JOINTS = ("shoulder", "elbow", "insertion")


class DayClock(Clock):
    """The machine's, of the day set by `ahead` [ns]."""

    ahead = 0

    def now(self) -> int:
        return super().now() + self.ahead


class Rig(EncoderBench):
    """A board, its node, a robot that tells its state, and a listener."""

    def __init__(self, link: Path) -> None:
        super().__init__(link)
        self.clock = DayClock()
        network = LoopbackNetwork(clock=self.clock)
        self.robot, listener = Loopback("robot", network), Loopback("listener", network)
        self.node = EncoderNode(self.driver, Loopback("node", network))
        self.state = self.robot.publisher(STATE_TOPIC, "crtk_msgs/operating_state")
        self.counts = listener.subscribe("/joint_enc", "sensor_msgs/JointState")
        self.positions = listener.subscribe("/ext_jpos", "sensor_msgs/JointState")

    def write(self, data: bytes) -> None:
        super().write(data)
        self.node.step()

    def tell(self, *, is_busy: bool, is_homed: bool) -> None:
        state = OperatingState("ENABLED", is_homed, is_busy)
        self.state.publish(operating_state_message(state, self.robot.now()))
        self.node.step()


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    rig = Rig(tmp_path / "encoders")
    yield rig
    rig.close()


def test_counts_are_published_as_they_come_and_positions_not_before_homing(rig):
    rig.send([1, -2, 3], [2, -2, 3])
    messages = [one.message for one in rig.counts.take()]
    assert [joint_values(m, JOINTS).tolist() for m in messages] == [[1, -2, 3], [2, -2, 3]]
    # a period apart, as the rows came
    assert messages[1].header.stamp - messages[0].header.stamp > 0
    assert rig.positions.take() == []


def test_the_robots_operating_state_registers_and_positions_follow(rig):
    rig.home()
    rig.counts.take()
    rig.send(AWAY)
    (position,), (count,) = rig.positions.take(), rig.counts.take()
    assert_allclose(joint_values(position.message, JOINTS), rig.driver.reading().q_encoder, rtol=0.0, atol=0.0)
    assert_array_equal(joint_values(count.message, JOINTS), AWAY)
    assert position.message.header.stamp == count.message.header.stamp
    status = rig.node.status(1.0)
    assert status.robot == "ENABLED homed"
    assert status.subscribers == 1
    assert status.as_data()["is_valid"]


def test_stamps_follow_a_clock_that_is_set_back(rig):
    rig.send([1, -2, 3])
    (before,) = rig.counts.take()
    rig.clock.ahead = -3600 * SECOND
    rig.send([2, -2, 3], [3, -2, 3])
    first, second = (one.message.header.stamp for one in rig.counts.take())
    assert before.message.header.stamp - first > 3500 * SECOND
    assert second > first
