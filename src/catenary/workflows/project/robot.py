"""What a calibration asks of a robot, simulated or real: the project's steps that need one."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

from catenary.calibration.model import CalibrationModel
from catenary.calibration.progress import Progress, silent
from catenary.trajectories.reference import Trajectory
from catenary.workflows.project.folder import Project


class ProjectRobot(Protocol):
    """Does the steps of a project that need a robot; each only unless it was done, and each by itself."""

    def home(self, project: Project) -> bool:
        """Home it; whether it had to be done. Writes robot/home.json."""
        ...

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
        """Drive it along a trajectory of its positioning joints and record it into recordings/NAME.

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
        ...

    def deploy(
        self,
        project: Project,
        model: CalibrationModel,
        trajectory: Trajectory,
        *,
        after: str,
        real_time: bool = True,
    ) -> Mapping[str, Any]:
        """Run a model in its 1 kHz loop along a trajectory; give `Deployment.as_data`."""
        ...


def empty(folder: Path) -> None:
    """Make room for a step that is done again."""
    import shutil

    if folder.exists():
        shutil.rmtree(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
