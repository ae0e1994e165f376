"""A robot in another process over ROS 1, calibrated to its report."""

import numpy as np
import pytest

from catenary import read_log
from catenary.trajectories.smoothed_path import SmoothedPath
from catenary.workflows.project import calibrate
from catenary.workflows.project.calibrate import motion_log_path
from catenary.workflows.project.folder import Project, ProjectSettings
from command_line import catenary
from meeting import Meeting
from ros import PATIENT_COMMAND, Program
from simulated_project import QUICK_MODELS

pytestmark = pytest.mark.slow

# from where the homed robot is: getting to a far start takes longer than the motion
STROLL = [[0.52, 1.57, 0.40], [0.7, 1.5, 0.395], [0.6, 1.7, 0.39], [0.55, 1.5, 0.4], [0.52, 1.57, 0.40]]


@pytest.mark.parametrize("meeting", ["1"], indirect=True, ids=["ros1"])
def test_served_robot_is_calibrated_to_its_report(meeting: Meeting, tmp_path, monkeypatch) -> None:
    programs, ros = meeting
    motion = SmoothedPath.through(np.linspace(0.0, 7.0, 5), STROLL, 0.5)  # from less than 5 s nothing is learnt
    monkeypatch.setattr(calibrate, "training_motion", lambda project: (motion, "a stroll"))
    monkeypatch.setattr(calibrate, "models_for", lambda robot, seed: QUICK_MODELS)
    monkeypatch.setattr(calibrate, "evaluation_motion", lambda project, seconds, number=0: (motion, "another"))
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
    assert "Simulated: no real robot was measured" in page
    assert "the external encoders" in page
