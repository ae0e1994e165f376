from dataclasses import replace
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest

from catenary.errors import ConfigError, FileFormatError, InputError
from catenary.workflows.project.folder import STEPS, Project, ProjectSettings, project_settings


class Work:
    """A step's work: writes a file, and counts."""

    def __init__(self, path: Path) -> None:
        self.path, self.times = path, 0

    def __call__(self) -> None:
        self.times += 1
        self.path.write_text("done")


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return Project(tmp_path, ProjectSettings())


@pytest.fixture
def work(project: Project, tmp_path: Path) -> Work:
    """The work of a step that was done with [1, (2.0, None)]."""
    work = Work(tmp_path / "file")
    assert project.run("step", MADE_FROM, [work.path], work)
    return work


MADE_FROM = [1, (2.0, None)]


def reopened(project: Project) -> Project:
    return Project(project.folder, project.settings)


def fail() -> None:
    raise OSError("unplugged")


def test_a_step_is_done_once_also_when_the_project_is_opened_again(project: Project, work: Work) -> None:
    for opened in (project, reopened(project)):
        assert not opened.run("step", MADE_FROM, [work.path], work)
    assert work.times == 1


def test_a_step_is_repeated_when_its_inputs_changed_or_a_file_is_gone(project: Project, work: Work) -> None:
    assert project.run("step", [2], [work.path], work)
    work.path.unlink()
    assert project.run("step", [2], [work.path], work)


def test_a_step_that_fails_is_not_done_but_those_before_it_are(project: Project, work: Work) -> None:
    with pytest.raises(OSError, match="unplugged"):
        project.run("second", [1], [work.path], fail)
    assert not reopened(project).run("step", MADE_FROM, [work.path], work)
    assert reopened(project).run("second", [1], [work.path], work)


def test_a_step_that_failed_with_other_inputs_is_not_the_one_before(project: Project, work: Work) -> None:
    with pytest.raises(OSError, match="unplugged"):
        project.run("step", [2], [work.path], fail)  # may have written half of its files over the others
    assert reopened(project).run("step", MADE_FROM, [work.path], work)


def test_fingerprints_differ_with_what_a_step_is_made_from(project: Project, work: Work) -> None:
    project.run("other", [2], [], lambda: None)
    assert project.fingerprint_of("step") != project.fingerprint_of("other")
    with pytest.raises(ConfigError, match="third was not done yet"):
        project.fingerprint_of("third")


def test_settings_are_kept(tmp_path: Path) -> None:
    assert project_settings(tmp_path) is None
    settings = ProjectSettings(seed=3, side="right", base_tilt_deg=(5.0, -2.0), sparsities=(0.5, 0.25))
    Project(tmp_path, settings)
    assert project_settings(tmp_path) == settings


@pytest.mark.parametrize("content", [b"{", b"3", b"[1]", b'{"home": 3}', b'{"home": {}}', b"\xff\xfe"])
def test_damaged_steps_are_refused(project: Project, content: bytes) -> None:
    (project.folder / STEPS).write_bytes(content)
    with pytest.raises(ConfigError, match=r"steps\.json: damaged.*delete it"):
        reopened(project)


UNEVEN = b'{"base_tilt_deg": 3, "sparsities": []}'


@pytest.mark.parametrize("content", [b"{", b"[]", b"{}", UNEVEN, b'{"color": "red"}', b"\xff"])
def test_damaged_settings_are_refused(project: Project, content: bytes) -> None:
    (project.folder / "settings.json").write_bytes(content)
    with pytest.raises(ConfigError, match=r"settings\.json: not the settings of a project"):
        project_settings(project.folder)


def test_what_is_there_already_is_no_project(tmp_path: Path) -> None:
    thesis = tmp_path / "thesis.tex"
    thesis.write_text("")
    for folder, words in ((tmp_path, "is neither empty nor a project"), (thesis, "cannot be made a project")):
        with pytest.raises(FileFormatError, match=words):
            Project(folder, ProjectSettings())
    assert list(tmp_path.iterdir()) == [thesis]


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("side", "middle"), ("seed", -1), ("base_tilt_deg", (1.0,)), ("base_tilt_deg", (nan, 0.0)),
        ("payload_kg", -1.0), ("payload_kg", inf), ("direction", "J4"), ("form", "paper"), ("form", "newest"), ("sparsities", ()), ("sparsities", (0.5, 0.0)),
        ("sparsities", (nan,)), ("test_minutes", 0.0), ("test_minutes", nan), ("state_rate_hz", 0.0),
    ],
)  # fmt: skip
def test_settings_that_nothing_can_have_are_refused(setting: str, value: Any) -> None:
    with pytest.raises(InputError, match=r"expected|has one form"):
        replace(ProjectSettings(), **{setting: value})
