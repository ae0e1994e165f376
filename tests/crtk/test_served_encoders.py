import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.recording.topics import EXT_JPOS, JOINT_ENC
from catenary.simulation.cable_plant import CablePlant
from served_robot import ServedRobot


def hear(robot, topic):
    return robot.client.subscribe(topic.name, topic.type, depth=10_000)


def positions(subscription):
    return np.array([message.position for message, _ in subscription.take()])


@pytest.fixture(scope="module")
def robot():
    return ServedRobot()


def test_both_topics_come_a_hundred_times_a_second(robot):
    heard = [hear(robot, topic) for topic in (EXT_JPOS, JOINT_ENC)]
    robot.tick(1150)
    for one in heard:
        stamps = [message.header.stamp for message, _ in one.take()][-100:]
        assert_allclose(np.diff(stamps), 1e7)
        one.close()


def test_they_move_as_the_joints_do_and_not_as_the_robot_believes(robot):
    counts, read = hear(robot, JOINT_ENC), hear(robot, EXT_JPOS)
    robot.tick(130)
    begin, believed = robot.plant.telemetry()["q_true"], robot.plant.measured_js().q[:3]
    for _ in range(200):
        robot.joints("servo_jr", [2e-3, 1e-3, 2e-5, 0, 0, 0, 0])
        robot.tick()
    robot.tick(1000)  # at rest
    true = robot.plant.telemetry()["q_true"] - begin
    believed = robot.plant.measured_js().q[:3] - believed
    c, q = positions(counts), positions(read)
    moved = q[-1] - q[0]
    assert (np.abs(moved) > [0.2, 0.1, 5e-4]).all()  # they do move
    resolution = 1.0 / robot.plant.rig.counts
    assert (np.abs(moved - true) < 3.0 * resolution + 1e-3 * np.abs(true)).all()
    assert (np.abs(believed - true) > np.abs(moved - true)).all()
    assert (c == np.rint(c)).all()
    assert_allclose((c[-1] - c[0]) * resolution, moved, rtol=1e-9)
    counts.close()
    read.close()


def test_an_arm_that_is_not_homed_has_counts_and_no_positions():
    robot = ServedRobot(plant=CablePlant(side="left"))
    counts, read = hear(robot, JOINT_ENC), hear(robot, EXT_JPOS)
    robot.tick(200)
    assert len(positions(counts)) > 5
    assert len(positions(read)) == 0
    assert EXT_JPOS.name in robot.client.topics()  # whoever waits for the encoders' program sees it run


def test_the_present_convention_knows_no_such_topics():
    robot = ServedRobot("crtk")
    robot.tick(5)
    assert EXT_JPOS.name not in robot.client.topics()
