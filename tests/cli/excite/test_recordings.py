from pathlib import Path

import pytest

from catenary.recording.bag_reader import open_recording
from catenary.workflows.project.folder import project_settings
from command_line import catenary


def test_excite_that_was_done_does_nothing(project_folder: Path) -> None:
    assert "nothing to do" in catenary("excite", project_folder).out
    assert catenary("excite", project_folder, "--json").json["run"] is False


def test_excite_homes_a_new_robot_first_and_records_its_state_at_100_hz(tmp_path: Path) -> None:
    project = tmp_path / "new"
    zigzag = ("--direction", "J1", "--sparsity", "1", "--state-rate", "100")
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


def test_record_makes_further_recordings(project_folder: Path) -> None:
    content = catenary("record", project_folder, "--hours", "0.003", "--name", "again", "--json").json
    assert content["seconds"] == pytest.approx(10.8)
    assert (project_folder / "recordings" / "again").is_dir()
