"""What a load on a robot asks of its joints, beside whatever the robot itself does."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array
from catenary.errors import InputError
from catenary.gravity.holding import HoldingKernel
from catenary.robots.model import RobotModel


class CarriedLoad:
    """Torque that holds a point mass which is taken up and put down at run time.

    `attach` and `detach` belong between two ticks of the loop: they take some microseconds more than a tick's call.
    """

    def __init__(self, model: RobotModel) -> None:
        """Take a robot, of which only the geometry is used; it carries nothing."""
        links = len(model.tree.mass)
        self.model = replace(
            model,
            missing_inertia=(),
            tree=model.tree._replace(
                mass=np.zeros(links), com=np.zeros((links, 3)), inertia=np.zeros((links, 3, 3))
            ),
        )
        self.mass = 0.0
        self._kernel = HoldingKernel(self.model)

    def attach(self, mass: float, frame: str | None = None, position: ArrayLike = (0.0, 0.0, 0.0)) -> None:
        """Carry a mass [kg] at a position (3,) [m] in a frame, the tip when None, in place of the last one.

        Raises:
            InputError: A mass below zero or infinite, another shape, no such frame, or one of the base. The load
                stays as it was.
        """
        kg = float(as_array("load mass", mass, ()))
        if kg < 0.0:
            raise InputError(f"load mass: expected zero or more kg, got {kg}")
        link, pose = self.model.frame(frame)
        if link < 0:
            raise InputError(
                f'robot "{self.model.name}": frame "{frame}" is fixed to the base: no joint would carry a load'
            )
        place = pose.rotation @ as_array("load position", position, (3,)) + pose.position
        masses, coms = np.zeros_like(self.model.tree.mass), np.zeros_like(self.model.tree.com)
        masses[link], coms[link] = kg, place
        tree = self.model.tree._replace(mass=masses, com=coms)  # a point has no inertia about itself
        self._kernel = HoldingKernel(replace(self.model, tree=tree))
        self.mass = kg

    def detach(self) -> None:
        """Carry nothing."""
        self.mass = 0.0

    def add(self, q: Floats, gravity: Floats, base_rates: Floats, tau: Floats) -> None:
        """Add the load's torque to tau (n,) [Nm|N]; without a mass tau stays as it is, to the bit."""
        if self.mass > 0.0:
            tau += self._kernel(q, gravity, base_rates)
