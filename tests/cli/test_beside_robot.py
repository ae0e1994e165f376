import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from catenary.calibration.files import save_model
from catenary.cli import beside_robot
from catenary.cli.beside_robot import TerminalGuide
from catenary.errors import TransportError
from catenary.nodes.deploy import CalibratedTopics
from catenary.plant import MotionLog
from catenary.recording.bag_reader import open_recording
from catenary.recording.logs import read_log
from catenary.workflows.project.folder import Project, ProjectSettings, project_settings
from command_line import catenary, refusal
from oracles.crtk_robot import RobotOnLoopback
from oracles.encoded_plant import EncodedPlant
from recordings import fitted


@pytest.fixture
def setup(monkeypatch: pytest.MonkeyPatch) -> RobotOnLoopback:
    """A robot where the command looks for one on ROS."""
    robot = RobotOnLoopback(EncodedPlant(ready=False), every=5)

    @contextmanager
    def transport(_: int, __: str = "") -> Iterator[Any]:
        yield robot.transport

    monkeypatch.setattr(beside_robot, "ros_transport", transport)
    return robot


def test_home_brings_a_robot_on_ros_home(setup: RobotOnLoopback, tmp_path: Path) -> None:
    outcome = catenary("home", tmp_path / "p", "--ros", 1, "--yes", "--simulated", "--json")
    assert outcome.code == 0, outcome
    assert outcome.json["run"] is True
    assert setup.robot.plant.operating_state().is_homed
    assert "start button" in outcome.err


def test_project_remembers_where_its_robot_is(setup: RobotOnLoopback, tmp_path: Path) -> None:
    catenary("home", tmp_path / "p", "--ros", 1, "--yes", "--simulated")
    assert catenary("home", tmp_path / "p", "--yes", "--json").json["run"] is False


def test_unattended_terminal_gives_up(setup: RobotOnLoopback, tmp_path: Path) -> None:
    assert "given up" in refusal("home", tmp_path / "p", "--ros", 1)
    assert setup.robot.commands == 0


def test_record_without_motion_keeps_what_others_do(setup: RobotOnLoopback, tmp_path: Path) -> None:
    setup.robot.plant.state_command("home")
    outcome = catenary(
        "record", tmp_path / "p", "--ros", 1, "--no-motion", "--hours", "0.005", "--simulated", "--json"
    )
    assert outcome.code == 0, outcome
    assert {topic["name"] for topic in outcome.json["topics"]} >= {"/ravenstate", "/ext_jpos"}
    assert open_recording(tmp_path / "p" / "recordings" / "test").about.simulated
    assert setup.robot.commands == 0


def test_recording_others_leaves_the_settings_of_a_project_as_they_are(
    setup: RobotOnLoopback, tmp_path: Path
) -> None:
    setup.robot.plant.state_command("home")
    before = ProjectSettings(test_minutes=33.0, seed=7)
    Project(tmp_path / "p", before)
    outcome = catenary("record", tmp_path / "p", "--ros", 1, "--no-motion", "--hours", "0.0005", "--json")
    assert outcome.code == 0, outcome
    assert outcome.json["seconds"] == pytest.approx(1.8)
    assert project_settings(tmp_path / "p") == before


def test_what_others_did_extracts_and_its_name_is_not_used_twice(
    setup: RobotOnLoopback, tmp_path: Path
) -> None:
    setup.robot.plant.state_command("home")
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


def test_a_deployment_reports_whatever_ends_it(
    setup: RobotOnLoopback, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    setup.robot.plant.state_command("home")
    q = np.random.default_rng(0).uniform(0.3, 0.4, (400, 3))
    names, units = ("shoulder", "elbow", "insertion"), ("rad", "rad", "m")
    log = MotionLog("run", names, units, q, np.ones(400, dtype=bool), q + 0.01, time=np.arange(400) / 30.0)
    inputs = tuple(f"q:{name}" for name in names)
    save_model(fitted(log, kind="linear", inputs=inputs), {}, tmp_path / "arm.npz")
    calls = []

    def ends(topics: CalibratedTopics, seconds: float) -> Any:
        calls.append(seconds)
        if len(calls) == 3:
            raise TransportError("the ROS node was shut down")
        for _ in range(100):
            setup.transport.sleep(0.001)
        topics.step()
        return topics.report()

    monkeypatch.setattr(CalibratedTopics, "run", ends)
    outcome = catenary("deploy", tmp_path / "arm.npz", "--ros", 1, "--json")
    assert outcome.code == 2
    assert "the ROS node was shut down" in outcome.err
    assert outcome.json["messages"] > 0
