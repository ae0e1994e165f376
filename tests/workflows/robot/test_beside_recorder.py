from collections import Counter
from pathlib import Path

import pytest

from catenary.crtk.client import CrtkClient
from catenary.errors import InputError, RecordingError
from catenary.recording.bag_reader import open_recording
from catenary.recording.extract import extract
from catenary.robots.catalog import load_robot
from catenary.simulation.cable_plant import CablePlant
from catenary.workflows.robot.beside_recorder import BesideRecorder
from catenary.workflows.robot.operated_robot import OperatedRobot
from oracles.cable_arms import homed_plant
from oracles.crtk_robot import RobotOnLoopback

SECONDS = 1.0


def simulated() -> tuple[OperatedRobot, CablePlant]:
    plant = homed_plant("left")
    return OperatedRobot("raven2", plant, load_robot("raven2"), lambda: 0), plant


def run(recorder: BesideRecorder, plant: CablePlant) -> None:
    for _ in range(round(SECONDS / plant.period)):
        plant.wait()
        recorder.observe()


def test_a_simulated_arm_is_recorded_at_its_topics_rates(tmp_path: Path) -> None:
    robot, plant = simulated()
    recorder = BesideRecorder(robot, tmp_path / "run")
    run(recorder, plant)
    recorder.close()
    counts = Counter(topic for topic, _, _ in open_recording(tmp_path / "run").messages())
    assert counts["/ravenstate"] == pytest.approx(30, abs=3)
    assert counts["/ext_jpos"] > 10
    assert extract([tmp_path / "run"], tmp_path / "out").problems == ()


def test_a_full_disk_ends_only_the_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot, plant = simulated()
    recorder = BesideRecorder(robot, tmp_path / "run")
    run(recorder, plant)

    def full(*_: object) -> None:
        raise RecordingError("no space left; what came before is safe")

    monkeypatch.setattr(recorder._recorder.journal, "append", full)
    run(recorder, plant)
    assert "no space left" in recorder.observe()
    assert "no space left" in recorder.close()


def test_a_robot_behind_topics_is_recorded_from_its_topics(tmp_path: Path) -> None:
    setup = RobotOnLoopback(homed_plant("left"))
    with CrtkClient(setup.transport) as client:
        robot = OperatedRobot("raven2", client, load_robot("raven2"), lambda: 0)
        recorder = BesideRecorder(robot, tmp_path / "run", clock=lambda: setup.clock.now() * 1e-9)
        for _ in range(500):
            client.wait()
            recorder.observe()
        recorder.close()
    assert recorder.messages > 15


def test_other_robots_are_refused(tmp_path: Path) -> None:
    robot, plant = simulated()
    with pytest.raises(InputError, match="RAVEN-II"):
        BesideRecorder(OperatedRobot("panda", plant, robot.model, lambda: 0), tmp_path / "run")
