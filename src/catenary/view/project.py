"""A project's recordings and models, to be shown."""

from pathlib import Path
from typing import NamedTuple

from catenary.errors import ConfigError
from catenary.workflows.project.calibrate import RECOMMENDED, TEST, TRAIN
from catenary.workflows.project.folder import project_settings


class ShownProject(NamedTuple):
    """What there is of a project to be shown."""

    log: Path
    model: Path | None
    robot: str | None  # its name in the catalogue


def shown_project(folder: Path) -> ShownProject:
    """Return a project's test recording and recommended model, or as much as there is by now."""
    settings = project_settings(folder)
    logs = [folder / f"{name}.parquet" for name in (TEST, TRAIN)]
    found = [log for log in logs if log.is_file()]
    if not found:
        raise ConfigError(f"{folder}: holds no motion log yet; run catenary calibrate {folder}")
    model = folder / "models" / f"{RECOMMENDED}.npz"
    robot = None
    if settings is not None:
        robot = "raven2_right" if settings.side == "right" and settings.robot == "raven2" else settings.robot
    return ShownProject(found[0], model if model.is_file() else None, robot)
