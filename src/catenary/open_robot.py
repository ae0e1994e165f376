"""Any robot, simulated in this process or behind topics, opened by `open_robot` and one registry of kinds.

What a kind of robot cannot have (a seed, a payload, a dialect, a namespace) is refused here, in the same words for
every command and node. Whether an opened robot is enabled and homed is asked when it is to move
(`plant.require_ready`), and who else moves it by `CrtkClient.require_free`.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import overload

import numpy as np
from numpy.typing import ArrayLike

from catenary.crtk.client import CrtkClient
from catenary.crtk.dialects import dialect_named
from catenary.crtk.reader import CrtkReader
from catenary.crtk.transport import Transport
from catenary.dvrk_psm import PSM_JOINTS
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

_log = logging.getLogger(__name__)
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
    """A kind of robot: its names in the catalogue, its topics, how it is simulated, and what can be asked of that."""

    robot: str  # joints that are calibrated
    whole: str  # as far as the tool
    joints: tuple[str, ...]  # of its messages
    dialects: tuple[str, ...]  # its own first
    simulate: Callable[[str | RobotModel, Simulated], SimulatedRobotPlant]  # just switched on
    options: frozenset[str]  # of _OPTIONS
    arm: Arm = "gold"  # of a RAVEN-II
    dvrk: str = ""  # which of DVRK_ARMS it is
    namespace: str | None = None  # of its topics where none is given

    def place(self, namespace: str | None) -> str:
        """Return the namespace of a dVRK's arm, its own when None; refuse one that is another arm's."""
        place = f"/{(namespace or self.namespace or '').strip('/')}"
        if not place.rpartition("/")[2].startswith(self.dvrk):
            last = f"{self.dvrk}, as {self.namespace}"
            raise InputError(f'namespace "{namespace}": expected one whose last word begins with {last}')
        return place


# fields of Simulated that only some kinds have, in words
_OPTIONS = {
    "seed": "seed, for cables are what is drawn",
    "payload": "payload",
    "grav_dir": "grav_dir of a gravity compensation of its own",
    "start": "start of choice",
    "hardware": "joint friction of choice",
}


def _raven(robot: str | RobotModel, where: Simulated) -> CablePlant:
    side = RAVEN_SIDES[str(robot)]
    return CablePlant(side=side, seed=where.seed, payload=where.payload, base=where.base, grav_dir=where.grav_dir)


def _psm(robot: str | RobotModel, where: Simulated) -> PsmPlant:
    return PsmPlant(seed=where.seed, base=where.base)


def _rigid(robot: str | RobotModel, where: Simulated) -> MujocoPlant:
    model = robot if isinstance(robot, RobotModel) else load_robot(robot)
    payload = Payload(where.payload) if where.payload != 0.0 else None
    return MujocoPlant(model, base=where.base, start=where.start, hardware=where.hardware, payload=payload)


# drives of arms of which kinematics alone are published: rotors are ours, the MTM's friction is of Wang et al. 2019
_DRIVES = {
    "dvrk_mtm": JointHardware(
        friction=(0.049, 0.032, 0.043, 0.029, 0.007, 0.0019, 0.0012),
        damping=(0.049, 0.093, 0.062, 0.0048, 0.0007, 0.0023, 0.0001),
        armature=(0.1, 0.1, 0.1, 0.01, 0.003, 0.003, 0.001),
    ),
    "dvrk_ecm": JointHardware(damping=(1.0, 1.0, 5.0, 0.05), armature=(1.0, 1.0, 5.0, 0.05)),
}
_STARTS = {"dvrk_ecm": (0.0, 0.0, 0.12, 0.0)}  # [rad, m] where the dVRK's simulated one stands


def _weightless(robot: str | RobotModel, where: Simulated) -> MujocoPlant:
    name = str(robot)
    _log.warning('robot "%s": simulated without weight, on assumed rotors: kinematics alone are published', name)
    model = load_robot(name, massless="all")
    return MujocoPlant(model, base=where.base, start=_STARTS.get(name), hardware=_DRIVES[name])


def _of_dvrk(robot: str, arm: str, namespace: str) -> RobotKind:
    return RobotKind(robot, robot, (), ("crtk",), _weightless, frozenset(), dvrk=arm, namespace=namespace)


_OF_RAVEN = frozenset({"seed", "payload", "grav_dir"})
_RIGID = RobotKind(
    "robots without cables", "", (), ("crtk",), _rigid, frozenset({"payload", "start", "hardware"})
)  # any other one
_RECORDS = (
    RobotKind("raven2", "raven2_full", JOINTS, ("raven", "crtk"), _raven, _OF_RAVEN),
    RobotKind("raven2_right", "raven2_full_right", JOINTS, ("raven", "crtk"), _raven, _OF_RAVEN, "green"),
    RobotKind("dvrk_psm", "dvrk_psm", PSM_JOINTS, ("crtk",), _psm, frozenset({"seed"}), dvrk="PSM", namespace="/PSM1"),
    _of_dvrk("dvrk_mtm", "MTM", "/MTMR"),
    _of_dvrk("dvrk_ecm", "ECM", "/ECM"),
)
KINDS: Mapping[str, RobotKind] = MappingProxyType({kind.robot: kind for kind in _RECORDS})
PSM = KINDS["dvrk_psm"]


def kind_with_joints(joints: Sequence[str], arm: str = "gold") -> RobotKind | None:
    """Return the kind of robot that has given joints among its own; None if no kind has.

    Args:
        arm: Side of a RAVEN-II: "gold" or "green".
    """
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
    """Open a robot: one simulated here, or one behind topics.

    Args:
        robot: Name in the catalogue or description file; a `RobotModel` is simulated as rigid bodies.
        where: `Simulated`: enabled and homed unless it is to stay switched off. `OverTopics`: a `CrtkClient`, or a
            `CrtkReader` if it is only read, for the caller to close.
    """
    if isinstance(where, OverTopics):
        return _over_topics(str(robot), where)
    refuse_unsupported(robot, where)
    plant = _kind(robot).simulate(robot, where)
    if where.homed:
        plant.home()
    return plant


def refuse_unsupported(robot: str | RobotModel, where: Simulated) -> None:
    """Refuse options that a simulated robot of a kind does not have; UnsupportedModelError names kinds that have them.

    Args:
        robot: Name, description file or model.
    """
    kind = _kind(robot)
    for option, words in _OPTIONS.items():
        is_set = where.payload != 0.0 if option == "payload" else getattr(where, option) is not None
        if is_set and option not in kind.options:
            name = robot if isinstance(robot, str) else robot.name
            having = ", ".join(other.robot for other in (*_RECORDS, _RIGID) if option in other.options)
            raise UnsupportedModelError(f'robot "{name}": has no {words}; {having} have one')


def spoken_dialect(robot: str, dialect: str | None) -> str:
    """Return the CRTK dialect to use with a robot.

    Args:
        dialect: Dialect asked for; the robot's own first one when None.
    """
    own = _kind(robot).dialects
    match = next((one for one in own if dialect in (None, one)), None)
    if match is None:
        other = dialect_named(str(dialect))
        raise InputError(f'robot "{robot}": speaks {" or ".join(own)}, not {other.name}, {other.words}')
    return match


def _kind(robot: str | RobotModel) -> RobotKind:
    return KINDS.get(robot, _RIGID) if isinstance(robot, str) else _RIGID


def _over_topics(robot: str, where: OverTopics) -> CrtkReader:
    dialect, kind, namespace = spoken_dialect(robot, where.dialect), _kind(robot), where.namespace
    if kind.dvrk:
        namespace = kind.place(namespace)
    return (CrtkReader if where.only_read else CrtkClient)(
        where.transport,
        dialect=dialect,
        arm=kind.arm,
        namespace=namespace,
        joints=None if kind.simulate is _raven else load_robot(robot),  # a RAVEN-II says its joints itself
        simulated=where.simulated,
        gravity=where.gravity,
    )
