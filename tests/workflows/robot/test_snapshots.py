from itertools import islice

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.crtk.loopback import Loopback
from catenary.crtk.message import message_class
from catenary.crtk.message_values import joint_state_message
from catenary.crtk.topic_names import JOINT_STATE
from catenary.errors import TransportError
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot
from catenary.workflows.robot.snapshots import watch_robot
from oracles.crtk_robot import RobotOnLoopback, robot_over
from oracles.encoded_plant import EncodedPlant
from oracles.ideal_plant import IdealPlant, ideal_robot

START = np.array([0.8, 1.5, 0.4])


class Ticking:
    """A clock on which every look takes a millisecond."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        self.now += 0.001
        return self.now


def test_a_robot_is_only_read() -> None:
    watched = ideal_robot(START)
    list(islice(watch_robot(watched, clock=Ticking()), 10))
    assert watched.plant.setpoints == []


def test_gravity_torque_is_that_of_the_reported_gravity() -> None:
    sample = next(watch_robot(ideal_robot(START), clock=Ticking()))
    assert_allclose(sample.gravity_tau, gravity_torque(load_robot("raven2"), START, sample.gravity))


def test_a_sample_comes_25_times_a_second() -> None:
    clock = Ticking()
    samples = watch_robot(ideal_robot(START), clock=clock)
    next(samples)
    begin = clock.now
    list(islice(samples, 25))
    assert clock.now - begin == pytest.approx(1.0, abs=0.05)  # a tick per sample late at most


def test_a_robot_late_with_its_first_state_is_waited_for_a_while() -> None:
    class Late(IdealPlant):
        since = 3000

        def measured_js(self):
            if self.ticks < self.since:
                raise TransportError("nothing has come from the robot")
            return super().measured_js()

    watched = ideal_robot(START, kind=Late)
    assert next(watch_robot(watched, clock=Ticking())).silent is None
    watched.plant.since, watched.plant.ticks = 100_000, 0
    with pytest.raises(TransportError, match="nothing has come"):
        next(watch_robot(watched, clock=Ticking()))


def test_joints_that_a_model_deployed_beside_calibrates_are_shown() -> None:
    setup = RobotOnLoopback(EncodedPlant())
    watched, client = robot_over(setup.transport, simulated=True)
    other = Loopback("deploy", setup.network)
    positions = other.publisher("/arm1/calibrated/measured_js", JOINT_STATE)
    validity = other.publisher("/arm1/calibrated/is_valid", "std_msgs/Bool")
    with client:
        samples = watch_robot(watched, every=0.0)
        assert next(samples).calibrated is None
        q = client.measured_js().q + 0.01
        positions.publish(joint_state_message(client.joint_names, 1, q))
        validity.publish(message_class("std_msgs/Bool")(False))
        shown = next(samples)
        assert_allclose(shown.calibrated, q)
        assert shown.inside.tolist() == [False] * 3 + [True] * 4
        assert shown.interval is None
        intervals = other.publisher("/arm1/calibrated/interval", JOINT_STATE)
        intervals.publish(joint_state_message(client.joint_names[:3], 2, np.array([0.01, 0.02, 0.001])))
        assert_allclose(next(samples).interval, [0.01, 0.02, 0.001, *[np.nan] * 4])
        silent = list(islice(samples, 250))[-1]  # ticks of 1 ms, in which nobody publishes
    assert np.isnan(silent.calibrated).all()
