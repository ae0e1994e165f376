"""A robot that is only read: also a recording that is played back, where nobody obeys and few topics are there."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.crtk.client import CrtkClient
from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.crtk.message import header, message_class
from catenary.crtk.message_values import joint_state_message
from catenary.crtk.reader import CrtkReader
from catenary.errors import TransportError
from catenary.raven2.topics import JOINTS
from catenary.simulation.cable_plant import UNITS
from oracles.crtk_robot import RobotOnLoopback
from oracles.ideal_plant import IdealPlant
from oracles.ticking_clock import SetClock

NAMES = tuple(f"gold_{name}" for name in ("shoulder", "elbow", "ins", "roll", "wrist", "jaw1", "jaw2"))
Q = [0.5, 1.2, 0.4, 0.0, 0.1, 0.2, -0.2]


def played(runlevel: int = 3, sublevel: int = 0) -> tuple[LoopbackNetwork, CrtkReader]:
    """A reader of what the recordings of RAVEN's group hold: joints, and a throttled state."""
    network = LoopbackNetwork(clock=SetClock())
    bag, state = Loopback("rosbag", network), message_class("raven_2/raven_state")
    joints = bag.publisher("/arm2/measured_js", "sensor_msgs/JointState", latch=True)
    states = bag.publisher("/ravenstate_100hz", "raven_2/raven_state", latch=True)
    joints.publish(joint_state_message(NAMES, network.clock.now(), Q))
    states.publish(state(header(network.clock.now()), runlevel, sublevel, tau=np.ones(16, np.float32)))
    return network, CrtkReader(Loopback("reader", network))


def test_a_recording_that_is_played_is_as_good_as_a_robot_without_listeners():
    _, reader = played()
    state = reader.measured_js()
    assert_allclose(state.q, Q)
    assert np.isfinite(state.tau).all()
    assert np.isnan(reader.setpoint_js().q).all()


@pytest.mark.parametrize(
    ("level", "sublevel", "state", "is_homed", "is_busy"),
    [
        (0, 0, "DISABLED", False, False),
        (0, 1, "DISABLED", True, False),
        (1, 0, "ENABLED", False, True),
        (2, 1, "PAUSED", True, False),
        (3, 0, "ENABLED", True, False),
        (9, 0, "DISABLED", False, False),
    ],
)
def test_a_run_level_stands_for_the_state_that_nobody_publishes(level, sublevel, state, is_homed, is_busy):
    _, reader = played(level, sublevel)
    assert tuple(reader.operating_state()) == (state, is_homed, is_busy)


def test_what_is_missing_is_named():
    with pytest.raises(TransportError, match=r"/arm2/measured_js: nobody publishes it; /ravenstate: nobody"):
        CrtkReader(Loopback("reader", LoopbackNetwork(clock=SetClock())), connect_timeout=0.1)


@pytest.mark.parametrize("kind", [CrtkReader, CrtkClient])
def test_a_robot_whose_first_position_is_nan_is_waited_for(kind):
    setup = RobotOnLoopback(IdealPlant(Q, joint_names=JOINTS, joint_units=UNITS))
    said, ticks = setup.robot.publish, []

    def publish() -> None:
        said()
        ticks.append(1)
        if len(ticks) < 200:
            odd = message_class("sensor_msgs/JointState")(header(1), JOINTS, np.full(7, np.nan))
            setup.robot._out["measured_js"].publish(odd)

    setup.robot.publish = publish
    assert np.isfinite(kind(setup.transport).measured_js().q).all()
    assert len(ticks) >= 200
