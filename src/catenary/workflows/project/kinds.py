"""The robots that a project can be about: how each is simulated, moved, recorded, and what its models are given."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, cast

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.client import CrtkClient
from catenary.crtk.transport import Transport
from catenary.dvrk_psm import PSM, PSM_JOINTS, psm_topics
from catenary.open_robot import OverTopics, Simulated, open_robot, tilted_base
from catenary.raven2.topics import ARM_OF_SIDE, EXT_JPOS, ROBOT, Arm, raven_topics
from catenary.raven2.transmission import CALIBRATED
from catenary.recording.import_formats.importer import Synchronisation
from catenary.recording.import_formats.known_layouts import read_psm
from catenary.recording.import_formats.raven_recordings import read_raven
from catenary.simulation.cable_parameters import load_cable_arm
from catenary.simulation.cable_plant import CablePlant
from catenary.simulation.cable_telemetry import COLUMNS, telemetry_of
from catenary.simulation.firmware_plant import FirmwarePlant
from catenary.simulation.psm_parameters import load_psm
from catenary.simulation.psm_plant import PSM_COLUMNS, PsmPlant, psm_telemetry
from catenary.topics import Topic
from catenary.trajectories.reference import Trajectory
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.trajectories.zigzag import zigzag
from catenary.workflows.project.folder import ProjectSettings

Motion = tuple[Trajectory, Any]  # and what it is, as plain data
Inputs = Sequence[str] | Mapping[str, Sequence[str]] | None

# box of a PSM's random motion, turning bands and speeds [rad, rad, m, rad, rad, rad], ours: the range of the public
# recordings about the middle, with the wrist outside the cannula
_PSM_LOWER = np.array([*np.deg2rad([-20.0, -18.0]), 0.09, *np.deg2rad([-80.0, -55.0, -55.0])])
_PSM_UPPER = np.array([*np.deg2rad([20.0, 18.0]), 0.20, *np.deg2rad([80.0, 55.0, 55.0])])
_PSM_BAND = np.array([*np.deg2rad([12.0, 12.0]), 0.04, *np.deg2rad([60.0, 45.0, 45.0])])
_PSM_SLOWEST = np.array([*np.deg2rad([1.5, 1.5]), 0.004, *np.deg2rad([6.0, 5.0, 5.0])])
_PSM_FASTEST = np.array([*np.deg2rad([4.0, 4.0]), 0.012, *np.deg2rad([20.0, 16.0, 16.0])])


class ProjectKind(ABC):
    """A kind of robot that can be calibrated in a project."""

    name: ClassVar[str]  # as people say it
    joints: ClassVar[tuple[str, ...]]  # that are calibrated; they come first among the robot's
    approach: ClassVar[tuple[float, ...]]  # [rad/s|m/s] of its simulation on the way to a motion
    encoders: ClassVar[str]  # what sees its joints, in a request to the person beside it

    def __init__(self, settings: ProjectSettings) -> None:
        self.settings = settings

    @property
    @abstractmethod
    def model(self) -> str:
        """Robot of the catalogue that has the calibrated joints."""

    @property
    @abstractmethod
    def robot(self) -> str:
        """Robot of the catalogue that it is, as `open_robot` takes it."""

    @property
    def namespace(self) -> str | None:
        """Namespace of its topics; None of a robot whose topics are fixed."""
        return None

    @property
    @abstractmethod
    def recorded_as(self) -> str:
        """Robot that recordings say they are of."""

    @property
    @abstractmethod
    def topics(self) -> tuple[Topic, ...]:
        """What is recorded."""

    @property
    @abstractmethod
    def required(self) -> tuple[Topic, ...]:
        """Topics without which a recording is no calibration: the robot's state, and what sees its joints."""

    def plant(self) -> FirmwarePlant[Any]:
        """Return the simulated robot, just switched on."""
        settings = self.settings
        base = tilted_base(settings.base_tilt_deg)
        where = Simulated(settings.seed, base, settings.payload_kg, homed=False)
        return cast(FirmwarePlant[Any], open_robot(self.robot, where))

    @abstractmethod
    def numbers(self) -> Any:
        """Return all that makes the simulated robot another one, as plain data."""

    @property
    @abstractmethod
    def columns(self) -> tuple[str, ...]:
        """Columns of `telemetry`."""

    @abstractmethod
    def telemetry(self, plant: Any, log: Any) -> dict[str, Floats]:
        """Return T ticks of a simulated run: column name to (T, width), SI."""

    @abstractmethod
    def excitation(self) -> Motion:
        """Return the motion that is trained on."""

    @abstractmethod
    def random_motion(self, seconds: float, seed: Sequence[int]) -> Motion:
        """Return a random motion."""

    @abstractmethod
    def synchronise(self, folder: Path) -> Synchronisation:
        """Return the motion log of an extracted recording."""

    def client(self, transport: Transport, *, simulated: bool) -> CrtkClient:
        """Return the robot behind a transport."""
        where = OverTopics(transport, namespace=self.namespace, simulated=simulated)
        return cast(CrtkClient, open_robot(self.robot, where))


class RavenProject(ProjectKind):
    """A RAVEN-II's left or right arm."""

    name = "RAVEN-II"
    joints = CALIBRATED
    approach = (0.2, 0.2, 0.01)
    encoders = "mount the external encoders and start their program"
    model = "raven2"
    columns = COLUMNS

    @property
    def _arm(self) -> Arm:
        return ARM_OF_SIDE[self.settings.side]

    @property
    def robot(self) -> str:
        """Arm by its side."""
        return ROBOT[self._arm]

    recorded_as = robot

    @property
    def topics(self) -> tuple[Topic, ...]:
        """What is recorded."""
        return raven_topics(self._arm, state_rate=self.settings.state_rate_hz)

    @property
    def required(self) -> tuple[Topic, ...]:
        """Its state, and the external encoders."""
        return tuple(topic for topic in self.topics if topic.type == "raven_2/raven_state" or topic == EXT_JPOS)

    def numbers(self) -> Any:
        """Return the numbers of its cables, firmware and rig."""
        tables = load_cable_arm().file
        return [
            {name: entry.value for name, entry in table.items()}
            for table in (tables.cable, tables.firmware, tables.rig)
        ]

    def telemetry(self, plant: CablePlant, log: Any) -> dict[str, Floats]:
        """Return ticks of a run as raven_state's fields and the encoders'."""
        return telemetry_of(plant, log)

    def excitation(self) -> Motion:
        """Return the project's zig-zag."""
        settings = self.settings
        motion: dict[str, Any] = {"zigzag": settings.direction, "sparsities": settings.sparsities}
        # projects without a form were driven along other paths, but for these two: again
        if settings.direction not in ("J1", "J1-J2"):
            motion["form"] = settings.form
        path = zigzag(settings.direction, settings.sparsities, form=settings.form)  # type: ignore[arg-type]
        return path, motion

    def random_motion(self, seconds: float, seed: Sequence[int]) -> Motion:
        """Return a random motion in the calibration box."""
        return random_sinusoids(np.random.default_rng(seed), seconds), {"random": seconds, "rng": list(seed)}

    def synchronise(self, folder: Path) -> Synchronisation:
        """Return the log on the stamps of raven_state."""
        return read_raven([folder], arm=self._arm, columns=self.settings.columns)


class PsmProject(ProjectKind):
    """A da Vinci PSM under the dVRK, with a tracker that sees its joints."""

    name = "dVRK PSM"
    joints = PSM_JOINTS
    approach = (0.2, 0.2, 0.02, 0.5, 0.5, 0.5)
    encoders = "start the program that publishes where a tracker sees the joints"
    model = robot = recorded_as = PSM
    columns = PSM_COLUMNS

    @property
    def namespace(self) -> str:
        """Namespace of its topics."""
        return self.settings.namespace

    @property
    def topics(self) -> tuple[Topic, ...]:
        """What is recorded."""
        return psm_topics(self.settings.namespace, state_rate=self.settings.state_rate_hz)

    @property
    def required(self) -> tuple[Topic, ...]:
        """Its measured_js, and the tracker."""
        return tuple(topic for topic in self.topics if not topic.name.endswith("setpoint_js"))

    def numbers(self) -> Any:
        """Return the numbers of its drives, controller, tracker and links."""
        return load_psm().file.model_dump()

    def telemetry(self, plant: PsmPlant, log: Any) -> dict[str, Floats]:
        """Return ticks of a run as its topics carry them."""
        return psm_telemetry(plant, log)

    def excitation(self) -> Motion:
        """Return a random motion of all six joints: a zig-zag of six would take days."""
        seed = [0 if self.settings.seed is None else self.settings.seed, 2]
        return self.random_motion(60.0 * self.settings.train_minutes, seed)

    def random_motion(self, seconds: float, seed: Sequence[int]) -> Motion:
        """Return a random motion of all six joints, turning anywhere in the outer part of their ranges."""
        motion = random_sinusoids(
            np.random.default_rng(seed), seconds, lower=_PSM_LOWER, upper=_PSM_UPPER,
            turning_band=_PSM_BAND, slowest=_PSM_SLOWEST, fastest=_PSM_FASTEST,
        )  # fmt: skip
        return motion, {"random": seconds, "rng": list(seed), "joints": 6}

    def synchronise(self, folder: Path) -> Synchronisation:
        """Return the log on the stamps of measured_js."""
        return read_psm([folder], self.settings.namespace)


def kind_of(settings: ProjectSettings) -> ProjectKind:
    """Return the kind of robot that a project is about."""
    return PsmProject(settings) if settings.robot == "dvrk_psm" else RavenProject(settings)
