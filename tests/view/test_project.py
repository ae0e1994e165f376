from pathlib import Path

import pytest

from catenary.errors import ConfigError
from catenary.recording.topics import PSM_JOINTS
from catenary.robots.catalog import load_robot
from catenary.view.project import shown_project
from catenary.workflows.project.folder import Project, ProjectSettings, is_project


def test_project_shows_its_test_and_its_recommended_model_as_soon_as_they_are_there(tmp_path: Path) -> None:
    folder = Project(tmp_path / "one", ProjectSettings(side="right")).folder
    assert is_project(folder)
    with pytest.raises(ConfigError, match="holds no motion log yet"):
        shown_project(folder)
    (folder / "train.parquet").touch()
    assert shown_project(folder) == (folder / "train.parquet", None, "raven2_right")
    (folder / "test.parquet").touch()
    (folder / "models").mkdir()
    (folder / "models" / "recommended.npz").touch()
    assert shown_project(folder) == (
        folder / "test.parquet",
        folder / "models" / "recommended.npz",
        "raven2_right",
    )


def test_folder_of_something_else_is_no_project(tmp_path: Path) -> None:
    assert not is_project(tmp_path)
    assert not is_project(Path("raven2"))


def test_a_psms_project_is_shown_in_the_joints_that_it_reports(tmp_path: Path) -> None:
    folder = Project(tmp_path / "psm", ProjectSettings(robot="dvrk_psm")).folder
    (folder / "train.parquet").touch()
    assert load_robot(str(shown_project(folder).robot)).joint_names == PSM_JOINTS
