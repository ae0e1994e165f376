"""A project on a simulated robot, as short as one can be: a zig-zag of two minutes, a test of a quarter of one."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from catenary.calibration.fit_options import FitOptions
from catenary.workflows.project import calibrate
from catenary.workflows.project.calibrate import extract_recording
from catenary.workflows.project.folder import Project, ProjectSettings
from catenary.workflows.project.robot import SimulatedRobot

SHORT = ProjectSettings(seed=1, sparsities=(1.0,), test_minutes=0.25)
POSITIONS = ("q:shoulder", "q:elbow", "q:insertion")
QUICK_MODELS = {
    "linear": FitOptions(kind="linear", inputs=POSITIONS),
    calibrate.RECOMMENDED: FitOptions(kind="linear", inputs=POSITIONS, ridge=1.0),
}


def record_short(folder: Path) -> Project:
    """Home a robot, record both motions and extract them."""
    project, robot = Project(folder, SHORT), SimulatedRobot()
    robot.home(project)
    robot.record(project, calibrate.TRAIN, *calibrate.training_motion(project), after="home")
    robot.record(
        project, calibrate.TEST, *calibrate.evaluation_motion(project, 60.0 * SHORT.test_minutes), after=calibrate.TRAIN
    )
    for name in (calibrate.TRAIN, calibrate.TEST):
        extract_recording(project, name)
    return project


def calibrate_short(folder: Path, *, with_page: bool = True, **changes: Any) -> calibrate.CalibrationResult:
    """Calibrate a project by linear models, two seconds in the loop; a page takes as long as all the rest."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(calibrate, "models_for", lambda *_: QUICK_MODELS)
        patch.setattr(calibrate, "_DEPLOY_S", 2.0)
        if not with_page:
            patch.setattr(calibrate, "write_project_report", lambda page, *_, **__: page.write_text("a page"))
        return calibrate.calibrate_robot(Project(folder, replace(SHORT, **changes)))
