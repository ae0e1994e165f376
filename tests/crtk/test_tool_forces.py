"""Forces, velocities and Jacobians at a served arm's tool, beside finite differences of its pose and the work they do."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.crtk.message import message_class
from catenary.crtk.message_values import pose_of
from catenary.crtk.serving.tool_pose import FrameOfForces as Frame
from catenary.crtk.serving.tool_pose import ToolPose, exerted, torques_for, wrench_of
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError
from catenary.robots.catalog import load_robot
from catenary.simulation.cable_plant import JOINTS
from catenary.spatial import rotation_vector
from oracles.cable_arms import ROBOTS, homed_plant
from served_robot import JointState, ServedRobot

H = 1e-6  # of central differences [rad|m]
Vector3 = message_class("geometry_msgs/Vector3")
Wrench = message_class("geometry_msgs/Wrench")
WrenchStamped = message_class("geometry_msgs/WrenchStamped")


@pytest.fixture(scope="module")
def robot() -> ServedRobot:
    """Homed and enabled, moved to where no axis of the tool is one of the base's."""
    robot = ServedRobot("crtk")
    robot.joints("move_jr", [0.2, -0.1, 0.03, 0.4, 0.3, -0.1, 0.5])
    robot.tick(1500)
    return robot


def wrench(values: Any) -> Any:
    return WrenchStamped(wrench=Wrench(Vector3(*values[:3]), Vector3(*values[3:])))


def moved(robot: ServedRobot, dq: np.ndarray) -> np.ndarray:
    """Twist (6,) of the tool in base axes for a change of joints, by central differences."""
    tool, q = robot.server.arms["gold"].tool, robot.server.arms["gold"].measured.q
    ahead, behind = tool.pose(q + H * dq), tool.pose(q - H * dq)
    turn = rotation_vector(ahead.rotation @ behind.rotation.T)
    return np.concatenate([ahead.position - behind.position, turn]) / (2.0 * H)


def in_frame(robot: ServedRobot, twist: np.ndarray, frame: Frame) -> np.ndarray:
    """The same twist of the tool in another frame."""
    pose = robot.server.arms["gold"].measured_tool.pose
    if frame is Frame.BODY:
        return np.concatenate([pose.rotation.T @ twist[:3], pose.rotation.T @ twist[3:]])
    if frame is Frame.SPATIAL:  # the velocity of the body's point that is at the base's origin
        return np.concatenate([twist[:3] - np.cross(twist[3:], pose.position), twist[3:]])
    return twist


@pytest.mark.parametrize("frame", Frame)
def test_jacobians_are_differences_of_the_pose(robot: ServedRobot, frame: Frame) -> None:
    message = robot.last(f"{frame.value}jacobian")
    matrix = message.data.reshape([dim.size for dim in message.layout.dim])
    expected = np.column_stack([in_frame(robot, moved(robot, dq), frame) for dq in np.eye(7)])
    assert_allclose(matrix, expected, atol=1e-7)  # central differences


@pytest.mark.parametrize("frame", Frame)
def test_torques_of_a_wrench_do_its_work(robot: ServedRobot, frame: Frame) -> None:
    """Virtual work: tau dq = F dx in every frame, for every motion of the joints that are pushed."""
    rng, arm = np.random.default_rng(0), robot.server.arms["gold"]
    force = rng.normal(size=6)
    tau = torques_for(arm.measured_tool, force, frame)
    assert np.isnan(tau[-2:]).all()  # jaws hold
    for _ in range(5):
        dq = np.concatenate([rng.normal(size=5), [0.0, 0.0]])
        assert_allclose(tau[:5] @ dq[:5], force @ in_frame(robot, moved(robot, dq), frame), atol=1e-6)


@pytest.mark.parametrize("frame", Frame)
def test_the_force_of_torques_does_their_work(robot: ServedRobot, frame: Frame) -> None:
    arm = robot.server.arms["gold"]
    beyond_weight = arm.measured.tau - arm.gravity_torque(arm.measured.q, arm.measured.gravity)
    force = exerted(arm.measured_tool, frame)
    for dq in np.eye(7)[:5]:
        assert_allclose(force @ in_frame(robot, moved(robot, dq), frame), beyond_weight @ dq, atol=1e-6)
    message = robot.last(f"{frame.value}measured_cf").wrench
    assert_allclose([*message.force, *message.torque], exerted(arm.measured_tool, frame), atol=1e-9)


def test_where_no_joint_feels_a_force_it_is_zero() -> None:
    j = np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 0.0])
    assert_allclose(wrench_of(j, np.arange(1.0, 7.0)), [1.0, 2.0, 3.0, 4.0, 5.0, 0.0])


def test_velocities_are_differences_of_poses_while_the_arm_moves() -> None:
    robot = ServedRobot("crtk")
    heard = {v: robot.hear(v) for v in ("measured_js", "measured_cv", "setpoint_cp", "setpoint_cv")}
    robot.joints("move_jr", [0.3, -0.2, 0.02, 0.3, 0.2, 0.0, 0.0])
    robot.tick(400)
    came = {v: [one.message for one in heard[v].take()] for v in heard}
    for k in (150, 250, 350):
        x = [pose_of(m).position for m in came["setpoint_cp"][k - 1 : k + 1]]
        v = np.array(came["setpoint_cv"][k].twist.linear)
        assert np.linalg.norm(v) > 2e-3
        assert_allclose(v, (x[1] - x[0]) / 0.001, atol=1e-4)  # the step's end stands for the step
        # of measured joint velocities; a RAVEN-II's leave the cables' coupling out, so its poses go otherwise
        q, qd = came["measured_js"][k].position, came["measured_js"][k].velocity
        tool = robot.server.arms["gold"].tool
        step = (tool.pose(q + H * qd).position - tool.pose(q - H * qd).position) / (2.0 * H)
        assert_allclose(came["measured_cv"][k].twist.linear, step, atol=1e-7)
    robot.tick(3000)
    assert_allclose(robot.last("setpoint_cv").twist.linear, 0.0, atol=0.0)


def test_a_force_pushes_the_arm_along_itself_and_lapses() -> None:
    """The haptic example: forces in base axes while gravity is compensated, then the arm holds again."""
    robot = ServedRobot("crtk")
    robot.say("use_gravity_compensation", message_class("std_msgs/Bool")(data=True))
    start, jaws = pose_of(robot.last("measured_cp")).position, robot.setpoint[-2:]
    for _ in range(60):
        robot.say("servo_cf", wrench([6.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
        robot.tick(5)
    way = pose_of(robot.last("measured_cp")).position - start
    assert way[0] > 2e-3
    assert way[0] > np.abs(way[1:]).max()  # an arm is not as heavy along every axis
    assert_allclose(robot.setpoint[-2:], jaws, atol=0.01)  # to where they are, when the force lapses
    robot.tick(150)
    held = robot.setpoint
    robot.tick(200)
    assert_allclose(robot.setpoint, held, atol=0.0)


def test_forces_below_body_turn_with_the_tool_unless_they_are_absolute(robot: ServedRobot) -> None:
    arm = robot.server.arms["gold"]
    robot.say("body/set_cf_orientation_absolute", message_class("std_msgs/Bool")(data=True))
    robot.tick(3)
    assert robot.last("body/measured_cf").header.frame_id == "base"
    force = np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0])
    robot.say("body/servo_cf", wrench(force))
    robot.tick(2)
    assert_allclose(arm._pushed if arm._pushed is not None else arm.measured.tau, arm.measured.tau, atol=1e-9)
    robot.say("body/set_cf_orientation_absolute", message_class("std_msgs/Bool")(data=False))
    robot.tick(300)
    assert robot.last("body/measured_cf").header.frame_id == "tool"


def test_the_jaws_are_pushed_while_the_arm_holds() -> None:
    robot = ServedRobot("crtk", plant=homed_plant("left", robot=ROBOTS[0]))  # without friction
    before = robot.plant.measured_js().q
    for _ in range(40):
        robot.say("jaw/servo_jf", JointState(effort=[0.05]))
        robot.tick(5)
    after = robot.plant.measured_js().q
    assert (after - before)[-2:].sum() > 0.05
    assert_allclose(after[:5], before[:5], atol=0.02)  # the tool's own axes give way a little
    robot.tick(150)
    assert robot.state() == "ENABLED"


Q = np.array([0.6, 1.5, 0.38, 0.2, -0.3, 0.5, 0.9])


def test_a_model_of_the_robots_own_joints_needs_no_jaws():
    model = load_robot("raven2")
    q = Q[:3]
    assert_allclose(ToolPose(model, JOINTS[:3]).pose(q).position, forward_kinematics(model, q).position)


def test_a_model_of_another_robot_is_refused():
    with pytest.raises(InputError, match="expected 7"):
        ToolPose(load_robot("two_link"), JOINTS)


def test_what_looks_for_joints_is_prepared_wherever_the_robot_is():
    for name, joints in (("raven2_full", JOINTS), ("two_link", ("joint1", "joint2"))):
        ToolPose(load_robot(name), joints).prepare()


def test_the_base_is_the_frame_0_of_a_robot_that_has_none():
    tool = ToolPose(load_robot("panda"), load_robot("panda").joint_names)
    pose = tool.pose(np.full(7, 0.2))
    for ours, expected in zip(tool.in_frame_0(pose), pose, strict=True):
        assert_allclose(ours, expected, atol=1e-15)
