"""A robot of unit joint inertias that hangs under gravity, and may pick up a payload: what an estimator has to learn."""

import numpy as np

from catenary.arrays import Floats
from catenary.gravity.torque import gravity_torque
from catenary.plant import JointState
from catenary.robots.model import RobotModel
from catenary.trajectories.reference import Reference
from oracles.ideal_plant import MassPlant


class HangingPlant(MassPlant):
    """Each joint moves by qdd = tau - g(q) - friction qd, g of `model`, or of `loaded` from `pick_up` seconds on."""

    def __init__(
        self,
        model: RobotModel,
        q: Floats,
        gravity: Floats,
        *,
        loaded: RobotModel | None = None,
        pick_up: float = np.inf,
    ) -> None:
        super().__init__(q, friction=0.5)
        self.joint_names, self.joint_units = model.joint_names, model.joint_units
        self.model, self.loaded, self.pick_up, self.gravity = model, loaded, pick_up, gravity

    def carried(self) -> RobotModel:
        """The model that the physics now follows."""
        return self.loaded if self.loaded is not None and self.time >= self.pick_up else self.model

    def measured_js(self) -> JointState:
        return super().measured_js()._replace(gravity=self.gravity.copy())

    def _load(self) -> Floats:
        return gravity_torque(self.carried(), self.q, self.gravity)


class Poses:
    """One pose after another: a second on the way, then at rest until `each` seconds are over."""

    def __init__(self, poses: Floats, each: float) -> None:
        self.poses, self.each, self.duration = np.array(poses), each, each * len(poses)

    def __call__(self, t: float) -> Reference:
        k = min(int(t / self.each), len(self.poses) - 1)
        start, end = self.poses[max(k - 1, 0)], self.poses[k]
        u = min(t - k * self.each, 1.0)
        way = end - start
        return Reference(start + u * u * (3.0 - 2.0 * u) * way, 6.0 * u * (1.0 - u) * way, (6.0 - 12.0 * u) * way)
