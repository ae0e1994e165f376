"""A served PSM over a loopback: dVRK's topics, its client, homing, moves, a tracker, a project, a deployed model."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.crtk.client import CrtkClient
from catenary.crtk.loopback import Loopback
from catenary.crtk.message_values import pose_of
from catenary.dvrk_psm import PSM_JOINTS
from catenary.errors import InputError, NotReadyError
from catenary.nodes.calibrated_topics import CalibratedTopics, reader_of
from catenary.nodes.serve import Serving
from catenary.plant import MotionLog
from catenary.recording.logs import read_log
from catenary.robots.catalog import load_robot
from catenary.simulation.psm_plant import PsmPlant
from catenary.workflows.project import calibrate
from catenary.workflows.project.calibrate import extract_recording, motion_log_path
from catenary.workflows.project.folder import Project, ProjectSettings
from catenary.workflows.project.robot import RosRobot
from catenary.workflows.robot.homing import AnswerYes
from catenary.workflows.robot.motion import move_to
from oracles.tree_poses import frame_pose
from recordings import fitted
from served_robot import ServedPsm

MODEL = load_robot("dvrk_psm")


def client_of(robot):
    return CrtkClient(robot.client, dialect="crtk", namespace="/PSM1", joints=MODEL, simulated=True)


@pytest.fixture
def robot():
    """Homed and enabled."""
    return ServedPsm()


def test_joint_states_have_six_joints_and_the_jaw_its_own(robot):
    measured, jaw = (robot.last(f"/PSM1/{name}measured_js") for name in ("", "jaw/"))
    assert tuple(measured.name) == PSM_JOINTS
    assert tuple(jaw.name) == ("jaw",)
    assert_allclose(measured.position, robot.plant.measured_js().q[:6], atol=1e-3)
    assert len(measured.velocity) == len(measured.effort) == 6
    assert_allclose(jaw.position, robot.plant.measured_js().q[6:], atol=1e-3)


def test_poses_are_those_of_the_dvrks_kinematics(robot):
    for name in ("setpoint_cp", "local/setpoint_cp"):
        told = pose_of(robot.last(f"/PSM1/{name}"))
        there = frame_pose(MODEL, "tool", robot.plant.setpoint_js().q[:6])
        assert_allclose(told.position, there[:3, 3], atol=1e-12)
        assert_allclose(told.rotation, there[:3, :3], atol=1e-12)


def test_it_homes_by_state_commands_and_moves_nowhere_before():
    robot = ServedPsm(PsmPlant())
    with client_of(robot) as client:
        assert client.operating_state().state == "DISABLED"
        with pytest.raises(NotReadyError):
            client.servo_jp(np.zeros(6))
        start = robot.plant.state.rotor.copy()
        robot.joints("servo_jp", [0.0, 0.0, 0.1, 0.0, 0.0, 0.0], 0.5)
        assert_array_equal(robot.plant.state.rotor, start)
        client.state_command("enable")
        client.state_command("home")
        assert client.operating_state().is_homed
        assert_allclose(client.setpoint_js().q, robot.plant.firmware.home_value[:6], atol=1e-9)


def test_the_client_moves_it_and_reads_the_tracker(robot):
    with client_of(robot) as client:
        goal = np.array([0.1, -0.05, 0.14, 0.4, -0.3, 0.2])
        move_to(client, goal, joints=PSM_JOINTS)
        assert_allclose(client.setpoint_js().q, goal, atol=1e-9)
        seen, error = client.external_encoders(), robot.plant.state.q[:6] - client.measured_js().q
        assert_allclose(seen, robot.plant.state.q[:6], atol=0.01)  # noise
        assert (np.abs(error[3:]) > np.deg2rad(1.0)).any()
        client.state_command("pause")
        with pytest.raises(NotReadyError, match="PAUSED"):
            client.servo_jp(goal)


def test_a_deployed_model_publishes_below_the_arms_namespace(robot):
    rng, n = np.random.default_rng(0), 400
    q = rng.uniform(-0.5, 0.5, (n, 6))
    offset = np.array([0.0, 0.0, 0.001, 0.1, -0.1, 0.2])
    units = ("rad", "rad", "m", "rad", "rad", "rad")
    log = MotionLog("log", PSM_JOINTS, units, q, np.ones(n, dtype=bool), q + offset)
    model = fitted(log, kind="offset")
    with reader_of(model.joint_names, robot.client, "gold") as reader:
        topics = CalibratedTopics(reader, model)
        heard = Loopback("lab", robot.network).subscribe(
            "/PSM1/calibrated/measured_js", "sensor_msgs/JointState", depth=1000
        )
        for _ in range(50):
            robot.sleep(0.001)
            topics.step()
        message = heard.take()[-1].message
        assert_allclose(message.position - reader.measured_js().q, offset, atol=1e-3)
        assert tuple(message.name) == PSM_JOINTS
        topics.close()


def test_a_psm_is_deployed_on_in_its_own_dialect_only(robot):
    with pytest.raises(InputError, match="speaks crtk"):
        reader_of(PSM_JOINTS, robot.client, "gold", dialect="raven")
    with pytest.raises(InputError, match="is none of a PSM"):
        reader_of(("shoulder",), robot.client, "gold", namespace="/PSM1")


def test_a_project_homes_and_records_it_over_a_transport(tmp_path):
    robot = ServedPsm(PsmPlant(seed=3))
    settings = ProjectSettings(robot="dvrk_psm", train_minutes=0.1, test_minutes=0.1, connection="ros1")
    project, lab = (
        Project(tmp_path / "psm", settings),
        RosRobot(robot.client, AnswerYes(lambda _: None), simulated=True),
    )
    assert lab.home(project)
    lab.record(project, calibrate.TRAIN, *calibrate.training_motion(project), after="home")
    extract_recording(project, calibrate.TRAIN)
    log = read_log(motion_log_path(project, calibrate.TRAIN))
    assert (log.joint_names, log.simulated) == (PSM_JOINTS, True)
    assert log.ok.mean() > 0.9
    error = np.abs(log.q_encoder - log.q_nominal)[log.ok].mean(axis=0)
    assert (error[3:] > np.deg2rad(1.0)).all()
    assert robot.plant.operating_state().state == "PAUSED"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"robot": "panda"}, "expected one of raven2, dvrk_psm"),
        ({"robot": "dvrk_psm"}, "speaks crtk, not raven"),
        ({"robot": "dvrk_psm", "dialect": "crtk", "with_green": True}, "has no green arm"),
        ({"robot": "dvrk_psm", "dialect": "crtk", "namespace": "/MTML"}, "begins with PSM"),
    ],
)
def test_what_cannot_be_served_is_refused(options, message):
    with pytest.raises(InputError, match=message):
        Serving(**options)
