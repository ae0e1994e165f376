from dataclasses import replace
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
def work(tmp_path: Path) -> Work:
    return Work(tmp_path / "file")


def reopened(project: Project) -> Project:
    return Project(project.folder, project.settings)


def test_a_step_is_done_once(project: Project, work: Work) -> None:
    assert [project.run("step", [1], [work.path], work) for _ in range(2)] == [True, False]
    assert work.times == 1


def test_a_step_stays_done_when_the_project_is_opened_again(project: Project, work: Work) -> None:
    project.run("step", [1, (2.0, None)], [work.path], work)
    assert not reopened(project).run("step", [1, (2.0, None)], [work.path], work)


def test_a_step_is_repeated_when_what_it_is_made_from_changed(project: Project, work: Work) -> None:
    project.run("step", [1], [work.path], work)
    assert project.run("step", [2], [work.path], work)


def test_a_step_is_repeated_when_a_file_of_it_is_gone(project: Project, work: Work) -> None:
    project.run("step", [1], [work.path], work)
    work.path.unlink()
    assert project.run("step", [1], [work.path], work)


def fail() -> None:
    raise OSError("unplugged")


def test_a_step_that_fails_is_not_done(project: Project, work: Work) -> None:
    with pytest.raises(OSError, match="unplugged"):
        project.run("step", [1], [work.path], fail)
    assert reopened(project).run("step", [1], [work.path], work)


def test_a_step_that_failed_with_other_settings_is_not_taken_for_the_one_before(
    project: Project, work: Work
) -> None:
    project.run("step", [1], [work.path], work)
    with pytest.raises(OSError, match="unplugged"):
        project.run("step", [2], [work.path], fail)  # may have written half of its files over those of [1]
    assert reopened(project).run("step", [1], [work.path], work)


def test_steps_before_one_that_fails_stay_done(project: Project, work: Work) -> None:
    project.run("first", [1], [work.path], work)
    with pytest.raises(OSError, match="unplugged"):
        project.run("second", [1], [], fail)
    assert not reopened(project).run("first", [1], [work.path], work)


def test_a_step_that_was_not_done_has_no_fingerprint(project: Project) -> None:
    with pytest.raises(ConfigError, match="step was not done yet"):
        project.fingerprint_of("step")


def test_fingerprints_differ_with_what_a_step_is_made_from(project: Project) -> None:
    project.run("a", [1], [], lambda: None)
    project.run("b", [2], [], lambda: None)
    assert project.fingerprint_of("a") != project.fingerprint_of("b")


@pytest.mark.parametrize("content", ["{", "3", "[1]", '{"home": 3}', '{"home": {}}', b"\xff\xfe"])
def test_damaged_steps_are_refused(project: Project, content: str | bytes) -> None:
    (project.folder / STEPS).write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(ConfigError, match=r"steps\.json: damaged.*delete it"):
        reopened(project)


def test_settings_are_kept(tmp_path: Path) -> None:
    settings = ProjectSettings(seed=3, side="right", base_tilt_deg=(5.0, -2.0), sparsities=(0.5, 0.25))
    Project(tmp_path, settings)
    assert project_settings(tmp_path) == settings


def test_a_folder_without_a_project_has_no_settings(tmp_path: Path) -> None:
    assert project_settings(tmp_path) is None


@pytest.mark.parametrize(
    "content", ["{", "[]", "{}", '{"base_tilt_deg": 3, "sparsities": []}', '{"color": "red"}', b"\xff"]
)
def test_damaged_settings_are_refused(project: Project, content: str | bytes) -> None:
    path = project.folder / "settings.json"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(ConfigError, match=r"settings\.json: not the settings of a project"):
        project_settings(project.folder)


def test_a_folder_with_other_things_in_it_is_no_project(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("")
    with pytest.raises(FileFormatError, match="is neither empty nor a project"):
        Project(tmp_path, ProjectSettings())
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_a_file_is_no_project(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FileFormatError, match="cannot be made a project"):
        Project(tmp_path / "file", ProjectSettings())


@pytest.mark.parametrize(
    "wrong",
    [
        {"side": "middle"},
        {"seed": -1},
        {"base_tilt_deg": (1.0,)},
        {"base_tilt_deg": (float("nan"), 0.0)},
        {"payload_kg": -1.0},
        {"payload_kg": float("inf")},
        {"direction": "J4"},
        {"sparsities": ()},
        {"sparsities": (0.5, 0.0)},
        {"sparsities": (float("nan"),)},
        {"test_minutes": 0.0},
        {"test_minutes": float("nan")},
        {"state_rate_hz": 0.0},
    ],
    ids=str,
)
def test_settings_that_nothing_can_have_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="expected"):
        replace(ProjectSettings(), **wrong)
