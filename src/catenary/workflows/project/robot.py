"""The steps of a project that need a robot, simulated or real."""

import logging
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

from catenary.calibration.fit_options import Progress, silent
from catenary.calibration.model import CalibrationModel
from catenary.recording.topics import Arm
from catenary.trajectories.reference import Trajectory
from catenary.workflows.project.folder import Project

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Take:
    """A recording to be made."""

    folder: Path
    name: str
    trajectory: Trajectory  # of the three positioning joints
    motion: Any  # what the trajectory is, as plain data
    after: str  # "home", or the name of the recording before
    progress: Progress


class ProjectRobot(ABC):
    """The steps of a project that need a robot; one that was done before is not run again."""

    @abstractmethod
    def home(self, project: Project) -> bool:
        """Home it, write robot/home.json, and return whether that had to be done."""

    def record(
        self,
        project: Project,
        name: str,
        trajectory: Trajectory,
        motion: Any,
        *,
        after: str,
        progress: Progress = silent,
    ) -> bool:
        """Drive it along a trajectory and record that into recordings/NAME; return whether that had to be done.

        Args:
            project: The project.
            name: Of the recording.
            trajectory: Of the three positioning joints.
            motion: What the trajectory is, as plain data.
            after: "home", or the name of the recording before.
            progress: Called with the share done.

        Raises:
            LimitError: The motion leaves the joint limits; nothing has moved.
            ConfigError: The step before was not done.
        """
        before = after if after == "home" else f"record {after}"
        made_from = [motion, project.settings.state_rate_hz, project.fingerprint_of(before)]
        take = Take(project.folder / "recordings" / name, name, trajectory, motion, after, progress)
        files = self.files(project, take)
        return project.run(f"record {name}", made_from, files, lambda: self.drive(project, take))

    @abstractmethod
    def drive(self, project: Project, take: Take) -> None:
        """Make a recording."""

    def files(self, project: Project, take: Take) -> list[Path]:
        """Return what a recording leaves behind."""
        return [take.folder]

    @abstractmethod
    def deploy(
        self, project: Project, model: CalibrationModel, trajectory: Trajectory, *, after: str
    ) -> Mapping[str, Any]:
        """Run a model in its 1 kHz loop along a trajectory, and return its `Deployment` as plain data."""


def arm_of(project: Project) -> Arm:
    """Return the arm that a project is about."""
    return "gold" if project.settings.side == "left" else "green"


def set_aside(project: Project, name: str) -> None:
    """Move what was recorded under a name before to replaced/NAME, or NAME.2 and so on: it cannot be made again."""
    folder = project.folder / "recordings" / name
    if not folder.exists():
        return
    kept = project.folder / "replaced"
    kept.mkdir(exist_ok=True)
    numbered = (kept / (name if number == 1 else f"{name}.{number}") for number in count(1))
    place = next(path for path in numbered if not path.exists())
    folder.rename(place)
    _log.warning("%s: what was recorded before under this name lies in %s", folder, place)


def empty(folder: Path) -> None:
    """Remove the folder that a step wrote before, and make its parent."""
    import shutil

    if folder.exists():
        shutil.rmtree(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
