"""The robot that an operator's tools move: a simulated one in this process, or one behind a transport."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, cast

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.client import CrtkClient
from catenary.crtk.joints import model_joints, raven_joints
from catenary.crtk.latest import ImuTopic
from catenary.crtk.names import Dialect
from catenary.crtk.reader import CrtkReader
from catenary.crtk.serving.tool_pose import ToolPose
from catenary.crtk.transport import Transport
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError
from catenary.plant import JointState, Plant
from catenary.recording.topics import Arm
from catenary.robots.catalog import RAVEN_SIDES, load_robot
from catenary.robots.model import Frame, RobotModel
from catenary.simulation.base_motion import FixedBase
from catenary.simulation.cable_plant import CablePlant
from catenary.simulation.mujoco_plant import MujocoPlant
from catenary.simulation.psm_plant import PsmPlant
from catenary.simulation.simulated_plant import PacedPlant

TRUE, ENCODERS = "q_true", "ext_jpos"  # columns of a simulated robot's telemetry
PSM, PSM_PLACE = "dvrk_psm", "/PSM1"
DIALECTS: tuple[Dialect, ...] = ("raven", "crtk")


class Truth(NamedTuple):
    """Where the joints of a simulated robot are.

    External encoders find their zero at the stops while the robot homes: on RAVEN-II 7.5 deg (elbow) and 10 mm
    (insertion) from the robot's own (docs/plant.md). A calibration model gives positions in the encoders' sense.
    """

    q: Floats  # (n,) [rad|m] of the joints themselves
    encoders: (
        Floats | None
    )  # (n,) [rad|m] as external encoders tell it, where there are any; NaN before it homes


@dataclass(frozen=True)
class OperatedRobot:
    """A plant, and the model of those of its joints that place the tool; they come first among the plant's."""

    name: str
    plant: Plant
    model: RobotModel
    late: Callable[[], int]  # ticks that began late, until now

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the model's joints."""
        return self.plant.joint_names[: self.model.n]

    def truth(self) -> "Truth | None":
        """Return where the model's joints really are; None but in a simulation, which alone knows."""
        if not any(column.name == TRUE for column in self.plant.columns):
            return None
        told, n = self.plant.telemetry(), self.model.n
        encoders = told.get(ENCODERS)
        return Truth(np.asarray(told[TRUE][:n]), None if encoders is None else np.asarray(encoders[:n]))

    def tip(self, q: Floats) -> Floats:
        """Return where the model's tip is at joints (n,) or more [rad|m], (3,) [m] in the base frame; NaN at NaN."""
        joints = q[: self.model.n]
        if not np.isfinite(joints).all():
            return np.full(3, np.nan)
        return forward_kinematics(self.model, joints).position

    @cached_property
    def tool(self) -> ToolPose | None:
        """Where the tool is by all of the plant's joints; None where the model itself ends at the tool.

        A RAVEN-II's model ends at its wrist, before the joints that turn the tool.
        """
        if self.model.name not in RAVEN_SIDES or self.plant.joint_names != raven_joints("gold").names:
            return None
        return ToolPose(
            load_robot(self.model.name.replace("raven2", "raven2_full", 1)), self.plant.joint_names
        )

    def tool_position(self, q: Floats) -> Floats:
        """Return where the tool is at all of the plant's joints [rad|m], (3,) [m] in the base frame; NaN at NaN."""
        if self.tool is None or not np.isfinite(q).all():
            return self.tip(q)
        return self.tool.pose(q).position

    def with_tool_at(self, q: Floats) -> RobotModel:
        """Return the model that ends at the tool, its turning joints fixed as they are in q, all of the plant's."""
        if self.tool is None:
            return self.model
        end, wrist = self.model.frame(), forward_kinematics(self.model, q[: self.model.n])
        tool = Frame(end.link, end.pose @ wrist.inverse() @ self.tool.pose(q))
        name = self.tool.model.tip
        # the closed form holds for the wrist alone
        return replace(self.model, frames={**self.model.frames, name: tool}, tip=name, closed_form=None)

    def gravity_torque(self, state: JointState) -> Floats | None:
        """Return torques that hold the model's joints still (n,) [Nm|N]; None for a model without inertia."""
        from catenary.errors import MissingInertiaError
        from catenary.gravity.torque import gravity_torque

        try:
            return np.asarray(gravity_torque(self.model, state.q[: self.model.n], state.gravity))
        except MissingInertiaError:
            return None


def distance(a: Floats, b: Floats) -> float:
    """Return how far one place (3,) is from another [m]."""
    return float(np.linalg.norm(a - b))


def simulated_robot(
    robot: str = "raven2",
    *,
    seed: int | None = None,
    base_tilt_deg: tuple[float, float] = (0.0, 0.0),
    homed: bool = True,
    real_time: bool = True,
) -> OperatedRobot:
    """Set up a simulated robot, enabled and homed: RAVEN-II and PSM with their cables, any other by MuJoCo.

    Args:
        robot: Name in the catalogue, or a robot file with inertia.
        seed: Draws another RAVEN-II or PSM of the kind; the nominal one when None.
        base_tilt_deg: Roll about x, then pitch about y, of the base.
        homed: False leaves it as it is when switched on.
        real_time: False lets its ticks be as short as the machine makes them.

    Raises:
        InputError: A seed for a robot that is always the same.
        MissingPackageError: MuJoCo is not installed.
        MissingInertiaError: Links without inertia.
    """
    base = FixedBase(*(float(angle) for angle in np.deg2rad(base_tilt_deg)))
    model = load_robot(robot)
    plant: CablePlant | PsmPlant | MujocoPlant
    if robot == PSM:
        plant = PsmPlant(seed=seed, base=base)
    elif robot in RAVEN_SIDES:
        plant = CablePlant(side=RAVEN_SIDES[robot], seed=seed, base=base)
    elif seed is not None:
        raise InputError(f'robot "{robot}": there is one simulated robot of it, --seed draws no other')
    else:
        plant = MujocoPlant(model, base=base)
    if homed:
        plant.home()
    if not real_time:
        return OperatedRobot(model.name, plant, model, lambda: 0)
    paced = PacedPlant(plant)
    return OperatedRobot(model.name, cast(Plant, paced), model, lambda: paced.late)


def robot_over(
    transport: Transport,
    robot: str = "raven2",
    *,
    dialect: str = "raven",
    namespace: str | None = None,
    simulated: bool = False,
    imu: ImuTopic | None = None,
    only_read: bool = False,
) -> tuple[OperatedRobot, CrtkReader]:
    """Reach a robot behind a transport; the client is the caller's to close, a `CrtkClient` where it may be moved.

    Args:
        transport: Brings and takes messages; stays open.
        robot: raven2 (gold) or raven2_right (green); any robot where the dialect is `crtk`.
        dialect: raven or crtk; a PSM speaks crtk.
        namespace: In front of the verbs of a robot that speaks `crtk`; a PSM's is /PSM1 when None.
        simulated: What is behind the topics, which do not say it.
        imu: What gravity is read from; nominal gravity when None.
        only_read: Nothing is advertised, and nobody has to take commands.

    Raises:
        TransportError: The robot is not there; the message names the topics.
        InputError: Another dialect, or a robot that does not speak it.
    """
    if robot == PSM:
        dialect, namespace = "crtk", namespace or PSM_PLACE
    if dialect not in DIALECTS:
        raise InputError(f'--dialect "{dialect}": expected one of {", ".join(DIALECTS)}')
    if robot not in RAVEN_SIDES and dialect == "raven":
        raise InputError(
            f'robot "{robot}": expected one of {", ".join(RAVEN_SIDES)} with the dialect raven; others speak crtk'
        )
    model = load_robot(robot)
    arm: Arm = "green" if robot == "raven2_right" else "gold"
    joints = None if robot in RAVEN_SIDES else model_joints(model)
    client = (CrtkReader if only_read else CrtkClient)(
        transport, dialect=dialect, arm=arm, namespace=namespace, joints=joints, simulated=simulated, imu=imu
    )
    return OperatedRobot(model.name, client, model, lambda: client.late), client
