import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import simulated_arm
from catenary.calibration.fit import FitOptions
from catenary.errors import CatenaryError, InputError
from catenary.workflows.fit import FitRun
from catenary.workflows.project import calibrate, simulated_robot
from catenary.workflows.project.calibrate import (
    BEST,
    CalibrationResult,
    calibrate_recordings,
    calibrate_robot,
    models_for,
)
from catenary.workflows.project.folder import Project, ProjectSettings
from simulated_project import QUICK_MODELS, SHORT

FITS = tuple(f"fit {name}" for name in QUICK_MODELS)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Linear models, and two seconds in the loop."""
    monkeypatch.setattr(calibrate, "models_for", lambda *_: QUICK_MODELS)
    monkeypatch.setattr(calibrate, "DEPLOY_SECONDS", 2.0)


@pytest.fixture
def recordings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Path, Path]:
    """Two recordings of an arm of three joints, and models for it."""
    models: Mapping[str, FitOptions] = {"linear": FitOptions(kind="linear"), BEST: FitOptions(kind="linear")}
    monkeypatch.setattr(calibrate, "models_for", lambda *_: models)
    return (
        simulated_arm.write(tmp_path / "monday.npz", seed=1),
        simulated_arm.write(tmp_path / "tuesday.npz", seed=2),
    )


def calibrated(folder: Path, **changes: Any) -> CalibrationResult:
    return calibrate_robot(Project(folder, replace(SHORT, **changes)))


def from_recordings(folder: Path, train: list[Path], test: list[Path]) -> CalibrationResult:
    return calibrate_recordings(Project(folder, ProjectSettings()), train, test, FitRun())


@pytest.mark.slow
def test_everything_is_done_once(tmp_path: Path) -> None:
    steps = calibrated(tmp_path).repeated
    assert steps == ("home", "excite", "record", "extract train", "extract test", *FITS, "deploy")
    assert calibrated(tmp_path).repeated == ()


def test_what_was_done_step_by_step_is_not_repeated(project_folder: Path) -> None:
    assert calibrated(project_folder).repeated == (*FITS, "deploy")


def test_another_test_motion_repeats_what_depends_on_it(project_folder: Path) -> None:
    calibrated(project_folder)
    assert calibrated(project_folder, test_minutes=0.2).repeated == ("record", "extract test", "deploy")


def test_it_goes_on_after_a_step_that_failed(project_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as broken:

        def fail(*_: object, **__: object) -> None:
            raise CatenaryError("the loop fell over")

        broken.setattr(simulated_robot, "deploy_on_simulated", fail)
        with pytest.raises(CatenaryError, match="fell over"):
            calibrated(project_folder)
    assert calibrated(project_folder).repeated == ("deploy",)


def test_results_are_written(project_folder: Path) -> None:
    result = calibrated(project_folder)
    content = json.loads((project_folder / "evaluation.json").read_text())
    assert set(content["models"]) == set(QUICK_MODELS)
    assert content["deployment"]["ticks"] >= 2000
    assert result.model_path.is_file()


def test_the_page_has_the_loop_and_says_that_it_is_simulated(project_folder: Path) -> None:
    page = calibrated(project_folder).page.read_text()
    assert "Deployed in the 1 kHz loop" in page
    assert "Simulated: no real robot was measured" in page


@pytest.mark.slow
def test_every_kind_of_model_is_fitted_to_a_robots_recordings(
    project_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(calibrate, "models_for", models_for)
    result = calibrated(project_folder)
    assert list(result.evaluations) == ["linear", "polynomial", "neural_paper", BEST]


def test_recordings_take_a_robots_place(recordings: tuple[Path, Path], tmp_path: Path) -> None:
    result = from_recordings(tmp_path / "project", [recordings[0]], [recordings[1]])
    assert result.repeated == FITS
    assert result.deployment is None
    assert result.page.is_file()


def test_models_of_the_same_recordings_are_not_fitted_again(
    recordings: tuple[Path, Path], tmp_path: Path
) -> None:
    from_recordings(tmp_path / "project", [recordings[0]], [recordings[1]])
    assert from_recordings(tmp_path / "project", [recordings[0]], [recordings[1]]).repeated == ()


def test_models_of_changed_recordings_are_fitted_again(recordings: tuple[Path, Path], tmp_path: Path) -> None:
    from_recordings(tmp_path / "project", [recordings[0]], [recordings[1]])
    simulated_arm.write(recordings[0], seed=5)
    assert from_recordings(tmp_path / "project", [recordings[0]], [recordings[1]]).repeated == FITS


def test_an_error_of_nothing_is_a_dash_in_the_table(recordings: tuple[Path, Path], tmp_path: Path) -> None:
    q = simulated_arm.arrays(seed=2)["q_des"]
    perfect = simulated_arm.write(tmp_path / "perfect.npz", q_act=q)
    exact = simulated_arm.write(tmp_path / "exact.npz", q_act=q, seed=3)
    _, rows = from_recordings(tmp_path / "project", [perfect], [exact]).table()
    assert not any("nan" in cell for row in rows for cell in row)


def test_a_recording_on_both_sides_is_refused(recordings: tuple[Path, Path], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be both"):
        from_recordings(tmp_path / "project", list(recordings), [recordings[0]])


def test_a_copy_of_a_recording_on_the_other_side_is_refused(
    recordings: tuple[Path, Path], tmp_path: Path
) -> None:
    copy = tmp_path / "copy.npz"
    copy.write_bytes(recordings[0].read_bytes())
    with pytest.raises(InputError, match=r"copy\.npz: a recording cannot be both"):
        from_recordings(tmp_path / "project", [recordings[0]], [copy])


def test_a_missing_test_recording_is_refused_before_anything_is_fitted(
    recordings: tuple[Path, Path], tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="no such recording"):
        from_recordings(tmp_path / "project", [recordings[0]], [tmp_path / "none.npz"])
    assert not (tmp_path / "project" / "models").exists()


def test_recordings_to_test_on_are_needed(recordings: tuple[Path, Path], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--test"):
        from_recordings(tmp_path / "project", [recordings[0]], [])


def test_the_model_takes_the_error_of_recordings_away(recordings: tuple[Path, Path], tmp_path: Path) -> None:
    result = from_recordings(tmp_path / "project", [recordings[0]], [recordings[1]])
    joints = result.evaluations[BEST].joints
    assert all(joint.rmse < 0.1 * joint.raw_rmse for joint in joints)
    assert np.isfinite([joint.rmse for joint in joints]).all()
