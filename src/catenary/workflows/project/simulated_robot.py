"""A simulated robot in a project: home it, drive it, record it, deploy on it; each from where it was left."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from catenary.calibration.model import CalibrationModel
from catenary.config import plain_data
from catenary.errors import ConfigError, FileFormatError
from catenary.recording.journal import About
from catenary.recording.recorder import Recorder
from catenary.simulation.firmware_plant import FirmwarePlant
from catenary.simulation.plant_state import FORMAT as STATE_FORMAT
from catenary.simulation.plant_state import restore_plant, save_plant
from catenary.simulation.simulated_plant import PERIOD
from catenary.trajectories.reference import Trajectory
from catenary.trajectories.smoothed_path import go_to
from catenary.workflows.project.deploy import deploy_on_robot
from catenary.workflows.project.folder import Project, ProjectSettings, write
from catenary.workflows.project.kinds import kind_of
from catenary.workflows.project.robot import ProjectRobot, Take, empty
from catenary.workflows.robot.motion import check_motion
from catenary.workflows.simulated_recording import driven

CHUNK = 20_000  # ticks whose telemetry is held at once


class SimulatedRobot(ProjectRobot):
    """The robot of a project without a real one; the same settings give the same robot."""

    def home(self, project: Project) -> bool:
        """Home it; again when another version's robot has other numbers, or cannot read the state that was left."""
        folder = project.folder / "robot"
        homed = folder / "homed.npz"
        readable = True
        if homed.is_file():
            try:
                restore_plant(make_plant(project.settings), homed)
            except FileFormatError:
                readable = False

        def work() -> None:
            folder.mkdir(exist_ok=True)
            for left in folder.glob("after_*.npz"):
                left.unlink()  # of the robot before it was homed again
            plant = make_plant(project.settings)
            plant.home()
            save_plant(plant, homed)
            content = {
                "simulated": True,
                "seconds": plant.time,
                "joint_names": plant.joint_names,
                "believed": plant.control.joint,
                "external_encoders": plant.external_encoders(),
                "true": plant.state.q,
            }
            write(folder / "home.json", content)

        files = [homed, folder / "home.json"]
        return project.run("home", _robot_settings(project.settings), files, work, trusted=readable)

    def files(self, project: Project, take: Take) -> list[Path]:
        """Return the recording's folder, and the robot as it was left."""
        return [take.folder, left_at(project, take.name)]

    def drive(self, project: Project, take: Take) -> None:
        """Record as fast as the machine runs, from where the step before left the robot; then put it away again."""
        settings, before = project.settings, left_at(project, take.after)
        if not before.is_file():
            raise ConfigError(f"{before}: is missing; do the step {take.after} first")
        plant = make_plant(settings)
        restore_plant(plant, before)
        plant.state_command("enable")
        kind = kind_of(settings)
        check_motion(plant, take.trajectory, joints=kind.joints)
        empty(take.folder)
        made = {"motion": take.motion}
        about = About(robot=kind.recorded_as, simulated=True, seed=settings.seed, configuration=made)
        rng = np.random.default_rng([0 if settings.seed is None else settings.seed, *take.name.encode()])
        start, speeds = plant.control.setpoint[: len(kind.joints)], np.array(kind.approach)
        approach = go_to(start, take.trajectory(0.0).q, max_velocity=speeds, max_acceleration=2.0 * speeds)
        for _ in driven(plant, approach, CHUNK):
            pass
        begin = plant.time
        with Recorder(take.folder, kind.topics, kind.columns, rng, about=about) as recorder:
            for log, done in driven(plant, take.trajectory, CHUNK):
                time = plant.time - begin - PERIOD * np.arange(len(log.joint), 0, -1)
                recorder.observe_many(np.round(time, 6), kind.telemetry(plant, log))
                take.progress(done)
        plant.state_command("pause")
        save_plant(plant, left_at(project, take.name))

    def deploy(
        self, project: Project, model: CalibrationModel, trajectory: Trajectory, *, after: str
    ) -> Mapping[str, Any]:
        """Run a model in its loop in real time, from where `after` left the robot."""
        plant = make_plant(project.settings)
        restore_plant(plant, left_at(project, after))
        plant.state_command("enable")
        return dict(plain_data(deploy_on_robot(plant, model, trajectory, real_time=True)))


def left_at(project: Project, step: str) -> Path:
    """Return the file in which the robot was put away after homing or a recording."""
    return project.folder / "robot" / ("homed.npz" if step == "home" else f"after_{step}.npz")


def make_plant(settings: ProjectSettings) -> FirmwarePlant[Any]:
    """Return the robot of a project, just switched on."""
    return kind_of(settings).plant()


def _robot_settings(settings: ProjectSettings) -> Any:
    """Return all that makes the robot another one; a new version may bring other numbers, or another form of states."""
    who = [settings.robot, settings.side, settings.seed, settings.base_tilt_deg, settings.payload_kg]
    return [*who, STATE_FORMAT, kind_of(settings).numbers()]
