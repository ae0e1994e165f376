"""Torques at the motors of a robot with closed loops, such as a four-bar: the tree's, by the constraint's Jacobian."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, as_batch
from catenary.dynamics.frame_motion import frame_motion
from catenary.dynamics.inverse_dynamics import BaseMotion, gravity_rows, inverse_dynamics, mass_matrix
from catenary.dynamics.torque_regressor import torque_regressor
from catenary.errors import InputError
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_open
from catenary.robots.loops import LoopChain
from catenary.robots.model import Frame, Massless, RobotModel
from catenary.spatial import Pose


def load_closed_robot(source: str | Path, *, massless: Massless = ()) -> "ClosedRobot":
    """Load a robot with closed loops: MJCF with `connect` equalities, or a table with `[[loop]]`.

    Args:
        source: Path of the file.
        massless: As of `load_robot`.

    Raises:
        InputError: The robot has no loop; `load_robot` loads it.
        UnsupportedModelError: Loops that do not close where the file assembles them, or motors that do not move all.
        FileFormatError: As of `load_robot`.
    """
    return ClosedRobot(load_open(Path(source), massless=massless))


class ClosedRobot:
    """A robot with closed loops in the coordinates of its m motors.

    The motors move the tree's n joints, q = q(q_motors), by the Jacobian J of the constraint, so torques at the motors
    are J^T times the tree's: g = J^T g_tree, M = J^T M_tree J. Places are reached from where the loops are assembled,
    along a straight line of the motors; those beyond a dead centre are refused.

    Args:
        model: With loops that are open.

    Attributes:
        joint_names: (m,) of the motors.
        joint_units: (m,) "rad" or "m".
        opened: The tree, (n,) coordinates in the order of `positions`.
    """

    def __init__(self, model: RobotModel) -> None:
        if model.loops is None:
            raise InputError(f'robot "{model.name}": has no loop to close; catenary.load_robot loads it')
        self._chain = LoopChain(model)
        self.joint_names = tuple(model.joint_names[k] for k in self._chain.motors)
        self.joint_units = tuple(model.joint_units[k] for k in self._chain.motors)
        ends = {
            f"{loop.name}/{end}": Frame((on := model.frame(name)).link, on.pose @ Pose(np.eye(3), point))
            for loop in model.loops.loops
            for end, (name, point) in enumerate(zip(loop.frames, loop.points, strict=True))
        }
        self._ends = [(f"{loop.name}/0", f"{loop.name}/1") for loop in model.loops.loops]
        self.opened = replace(model, loops=None, frames={**model.frames, **ends})

    @property
    def n(self) -> int:
        """Number of motors."""
        return len(self.joint_names)

    def positions(self, q: ArrayLike) -> Floats:
        """Return the tree's joints, (n,) or (N, n) [rad or m], at the motors' places q, (m,) or (N, m).

        Raises:
            InputError: A place that the loops do not reach without a dead centre.
        """
        rows, single = as_batch("q", q, self.n)
        x = self._chain.coordinates(rows)
        return x[0] if single else x

    def gravity_torque(self, q: ArrayLike, gravity: ArrayLike) -> Floats:
        """Return the torques at the motors that hold the robot still, (m,) or (N, m) [Nm or N].

        For q (m,) or (N, m) [rad or m] and gravity (3,) or (N, 3), free-fall acceleration in base axes [m/s2]. Needs
        masses. Errors as of `positions`.
        """
        rows, single = as_batch("q", q, self.n)
        x, J = self._moved(rows)
        torque = _along(J, gravity_torque(self.opened, x, gravity_rows(gravity, len(rows))))
        return torque[0] if single else torque

    def mass_matrix(self, q: ArrayLike) -> Floats:
        """Return the mass matrix that the motors feel, (m, m) or (N, m, m), at q (m,) or (N, m); needs inertia."""
        rows, single = as_batch("q", q, self.n)
        x, J = self._moved(rows)
        M: Floats = np.swapaxes(J, 1, 2) @ mass_matrix(self.opened, x) @ J
        return M[0] if single else M

    def inverse_dynamics(
        self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, gravity: ArrayLike, base: BaseMotion | None = None
    ) -> Floats:
        """Return the torques at the motors of a motion, (m,) or (N, m) [Nm or N].

        For the motors' q, qd and qdd, each (m,) or (N, m) [rad or m, and per s, s2]; gravity and base as of
        `catenary.inverse_dynamics`. Needs inertia.
        """
        motion, J, single = self._motion(q, qd, qdd)
        torque = _along(J, inverse_dynamics(self.opened, *motion, gravity_rows(gravity, len(J)), base))
        return torque[0] if single else torque

    def torque_regressor(
        self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, gravity: ArrayLike, base: BaseMotion | None = None
    ) -> Floats:
        """Return Y of tau = Y phi at the motors, (m, 10 n_tree) or (N, m, 10 n_tree); see `catenary.torque_regressor`.

        Arguments as of `inverse_dynamics`; needs no inertia.
        """
        motion, J, single = self._motion(q, qd, qdd)
        Y: Floats = np.swapaxes(J, 1, 2) @ torque_regressor(self.opened, *motion, gravity_rows(gravity, len(J)), base)
        return Y[0] if single else Y

    def _moved(self, rows: Floats) -> tuple[Floats, Floats]:
        """Return the tree's joints (N, n) and J (N, n, m)."""
        x = self._chain.coordinates(rows)
        return x, self._chain.jacobian(x)

    def _motion(
        self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike
    ) -> tuple[tuple[Floats, Floats, Floats], Floats, bool]:
        """Return the tree's joints and rates, xdd = J qdd + dJ/dt qd by what the loops' points would part at."""
        rows, single = as_batch("q", q, self.n)
        shape = (self.n,) if single else rows.shape
        rates, accelerations = (
            as_array(key, rate, shape).reshape(rows.shape) for key, rate in (("qd", qd), ("qdd", qdd))
        )
        x, J = self._moved(rows)
        xd, xdd = ((J @ rate[:, :, None])[:, :, 0] for rate in (rates, accelerations))
        apart = [
            np.subtract(*(frame_motion(self.opened, x, xd, xdd, frame).acceleration for frame in ends))
            for ends in self._ends
        ]
        passive, (_, A) = self._chain.passive, self._chain.constraint(x)
        xdd[:, passive] += self._chain.followed(A, np.concatenate(apart, axis=1)[:, :, None])[:, :, 0]
        return (x, xd, xdd), J, single


def _along(J: Floats, torque: Floats) -> Floats:
    return np.asarray(np.einsum("Nkm,Nk->Nm", J, torque))
