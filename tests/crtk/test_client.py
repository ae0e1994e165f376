"""A robot over messages; what holds for every plant is in contracts."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.client import CrtkClient
from catenary.crtk.loopback import Loopback, LoopbackNetwork
from catenary.crtk.message import message_class
from catenary.errors import InputError, NotReadyError, TransportError
from catenary.plant import JointRanges
from catenary.raven2.topics import JOINTS
from catenary.simulation.cable_plant import UNITS, CablePlant
from catenary.topics import SECOND
from catenary.workflows.robot.motion import pause
from oracles.cable_arms import homed_plant
from oracles.crtk_robot import CrtkRobot, RobotOnLoopback
from oracles.ideal_plant import IdealPlant
from oracles.ticking_clock import SetClock

START = [0.5, 1.2, 0.4, 0.0, 0.1, 0.2, -0.2]


def ideal(**options: Any) -> IdealPlant:
    return IdealPlant(START, joint_names=JOINTS, joint_units=UNITS, **options)


def connected(plant: Any, **options: Any) -> tuple[RobotOnLoopback, CrtkClient]:
    setup = RobotOnLoopback(plant)
    return setup, CrtkClient(setup.transport, **options)


def wait(client: CrtkClient, ticks: int) -> None:
    for _ in range(ticks):
        client.wait()


def test_missing_robot_is_reported_by_its_topics() -> None:
    clock = SetClock()
    with pytest.raises(TransportError, match="after 5 s") as caught:
        CrtkClient(Loopback("client", LoopbackNetwork(clock=clock)))
    for topic in ("/arm2/measured_js", "/arm1/setpoint_js", "/arm1/servo_jp", "/ravenstate"):
        assert topic in str(caught.value)
    assert_allclose(clock.elapsed() * 1e-9, 5.0, atol=0.02)


def test_robot_that_publishes_nothing_is_named_and_a_client_that_could_not_connect_leaves_nothing() -> None:
    setup = RobotOnLoopback(ideal())
    setup.robot.silent = True
    with pytest.raises(TransportError, match="/arm2/measured_js: robot sends nothing"):
        CrtkClient(setup.transport, connect_timeout=0.1)
    setup.robot.silent = False
    CrtkClient(setup.transport)


def test_each_arm_is_read_from_its_own_topics() -> None:
    """arm1's measured_js is the green arm's, its setpoint_js the gold one's."""
    setup, gold = connected(ideal())
    other = IdealPlant(np.array(START) + 0.1, joint_names=JOINTS, joint_units=UNITS)
    setup.clock.robots.append(CrtkRobot(Loopback("green", setup.network), other, arm="green", second=True))
    green = CrtkClient(setup.transport, arm="green")
    assert_allclose(gold.measured_js().q, START)
    assert_allclose(green.measured_js().q, other.measured_js().q)
    green.servo_jr(np.full(7, 1e-3))
    green.wait()
    assert_allclose(green.setpoint_js().q, np.array(START) + 0.101)
    assert_allclose(gold.setpoint_js().q, START)


def test_robot_with_other_joints_is_refused() -> None:
    setup = RobotOnLoopback(IdealPlant(START), dialect="crtk")
    with pytest.raises(InputError, match="joint0"):
        CrtkClient(setup.transport, dialect="crtk")


def test_robot_of_any_joints_is_taken_with_its_limits() -> None:
    setup = RobotOnLoopback(IdealPlant([0.1, 0.2], joint_names=("a", "b")), dialect="crtk")
    joints = JointRanges(("a", "b"), ("rad", "m"), np.array([-1.0, 0.0]), np.array([1.0, 0.5]))
    client = CrtkClient(setup.transport, dialect="crtk", joints=joints)
    client.servo_jp([2.0, 0.3])
    client.wait()
    assert_allclose(client.setpoint_js().q, [1.0, 0.3])  # the first at its limit


def test_silent_robot_is_refused() -> None:
    setup, client = connected(ideal(), stale_after=0.1)
    setup.robot.silent = True
    wait(client, 95)
    client.measured_js()
    wait(client, 10)
    for ask in (client.measured_js, client.setpoint_js, client.operating_state):
        with pytest.raises(TransportError, match="nothing has come from the robot"):
            ask()
    with pytest.raises(TransportError):
        client.servo_jp(START)


def test_what_waits_when_a_silence_seems_to_begin_is_let_in_first() -> None:
    """A program that stood still, and whose receiver did, is no robot that is silent."""
    setup, client = connected(ideal(), stale_after=0.1)
    setup.robot.silent = True
    setup.clock.sleep(0.11)
    setup.robot.silent = False
    client.measured_js()
    assert client.age < 0.1
    setup.robot.silent = True
    setup.clock.sleep(0.11)
    begin = setup.transport.steady()
    for _ in range(5):  # it waits once, not each time
        with pytest.raises(TransportError, match="nothing has come"):
            client.measured_js()
    assert setup.transport.steady() - begin <= 0.026 * 1e9


def test_far_goal_is_reached_in_clamped_steps() -> None:
    setup, client = connected(homed_plant())
    goal = client.setpoint_js().q + np.array([0.02, -0.02, 4e-4, 0.0, 0.0, 0.0, 0.0])
    client.servo_jp(goal)
    before = setup.robot.commands
    client.wait()
    # less one step of 2.5 mrad
    assert_allclose(np.abs(client.setpoint_js().q - goal).max(), 0.0175, atol=1e-9)
    wait(client, 7)
    assert_allclose(client.setpoint_js().q, goal, atol=1e-9)
    client.wait()
    assert setup.robot.commands - before == 8  # one message a tick, none when it is there


def test_lost_and_repeated_messages_move_no_joint_elsewhere() -> None:
    setup, client = connected(ideal())
    take = setup.robot._in["servo_jp"].take
    turn = iter(range(1000))

    def unreliable() -> list[Any]:
        came = take()
        return [came * 2, [], came][next(turn) % 3]

    setup.robot._in["servo_jp"].take = unreliable  # type: ignore[method-assign]
    for _ in range(100):
        client.servo_jr(np.full(7, np.deg2rad(0.003)))
        client.wait()
    wait(client, 3)
    assert_allclose(client.setpoint_js().q - START, np.deg2rad(0.3), rtol=1e-9)


def test_goal_is_forgotten_by_a_pause() -> None:
    setup, client = connected(homed_plant())
    client.servo_jp(client.setpoint_js().q + 0.02)
    setup.robot.plant.state_command("pause")  # the pedal
    wait(client, 2)
    setup.robot.plant.state_command("resume")
    held = setup.robot.plant.setpoint_js().q
    wait(client, 5)
    assert_array_equal(setup.robot.plant.setpoint_js().q, held)


def test_increments_begin_where_somebody_else_has_moved_the_robot() -> None:
    setup, client = connected(ideal())
    client.servo_jp(START)
    wait(client, 2)
    setup.robot.plant.servo_jp(np.array(START) + 0.1)
    client.wait()
    client.servo_jr(np.full(7, 0.01))
    client.wait()
    assert_allclose(client.setpoint_js().q, np.array(START) + 0.11)


def test_robot_that_restarts_is_not_enabled_by_what_was_asked_before() -> None:
    setup, client = connected(ideal())
    client.state_command("pause")
    client.state_command("resume")
    setup.unplug()
    setup.restart(ideal(ready=False))
    wait(client, 10)
    assert client.operating_state().state == "DISABLED"
    with pytest.raises(NotReadyError):
        client.servo_jp(START)


def test_homing_is_waited_for() -> None:
    setup, client = connected(ideal(ready=False))
    client.state_command("enable")
    plant = setup.robot.plant
    until = setup.robot.ticks + 700
    honest = plant.operating_state
    plant.operating_state = lambda: honest()._replace(is_homed=setup.robot.ticks > until)  # type: ignore[method-assign]
    client.state_command("home")
    assert client.operating_state().is_homed
    assert setup.robot.ticks > until


def test_transition_that_does_not_come_is_reported() -> None:
    _, client = connected(ideal(ready=False))
    with pytest.raises(NotReadyError, match="resume: not confirmed within 2 s; the robot is DISABLED, not homed"):
        client.state_command("resume")


def test_torques_are_those_at_the_joints() -> None:
    plant = homed_plant()
    _, client = connected(plant)
    for _ in range(20):
        client.servo_jr(np.array([1e-3, 1e-3, 2e-5, 0.0, 0.0, 0.0, 0.0]))
        client.wait()
    assert np.abs(plant.measured_js().tau).max() > 0.1
    assert_allclose(client.measured_js().tau, plant.measured_js().tau, rtol=1e-6)  # float32 on the way


@pytest.mark.parametrize(("side", "arm"), [("left", "gold"), ("right", "green")])
def test_motors_are_those_of_the_arm(side: str, arm: Any) -> None:
    plant = homed_plant(side)
    client = CrtkClient(RobotOnLoopback(plant, arm=arm).transport, arm=arm)
    assert_allclose(client.measured_js().q_motor, plant.measured_js().q_motor, rtol=1e-6)


def test_external_encoders_turn_to_nan_when_silent_and_where_there_are_none() -> None:
    setup, client = connected(homed_plant())
    assert_allclose(client.external_encoders(), setup.robot.plant.telemetry()["ext_jpos"])
    setup.robot._out.pop("ext_jpos")
    wait(client, 250)
    assert np.isnan(client.external_encoders()).all()
    without = RobotOnLoopback(CablePlant(), encoders=False)
    assert np.isnan(CrtkClient(without.transport).external_encoders()).all()


def test_gravity_is_nominal_where_nobody_publishes_it_or_what_cannot_be_gravity() -> None:
    setup, client = connected(ideal(), gravity="/gravity")
    vectors = Loopback("node", setup.network).publisher("/gravity", "geometry_msgs/Vector3Stamped")
    for nonsense in ((0.0, 0.0, -0.1), (np.nan, 0.0, -9.8)):
        vectors.publish(
            message_class("geometry_msgs/Vector3Stamped")(vector=message_class("geometry_msgs/Vector3")(*nonsense))
        )
    for state in (connected(ideal())[1].measured_js(), client.measured_js()):
        assert_array_equal(state.gravity, [0.0, 0.0, -9.81])
        assert state.gravity_age == np.inf


def test_gravity_that_a_node_publishes_points_down_and_ages_while_it_does_not_measure() -> None:
    setup, client = connected(ideal(), gravity="/gravity")
    node = Loopback("node", setup.network)
    vectors = node.publisher("/gravity", "geometry_msgs/Vector3Stamped")
    states = node.publisher("/gravity/status", "crtk_msgs/StringStamped", latch=True)
    vector = message_class("geometry_msgs/Vector3")
    for status, x in (("live", 1.7), ("fallback sensor_lost", 1.0)):
        states.publish(message_class("crtk_msgs/StringStamped")(string=status))
        vectors.publish(message_class("geometry_msgs/Vector3Stamped")(vector=vector(x, 0.0, -9.66)))
        client.wait()
        state = client.measured_js()
        assert_allclose(state.gravity, [x, 0.0, -9.66])  # what the node goes by
    assert_allclose(state.gravity_age, 0.002)  # since it was measured


@pytest.mark.parametrize("by", [-3600, 3600])
def test_commands_are_stamped_by_the_clock_as_it_is_set(by: int) -> None:
    setup, client = connected(ideal())
    heard = setup.transport.subscribe("/arm1/servo_jp", "sensor_msgs/JointState")
    for ahead in (0, by):
        setup.clock.ahead = ahead * SECOND
        client.servo_jp(START)
        client.wait()
        assert client.age < 0.01  # and it is heard
        assert 0 <= setup.clock.now() - heard.take()[-1].message.header.stamp <= 0.01 * SECOND


def test_a_robot_that_is_silent_is_asked_to_pause_all_the_same_and_not_waited_for() -> None:
    setup, client = connected(ideal(), stale_after=0.1)
    heard = setup.transport.subscribe("/arm1/state_command", "crtk_msgs/StringStamped")
    setup.robot.silent = True
    wait(client, 200)
    begin = setup.transport.steady()
    with pytest.raises(TransportError, match="nothing has come from the robot"):
        pause(client)
    assert setup.transport.steady() - begin < 0.3 * SECOND
    assert [one.message.string for one in heard.take()] == ["pause"]
