"""The robot that an operator's tools move: a simulated one in this process, or one behind a transport."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np

from catenary.arrays import Floats
from catenary.crtk.reader import CrtkReader
from catenary.crtk.serving.tool_pose import ToolPose
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import MissingInertiaError
from catenary.gravity import torque
from catenary.open_robot import KINDS, OverTopics, Simulated, open_robot
from catenary.plant import JointState, Plant
from catenary.robots.catalog import load_robot
from catenary.robots.model import Frame, RobotModel
from catenary.simulation.simulated_plant import PacedPlant

TRUE_COLUMN, _ENCODER_COLUMN = "q_true", "ext_jpos"  # columns of a simulated robot's telemetry


class Truth(NamedTuple):
    """Where the joints of a simulated robot are; external encoders have their zero elsewhere (docs/plant.md)."""

    q: Floats  # (n,) [rad|m] of the joints themselves
    encoders: Floats | None  # (n,) [rad|m] as external encoders tell it, where there are any; NaN before it homes


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
        """Return the true positions of the model's joints; None except in a simulation."""
        if not any(column.name == TRUE_COLUMN for column in self.plant.columns):
            return None
        telemetry, n = self.plant.telemetry(), self.model.n
        encoders = telemetry.get(_ENCODER_COLUMN)
        return Truth(np.asarray(telemetry[TRUE_COLUMN][:n]), None if encoders is None else np.asarray(encoders[:n]))

    def tip(self, q: Floats) -> Floats:
        """Return the tip in the base frame (3,) [m], at joints of the model (n,) or more [rad|m]; NaN at NaN."""
        joints = q[: self.model.n]
        if not np.isfinite(joints).all():
            return np.full(3, np.nan)
        return forward_kinematics(self.model, joints).position

    @cached_property
    def tool(self) -> ToolPose | None:
        """Where the tool is by all of the plant's joints; None if the model itself ends at the tool."""
        kind = KINDS.get(self.model.name)
        if kind is None or kind.whole == kind.robot or self.plant.joint_names != kind.joints:
            return None
        return ToolPose(load_robot(kind.whole), self.plant.joint_names)

    def tool_position(self, q: Floats) -> Floats:
        """Return the tool's position at all of the plant's joints [rad|m], (3,) [m] in the base frame; NaN at NaN."""
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
        try:
            return np.asarray(torque.gravity_torque(self.model, state.q[: self.model.n], state.gravity))
        except MissingInertiaError:
            return None


def operated_robot(robot: str, where: Simulated | OverTopics, *, real_time: bool = True) -> OperatedRobot:
    """Open a robot in real time; one behind a transport is the caller's to close.

    Args:
        real_time: Whether a simulated robot keeps time.
    """
    plant, model = open_robot(robot, where), load_robot(robot)
    if not isinstance(plant, CrtkReader):
        if not real_time:
            return OperatedRobot(model.name, plant, model, lambda: 0)
        plant = cast(Any, PacedPlant(plant))
    return OperatedRobot(model.name, plant, model, lambda: plant.late)
