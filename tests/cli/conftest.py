"""What tests of several commands share: a recording, and a model fitted to it."""

from pathlib import Path

import pytest

import simulated_arm
from catenary.robots.catalog import load_robot
from catenary.workflows.project.folder import Project, ProjectSettings
from command_line import catenary
from moving_arm import recorded as recorded_arm
from moving_arm import write_npz


@pytest.fixture(scope="session")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of 400 rows; not to be written."""
    return simulated_arm.write(tmp_path_factory.mktemp("recording") / "run.npz")


@pytest.fixture(scope="session")
def model(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model of `run`; not to be written."""
    path = tmp_path_factory.mktemp("model") / "model.npz"
    assert catenary("fit", run, "--model", "linear", "--out", path).code == 0
    return path


@pytest.fixture(scope="session")
def begun(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a project in which nothing was done yet."""
    return Project(tmp_path_factory.mktemp("begun"), ProjectSettings()).folder


@pytest.fixture(scope="session")
def motion(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Four seconds of RAVEN-II moving, 800 rows, with torques."""
    path = tmp_path_factory.mktemp("motion") / "motion.npz"
    write_npz(recorded_arm(load_robot("raven2"), 0, seconds=4.0), path)
    return path
