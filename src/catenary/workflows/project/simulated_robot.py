"""A simulated RAVEN-II in a project: home it, drive it, record it, deploy on it; each from where it was left."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.model import CalibrationModel
from catenary.calibration.progress import Progress, silent
from catenary.errors import ConfigError, FileFormatError
from catenary.recording.journal import About
from catenary.recording.recorder import Recorder
from catenary.recording.topics import raven_topics
from catenary.simulation.base_motion import FixedBase
from catenary.simulation.cable_parameters import load_cable_arm
from catenary.simulation.cable_plant import JOINTS, CablePlant
from catenary.simulation.firmware import TickLog
from catenary.simulation.plant_state import FORMAT as STATE_FORMAT
from catenary.simulation.plant_state import restore_plant, save_plant
from catenary.simulation.raven_telemetry import COLUMNS, telemetry_of
from catenary.simulation.simulated_plant import PERIOD
from catenary.trajectories.point_to_point import go_to
from catenary.trajectories.reference import Trajectory
from catenary.workflows.project.deploy import deploy_on_simulated
from catenary.workflows.project.folder import Project, ProjectSettings, write
from catenary.workflows.project.robot import empty
from catenary.workflows.robot.motion import check_motion

CHUNK = 20_000  # ticks whose telemetry is held at once
CALIBRATED = 3


class SimulatedRobot:
    """The robot of a project without a real one; the same settings give the same robot."""

    def home(self, project: Project) -> bool:
        """Home it; again when another version's robot has other numbers, or cannot read the state that was left."""
        folder = project.folder / "robot"
        homed = folder / "homed.npz"
        if homed.is_file():
            try:
                restore_plant(make_plant(project.settings), homed)
            except FileFormatError:
                homed.unlink()  # the step is not done without it

        def work() -> None:
            folder.mkdir(exist_ok=True)
            for left in folder.glob("after_*.npz"):
                left.unlink()  # of the robot before it was homed again
            plant = make_plant(project.settings)
            plant.home()
            save_plant(plant, homed)
            telemetry = plant.telemetry()
            write(
                folder / "home.json",
                {
                    "simulated": True,
                    "seconds": plant.time,
                    "joint_names": plant.joint_names,
                    "believed": plant.control.joint,
                    "external_encoders": telemetry["ext_jpos"],
                    "true": plant.state.q,
                },
            )

        return project.run("home", _robot_settings(project.settings), [homed, folder / "home.json"], work)

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
        """Drive and record it, as fast as the machine runs, from where `after` left it; then put it away again."""
        settings = project.settings
        recording = project.folder / "recordings" / name
        before, left = left_at(project, after), left_at(project, name)
        made_from = [
            motion,
            settings.state_rate_hz,
            project.fingerprint_of(after if after == "home" else f"record {after}"),
        ]

        def work() -> None:
            if not before.is_file():
                raise ConfigError(f"{before}: is missing; do the step {after} first")
            plant = make_plant(settings)
            restore_plant(plant, before)
            plant.state_command("enable")
            check_motion(plant, trajectory, joints=JOINTS[:CALIBRATED])
            empty(recording)
            topics = raven_topics(
                "gold" if settings.side == "left" else "green", state_rate=settings.state_rate_hz
            )
            about = About(
                robot=settings.robot if settings.side == "left" else f"{settings.robot}_right",
                simulated=True,
                seed=settings.seed,
                configuration={"motion": motion},
            )
            seed = 0 if settings.seed is None else settings.seed
            rng = np.random.default_rng([seed, *name.encode()])
            approach = go_to(plant.control.setpoint[:CALIBRATED], trajectory(0.0).q, max_velocity=[0.2, 0.2, 0.01],
                             max_acceleration=[0.4, 0.4, 0.02])  # fmt: skip
            for _ in _ticks(plant, approach):
                pass
            begin = plant.time
            with Recorder(recording, topics, COLUMNS, rng, about=about) as recorder:
                for log, done in _ticks(plant, trajectory):
                    time = plant.time - begin - PERIOD * np.arange(len(log.joint), 0, -1)
                    recorder.observe_many(np.round(time, 6), telemetry_of(plant, log))
                    progress(done)
            plant.state_command("pause")
            save_plant(plant, left)

        return project.run(f"record {name}", made_from, [recording, left], work)

    def deploy(
        self,
        project: Project,
        model: CalibrationModel,
        trajectory: Trajectory,
        *,
        after: str,
        real_time: bool = True,
    ) -> Mapping[str, Any]:
        """Run a model in its loop, from where `after` left it."""
        plant = make_plant(project.settings)
        restore_plant(plant, left_at(project, after))
        plant.state_command("enable")
        return deploy_on_simulated(plant, model, trajectory, real_time=real_time).as_data()


def left_at(project: Project, step: str) -> Path:
    """File in which the robot was put away after homing or a recording."""
    return project.folder / "robot" / ("homed.npz" if step == "home" else f"after_{step}.npz")


def make_plant(settings: ProjectSettings) -> CablePlant:
    """The robot of a project, as it wakes up."""
    roll, pitch = np.deg2rad(settings.base_tilt_deg)
    return CablePlant(
        side=settings.side,
        seed=settings.seed,
        payload=settings.payload_kg,
        base=FixedBase(float(roll), float(pitch)),
    )


def _ticks(plant: CablePlant, trajectory: Trajectory) -> Iterator[tuple[TickLog, float]]:
    """Drive an arm along a trajectory: each piece of its log, and the share done."""
    ticks = max(1, round(trajectory.duration / PERIOD))
    for first in range(0, ticks, CHUNK):
        last = min(ticks, first + CHUNK)
        rows: Floats = np.full((last - first, len(JOINTS)), np.nan)
        rows[:, :CALIBRATED] = trajectory.sample(np.arange(first, last) * PERIOD)[0]
        yield plant.run(rows), last / ticks


def _robot_settings(settings: ProjectSettings) -> Any:
    """Everything that makes the robot another one; a new version may bring other numbers, or states of another form."""
    tables = load_cable_arm().file
    numbers = [
        {name: entry.value for name, entry in table.items()}
        for table in (tables.cable, tables.firmware, tables.rig)
    ]
    who = [settings.robot, settings.side, settings.seed, settings.base_tilt_deg, settings.payload_kg]
    return [*who, STATE_FORMAT, numbers]
