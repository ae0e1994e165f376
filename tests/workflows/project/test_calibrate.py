import json
from dataclasses import replace
from pathlib import Path

import pytest

from catenary.workflows.project import calibrate
from catenary.workflows.project.calibrate import RECOMMENDED, CalibrationResult
from catenary.workflows.project.folder import Project
from simulated_project import QUICK_MODELS, SHORT, calibrate_short


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
