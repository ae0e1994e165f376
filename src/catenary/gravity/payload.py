"""What a robot carries: as part of the robot, as a torque beside it, and as a change of its gravity parameters."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats
from catenary.dynamics.inverse_dynamics import BaseMotion, inverse_dynamics
from catenary.errors import InputError
from catenary.gravity.compact import CompactRegressor
from catenary.gravity.regressor import CARRIED_MASS, carried
from catenary.robots.model import RobotModel

PER_LOAD = 4  # mass, and moments about three axes


class Payload(NamedTuple):
    """A point mass on a robot."""

    mass: float  # [kg]
    frame: str | None = None  # the tip when None
    position: ArrayLike = (0.0, 0.0, 0.0)  # (3,) [m] in that frame

    def on(self, model: RobotModel) -> RobotModel:
        """Return the robot with the payload as part of the link that carries it; see `RobotModel.with_payload`."""
        frame = model.tip if self.frame is None else self.frame
        return model.with_payload(frame, self.mass, np.asarray(self.position, dtype=float))


class CarriedLoad:
    """Torque that holds a point mass which is taken up and put down at run time.

    `attach` and `detach` belong between two ticks of the loop: they take some microseconds more than a tick's call.
    """

    def __init__(self, model: RobotModel) -> None:
        """Take a robot, of which only the geometry is used; it carries nothing."""
        n = len(model.tree.mass)
        empty = model.tree._replace(mass=np.zeros(n), com=np.zeros((n, 3)), inertia=np.zeros((n, 3, 3)))
        # the load alone, on massless links
        self.model = self._empty = replace(model, missing_inertia=(), tree=empty)
        self.mass = 0.0

    def attach(self, mass: float, frame: str | None = None, position: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        """Carry a mass [kg] at a position (3,) [m] in a frame, the tip when None, in place of the last one.

        Raises:
            InputError: A mass below zero or infinite, another shape, no such frame, or one of the base. The load
                stays as it was.
        """
        self.model, self.mass = Payload(mass, frame, position).on(self._empty), float(mass)

    def detach(self) -> None:
        """Carry nothing."""
        self.mass = 0.0

    def add(self, q: Floats, gravity: Floats, base_rates: Floats, tau: Floats) -> None:
        """Add the load's torque to tau (n,) [Nm|N]: all NaN where an argument has one, nothing without a mass."""
        if self.mass == 0.0:
            return
        if not np.isfinite(np.concatenate([q, gravity, base_rates.ravel()])).all():
            tau[:] = np.nan
            return
        still = np.zeros(len(q))
        tau += inverse_dynamics(self.model, q, still, still, gravity, BaseMotion(*base_rates))


def load_directions(regressor: CompactRegressor, frame: str) -> Floats:
    """Return the change (p, 4) of the compact parameters per load on a frame.

    First column: 1 kg at the frame's origin. The others: 1 kg m of first moment about it, along each of its axes. The
    parameters are linear in masses and moments, so a body of mass m with its centre at c in the frame changes them by
    the columns times (m, m c). What the structure cannot hold is left out: a moment
    off the axes that `axes_of_com` declares.

    Raises:
        InputError: No such frame, or one of the base, whose load no joint carries.
    """
    model = regressor.model
    link, pose = model.frame(frame)
    if link < 0:
        raise InputError(
            f'robot "{model.name}": frame "{frame}" is fixed to the base: no joint would carry a load'
        )
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
