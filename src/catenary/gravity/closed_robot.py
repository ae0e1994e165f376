"""Torques at the motors of a robot with closed loops, such as a four-bar: the tree's, by the constraint's Jacobian."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_batch
from catenary.dynamics.inverse_dynamics import gravity_rows
from catenary.errors import InputError
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_open
from catenary.robots.loops import LoopChain
from catenary.robots.model import Massless, RobotModel


def load_closed_robot(source: str | Path, *, massless: Massless = ()) -> "ClosedRobot":
    """Load a robot with closed loops: MJCF with `connect` equalities, or a table with `[[loop]]`.

    Args:
        source: Path of the file.
        massless: Links that may have no mass, as of `load_robot`.

    Raises:
        InputError: The robot has no loop; `load_robot` loads it.
        UnsupportedModelError: Loops that do not close where the file assembles them, or motors that do not move all.
        FileFormatError: As of `load_robot`.
    """
    return ClosedRobot(load_open(Path(source), massless=massless))


class ClosedRobot:
    """A robot with closed loops in the coordinates of its m motors.

    `opened` is its tree of n joints; `joint_names`, `joint_units`, `lower` and `upper` are the motors'. Places of the
    motors, (m,) or (N, m) [rad or m], are reached along a straight line from where the loops are assembled; InputError
    refuses those beyond a dead centre.
    """

    def __init__(self, model: RobotModel) -> None:
        if model.loops is None:
            raise InputError(f'robot "{model.name}": has no loop to close; catenary.load_robot loads it')
        self._chain = LoopChain(model)
        self.opened, self.name = replace(model, loops=None), model.name
        self.lower, self.upper = model.lower[self._chain.motors], model.upper[self._chain.motors]
        self.joint_names = tuple(model.joint_names[k] for k in self._chain.motors)
        self.joint_units = tuple(model.joint_units[k] for k in self._chain.motors)

    @property
    def n(self) -> int:
        """Number of motors."""
        return len(self.joint_names)

    def positions(self, q: ArrayLike) -> Floats:
        """Return the tree's joints, (n,) or (N, n) [rad or m], at the motors' places q."""
        rows, single = as_batch("q", q, self.n)
        x = self._chain.coordinates(rows)
        return x[0] if single else x

    def jacobian(self, q: ArrayLike) -> Floats:
        """Return J of xd = J qd, the tree's rates by the motors', (n, m) or (N, n, m); M = J^T M_tree J by it."""
        rows, single = as_batch("q", q, self.n)
        J = self._chain.jacobian(self._chain.coordinates(rows))
        return J[0] if single else J

    def gravity_torque(self, q: ArrayLike, gravity: ArrayLike) -> Floats:
        """Return the torques at the motors that hold the robot still, J^T g_tree, (m,) or (N, m) [Nm or N].

        Gravity (3,) or (N, 3) is free-fall acceleration in base axes [m/s2].
        """
        rows, single = as_batch("q", q, self.n)
        x = self._chain.coordinates(rows)
        held = gravity_torque(self.opened, x, gravity_rows(gravity, len(rows)))
        torque: Floats = np.einsum("Nkm,Nk->Nm", self._chain.jacobian(x), held)
        return torque[0] if single else torque
