"""A served MTM and ECM: what dVRK's classes and teleoperation use of them, call by call on a loopback."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.crtk.loopback import Loopback
from catenary.crtk.message import message_class
from catenary.crtk.message_values import command_message, pose_message, pose_of
from catenary.errors import InputError
from catenary.nodes.serve import Serving, make_server
from catenary.open_robot import Simulated, open_robot
from catenary.spatial import Pose, rotation_from_rpy, rotation_from_vector, rotation_vector
from served_robot import ServedDvrk, answered

pytest.importorskip("mujoco")
Bool, Empty, String = (message_class(f"std_msgs/{name}") for name in ("Bool", "Empty", "String"))
Quaternion, Vector3, Wrench = (message_class(f"geometry_msgs/{name}") for name in ("Quaternion", "Vector3", "Wrench"))
WrenchStamped, Impedance = message_class("geometry_msgs/WrenchStamped"), message_class("crtk_msgs/CartesianImpedance")
OF_ALL = {"measured_js", "setpoint_cp", "local/measured_cp", "servo_ci", "current_state", "period_statistics"}
OF_AN_MTM = {"gripper/measured_js", "gripper/closed", "orientation_locked", "lock_orientation", "unlock_orientation"}


def served(robot: str, name: str) -> ServedDvrk:
    return ServedDvrk(robot, name, open_robot(robot, Simulated()))


@pytest.fixture
def mtm():
    return served("dvrk_mtm", "MTMR")


@pytest.fixture
def ecm():
    return served("dvrk_ecm", "ECM")


def verbs(arm):
    return {topic.verb for topic in arm.server._dialect.topics}


def wrench(*force):
    return WrenchStamped(wrench=Wrench(force=Vector3(*force)))


@pytest.mark.slow
def test_no_tick_of_a_prepared_arm_compiles(tmp_path: Path):
    code = """
from numba.core import event
from catenary.nodes.serve import prepare_server
from catenary.open_robot import Simulated, open_robot
from served_robot import ServedDvrk
mtm = ServedDvrk("dvrk_mtm", "MTMR", open_robot("dvrk_mtm", Simulated()))
prepare_server(mtm.server)
with event.install_recorder("numba:compile") as compiled:
    mtm.joints("move_jp", mtm.setpoint + 1e-3)
    mtm.say("/MTMR/servo_cp", mtm.last("/MTMR/setpoint_cp"))
print(mtm.server.commands, [entry.data["dispatcher"] for _, entry in compiled.buffer])
"""
    caches = dict.fromkeys(("XDG_CACHE_HOME", "NUMBA_CACHE_DIR"), str(tmp_path))
    python = {**os.environ, **caches, "PYTHONPATH": os.pathsep.join(sys.path)}
    run = subprocess.run([sys.executable, "-c", code], env=python, capture_output=True, text=True, check=True)
    assert run.stdout == "2 []\n"


def test_each_kind_of_arm_has_its_own_topics_and_no_others(mtm, ecm):
    assert verbs(mtm) >= OF_ALL | OF_AN_MTM
    assert verbs(ecm) >= OF_ALL | {"endoscope_type", "set_endoscope_type"}
    assert not verbs(ecm) & OF_AN_MTM
    assert not {verb for verb in verbs(mtm) | verbs(ecm) if verb.startswith(("jaw/", "tool_", "emulate_tool"))}
    assert ecm.last("/ECM/endoscope_type").data == "Classic_SD_STRAIGHT"
    ecm.say("/ECM/set_endoscope_type", String(data="Classic_HD_UP"))
    assert len(ecm.refusals) == 1


@pytest.mark.parametrize(("robot", "namespace"), [("dvrk_mtm", "/PSM1"), ("dvrk_ecm", "/MTMR"), ("dvrk_psm", "/ECM")])
def test_a_namespace_of_another_arm_is_refused(robot: str, namespace: str):
    with pytest.raises(InputError, match="expected one whose last word begins with"):
        Serving(robot, "crtk", namespace=namespace)


def test_a_master_goes_limp_and_stays_so_until_it_is_told_otherwise(mtm):
    mtm.say("/MTMR/body/servo_cf", wrench(0.0, 0.0, 0.0), 1.0)
    start = pose_of(mtm.last("/MTMR/measured_cp")).position
    for _ in range(50):
        mtm.say("/MTMR/hand/servo_cf", wrench(0.0, 0.0, 0.5))
    pushed = pose_of(mtm.last("/MTMR/measured_cp")).position
    assert pushed[2] - start[2] > 0.02
    mtm.say("/MTMR/hold", Empty(), 0.3)
    held = pose_of(mtm.last("/MTMR/measured_cp")).position
    for _ in range(50):
        mtm.say("/MTMR/hand/servo_cf", wrench(0.0, 0.0, 0.5))
    assert_allclose(pose_of(mtm.last("/MTMR/measured_cp")).position, held, atol=2e-3)
    assert not mtm.refusals


@pytest.mark.parametrize("absolute", [False, True])
def test_a_force_is_in_the_tools_axes_or_in_those_of_the_frame_that_was_set(mtm, absolute: bool):
    base = Pose(rotation_from_rpy((0.3, -0.4, 1.1)), np.array([0.2, -0.1, 0.5]))
    mtm.say("/MTMR/set_base_frame", pose_message(base, 0, "HRSV"))
    mtm.say("/MTMR/body/set_cf_orientation_absolute", Bool(data=absolute))
    start = pose_of(mtm.last("/MTMR/measured_cp"))
    mtm.say("/MTMR/body/servo_cf", wrench(0.0, 0.0, -3.0), 0.0)
    tau = mtm.last("/MTMR/measured_js").effort
    tool = mtm.server.arms["MTMR"].measured_tool
    force = np.array([0.0, 0.0, -3.0]) if absolute else start.rotation @ [0.0, 0.0, -3.0]
    expected = tool.jacobian[:3].T @ (base.rotation.T @ force)
    assert_allclose(tau, expected, atol=0.05 * np.abs(expected).max())  # the arm has moved since


def test_a_locked_wrist_keeps_its_orientation_while_the_hand_leads_it(mtm):
    mtm.joints("move_jp", [0.1, 0.2, 0.1, 0.2, 0.5, 0.1, 0.3])
    mtm.wait()
    mtm.say("/MTMR/body/servo_cf", wrench(0.0, 0.0, 0.0), 0.1)
    turned = {}
    for locked in (True, False):
        start = pose_of(mtm.last("/MTMR/measured_cp"))
        if locked:
            mtm.say("/MTMR/lock_orientation", pose_message(start, 0, "base").pose.orientation)
        else:
            mtm.say("/MTMR/unlock_orientation", Empty())
        assert mtm.last("/MTMR/orientation_locked").data == locked
        for _ in range(60):
            mtm.say("/MTMR/hand/servo_cf", wrench(0.0, 0.4, 0.3))
        now = pose_of(mtm.last("/MTMR/measured_cp"))
        assert np.linalg.norm(now.position - start.position) > 0.02
        turned[locked] = np.linalg.norm(rotation_vector(start.rotation.T @ now.rotation))
    assert turned[True] < np.deg2rad(3.0)
    assert turned[False] > np.deg2rad(8.0)


def test_a_gripper_is_moved_by_fingers_and_says_that_it_is_closed(mtm):
    heard = [mtm.hear(f"/MTMR/gripper/{name}") for name in ("closed", "pinch")]
    for angle in (0.8, -0.1, 0.3):
        mtm.joints("hand/servo_jp", [angle], 0.05)
        assert mtm.last("/MTMR/gripper/measured_js").position[0] == max(angle, 0.0)
    assert [[type(one.message) for one in pinches.take()] for pinches in heard[1:]] == [[Empty]]
    assert [one.message.data for one in heard[0].take()] == [False, True, False]


def test_a_master_turns_to_the_pose_of_a_slave_where_it_stands(mtm):
    start = pose_of(mtm.last("/MTMR/setpoint_cp"))
    slave = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # of a PSM at its zero
    mtm.say("/MTMR/move_cp", pose_message(Pose(slave, start.position), 0, "base"))
    mtm.wait()
    reached = pose_of(mtm.last("/MTMR/measured_cp"))
    assert_allclose(reached.position, start.position, atol=1e-4)
    assert np.linalg.norm(rotation_vector(reached.rotation.T @ slave)) < 1e-3


def test_an_impedance_pulls_back_by_the_gains_of_the_side_beyond_the_deadband(mtm):
    start = pose_of(mtm.last("/MTMR/measured_cp"))
    gains = message_class("crtk_msgs/CartesianImpedanceHalfPlaneGains")
    here, up = Vector3(*start.position), Quaternion(w=1.0)
    soft, hard = (gains(p=Vector3(z=-p), d=Vector3(z=-5.0), deadband=Vector3(z=0.01)) for p in (20.0, 200.0))
    goal = Impedance(
        force_orientation=up, torque_orientation=up, force_position=here, position_positive=soft, position_negative=hard
    )
    mtm.say("/MTMR/servo_ci", goal, 0.1)
    for push, stiffness in ((1.0, 20.0), (-1.0, 200.0)):
        for _ in range(120):
            mtm.say("/MTMR/hand/servo_cf", wrench(0.0, 0.0, push))
        away = pose_of(mtm.last("/MTMR/measured_cp")).position[2] - start.position[2]
        # joints' friction holds up to .15 N of the push
        assert away == pytest.approx(push * (0.01 + 1.0 / stiffness), rel=0.2)


def test_an_endoscope_goes_to_a_place_and_turns(ecm):
    start = pose_of(ecm.last("/ECM/setpoint_cp"))
    turned = start.rotation @ rotation_from_vector([0.0, 0.0, 0.4])
    ecm.say("/ECM/move_cp", pose_message(Pose(turned, start.position), 0, "base"))
    ecm.wait()
    reached = pose_of(ecm.last("/ECM/setpoint_cp"))
    assert_allclose(reached.position, start.position, atol=1e-5)
    assert_allclose(reached.rotation, turned, atol=1e-5)
    kind = "cisst_msgs/ConvertFloat64Array"
    assert_allclose(
        answered(ecm.server, "/ECM/actuator_to_joint_position", kind, input=[0.1, 0.2, 0.1, 0.3]).output,
        [0.1, 0.2, 0.1, 0.3],
    )


def test_a_masters_motors_turn_its_parallelogram(mtm):
    asked = answered(
        mtm.server, "/MTMR/actuator_to_joint_position", "cisst_msgs/ConvertFloat64Array",
        input=[0.1, 0.2, 0.5, 0.1, 0.3, 0.2, 0.4],
    )  # fmt: skip
    assert_allclose(asked.output, [0.1, 0.2, 0.3, 0.1 - 0.6697 * 0.3, 0.3, 0.2, 0.4])


def test_who_asks_for_a_state_has_the_joints_when_it_is_answered(mtm):
    serving, transport = Serving("dvrk_mtm", "crtk", namespace="/lab/MTML"), Loopback("seldom", mtm.network)
    server = make_server(serving, transport, rate_hz=1.0, plants={"MTML": mtm.plant})
    server.tick()  # that publishes; the next one that does is due in a second
    heard = mtm.client.subscribe("/lab/MTML/setpoint_js", "sensor_msgs/JointState")
    command = mtm.commander.publisher("/lab/MTML/state_command", "crtk_msgs/StringStamped")
    command.publish(command_message("enable", mtm.client.now()))
    server.tick()
    assert len(heard.take()) == 1
