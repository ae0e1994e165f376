import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.crtk.gravity_topic import _IMU, _VECTOR, GravityTopic
from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.crtk.message import header, message_class
from catenary.crtk.message_values import joint_state_message
from catenary.errors import InputError
from catenary.gravity.torque import gravity_delta
from catenary.nodes.sensor_nodes import GravityNode, LevelBaseArm, publish
from catenary.robots.catalog import load_robot
from catenary.sensing.gravity_vector import Mailbox, tilted_gravity
from catenary.sensing.imu import SensedGravity
from catenary.sensing.mounting import Mounting
from catenary.spatial import rotation_about_z
from catenary.topics import SECOND
from oracles.ticking_clock import SetClock

XYZ = message_class("geometry_msgs/Vector3")
START = 1_700_000_000 * SECOND  # stamps are times of day, and large
TILTED = tilted_gravity(0.2, -0.1)


class World:
    """A sensor, the node and a listener, in a time that goes on by 10 ms."""

    def __init__(self, type_name=_IMU, *, mounting=None, points_down=False, arm=None, **options) -> None:
        network = LoopbackNetwork(clock=SetClock(START))
        self.sensor = Loopback("sensor", network)
        self.node_transport = Loopback("node", network)
        self.listener = listener = Loopback("listener", network)
        mailbox = Mailbox()
        topic = GravityTopic(self.node_transport, "/imu", type_name, mailbox, points_down=points_down)
        source = SensedGravity(mailbox, mounting, angular=type_name == _IMU, feed=topic.feed, **options)
        self.node = GravityNode(self.node_transport, source, urscript=None if mounting else "/script", arm=arm)
        self.joints = self.sensor.publisher("/joint_states", "sensor_msgs/JointState")
        self.deltas = listener.subscribe("/gravity/delta", "sensor_msgs/JointState")
        self.scripts = listener.subscribe("/script", "std_msgs/String")
        self.publisher = self.sensor.publisher("/imu", type_name)
        self.vectors = listener.subscribe("/gravity", _VECTOR)
        self.states = listener.subscribe("/gravity/status", "crtk_msgs/StringStamped")
        self.rng = np.random.default_rng(0)

    def message(self, vector):
        noisy = XYZ(*(vector + 0.01 * self.rng.normal(size=3)))
        head = header(self.sensor.now(), "imu_link")
        if self.publisher.type_name == _VECTOR:
            return message_class(_VECTOR)(head, noisy)
        rates = XYZ(*(0.001 * self.rng.normal(size=3)))
        return message_class(_IMU)(head, angular_velocity=rates, linear_acceleration=noisy)

    def run(self, seconds, vector=None):
        """Let time pass; the sensor reads `vector`, or nothing."""
        for _ in range(round(seconds / 0.01)):
            if vector is not None:
                self.publisher.publish(self.message(np.asarray(vector)))
            self.node_transport.sleep(0.01)
            reading = self.node.step()
        return reading

    def said(self):
        """The last vector and the last status."""
        message = self.vectors.take()[-1].message
        return np.array(message.vector), self.states.take()[-1].message.string


def test_an_imu_in_the_origin_carries_the_covariance_and_a_number_the_magnitude():
    world = World()
    imus, lengths = (
        world.listener.subscribe(*of) for of in (("/gravity/imu", _IMU), ("/gravity/magnitude", "std_msgs/Float64"))
    )
    reading = world.run(1.0, -TILTED)
    got = [arrived.message for arrived in imus.take()]
    first, last = got[0], got[-1]
    assert first.linear_acceleration_covariance[0] == -1.0  # that of a level base is not measured
    assert_allclose(last.linear_acceleration, -reading.gravity)
    assert_allclose(np.reshape(last.linear_acceleration_covariance, (3, 3)), reading.covariance)
    assert 0.0 < reading.covariance[0, 0] < 0.01
    assert lengths.take()[-1].message.data == pytest.approx(9.81, abs=0.05)


TURNED = rotation_about_z(0.5)  # R_base_imu
NOMINAL = np.array([0.0, 0.0, -9.81])


@pytest.mark.parametrize(
    ("type_name", "options", "read", "published", "status"),
    [
        (_IMU, {}, -TILTED, TILTED, "live"),
        (_IMU, {"mounting": Mounting(rotation=TURNED)}, -TURNED.T @ TILTED, TILTED, "live"),
        (_VECTOR, {"points_down": True}, TILTED, TILTED, "live"),
        (_VECTOR, {}, TILTED, NOMINAL, "upside_down"),
        (_IMU, {}, [0.0, 0.0, 1.0], NOMINAL, "unit_g"),
    ],
    ids=["imu", "mounted", "gravity itself", "wrong sign", "in g"],
)
def test_gravity_goes_out_where_the_reading_is_believed(type_name, options, read, published, status):
    world = World(type_name, **options)
    world.run(2.0, read)
    gravity, said = world.said()
    assert_allclose(gravity, published, atol=0.05)  # noise of 0.01 m/s2
    assert status in said


def test_vectors_are_in_the_base_frame_with_rising_stamps():
    world = World(mounting=Mounting(base="table"))
    world.run(0.2, -TILTED)
    received = world.vectors.take()
    assert {one.message.header.frame_id for one in received} == {"table"}
    stamps = [one.message.header.stamp for one in received]
    assert stamps == sorted(set(stamps))
    assert_allclose(np.diff(stamps), 0.01 * SECOND)


def test_a_driver_that_takes_gravity_away_is_named_with_those_known_to_do_it():
    world = World()
    world.run(2.0, np.zeros(3))
    final = publish(world.node, rate_hz=100.0, duration=0.05)
    assert any("gravity_stripped" in text and "dmpGetLinearAccel" in text for text in final.warnings)


def test_stop_publishes_nothing_but_says_so():
    world = World(fallback="stop")
    world.run(1.0, -TILTED)
    world.run(0.3)
    world.vectors.take()
    world.run(1.0)
    assert world.vectors.take() == []
    assert world.states.take()[-1].message.string == "stop interrupted"
    world.run(2.0, -TILTED)
    assert world.said()[1] == "live"  # a sensor that comes back is believed again


def test_the_rate_is_kept_the_status_shown_each_second_and_a_duration_of_nothing_refused():
    world = World()
    shown = []
    final = publish(world.node, rate_hz=50.0, duration=2.5, show=shown.append)
    assert final.published == 1 + 125
    assert [round(status.seconds) for status in shown] == [1, 2]
    assert final.subscribers == 1
    assert final.as_data()["faults"] == ["nothing_received"]
    assert final.seconds == pytest.approx((world.node_transport.steady() - START) / SECOND)
    with pytest.raises(InputError, match="duration"):
        publish(world.node, rate_hz=100.0, duration=0.0)


@pytest.mark.parametrize("by", [-3600, 3600])
def test_a_clock_that_is_set_costs_no_gravity_and_stamps_follow_it(by):
    world = World()
    world.run(2.0, -TILTED)
    world.node_transport.clock.ahead = by * SECOND
    world.run(2.0, -TILTED)
    assert world.said()[1] == "live"
    world.run(0.1, -TILTED)
    stamps = [one.message.header.stamp for one in world.vectors.take()]
    assert stamps[-1] == world.sensor.now()
    assert_allclose(np.diff(stamps), 0.01 * SECOND)
    final = publish(world.node, rate_hz=100.0, duration=0.5)  # durations are none of the clock's
    assert final.seconds == pytest.approx(0.5, abs=0.011)


def test_a_universal_robot_is_told_of_gravity_that_is_live_and_has_changed():
    world = World()
    world.run(0.5)
    assert not world.scripts.take()  # nominal
    world.run(3.0, -TILTED)
    (first, *others) = [each.message.data for each in world.scripts.take()]
    said = np.array([float(v) for v in first.partition("[")[2].partition("]")[0].split(",")])
    assert first.startswith("sec ")
    assert first.endswith("end\n")
    assert_allclose(said, -TILTED, atol=0.4)  # it may still be coming from that of a level base
    assert len(others) <= 2
    world.run(2.0, -tilted_gravity(0.1, -0.1))
    assert len(world.scripts.take()) >= 1


def test_what_a_level_base_firmware_leaves_over_is_told_of_joints_by_name():
    arm = load_robot("raven2")
    names, q = (*reversed(arm.joint_names), "gripper"), np.array([0.2, 1.4, 0.3])
    world = World(arm=LevelBaseArm(arm, "/joint_states"))
    world.run(2.0, -TILTED)
    assert not world.deltas.take()
    assert any("no joints on /joint_states" in w for w in publish(world.node, rate_hz=100.0, duration=0.02).warnings)
    world.joints.publish(joint_state_message(names, world.sensor.now(), [*q[::-1], 0.0]))
    world.run(0.03, -TILTED)
    message = world.deltas.take()[-1].message
    assert message.name == arm.joint_names
    gravity, _ = world.said()
    # g(q, gravity) - g(q, level); the gyroscope's noise is not yet used at rest
    assert_allclose(message.effort, gravity_delta(arm, q, gravity), atol=1e-9)
    world.joints.publish(joint_state_message(names[1:], world.sensor.now(), [*q[1::-1], 0.0]))
    world.run(0.03, -TILTED)
    assert "tells nothing of insertion" in publish(world.node, rate_hz=100.0, duration=0.02).warnings[-1]
