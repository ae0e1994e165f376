"""The steps of a project that need a robot, simulated or on ROS: home it, drive and record it, deploy on it.

A simulated one goes on from where it was left; the same settings give the same robot. Beside one on ROS a person is
asked for what has to be done, and it is done when the robot's own topics show it: encoders when their readings come,
the start button when it is homed, the pedal when it is ENABLED. Whatever ends a step, the robot holds and is paused.
"""

import logging
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from catenary.arrays import Floats
from catenary.calibration.corrector import Corrector
from catenary.calibration.evaluate import rms
from catenary.calibration.model import CalibrationModel
from catenary.config import IN_FILES, plain_data
from catenary.control.loop import Tick, run_loop
from catenary.control.shutdown import MAX_SPEED
from catenary.crtk.client import CrtkClient
from catenary.crtk.transport import Transport
from catenary.errors import ConfigError, FileFormatError, NotReadyError
from catenary.parallel import Progress, silent
from catenary.recording.journal import About
from catenary.recording.recorder import Recorder
from catenary.simulation.firmware_plant import STATE_FORMAT as STATE_FORMAT
from catenary.simulation.firmware_plant import FirmwarePlant, restore_plant, save_plant
from catenary.simulation.simulated_plant import PERIOD
from catenary.trajectories.reference import Embedded, GoneOn, Trajectory
from catenary.trajectories.smoothed_path import go_to
from catenary.units import DISPLAY
from catenary.workflows.project.folder import Project, write
from catenary.workflows.project.kinds import ProjectKind, project_kind
from catenary.workflows.robot import homing
from catenary.workflows.robot.motion import at_rest_afterwards, check_motion, move_to, pause, paused_if_interrupted
from catenary.workflows.robot.topic_recorder import Along, TopicRecorder, left_off, record_motion
from catenary.workflows.simulated_recording import driven

Known = float | None  # None if the encoders said nothing
Microseconds = dict[str, float]  # of a loop's durations


@dataclass(frozen=True)
class DeployedJoint:
    """Errors of a joint of the model against its true position, in deg or mm."""

    name: str
    unit: str
    raw_rmse: Known
    rmse: Known
    outside_valid_range: Known  # share of ticks
    coverage: Known  # share of errors within the model's intervals; None without any


@dataclass(frozen=True)
class Deployment:
    """What a deployed model did in a loop, as deployment.json holds it."""

    __pydantic_config__ = IN_FILES

    simulated: bool
    ticks: Annotated[int, Field(ge=0)]
    rate_hz: float
    compute_us: Microseconds | None
    jitter_us: Microseconds | None
    correction_us: Microseconds | None  # of the model's part of each tick
    overruns: Annotated[int, Field(ge=0)] | None  # None where nobody kept time
    real_time_priority: bool
    leaps: dict[str, int]  # by input: positions that play states did not follow
    coverage_asked: float | None  # by the model's intervals
    joints: tuple[DeployedJoint, ...]
    loop: Annotated[Any, Field(exclude=True)] = None  # its LoopReport, where it has just run


def deploy_on_robot(
    plant: FirmwarePlant[Any] | CrtkClient, model: CalibrationModel, trajectory: Trajectory, *, real_time: bool = False
) -> Deployment:
    """Run a model in the 1 kHz loop of a robot that follows a trajectory by its own firmware.

    Args:
        plant: The robot, homed and enabled.
        real_time: Whether a simulated robot keeps time too.

    Raises:
        LimitError: The trajectory leaves the limits; nothing has moved.
        InputError: The robot lacks signals that the model takes; nothing has moved.
    """
    places = [plant.joint_names.index(name) for name in model.joint_names if name in plant.joint_names]
    corrector = Corrector(model)
    # refuses before anything moves
    corrector.prepare(plant.joint_names, plant.joint_units, 1.0 / plant.period)
    joints = [plant.joint_names[j] for j in places]
    check_motion(plant, trajectory, joints=joints)
    move_to(plant, trajectory(0.0).q, joints=joints)
    motion = Embedded(trajectory, places, plant.setpoint_js().q)
    true: list[Floats] = []
    ticks: list[Tick] = []

    def observe(tick: Tick) -> None:  # light: it is part of the loop
        true.append(plant.external_encoders())
        ticks.append(tick)

    planned = np.abs(trajectory.sample(np.arange(0.0, trajectory.duration, 0.01))[1]).max(axis=0)
    max_speed = np.array([2.0 * MAX_SPEED[unit] for unit in plant.joint_units])  # jaws follow the wrist, and swing
    max_speed[places] = np.maximum(max_speed[places], 1.5 * planned)  # the motion was checked before it began
    report = run_loop(
        plant, None, motion, corrector=corrector, observers=[observe], real_time=real_time, max_speed=max_speed
    )
    scale = np.array([DISPLAY[unit][1] for unit in model.joint_units])
    known = np.array(true)
    half_widths = np.array([tick.state.q_interval[places] for tick in ticks]) * scale
    rows = np.isfinite(known).all(axis=1)
    before = (known - np.array([tick.q_nominal[places] for tick in ticks]))[rows] * scale
    after = (known - np.array([tick.state.q[places] for tick in ticks]))[rows] * scale
    held = np.abs(after) <= half_widths[rows]
    deployed = tuple(
        DeployedJoint(
            name,
            DISPLAY[unit][0],
            rms(before[:, k]) if rows.any() else None,
            rms(after[:, k]) if rows.any() else None,
            (report.outside_valid_range or ())[places[k]],
            None if model.intervals is None or not rows.any() else float(np.mean(held[:, k])),
        )
        for k, (name, unit) in enumerate(zip(model.joint_names, model.joint_units, strict=True))
    )
    return Deployment(
        simulated=plant.simulated,
        ticks=report.ticks,
        rate_hz=report.rate_hz,
        compute_us=report.compute and report.compute.in_us(),
        jitter_us=report.jitter and report.jitter.in_us(),
        correction_us=report.correction and report.correction.in_us(),
        overruns=report.overruns,
        real_time_priority=report.has_priority,
        leaps=corrector.leaps,
        coverage_asked=None if model.intervals is None else model.intervals.level,
        joints=deployed,
        loop=report,
    )


_log = logging.getLogger(__name__)


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
        """Drive it along a trajectory of the calibrated joints and record that; return whether that had to be done."""
        before = after if after == "home" else f"record {after}"
        made_from = [motion, project.settings.state_rate_hz, project.fingerprint_of(before)]
        folder = project.folder / "recordings" / name

        def work() -> None:
            self.drive(project, folder, trajectory, motion, after=after, progress=progress)

        return project.run(f"record {name}", made_from, self.files(project, folder), work)

    @abstractmethod
    def drive(
        self, project: Project, folder: Path, trajectory: Trajectory, motion: Any, *, after: str, progress: Progress
    ) -> None:
        """Make a recording along a trajectory, which `motion` describes, `after` "home" or another recording."""

    def files(self, project: Project, folder: Path) -> list[Path]:
        """Return the files of a recording."""
        return [folder]

    @abstractmethod
    def deploy(
        self, project: Project, model: CalibrationModel, trajectory: Trajectory, *, after: str
    ) -> Mapping[str, Any]:
        """Run a model in its 1 kHz loop along a trajectory, and return its `Deployment` as plain data."""


def set_aside(project: Project, name: str) -> None:
    """Move what was recorded under a name before to replaced/NAME, NAME.2, ..."""
    folder, kept = project.folder / "recordings" / name, project.folder / "replaced"
    if not folder.exists():
        return
    kept.mkdir(exist_ok=True)
    numbered = (kept / (name if number == 1 else f"{name}.{number}") for number in count(1))
    place = next(path for path in numbered if not path.exists())
    folder.rename(place)
    _log.warning("%s: the earlier recording of this name is kept in %s", folder, place)


def clear_folder(folder: Path) -> None:
    """Remove the folder that a step wrote before, and make its parent."""
    import shutil

    if folder.exists():
        shutil.rmtree(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)


_CHUNK_TICKS = 20_000  # ticks whose telemetry is held at once


class SimulatedRobot(ProjectRobot):
    """The robot of a project without a real one; the same settings give the same robot."""

    def home(self, project: Project) -> bool:
        """Home it; again when another version's robot has other numbers, or cannot read the state that was left."""
        folder = project.folder / "robot"
        homed = folder / "homed.npz"
        readable = True
        if homed.is_file():
            try:
                restore_plant(project_kind(project.settings).plant(), homed)
            except FileFormatError:
                readable = False

        def work() -> None:
            folder.mkdir(exist_ok=True)
            for saved in folder.glob("after_*.npz"):
                saved.unlink()  # of the robot before it was homed again
            plant = project_kind(project.settings).plant()
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
        settings = project.settings  # all that makes the robot another one; a new version may bring other numbers
        who = [settings.robot, settings.side, settings.seed, settings.base_tilt_deg, settings.payload_kg]
        made_from = [*who, STATE_FORMAT, project_kind(settings).numbers()]
        return project.run("home", made_from, files, work, trusted=readable)

    def files(self, project: Project, folder: Path) -> list[Path]:
        """Return the recording's folder, and the robot as it was left."""
        return [folder, left_at(project, folder.name)]

    def drive(
        self, project: Project, folder: Path, trajectory: Trajectory, motion: Any, *, after: str, progress: Progress
    ) -> None:
        """Record as fast as the machine runs, from where the step before left the robot; then put it away again."""
        settings, before = project.settings, left_at(project, after)
        if not before.is_file():
            raise ConfigError(f"{before}: is missing; do the step {after} first")
        kind = project_kind(settings)
        plant = kind.plant()
        restore_plant(plant, before)
        plant.state_command("enable")
        check_motion(plant, trajectory, joints=kind.joints)
        clear_folder(folder)
        about = About(robot=kind.recorded_as, simulated=True, seed=settings.seed, configuration={"motion": motion})
        rng = np.random.default_rng([settings.seed or 0, *folder.name.encode()])
        start, speeds = plant.control.setpoint[: len(kind.joints)], np.array(kind.approach)
        approach = go_to(start, trajectory(0.0).q, max_velocity=speeds, max_acceleration=2.0 * speeds)
        for _ in driven(plant, approach, _CHUNK_TICKS):
            pass
        begin = plant.time
        with Recorder(folder, kind.topics, kind.columns, rng, about=about) as recorder:
            for log, done in driven(plant, trajectory, _CHUNK_TICKS):
                time = plant.time - begin - PERIOD * np.arange(len(log.joint), 0, -1)
                recorder.observe_many(np.round(time, 6), kind.telemetry(plant, log))
                progress(done)
        plant.state_command("pause")
        save_plant(plant, left_at(project, folder.name))

    def deploy(
        self, project: Project, model: CalibrationModel, trajectory: Trajectory, *, after: str
    ) -> Mapping[str, Any]:
        """Run a model in its loop in real time, from where `after` left the robot."""
        plant = project_kind(project.settings).plant()
        restore_plant(plant, left_at(project, after))
        plant.state_command("enable")
        return dict(plain_data(deploy_on_robot(plant, model, trajectory, real_time=True)))


def left_at(project: Project, step: str) -> Path:
    """Return the file with the pose in which the robot was left after homing or a recording.

    Args:
        step: Name of the step.
    """
    return project.folder / "robot" / ("homed.npz" if step == "home" else f"after_{step}.npz")


_ENCODERS_READ_WITHIN_S = 3.0  # in which encoders that are mounted read, once the robot has homed


class RosRobot(ProjectRobot):
    """A robot behind a transport, which stays open; it is looked for when a step needs it."""

    def __init__(
        self,
        transport: Transport,
        guide: homing.Guide,
        *,
        simulated: bool = False,
        patience: float = homing.PATIENCE,
        homing_patience: float = homing.HOMING,
    ) -> None:
        """Take a transport, and how long [s] to wait for what a person does, and for homing."""
        self._transport, self._guide, self._simulated = transport, guide, simulated
        self._patience, self._homing_patience = patience, homing_patience
        self._is_clear = False  # whether the workspace was said to be

    def home(self, project: Project) -> bool:
        """Home it with its encoders mounted; return whether that had to be done."""
        path = project.folder / "robot" / "home.json"

        def work() -> None:
            path.parent.mkdir(exist_ok=True)
            with self._connected(project) as client, paused_if_interrupted(client):
                self._make_homed(client, project)
                pause(client)  # nobody moves it now; one that homes by its own button is paused already
                believed, encoders = client.measured_js().q, client.external_encoders()
                content = {"joint_names": client.joint_names, "believed": believed, "external_encoders": encoders}
                write(path, {"simulated": self._simulated, **content})

        settings = project.settings
        place = [settings.namespace] if settings.robot == "dvrk_psm" else []
        return project.run("home", [settings.robot, settings.side, settings.connection, *place], [path], work)

    def drive(
        self, project: Project, folder: Path, trajectory: Trajectory, motion: Any, *, after: str, progress: Progress
    ) -> None:
        """Record over topics, on from where one was cut off, unless it had to home since."""
        with self._connected(project) as client, paused_if_interrupted(client):
            kind = project_kind(project.settings)
            check_motion(client, trajectory, joints=kind.joints)
            was_homed = client.operating_state().is_homed
            self._make_homed(client, project)
            client.require_free()
            about = About(robot=kind.recorded_as, simulated=self._simulated, configuration={"motion": motion})
            along = Along(trajectory, *kind.setpoint)
            cut_off = left_off(folder, about, kind.topics, self._transport.steady(), along) if was_homed else None
            onwards = GoneOn(trajectory, 0.0 if cut_off is None else cut_off.begins)
            with at_rest_afterwards(client):
                self._enable(client)
                required = [topic.name for topic in kind.required]

                def ready(recorder: TopicRecorder) -> None:
                    self._comes(lambda: recorder.silent(required) or None)
                    recorder.require(required)  # before a file or the robot moves
                    if cut_off is None:
                        set_aside(project, folder.name)
                    else:
                        self._guide.say(f"{folder.name}: {cut_off.gap(self._transport.steady())}")

                options: dict[str, Any] = {"about": about, "after": cut_off, "ready": ready}
                with TopicRecorder(self._transport, folder, kind.topics, **options) as recorder:
                    try:
                        record_motion(client, recorder, onwards, joints=kind.joints, progress=progress)
                        recorder.require(required)
                    finally:
                        for problem in recorder.problems():
                            self._guide.say(problem)

    def deploy(
        self, project: Project, model: CalibrationModel, trajectory: Trajectory, *, after: str
    ) -> Mapping[str, Any]:
        """Run a model in a 1 kHz loop around the robot; errors are against the external encoders' latest reading."""
        with self._connected(project) as client, paused_if_interrupted(client):
            self._make_homed(client, project)
            client.require_free()
            with at_rest_afterwards(client):
                self._enable(client)
                result = deploy_on_robot(client, model, trajectory, real_time=not self._simulated)
        return dict(plain_data(result))

    def _connected(self, project: Project) -> CrtkClient:
        return project_kind(project.settings).client(self._transport, simulated=self._simulated)

    def _make_homed(self, client: CrtkClient, project: Project) -> None:
        """Home it if it is not, with encoders whose readings come."""
        if not self._is_clear:
            homing.clear_workspace(self._guide)
            self._is_clear = True
        if isinstance(self._guide, homing.AnswerYes) and client.operating_state().state == "FAULT":
            raise NotReadyError("the robot is in FAULT; clear the fault by hand: --yes does not clear it")
        kind = project_kind(project.settings)
        if not client.operating_state().is_homed:
            topic = kind.required[-1].name  # whose readings count from the homing on
            absent = f"nobody publishes {topic}"
            self._have(kind.encoders, lambda: None if topic in self._transport.topics() else absent)
            homing.home_client(client, self._guide, patience=self._homing_patience)
        if not self._comes(lambda: _not_registered(client, kind)):
            self._have(kind.encoders, lambda: _not_registered(client, kind))

    def _enable(self, client: CrtkClient) -> None:
        if client.operating_state().state == "ENABLED":
            return
        if (
            isinstance(self._guide, homing.AnswerYes) or not client.dialect.has_run_levels
        ):  # a dVRK has no pedal that enables it
            client.state_command("resume" if client.operating_state().state == "PAUSED" else "enable")

        self._have(
            "press the pedal, so that the robot is ENABLED",
            lambda: None if (now := client.operating_state().state) == "ENABLED" else f"the robot is {now}",
        )

    def _have(self, text: str, missing: homing.Check) -> None:
        homing.have_done(self._guide, text, missing, self._transport.sleep, patience=self._patience)

    def _comes(self, missing: homing.Check) -> bool:
        """Wait a little for what needs nobody's help; return whether the robot reports it."""
        for _ in range(round(_ENCODERS_READ_WITHIN_S / homing.LOOK)):
            if missing() is None:
                return True
            self._transport.sleep(homing.LOOK)
        return missing() is None


def _not_registered(client: CrtkClient, kind: ProjectKind) -> str | None:
    if np.isfinite(client.external_encoders()).all():
        return None
    return f"no reading comes on {kind.required[-1].name}"
