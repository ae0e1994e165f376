from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.conversions import joint_values, operating_state_message
from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.devices.encoder_board import EncoderBoard
from catenary.errors import InputError
from catenary.nodes import encoders as encoder_node
from catenary.nodes.encoders import STATE_TOPIC, EncoderNode, publish_encoders
from catenary.plant import OperatingState
from oracles.manual_time import ManualTime
from oracles.simulated_encoders import SimulatedEncoders
from patience import until

JOINTS = ("shoulder", "elbow", "insertion")
AWAY, STOPS = np.array([3000.0, 26_000.0, 100_000.0]), np.array([0.0, 30_000.0, 112_000.0])


class Rig:
    """A board, its node, a robot that tells its state, and a listener."""

    def __init__(self, folder: Path) -> None:
        network = LoopbackNetwork()
        self.now = 10.0
        self.board = SimulatedEncoders(folder / "encoders")
        self.driver = EncoderBoard(str(self.board.link), clock=lambda: self.now)
        self.board.write(b"\n7\n")
        self.transport, listener = Loopback("node", network), Loopback("listener", network)
        self.node = EncoderNode(self.driver, self.transport)
        self.robot = Loopback("robot", network)
        self.state = self.robot.publisher(STATE_TOPIC, "crtk_msgs/operating_state")
        self.counts = listener.subscribe("/joint_enc", "sensor_msgs/JointState")
        self.positions = listener.subscribe("/ext_jpos", "sensor_msgs/JointState")

    def send(self, row) -> None:
        self.now += 0.01
        before = self.driver.tally.rows
        self.board.send(row)
        until(lambda: self.driver.tally.rows > before, every=0.0005)
        self.node.step()

    def tell(self, homed: bool, busy: bool) -> None:
        state = OperatingState("ENABLED", homed, busy)
        self.state.publish(operating_state_message(state, self.robot.now()))
        self.node.step()

    def home(self) -> None:
        self.tell(homed=False, busy=True)
        for share in (*np.linspace(0.0, 1.0, 60), *[1.0] * 5, *np.linspace(1.0, 0.0, 60)):
            self.send(np.round(AWAY + share * (STOPS - AWAY)))
        self.tell(homed=True, busy=False)

    def close(self) -> None:
        self.driver.close()
        self.board.close()


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    rig = Rig(tmp_path)
    yield rig
    rig.close()


def test_counts_are_published_as_they_come_and_positions_not_before_homing(rig):
    rig.send([1, -2, 3])
    rig.send([2, -2, 3])
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
    assert_allclose(
        joint_values(position.message, JOINTS), rig.driver.reading().q_encoder, rtol=0.0, atol=0.0
    )
    assert_array_equal(joint_values(count.message, JOINTS), AWAY)
    assert position.message.header.stamp == count.message.header.stamp
    status = rig.node.status(1.0)
    assert status.robot == "ENABLED homed"
    assert status.subscribers == 1
    assert status.as_data()["is_valid"]


def test_positions_end_when_the_counts_are_lost(rig):
    rig.home()
    rig.positions.take()
    lost = AWAY + np.array([40_000.0, 0.0, 0.0])
    tally = rig.driver.tally
    for _ in range(10):
        before = tally.rows + tally.rejected
        rig.board.send(lost)
        until(lambda before=before: tally.rows + tally.rejected > before, every=0.0005)
        rig.now += 0.01
    assert tally.losses == 1
    rig.node.step()
    assert rig.positions.take() == []
    assert "home the robot again" in rig.node.status(1.0).reading.reason


def test_a_robot_that_homes_again_is_registered_anew(rig):
    rig.home()
    rig.tell(homed=False, busy=True)
    rig.positions.take()
    rig.send(AWAY)
    assert rig.positions.take() == []


def test_publishing_ends_after_its_duration_with_a_status(rig, monkeypatch):
    monkeypatch.setattr(encoder_node, "time", ManualTime())
    shown = []
    final = publish_encoders(rig.node, duration=1.2, show=shown.append)
    assert len(shown) == 1
    assert final.seconds >= 1.2
    assert not final.reading.is_valid
    with pytest.raises(InputError, match="duration"):
        publish_encoders(rig.node, duration=0.0)
