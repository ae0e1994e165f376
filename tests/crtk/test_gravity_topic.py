import numpy as np
import pytest

from catenary.crtk.gravity_topic import _ACCEL, _IMU, _VECTOR, GravityTopic
from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.crtk.message import header, message_class
from catenary.errors import InputError
from catenary.sensing.gravity_vector import Kind, Mailbox
from catenary.topics import SECOND
from oracles.ticking_clock import SetClock

XYZ = message_class("geometry_msgs/Vector3")
MINUS_ONE = np.array([-1.0, *[0.0] * 8])


def imu(stamp=7 * SECOND, force=(0.1, 0.2, 9.8), rates=(0.01, 0.02, 0.03), **more):
    return message_class(_IMU)(
        header(stamp, "imu_link"), angular_velocity=XYZ(*rates), linear_acceleration=XYZ(*force), **more
    )


def heard(type_name, *messages, **options):
    """What a mailbox holds of messages sent at 50 s."""
    network = LoopbackNetwork(clock=SetClock(50 * SECOND))
    sender, receiver, mailbox = Loopback("sensor", network), Loopback("node", network), Mailbox()
    topic = GravityTopic(receiver, "/sensor", type_name, mailbox, **options)
    publisher = sender.publisher("/sensor", type_name)
    for message in messages:
        publisher.publish(message)
    topic.feed(0.0)
    return topic, [mailbox.take() for _ in range(len(mailbox))]


def test_an_imu_gives_rates_then_specific_force_at_its_stamp():
    topic, samples = heard(_IMU, imu())
    assert samples == [(7.0, (0.01, 0.02, 0.03), Kind.ANGULAR_RATE), (7.0, (0.1, 0.2, 9.8), Kind.SPECIFIC_FORCE)]
    assert topic.frame_id == "imu_link"


def test_an_accel_gives_its_linear_part():
    accel = message_class("geometry_msgs/Accel")(XYZ(0.0, 1.0, 9.7), XYZ(5.0, 5.0, 5.0))
    _, samples = heard(_ACCEL, message_class(_ACCEL)(header(SECOND), accel))
    assert samples == [(1.0, (0.0, 1.0, 9.7), Kind.SPECIFIC_FORCE)]


@pytest.mark.parametrize(("points_down", "kind"), [(False, Kind.SPECIFIC_FORCE), (True, Kind.FREE_FALL)])
def test_a_vector_is_what_was_told(points_down, kind):
    message = message_class(_VECTOR)(header(SECOND), XYZ(0.0, 0.0, 9.8))
    _, samples = heard(_VECTOR, message, points_down=points_down)
    assert samples == [(1.0, (0.0, 0.0, 9.8), kind)]


def test_what_an_imu_does_not_measure_is_left_out_and_counted():
    topic, samples = heard(
        _IMU, imu(angular_velocity_covariance=MINUS_ONE), imu(linear_acceleration_covariance=MINUS_ONE)
    )
    assert [sample.kind for sample in samples] == [Kind.SPECIFIC_FORCE, Kind.ANGULAR_RATE]
    assert (topic.tally.without_rates, topic.tally.without_acceleration) == (1, 1)


def test_a_message_without_stamp_is_stamped_when_it_came():
    topic, samples = heard(_IMU, imu(stamp=0))
    assert samples[0].stamp == 50.0
    assert topic.tally.unstamped == 1


def test_numbers_that_are_none_pass_for_the_estimator_to_name():
    _, samples = heard(_IMU, imu(force=(np.nan, 0.0, np.inf)))
    assert np.isnan(samples[1].vector[0])


def test_another_type_is_refused():
    with pytest.raises(InputError, match="expected one of sensor_msgs/Imu"):
        heard("sensor_msgs/JointState")
