"""Rigid-body terms of any robot's tree on a moving base, computed by MuJoCo; the only import of it here."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.errors import InputError, MissingPackageError
from catenary.robots.model import RobotModel
from catenary.simulation.joint_step import TreeTerms
from catenary.simulation.model_mjcf import tree_mjcf


class MujocoDynamics:
    """M and h of M xdd + h = tree torque, for the tree's joints; a second opinion on catenary's own recursions.

    The base is MuJoCo's free body: it stands at the origin, turns and accelerates as it is told, and the joints
    feel it. Base axes are MuJoCo's world axes at that instant, so gravity is given in them, and h comes from one
    inverse dynamics with the base's true acceleration in it: nothing is approximated, no force is invented.
    """

    def __init__(self, model: RobotModel) -> None:
        """Compile a robot for MuJoCo."""
        self._robot = model
        self._mujoco = mujoco = _import()
        text = tree_mjcf(model)
        try:
            self._model = m = mujoco.MjModel.from_xml_string(text)
        except ValueError as error:
            raise InputError(f'robot "{model.name}": MuJoCo refuses it: {str(error).strip()}') from error
        self._data = d = mujoco.MjData(m)
        joints = [m.joint(name) for name in model.link_names]
        self.dof: NDArray[np.int64] = np.array([joint.dofadr[0] for joint in joints], dtype=np.int64)
        self.at: NDArray[np.int64] = np.array([joint.qposadr[0] for joint in joints], dtype=np.int64)
        # positions to be written at `at`, velocities at `dof`; the terms there after `update`
        self.tree = TreeTerms(d.qpos, d.qvel, np.zeros((m.nv, m.nv)), np.zeros(m.nv))
        self._gravity, self._qdd = m.opt.gravity, d.qacc  # views: every access to MuJoCo's makes a new one
        self.tree.q[:] = 0.0
        self.tree.q[3] = 1.0  # the base's quaternion
        self._write_mass = _mass_writer(mujoco, m, d, self.tree.mass)

    def __deepcopy__(self, memo: dict[int, Any]) -> "MujocoDynamics":
        """Return another one in the same state; its arrays are views into its own MuJoCo."""
        twin = MujocoDynamics(self._robot)
        memo[id(self)] = twin
        twin.tree.q[:], twin.tree.qd[:], twin._qdd[:] = self.tree.q, self.tree.qd, self._qdd
        twin._gravity[:] = self._gravity
        return twin

    def move_base(self, gravity: Floats, motion: Floats) -> None:
        """Set gravity and the base's motion for the next `update`.

        Args:
            gravity: (3,) free-fall acceleration in base axes [m/s2].
            motion: (3, 3) of the base, in its axes: angular velocity, angular acceleration, linear acceleration.
        """
        self._gravity[:] = gravity
        self.tree.qd[3:6] = motion[0]
        self._qdd[:3] = motion[2]
        self._qdd[3:6] = motion[1]

    def update(self) -> None:
        """Write the tree's mass matrix and bias for its positions and velocities."""
        mujoco, m, d = self._mujoco, self._model, self._data
        mujoco.mj_kinematics(m, d)
        mujoco.mj_comPos(m, d)
        mujoco.mj_crb(m, d)
        mujoco.mj_comVel(m, d)
        mujoco.mj_rne(m, d, 1, self.tree.bias)
        self._write_mass()


def _import() -> Any:
    try:
        import mujoco
    except ImportError as error:
        raise MissingPackageError(
            "MuJoCo simulates this robot and is not installed: pip install catenary[mujoco]"
        ) from error
    return mujoco


def _mass_writer(mujoco: Any, model: Any, data: Any, mass: Floats) -> Any:
    """Return the call that writes the mass matrix; MuJoCo 4 changed it."""
    try:
        mujoco.mj_fullM(model, data, mass)
    except TypeError:
        return lambda: mujoco.mj_fullM(model, mass, data.qM)
    return lambda: mujoco.mj_fullM(model, data, mass)
