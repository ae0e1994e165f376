"""The pipeline on a robot behind topics; over loopback, time passes only in sleeps."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import NotReadyError, RecordingError
from catenary.recording.logs import read_log
from catenary.trajectories.reference import Trajectory
from catenary.trajectories.smoothed_path import SmoothedPath
from catenary.workflows.project import robot as ros_robot
from catenary.workflows.project.calibrate import TRAIN, extract_recording, motion_log_path
from catenary.workflows.project.folder import Project, ProjectSettings
from catenary.workflows.project.robot import RosRobot, set_aside
from catenary.workflows.robot.homing import AnswerYes
from oracles.crtk_robot import RobotOnLoopback
from oracles.encoded_plant import OFFSET, START, EncodedPlant
from person import Person

SETTINGS = ProjectSettings(connection="ros1", test_minutes=0.25)
SWING = np.array([0.1, 0.15, 0.01])


def short_motion(seed: int = 0) -> Trajectory:
    """Some seconds around START."""
    rng = np.random.default_rng(seed)
    points = np.array(START[:3]) + SWING * rng.uniform(-1.0, 1.0, (6, 3))
    return SmoothedPath.through(np.arange(6.0), points, 0.5)


def on_loopback(plant: EncodedPlant | None = None) -> RobotOnLoopback:
    return RobotOnLoopback(EncodedPlant() if plant is None else plant, every=5)


def project(tmp_path: Path, **changes: Any) -> Project:
    return Project(tmp_path / "project", replace(SETTINGS, **changes))


def homed(opened: Project, setup: RobotOnLoopback) -> RosRobot:
    robot = RosRobot(setup.transport, AnswerYes(), simulated=True, patience=1.0)
    robot.home(opened)
    return robot


def test_homing_asks_for_what_is_missing_only_and_checks_the_answer(tmp_path: Path) -> None:
    setup = on_loopback(EncodedPlant(ready=False))
    presses = []

    def press() -> None:
        presses.append(1)
        if len(presses) == 2:  # at first nothing happens
            setup.robot.plant.state_command("enable")
            setup.robot.plant.state_command("home")

    person = Person(button=press)
    robot = RosRobot(setup.transport, person, simulated=True, homing_patience=0.5)
    assert robot.home(project(tmp_path))
    # its encoders are there, and it is ENABLED
    assert ["button" in text for text in person.asked] == [False, True, True]
    assert "workspace" in person.asked[0]
    assert any("not yet: the robot is DISABLED, not homed" in text for text in person.told)
    content = json.loads((tmp_path / "project/robot/home.json").read_text())
    assert_allclose(content["external_encoders"], START[:3] + OFFSET)


def test_encoders_are_asked_for_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They register while the robot homes, and their first reading comes a moment after it is homed."""
    setup = on_loopback(EncodedPlant(ready=False))
    silent = ["no reading"] * 10
    monkeypatch.setattr(ros_robot, "_not_registered", lambda client, kind: silent.pop() if silent else None)

    def press() -> None:
        setup.robot.plant.state_command("enable")
        setup.robot.plant.state_command("home")

    person = Person(button=press)
    RosRobot(setup.transport, person, simulated=True, homing_patience=0.5).home(project(tmp_path))
    assert silent == []
    assert not [text for text in person.asked if "encoders" in text]


def test_ctrl_c_while_a_person_is_asked_leaves_the_robot_paused(tmp_path: Path) -> None:
    setup = on_loopback()
    assert setup.robot.plant.operating_state().state == "ENABLED"

    def leave() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        RosRobot(setup.transport, Person(workspace=leave), simulated=True).home(project(tmp_path))
    assert setup.robot.plant.operating_state().state == "PAUSED"


def test_yes_presses_a_button_but_clears_no_fault_and_needs_encoders(tmp_path: Path) -> None:
    setup = on_loopback(EncodedPlant(ready=False))
    homed(project(tmp_path / "a"), setup)
    plant = setup.robot.plant
    assert plant.operating_state().is_homed
    plant.state = plant.operating_state()._replace(state="FAULT")
    with pytest.raises(NotReadyError, match="FAULT"):
        homed(project(tmp_path / "b"), setup)
    blind = RobotOnLoopback(EncodedPlant(), encoders=False, every=5)
    with pytest.raises(NotReadyError, match=r"mount the external encoders.*no reading comes on /ext_jpos"):
        homed(project(tmp_path / "c"), blind)


def test_recording_becomes_a_motion_log_of_the_robot(tmp_path: Path) -> None:
    setup, opened = on_loopback(), project(tmp_path)
    robot = homed(opened, setup)
    assert robot.record(opened, TRAIN, short_motion(), "short", after="home")
    assert setup.robot.plant.operating_state().state == "PAUSED"
    extract_recording(opened, TRAIN)
    log = read_log(motion_log_path(opened, TRAIN))
    assert log.robot == "raven2"
    assert log.q_encoder is not None
    errors = (log.q_encoder - log.q_nominal)[log.ok]
    assert len(errors) > 100
    assert_allclose(np.median(errors, axis=0), OFFSET, atol=1e-3)
    assert not robot.record(opened, TRAIN, short_motion(), "short", after="home")  # once


def test_a_name_used_twice_loses_no_recording_of_a_robot(tmp_path: Path) -> None:
    setup, opened = on_loopback(), project(tmp_path)
    robot, recording = homed(opened, setup), opened.folder / "recordings" / "again"
    for number in range(3):
        recording.mkdir(parents=True)
        (recording / "hours").write_text(str(number))
        if number < 2:
            set_aside(opened, "again")
    assert robot.record(opened, "again", short_motion(), "short", after="home")
    kept = [opened.folder / "replaced" / name / "hours" for name in ("again", "again.2", "again.3")]
    assert [path.read_text() for path in kept] == ["0", "1", "2"]
    assert not (recording / "hours").exists()


def test_without_its_topics_nothing_is_moved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    setup, opened = on_loopback(), project(tmp_path)
    robot, recording = homed(opened, setup), opened.folder / "recordings" / TRAIN
    recording.mkdir(parents=True)
    (recording / "hours").touch()
    monkeypatch.setattr(ros_robot, "_not_registered", lambda client, kind: None)
    del setup.robot._out["ext_jpos"]  # their program ends just now
    with pytest.raises(RecordingError, match="nothing came of /ext_jpos"):
        robot.record(opened, TRAIN, short_motion(), "short", after="home")
    assert [*recording.iterdir()] == [recording / "hours"]
    assert not (opened.folder / "replaced").exists()
    assert np.array_equal(setup.robot.plant.setpoint_js().q[:3], START[:3])


def test_recording_that_is_stopped_leaves_the_robot_paused_and_is_begun_anew(tmp_path: Path) -> None:
    setup, opened = on_loopback(), project(tmp_path)
    robot = homed(opened, setup)

    def interrupt(done: float) -> None:
        if done > 0.2:
            raise KeyboardInterrupt

    def pedal(done: float) -> None:
        if done > 0.2:
            setup.robot.plant.state_command("pause")

    for stop, error, words in ((interrupt, KeyboardInterrupt, "^$"), (pedal, NotReadyError, "PAUSED")):
        with pytest.raises(error, match=words):
            robot.record(opened, TRAIN, short_motion(), "short", after="home", progress=stop)
        assert setup.robot.plant.operating_state().state == "PAUSED"
    assert robot.record(opened, TRAIN, short_motion(), "short", after="home")
