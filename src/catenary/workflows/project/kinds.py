"""The robots that a project can be about: how each is simulated, moved, recorded, and what its models are given."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.model_refresh import MIN_SWEEPS
from catenary.crtk.client import CrtkClient
from catenary.crtk.message import Message
from catenary.crtk.transport import Transport
from catenary.dvrk_psm import PSM, PSM_JOINTS, psm_topic, psm_topics
from catenary.open_robot import OverTopics, Simulated, open_robot, tilted_base
from catenary.raven2.topics import ARM_OF_SIDE, CHANNELS, EXT_JPOS, ROBOT, raven_topics, state_column
from catenary.raven2.transmission import CALIBRATED
from catenary.recording.import_formats.importer import Synchronisation
from catenary.recording.import_formats.known_layouts import read_psm, read_raven
from catenary.simulation.cable_parameters import load_cable_arm
from catenary.simulation.cable_plant import COLUMNS, telemetry_of
from catenary.simulation.firmware_plant import FirmwarePlant
from catenary.simulation.psm_controller import load_psm
from catenary.simulation.psm_plant import PSM_COLUMNS, psm_telemetry
from catenary.topics import Topic
from catenary.trajectories.reference import InTurn, Trajectory
from catenary.trajectories.sinusoids import FASTEST_SPEEDS, TURN_TIME_S, random_sinusoids
from catenary.trajectories.smoothed_path import go_to
from catenary.trajectories.zigzag import CALIBRATION_LOWER, CALIBRATION_UPPER, zigzag
from catenary.workflows.project.folder import ProjectSettings

_RAVEN_APPROACH = (0.2, 0.2, 0.01)  # [rad/s, rad/s, m/s]
Motion = tuple[Trajectory, Any]  # and what it is, as plain data

# box of a PSM's random motion, turning bands and speeds [rad, rad, m, rad, rad, rad], ours: the range of the public
# recordings about the middle, with the wrist outside the cannula
_PSM_LOWER = np.array([*np.deg2rad([-20.0, -18.0]), 0.09, *np.deg2rad([-80.0, -55.0, -55.0])])
_PSM_UPPER = np.array([*np.deg2rad([20.0, 18.0]), 0.20, *np.deg2rad([80.0, 55.0, 55.0])])
_PSM_BAND = np.array([*np.deg2rad([12.0, 12.0]), 0.04, *np.deg2rad([60.0, 45.0, 45.0])])
_PSM_SLOWEST = np.array([*np.deg2rad([1.5, 1.5]), 0.004, *np.deg2rad([6.0, 5.0, 5.0])])
_PSM_FASTEST = np.array([*np.deg2rad([4.0, 4.0]), 0.012, *np.deg2rad([20.0, 16.0, 16.0])])


@dataclass(frozen=True)
class ProjectKind:
    """A kind of robot that can be calibrated in a project, with the settings of one."""

    settings: ProjectSettings
    robot: str  # of the catalogue, as `open_robot` takes it
    model: str  # of the catalogue, that has the calibrated joints
    recorded_as: str  # what recordings say they are of
    joints: tuple[str, ...]  # that are calibrated; they come first among the robot's
    approach: tuple[float, ...]  # [rad/s|m/s] of its simulation on the way to a motion
    encoders: str  # what sees its joints, in a request to the person beside it
    namespace: str | None  # of its topics; None of a robot whose topics are fixed
    topics: tuple[Topic, ...]  # what is recorded
    required: tuple[Topic, ...]  # without which a recording is no calibration: its state, then what sees its joints
    setpoint: tuple[Topic, Callable[[Message], Floats]]  # topic that has it, and what it is of `joints` (k,) [rad|m]
    columns: tuple[str, ...]  # of `telemetry`
    telemetry: Callable[[Any, Any], dict[str, Floats]]  # of a plant and T ticks of its log: column to (T, width), SI
    numbers: Callable[[], Any]  # all that makes the simulated robot another one, as plain data
    excitation: Callable[[], Motion]  # what is trained on
    random_motion: Callable[[float, Sequence[int]], Motion]  # of so many seconds, by a seed
    refresh_motion: Callable[[], Motion]  # minutes that show enough to bring a model up to date
    synchronise: Callable[[Path], Synchronisation]  # the motion log of a recording

    def plant(self) -> FirmwarePlant[Any]:
        """Return the simulated robot, just switched on."""
        base, payload = tilted_base(self.settings.base_tilt_deg), self.settings.payload_kg
        return cast(
            FirmwarePlant[Any], open_robot(self.robot, Simulated(self.settings.seed, base, payload, homed=False))
        )

    def client(self, transport: Transport, *, simulated: bool) -> CrtkClient:
        """Return the robot behind a transport."""
        where = OverTopics(transport, namespace=self.namespace, simulated=simulated)
        return cast(CrtkClient, open_robot(self.robot, where))


def project_kind(settings: ProjectSettings) -> ProjectKind:
    """Return the kind of robot that a project is about."""
    return _psm(settings) if settings.robot == "dvrk_psm" else _raven(settings)


def _full_reversals(lower: Floats, upper: Floats, fastest: Floats) -> Motion:
    """Return a motion in which each joint sweeps its whole range, as often as a refresh asks, at speeds of its own."""
    slowest = 0.85 * fastest  # so that joints fall out of step
    seconds = (MIN_SWEEPS - 0.5) * (TURN_TIME_S + float(np.max((upper - lower) / slowest)))
    motion = random_sinusoids(
        np.random.default_rng(0), seconds, lower=lower, upper=upper,
        turning_band=np.zeros_like(lower), slowest=slowest, fastest=fastest,
    )  # fmt: skip
    return motion, {"full reversals": MIN_SWEEPS}


def _then_random(path: Trajectory, seconds: float) -> Trajectory:
    """Return a RAVEN-II's motion with as many seconds of swings of all sizes, from slow to fast.

    Sweeps of even speed cannot tell a measurement that is late from hysteresis; many turns at other speeds do.
    """
    speeds, reach = np.array(_RAVEN_APPROACH), CALIBRATION_UPPER - CALIBRATION_LOWER
    swings = random_sinusoids(
        np.random.default_rng(0), seconds, turning_band=0.45 * reach,
        slowest=0.5 * FASTEST_SPEEDS, fastest=speeds, turn_time=0.5,
    )  # fmt: skip
    way = go_to(path(path.duration).q, swings(0.0).q, max_velocity=speeds, max_acceleration=2.0 * speeds)
    return InTurn([path, way, swings])


def _raven(settings: ProjectSettings) -> ProjectKind:
    arm = ARM_OF_SIDE[settings.side]
    topics = raven_topics(arm, state_rate=settings.state_rate_hz)

    def numbers() -> Any:
        tables = load_cable_arm().file
        return [
            {name: entry.value for name, entry in table.items()}
            for table in (tables.cable, tables.firmware, tables.rig)
        ]

    def excitation() -> Motion:
        description = {"zigzag": settings.direction, "sparsities": settings.sparsities, "form": settings.form}
        path = zigzag(settings.direction, settings.sparsities, form=settings.form)  # type: ignore[arg-type]
        seconds = settings.random_seconds
        return (_then_random(path, seconds), description | {"random": seconds}) if seconds else (path, description)

    return ProjectKind(
        settings,
        robot="raven2" if settings.side == "left" else "raven2_right",
        model="raven2",
        recorded_as=ROBOT[arm],
        joints=CALIBRATED,
        approach=_RAVEN_APPROACH,
        encoders="mount the external encoders and start their program",
        namespace=None,
        topics=topics,
        required=tuple(topic for topic in topics if topic.type == "raven_2/raven_state" or topic == EXT_JPOS),
        setpoint=(topics[0], lambda message: state_column(message, "jpos_d")[list(CHANNELS[arm][: len(CALIBRATED)])]),
        columns=COLUMNS,
        telemetry=telemetry_of,
        numbers=numbers,
        excitation=excitation,
        random_motion=lambda seconds, seed: (
            random_sinusoids(np.random.default_rng(seed), seconds),
            {"random": seconds, "rng": list(seed)},
        ),
        refresh_motion=lambda: _full_reversals(CALIBRATION_LOWER, CALIBRATION_UPPER, FASTEST_SPEEDS),
        synchronise=lambda folder: read_raven([folder], arm=arm, columns=settings.columns),
    )


def _psm(settings: ProjectSettings) -> ProjectKind:
    """Return a da Vinci PSM under the dVRK, with a tracker that sees its joints."""
    topics, n = psm_topics(settings.namespace, state_rate=settings.state_rate_hz), len(PSM_JOINTS)

    def random_motion(seconds: float, seed: Sequence[int]) -> Motion:
        """Return a motion of all six joints, turning anywhere in the outer part of their ranges."""
        motion = random_sinusoids(
            np.random.default_rng(seed), seconds, lower=_PSM_LOWER, upper=_PSM_UPPER,
            turning_band=_PSM_BAND, slowest=_PSM_SLOWEST, fastest=_PSM_FASTEST,
        )  # fmt: skip
        return motion, {"random": seconds, "rng": list(seed), "joints": 6}

    return ProjectKind(
        settings,
        robot=PSM,
        model=PSM,
        recorded_as=PSM,
        joints=PSM_JOINTS,
        approach=(0.2, 0.2, 0.02, 0.5, 0.5, 0.5),
        encoders="start the program that publishes where a tracker sees the joints",
        namespace=settings.namespace,
        topics=topics,
        required=tuple(topic for topic in topics if not topic.name.endswith("setpoint_js")),
        setpoint=(psm_topic(settings.namespace, "setpoint_js"), lambda message: np.asarray(message.position)[:n]),
        columns=PSM_COLUMNS,
        telemetry=psm_telemetry,
        numbers=lambda: load_psm().file.model_dump(),
        # a zig-zag of six joints would take days
        excitation=lambda: random_motion(60.0 * settings.train_minutes, [settings.seed or 0, 2]),
        random_motion=random_motion,
        refresh_motion=lambda: _full_reversals(_PSM_LOWER, _PSM_UPPER, _PSM_FASTEST),
        synchronise=lambda folder: read_psm([folder], settings.namespace),
    )
