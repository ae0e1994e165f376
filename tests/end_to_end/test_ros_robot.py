"""A robot in another process over ROS 1: connected to, restarted, and calibrated to its report."""

from collections.abc import Iterator

import numpy as np
import pytest

from catenary import CrtkClient, read_log
from catenary.crtk.ros1.transport import Ros1Transport
from catenary.errors import TransportError
from catenary.trajectories.smoothed_path import follow_waypoints
from catenary.workflows.project import calibrate
from catenary.workflows.project.folder import Project, ProjectSettings
from catenary.workflows.project.recordings import motion_log_path
from command_line import catenary
from meeting import Meeting
from patience import PATIENCE, until
from ros import NODE, PATIENT_COMMAND, Master, Program
from simulated_project import QUICK_MODELS

pytestmark = pytest.mark.slow

ROBOT = """
import sys
from catenary.crtk.ros1.transport import Ros1Transport
from oracles.crtk_robot import CrtkRobot
from oracles.encoded_plant import EncodedPlant
transport = Ros1Transport("robot")
robot = CrtkRobot(transport, EncodedPlant(ready=sys.argv[1] == "ready"), every=2)
rate = transport.rate(1000.0)
print("up")
while True:
    robot.tick()
    rate.sleep()
"""


# from where the homed robot is: getting to a far start takes longer than the motion
STROLL = [[0.52, 1.57, 0.40], [0.7, 1.5, 0.395], [0.6, 1.7, 0.39], [0.55, 1.5, 0.4], [0.52, 1.57, 0.40]]


@pytest.fixture
def transport(ros_master: Master) -> Iterator[Ros1Transport]:
    with Ros1Transport(NODE) as one:
        yield one


def robot(master: Master, state: str = "ready") -> Program:
    program = Program(master, ROBOT, state)
    assert program.line() == "up"
    return program


def test_robot_that_dies_is_noticed_and_not_enabled_when_back(ros_master, transport) -> None:
    with robot(ros_master) as first, CrtkClient(transport, stale_after=5.0, connect_timeout=PATIENCE) as client:
        client.state_command("pause", timeout=PATIENCE)
        client.state_command("resume", timeout=PATIENCE)
        assert client.operating_state().state == "ENABLED"
        first.process.kill()
        with pytest.raises(TransportError, match="nothing has come from the robot"):
            until(lambda: client.operating_state() and False)
    with robot(ros_master, "fresh"), CrtkClient(transport, stale_after=PATIENCE, connect_timeout=PATIENCE) as client:
        until(lambda: not client.operating_state().is_homed)
        assert client.operating_state().state == "DISABLED"


@pytest.mark.parametrize("meeting", ["1"], indirect=True, ids=["ros1"])
def test_served_robot_is_calibrated_to_its_report(meeting: Meeting, tmp_path, monkeypatch) -> None:
    programs, ros = meeting
    motion = follow_waypoints(STROLL, speed=[0.1, 0.1, 0.005])  # 7 s: from less than 5 s nothing is learnt
    monkeypatch.setattr(calibrate, "excitation", lambda project: (motion, "a stroll"))
    monkeypatch.setattr(calibrate, "models_for", lambda robot, seed: QUICK_MODELS)
    monkeypatch.setattr(calibrate, "random_motion", lambda project, seconds, number=0: (motion, "another"))
    project = tmp_path / "project"
    with Program(programs, PATIENT_COMMAND, "serve", "--ros", ros, "--homed", "--json") as server:
        server.line()  # it is up
        outcome = catenary("calibrate", project, "--ros", ros, "--yes", "--simulated", "--json")
    assert outcome.code == 0, outcome.err
    assert outcome.json["deployment"]["ticks"] > 1000
    log = read_log(motion_log_path(Project(project, ProjectSettings(connection=f"ros{ros}")), "test"))
    assert log.ok.any()  # where the machine let messages come within 50 ms of each other
    # what the cables stretch by and the rig's own zeros, and no more: the encoders are the same joints'
    assert log.q_encoder is not None
    error = np.abs((log.q_encoder - log.q_nominal)[log.ok])
    assert (np.median(error, axis=0) < [0.2, 0.2, 0.02]).all()
    page = (project / "report.html").read_text(encoding="utf-8")
    assert f"model (simulated, over ROS {ros})" in page
    assert "the external encoders" in page
