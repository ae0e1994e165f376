"""Payloads of a robot: as part of the robot, and as a change of its gravity parameters."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats
from catenary.errors import InputError
from catenary.gravity.compact_regressor import CompactRegressor
from catenary.gravity.gravity_regressor import CARRIED_MASS, carried
from catenary.robots.model import RobotModel

PER_LOAD = 4  # mass, and moments about three axes


class Payload(NamedTuple):
    """A body on a robot."""

    mass: float  # [kg]
    frame: str | None = None  # the tip when None
    position: ArrayLike = (0.0, 0.0, 0.0)  # (3,) [m] of its centre of mass in that frame
    inertia: ArrayLike | None = None  # (3, 3) or (6,) about it [kg m2]; a point mass when None

    def on(self, model: RobotModel) -> RobotModel:
        """Return the robot with the payload as part of the link that carries it; see `RobotModel.with_payload`."""
        frame = model.tip if self.frame is None else self.frame
        return model.with_payload(frame, self.mass, self.position, inertia=self.inertia)


def load_directions(regressor: CompactRegressor, frame: str) -> Floats:
    """Return the change (p, 4) of the compact parameters per load on a frame.

    First column: 1 kg at the frame's origin. The others: 1 kg m of first moment about it, along each of its axes. The
    parameters are linear in masses and moments, so a body of mass m with its centre at c in the frame changes them by
    the columns times (m, m c). What the structure cannot hold is left out: a moment
    off the axes that `axes_of_com` declares.
    """
    model = regressor.model
    link, pose = model.frame(frame)
    if link < 0:
        raise InputError(f'robot "{model.name}": frame "{frame}" is fixed to the base: no joint would carry a load')
    mass = np.zeros(len(model.tree.parent))
    mass[link] = 1.0
    moments, masses = carried(model.tree._replace(mass=mass, com=np.zeros_like(model.tree.com)))
    directions = np.zeros((len(regressor.labels), PER_LOAD))
    for (at, along), target in zip(regressor.columns, regressor.targets, strict=True):
        if along == CARRIED_MASS:
            directions[target, 0] = masses[at]
        else:
            directions[target, 0] = moments[at, along]
            if at == link:
                directions[target, 1 + along] = 1.0
    directions[:, 0] += directions[:, 1:] @ pose.position
    directions[:, 1:] = directions[:, 1:] @ pose.rotation
    return directions
