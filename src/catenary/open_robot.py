"""Any robot, simulated in this process or behind topics, opened by `open_robot` and one registry of kinds.

What a kind of robot cannot have (a seed, a payload, a dialect, a namespace) is refused here, in the same words for
every command and node. Whether an opened robot is enabled and homed is asked when it is to move
(`plant.require_ready`), and who else moves it by `CrtkClient.require_free`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from catenary.crtk.client import CrtkClient
from catenary.crtk.dialects import dialect_named
from catenary.crtk.reader import CrtkReader
from catenary.crtk.transport import Transport
from catenary.dvrk_psm import PSM_JOINTS, psm_topic
from catenary.errors import InputError, UnsupportedModelError
from catenary.gravity.payload import Payload
from catenary.raven2.topics import JOINTS, Arm
from catenary.robots.catalog import RAVEN_SIDES, load_robot
from catenary.robots.model import RobotModel
from catenary.simulation.base_motion import FixedBase, MovingBase
from catenary.simulation.cable_plant import CablePlant
from catenary.simulation.joint_hardware import JointHardware
from catenary.simulation.mujoco_plant import MujocoPlant
from catenary.simulation.psm_plant import PsmPlant

SimulatedRobotPlant = CablePlant | PsmPlant | MujocoPlant


@dataclass(frozen=True)
class Simulated:
    """A robot in this process: RAVEN-II and PSM with their cables, any other as rigid bodies by MuJoCo."""

    seed: int | None = None  # draws another robot of a kind with cables; the nominal one when None
    base: MovingBase | None = None  # a level one at rest when None
    payload: float = 0.0  # [kg] at a RAVEN-II's wrist, or at the tip of a robot without cables
    homed: bool = True  # else as it is when switched on
    grav_dir: Sequence[float] | None = None  # [cm/s2] of a RAVEN-II's own gravity compensation; None: without
    start: ArrayLike | None = None  # (n,) [rad|m] where a robot without cables stands at first
    hardware: JointHardware | None = None  # drives of a robot without cables; ideal ones when None


@dataclass(frozen=True)
class OverTopics:
    """A robot behind a transport, which stays open when the robot is closed."""

    transport: Transport
    dialect: str | None = None  # raven or crtk; the robot's own when None
    namespace: str | None = None  # in front of the verbs of one that speaks crtk; a PSM's is /PSM1 when None
    simulated: bool = False  # what is behind the topics, which do not say it
    gravity: str | None = None  # topic of a gravity node; nominal gravity when None
    only_read: bool = False  # nothing is advertised, and nobody has to take commands


@dataclass(frozen=True)
class RobotKind:
    """A robot with cables and topics of its own, by its names in the catalogue."""

    robot: str  # joints that are calibrated
    whole: str  # as far as the tool
    joints: tuple[str, ...]  # of its messages
    dialects: tuple[str, ...]  # its own first
    arm: Arm = "gold"  # of a RAVEN-II


KINDS: Mapping[str, RobotKind] = MappingProxyType(
    {
        kind.robot: kind
        for kind in (
            RobotKind("raven2", "raven2_full", JOINTS, ("raven", "crtk")),
            RobotKind("raven2_right", "raven2_full_right", JOINTS, ("raven", "crtk"), "green"),
            RobotKind("dvrk_psm", "dvrk_psm", PSM_JOINTS, ("crtk",)),
        )
    }
)
PSM = KINDS["dvrk_psm"]


def kind_with_joints(joints: Sequence[str], arm: str = "gold") -> RobotKind | None:
    """Return the kind that has these joints among its own, of a RAVEN-II the one on a side; None of others."""
    return next((k for k in KINDS.values() if set(joints) <= set(k.joints) and (k is PSM or k.arm == arm)), None)


def tilted_base(angles_deg: tuple[float, float]) -> FixedBase:
    """Return a base at rest, turned by roll about x, then by pitch about its own y [deg]."""
    roll, pitch = np.deg2rad(angles_deg)
    return FixedBase(float(roll), float(pitch))


@overload
def open_robot(robot: str | RobotModel, where: Simulated) -> SimulatedRobotPlant: ...
@overload
def open_robot(robot: str, where: OverTopics) -> CrtkReader: ...
def open_robot(robot: str | RobotModel, where: Simulated | OverTopics) -> SimulatedRobotPlant | CrtkReader:
    """Open a robot: one simulated here, enabled and homed unless it is to stay switched off, or one behind topics.

    A robot is named by the catalogue or its file; a model is simulated as rigid bodies. Behind topics it is a
    `CrtkClient` unless it is only read, the caller's to close.
    """
    if isinstance(where, OverTopics):
        return _over_topics(str(robot), where)
    plant = _simulated(robot, where)
    if where.homed:
        plant.home()
    return plant


def refuse_unsupported(robot: str | RobotModel, where: Simulated) -> None:
    """Refuse what a simulated robot of a kind cannot have."""
    kind, name = _kind(robot), robot if isinstance(robot, str) else robot.name
    is_raven, with_drives = kind is not None and kind is not PSM, where.hardware is not None or where.start is not None
    whose = ", ".join(KINDS)
    for is_so, why in (
        (kind is None and where.seed is not None,
         f"a seed draws the cables of {whose}; this one has none, and is always the same"),
        (kind is not None and with_drives, "friction comes from its cables; joint friction is for robots without"),
        (kind is PSM and where.payload, "has no payload; a RAVEN-II and robots without cables have one"),
        (not is_raven and where.grav_dir is not None,
         "has no grav_dir; its own gravity compensation is a RAVEN-II's"),
    ):  # fmt: skip
        if is_so:
            raise UnsupportedModelError(f'robot "{name}": {why}')


def spoken_dialect(robot: str, dialect: str | None) -> str:
    """Return the dialect that a robot is spoken to in; its own when None."""
    kind = _kind(robot)
    own: tuple[str, ...] = ("crtk",) if kind is None else kind.dialects
    found = next((one for one in own if dialect in (None, one)), None)
    if found is None:
        other = dialect_named(str(dialect))
        raise InputError(f'robot "{robot}": speaks {" or ".join(own)}, not {other.name}, {other.words}')
    return found


def _kind(robot: str | RobotModel) -> RobotKind | None:
    return KINDS.get(robot) if isinstance(robot, str) else None


def _simulated(robot: str | RobotModel, where: Simulated) -> SimulatedRobotPlant:
    refuse_unsupported(robot, where)
    kind = _kind(robot)
    if kind is PSM:
        return PsmPlant(seed=where.seed, base=where.base)
    if kind is not None:
        side = RAVEN_SIDES[kind.robot]
        return CablePlant(side=side, seed=where.seed, payload=where.payload, base=where.base, grav_dir=where.grav_dir)
    model = robot if isinstance(robot, RobotModel) else load_robot(robot)
    payload = Payload(where.payload) if where.payload != 0.0 else None
    return MujocoPlant(model, base=where.base, start=where.start, hardware=where.hardware, payload=payload)


def _over_topics(robot: str, where: OverTopics) -> CrtkReader:
    dialect, kind, namespace = spoken_dialect(robot, where.dialect), _kind(robot), where.namespace
    if kind is PSM:
        namespace = psm_topic(namespace or "/PSM1", "measured_js").name.rpartition("/")[0]
    is_raven = kind is not None and kind is not PSM
    return (CrtkReader if where.only_read else CrtkClient)(
        where.transport,
        dialect=dialect,
        arm="gold" if kind is None else kind.arm,
        namespace=namespace,
        joints=None if is_raven else load_robot(robot),
        simulated=where.simulated,
        gravity=where.gravity,
    )
