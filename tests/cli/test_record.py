import io
from pathlib import Path

import numpy as np
import pytest

from catenary.cli.robot_options import TerminalGuide
from catenary.recording.bag_reader import open_recording
from catenary.recording.logs import read_log
from catenary.workflows.project import kinds
from catenary.workflows.project.folder import Project, ProjectSettings, project_settings
from catenary.workflows.robot.operator_motion import read_followed_file
from command_line import catenary, refusal
from oracles.crtk_robot import RobotOnLoopback


def test_a_simulated_robot_is_homed_without_a_project() -> None:
    found = catenary("home", "--json").json
    assert found["run"]
    assert found["state"] == {"state": "ENABLED", "is_homed": True, "is_busy": False}
    assert found["seconds"] > 5.0
    # the rig and the robot register the same stops 7.5 deg apart at the elbow, and the cables stretch
    assert abs(found["external_encoders"][1] - found["believed"][1] + 0.1309) < 0.05


def test_a_robot_on_ros_is_homed_without_a_project(on_ros: RobotOnLoopback) -> None:
    outcome = catenary("home", "--ros", "1", "--yes")
    assert outcome.code == 0, outcome
    assert "raven2: homed in" in outcome.out
    assert on_ros.robot.plant.operating_state().is_homed


def test_nobody_at_the_terminal_moves_no_robot(on_ros: RobotOnLoopback) -> None:
    assert "nothing has moved" in refusal("home", "--ros", "1")
    assert not on_ros.robot.plant.operating_state().is_homed


def test_project_remembers_where_its_robot_is(on_ros: RobotOnLoopback, tmp_path: Path) -> None:
    catenary("home", tmp_path / "p", "--ros", 1, "--yes", "--simulated")
    assert catenary("home", tmp_path / "p", "--yes", "--json").json["run"] is False


def test_record_without_motion_keeps_what_others_do_and_the_settings_of_a_project(
    on_ros: RobotOnLoopback, tmp_path: Path
) -> None:
    on_ros.robot.plant.state_command("home")
    before = ProjectSettings(test_minutes=33.0, seed=7)
    Project(tmp_path / "p", before)
    line = ("record", tmp_path / "p", "--ros", 1, "--no-motion", "--hours", "0.0005", "--simulated", "--json")
    outcome = catenary(*line)
    assert outcome.code == 0, outcome
    assert outcome.json["seconds"] == pytest.approx(1.8)
    assert {topic["name"] for topic in outcome.json["topics"]} >= {"/ravenstate", "/ext_jpos"}
    assert open_recording(tmp_path / "p" / "recordings" / "test").about.simulated
    assert on_ros.robot.commands == 0
    assert project_settings(tmp_path / "p") == before


def test_what_others_did_extracts_and_its_name_is_not_used_twice(on_ros: RobotOnLoopback, tmp_path: Path) -> None:
    on_ros.robot.plant.state_command("home")
    line = ("record", tmp_path / "p", "--ros", 1, "--no-motion", "--hours", "0.001", "--name", "hand")
    assert catenary(*line).code == 0
    assert "recordings/hand: holds a recording already; give this one another --name" in refusal(*line)
    found = catenary("extract", tmp_path / "p", "--json").json["hand"]
    assert found["rows"] > 50
    assert read_log(Path(found["log"])).robot == "raven2"
    assert catenary(*line[:-1], "foot").code == 0
    assert catenary("extract", tmp_path / "p", "--json").json.keys() == {"hand", "foot"}


@pytest.mark.parametrize(("typed", "done"), [("\n", True), ("yes\n", True), ("q\n", False), ("", False)])
def test_enter_says_done_and_q_gives_up(typed: str, done: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(typed))
    assert TerminalGuide().confirm("press the pedal") is done


def test_excite_homes_a_new_robot_first_and_records_its_state_at_100_hz(tmp_path: Path) -> None:
    project = tmp_path / "new"
    zigzag = ("--direction", "J1", "--sparsity", "1", "--state-rate", "100", "--random-seconds", "0")
    assert catenary("excite", project, *zigzag, "--json").json["run"] is True
    assert {p.name for p in project.iterdir()} >= {"robot", "recordings", "settings.json"}
    topics = catenary("extract", project, "--json").json["train"]["topics"]
    assert {t["topic"]: round(t["rate"], -1) for t in topics}["ravenstate_100hz"] == 100.0


def test_excite_begins_the_project_of_another_robot(tmp_path: Path) -> None:
    project = tmp_path / "psm"
    minutes = ("--train-minutes", "0.2")
    assert catenary("excite", project, "--robot", "dvrk_psm", "--namespace", "/PSM2", *minutes).code == 0
    settings = project_settings(project)
    assert settings is not None
    assert (settings.robot, settings.namespace) == ("dvrk_psm", "/PSM2")
    assert open_recording(project / "recordings" / "train").about.robot == "dvrk_psm"
    assert "nothing to do" in catenary("excite", project, *minutes).out


@pytest.mark.parametrize("robot", ["raven2", "dvrk_psm"])
def test_minutes_of_full_reversals_are_a_file_that_follow_takes(tmp_path: Path, robot: str) -> None:
    out = tmp_path / "motion.csv"
    said = catenary("excite", "--refresh", "--robot", robot, "--out", out, "--json").json
    found = read_followed_file(out)
    assert list(found.joint_names) == said["joints"]
    assert 100.0 < found.time[-1] < 200.0
    for q in found.q_nominal.T:
        middle, reach = 0.5 * (q.max() + q.min()), 0.5 * np.ptp(q)
        side = np.sign(q - middle)[np.abs(q - middle) > 0.9 * reach]
        assert np.count_nonzero(np.diff(side)) + 1 >= 10  # sweeps of nearly all of the range
    assert list(tmp_path.iterdir()) == [out]  # no project was begun
    assert "PROJECT: is missing" in refusal("excite", "--refresh")


def test_minutes_of_full_reversals_are_recorded_anew_each_day(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kinds, "MIN_SWEEPS", 1)  # a tenth of the minutes
    for name in ("refresh", "refresh_2"):
        assert catenary("excite", tmp_path / "arm", "--refresh", "--json").json["recording"] == name
    found = catenary("extract", tmp_path / "arm", "--json").json
    assert found.keys() == {"refresh", "refresh_2"}


def test_record_makes_further_recordings(project_folder: Path) -> None:
    content = catenary("record", project_folder, "--hours", "0.003", "--name", "again", "--json").json
    assert content["seconds"] == pytest.approx(10.8)
    assert (project_folder / "recordings" / "again").is_dir()
