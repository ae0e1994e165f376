import json
from dataclasses import replace
from pathlib import Path

import pytest

import simulated_arm
from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.errors import InputError
from catenary.workflows.project import calibrate
from catenary.workflows.project.calibrate import RECOMMENDED, CalibrationResult, calibrate_recordings
from catenary.workflows.project.folder import Project, ProjectSettings
from simulated_project import QUICK_MODELS, SHORT, calibrate_short

FITS = tuple(f"fit {name}" for name in QUICK_MODELS)


@pytest.fixture(scope="module")
def days(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two recordings of an arm of three joints."""
    folder = tmp_path_factory.mktemp("recordings")
    return tuple(simulated_arm.write(folder / f"day{k}.npz", seed=k) for k in (1, 2))


def calibrated(
    folder: Path, train: list[Path], test: list[Path], *, with_page: bool = False, run: FitRun | None = None
) -> CalibrationResult:
    with pytest.MonkeyPatch.context() as patch:
        linear = FitOptions(kind="linear")
        patch.setattr(calibrate, "models_for", lambda *_: dict.fromkeys(QUICK_MODELS, linear))
        if not with_page:
            patch.setattr(calibrate, "write_project_report", lambda page, *_, **__: page.write_text("a page"))
        return calibrate_recordings(Project(folder, ProjectSettings()), train, test, run=run)


def test_another_test_motion_repeats_what_depends_on_it(finished_folder: Path) -> None:
    repeated = calibrate_short(finished_folder, with_page=False, test_minutes=0.2).repeated
    assert repeated == ("record", "extract test", "deploy")


def test_results_are_written_and_said_to_be_simulated(finished: CalibrationResult) -> None:
    content = json.loads((finished.page.parent / "evaluation.json").read_text())
    assert set(content["models"]) == set(QUICK_MODELS)
    assert content["deployment"]["ticks"] >= 2000
    assert finished.model_path.is_file()
    page = finished.page.read_text()
    assert "Deployed in the 1 kHz loop" in page
    assert "Simulated: no real robot was measured" in page


@pytest.mark.slow
def test_every_kind_of_model_is_fitted_to_a_robots_recordings(project_folder: Path) -> None:
    settings = replace(SHORT, test_minutes=0.7)
    result = calibrate.calibrate_robot(Project(project_folder, settings))
    assert list(result.evaluations) == ["linear", RECOMMENDED]


@pytest.mark.usefixtures("undrawn")
def test_recordings_replace_a_robot_and_are_fitted_once(days: tuple[Path, Path], tmp_path: Path) -> None:
    train = tmp_path / "train.npz"
    train.write_bytes(days[0].read_bytes())
    result = calibrated(tmp_path / "project", [train], [days[1]], with_page=True)
    assert result.repeated == FITS
    assert result.deployment is None
    assert result.page.is_file()
    joints = result.evaluations[RECOMMENDED].joints
    assert all(joint.rmse < 0.1 * joint.raw_rmse for joint in joints)
    # not fitted again to the same recordings, and again to changed ones
    assert calibrated(tmp_path / "project", [train], [days[1]]).repeated == ()
    simulated_arm.write(train, seed=5)
    assert calibrated(tmp_path / "project", [train], [days[1]]).repeated == FITS


def test_unfit_tests_are_refused_before_anything_is_fitted(days: tuple[Path, Path], tmp_path: Path) -> None:
    project, train, copied = tmp_path / "project", list(days), tmp_path / "copy.npz"
    copied.write_bytes(train[0].read_bytes())
    for test, words in (
        ([train[0]], "cannot be both"),
        ([copied], r"copy\.npz: a recording cannot be both"),
        ([tmp_path / "none.npz"], "no such recording"),
        ([], "--test"),
    ):
        with pytest.raises(InputError, match=words):
            calibrated(project, train, test)
    assert not (project / "models").exists()
