"""What tests of several commands share: a recording, and a model fitted to it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

import simulated_arm
from catenary.crtk import network
from catenary.robots.catalog import load_robot
from catenary.workflows.project.folder import Project, ProjectSettings
from command_line import catenary
from moving_arm import recorded as recorded_arm
from moving_arm import write_npz
from oracles.crtk_robot import RobotOnLoopback
from oracles.encoded_plant import EncodedPlant


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


@pytest.fixture
def on_ros(monkeypatch: pytest.MonkeyPatch) -> RobotOnLoopback:
    """A robot, not homed, where commands look for one on ROS."""
    robot = RobotOnLoopback(EncodedPlant(ready=False), every=5)

    @contextmanager
    def transport(*_: object) -> Iterator[Any]:
        yield robot.transport

    monkeypatch.setattr(network, "make_transport", transport)
    return robot


class NoPage:
    """In the place of the page's process, which takes seconds to start."""

    url = "http://127.0.0.1:18092/0123456789abcdefghijkl/"

    def __init__(self, **_: object) -> None: ...

    def __enter__(self) -> "NoPage":
        return self

    def __exit__(self, *_: object) -> None: ...

    def open(self, shown: object) -> str:
        return self.url


@pytest.fixture
def no_page(monkeypatch: pytest.MonkeyPatch) -> str:
    """Views without the process of their page; the page's address."""
    monkeypatch.setattr("catenary.view.page_process.PageProcess", NoPage)
    return NoPage.url
