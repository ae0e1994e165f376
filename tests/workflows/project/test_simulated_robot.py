import json
from dataclasses import replace
from pathlib import Path
from shutil import copytree
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.arrays import Floats
from catenary.errors import ConfigError, FileFormatError
from catenary.recording.logs import read_log
from catenary.simulation.cable_plant import CablePlant, telemetry_of
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.workflows.project import robot as simulated_robot
from catenary.workflows.project.calibrate import TEST, TRAIN, evaluation_motion, extract_recording, motion_log_path
from catenary.workflows.project.folder import Project
from catenary.workflows.project.kinds import project_kind
from catenary.workflows.project.robot import SimulatedRobot
from simulated_project import SHORT

ROBOT = SimulatedRobot()


@pytest.fixture
def project(project_folder: Path) -> Project:
    return Project(project_folder, SHORT)


def test_what_was_done_is_not_done_again(project: Project) -> None:
    assert not ROBOT.home(project)
    assert not ROBOT.record(project, TRAIN, *project_kind(project.settings).excitation(), after="home")
    assert not ROBOT.home(Project(project.folder, replace(SHORT, direction="J1", test_minutes=1.0)))


OTHERS = [{"seed": 2}, {"side": "right"}, {"payload_kg": 0.2}, {"base_tilt_deg": (3.0, 0.0)}]


@pytest.mark.alike
@pytest.mark.parametrize("change", OTHERS, ids=str)
def test_another_robot_is_homed_again(project: Project, change: dict[str, Any]) -> None:
    assert ROBOT.home(Project(project.folder, replace(SHORT, **change)))


def test_the_robot_of_another_version_is_homed_again(project, monkeypatch) -> None:
    left = project.folder / "robot" / f"after_{TRAIN}.npz"
    assert left.is_file()
    monkeypatch.setattr(simulated_robot, "STATE_FORMAT", "another")
    assert ROBOT.home(project)
    assert not left.is_file()


def test_a_state_that_cannot_be_read_is_made_again(project: Project) -> None:
    (project.folder / "robot" / "homed.npz").write_bytes(b"nonsense")
    assert ROBOT.home(project)
    assert not ROBOT.home(project)


def test_another_motion_is_recorded_again(project: Project) -> None:
    changed = Project(project.folder, replace(SHORT, test_minutes=0.2))
    assert ROBOT.record(changed, TEST, *evaluation_motion(changed, 12.0), after=TRAIN)
    assert extract_recording(changed, TEST)
    assert read_log(motion_log_path(changed, TEST)).time[-1] < 12.0


def test_a_recording_made_again_is_the_same(project: Project) -> None:
    before = read_log(motion_log_path(project, TEST))
    motion_log_path(project, TEST).unlink()
    (project.folder / "robot" / f"after_{TEST}.npz").unlink()
    assert ROBOT.record(project, TEST, *evaluation_motion(project, 15.0), after=TRAIN)
    assert extract_recording(project, TEST)
    assert_allclose(read_log(motion_log_path(project, TEST)).q_nominal, before.q_nominal, rtol=0)


def test_steps_on_what_was_not_done_or_by_another_robot_are_refused(project: Project) -> None:
    with pytest.raises(ConfigError, match="record other was not done yet"):
        ROBOT.record(project, "more", *evaluation_motion(project, 12.0), after="other")
    with pytest.raises(ConfigError, match="record other was not done yet"):
        extract_recording(project, "other")
    tilted = Project(project.folder, replace(SHORT, base_tilt_deg=(3.0, 0.0)))
    with pytest.raises(FileFormatError, match="of another robot"):
        ROBOT.record(tilted, "more", *evaluation_motion(tilted, 12.0), after=TRAIN)


def truth_of(project: Project, seconds: float, monkeypatch: pytest.MonkeyPatch) -> dict[str, Floats]:
    """Record a motion; return what the plant itself did on every tick of it, q besides its telemetry."""
    pieces: list[dict[str, Floats]] = []
    run = CablePlant.run

    def watched(plant: CablePlant, rows: Floats) -> Any:
        log = run(plant, rows)
        pieces.append(telemetry_of(plant, log) | {"q": log.q})
        return log

    monkeypatch.setattr(CablePlant, "run", watched)
    motion = random_sinusoids(np.random.default_rng(5), seconds)
    ROBOT.record(project, "seen", motion, "seen", after=TRAIN)
    ticks = round(1000.0 * seconds)  # what came before is the way to its start
    return {name: np.concatenate([piece[name] for piece in pieces])[-ticks:] for name in pieces[0]}


@pytest.mark.parametrize("side", ["left", "right"])
def test_what_is_extracted_is_what_it_did(tmp_path: Path, side: str, monkeypatch: pytest.MonkeyPatch) -> None:
    project = Project(tmp_path, replace(SHORT, side=side))
    ROBOT.home(project)
    ROBOT.record(project, TRAIN, random_sinusoids(np.random.default_rng(4), 10.0), "a while", after="home")
    truth = truth_of(project, 12.0, monkeypatch)
    extract_recording(project, "seen")
    log = read_log(motion_log_path(project, "seen"))
    at = np.round(1000.0 * log.time).astype(int)
    assert log.q_encoder is not None
    assert log.tau is not None
    # degrees and millimetres in single precision: half a unit in the last place of 180, and of 560
    assert_allclose(log.q_nominal, truth["measured_js"][at, :3], atol=2e-7)
    assert_allclose(log.tau, truth["measured_js_effort"][at, :3], rtol=1e-6, atol=1e-6)
    # encoders come at 100 Hz: within 10 ms joints go at most 7e-2 rad/s, 7e-3 m/s; and a count on either side
    moved = np.abs(np.diff(truth["q"], axis=0)).max(axis=0) * 10
    count = 1.0 / np.abs(CablePlant(side=side, seed=1).encoders.rig.counts)
    error = np.abs(log.q_encoder - truth["ext_jpos"][at])
    assert (error <= moved + count).all()


def test_a_recording_that_no_step_made_is_extracted_once(project: Project) -> None:
    recordings = project.folder / "recordings"
    copytree(recordings / TEST, recordings / "mine")
    assert extract_recording(project, "mine")
    assert read_log(motion_log_path(project, "mine")).robot == "raven2"
    assert not extract_recording(Project(project.folder, SHORT), "mine")


def test_a_recording_is_extracted_as_it_is_and_said_to_have_changed(project: Project) -> None:
    recording = project.folder / "recordings" / TEST
    for file in recording.iterdir():
        with file.open("ab") as journal:
            journal.write(b"\x00")
    assert not extract_recording(project, TEST)  # its log is still that of the whole recording
    motion_log_path(project, TEST).unlink()
    assert extract_recording(project, TEST)
    report = json.loads((project.folder / f"{TEST}.synchronised.json").read_bytes())
    assert f"{recording}: differs from what was recorded; its present content was extracted" in report["problems"]
