"""Rigid-body terms of any robot's tree on a moving base, computed by MuJoCo."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.errors import InputError, imported
from catenary.robots.model import RobotModel
from catenary.simulation.joint_step import TreeTerms
from catenary.spatial import quaternion_from_rotation

# MuJoCo refuses moving bodies below mjMINVAL = 1e-15; a massless link gets this much, which no torque shows
LEAST_MASS = 1e-12  # [kg]
LEAST_INERTIA = 1e-14  # [kg m2]
_ROUNDING = 1e-9  # of the largest moment, by which the triangle inequality may be missed


def compiled_tree(mujoco: Any, model: RobotModel) -> Any:
    """Return the tree as MuJoCo compiles it: on a body, the base, with a free joint, in weightlessness.

    Body and joint i have the name of link i, the body's frame is frame i of the tree. The joints are the tree's
    own, each free to move by itself: MuJoCo has no joint that moves by a linear combination of others, only soft
    constraints that nearly make it so. Who simulates this sets tree coordinate = coupling q + offset.
    """
    model.require_inertia()
    tree, spec = model.tree, mujoco.MjSpec()
    spec.option.gravity = np.zeros(3)
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT
    base = spec.worldbody.add_body(name=model.base, mass=1.0, inertia=np.ones(3), explicitinertial=True)
    base.add_freejoint()
    bodies: list[Any] = []
    for i, (name, parent) in enumerate(zip(model.link_names, tree.parent, strict=True)):
        moments, axes = _principal(model, i)
        body = (base if parent < 0 else bodies[parent]).add_body(
            name=name, pos=tree.origin[i], quat=quaternion_from_rotation(tree.rotation[i]), explicitinertial=True,
            mass=max(tree.mass[i], LEAST_MASS), ipos=tree.com[i], iquat=quaternion_from_rotation(axes), inertia=moments,
        )  # fmt: skip
        kind = mujoco.mjtJoint.mjJNT_SLIDE if tree.prismatic[i] else mujoco.mjtJoint.mjJNT_HINGE
        body.add_joint(name=name, type=kind, axis=tree.axis[i])
        bodies.append(body)
    try:
        return spec.compile()
    except ValueError as error:
        raise InputError(f'robot "{model.name}": MuJoCo refuses it: {str(error).strip()}') from error


def _principal(model: RobotModel, i: int) -> tuple[Floats, Floats]:
    """Return the principal moments (3,), rising, and their axes as columns, right-handed."""
    moments, axes = np.linalg.eigh(model.tree.inertia[i])
    axes = axes * np.linalg.det(axes)
    tolerance = _ROUNDING * moments[2]
    if moments[0] < -tolerance or moments[0] + moments[1] < moments[2] - tolerance:
        raise InputError(
            f'robot "{model.name}": link "{model.link_names[i]}": principal moments of inertia '
            f"{moments.tolist()} kg m2 are not those of a rigid body; expected none below zero, and each at most "
            "the sum of the other two"
        )
    moments = np.maximum(moments, LEAST_INERTIA)
    # a rod's moments (0, I, I) may miss the inequality by rounding, and MuJoCo takes it exactly
    moments[0] += max(0.0, moments[2] - moments[1] - moments[0])
    return moments, axes


class MujocoDynamics:
    """M and h of M xdd + h = tree torque, for the tree's joints; a second opinion on catenary's own recursions.

    The base is MuJoCo's free body: it stands at the origin, turns and accelerates as it is told, and the joints
    feel it. Base axes are MuJoCo's world axes at that instant, so gravity is given in them, and h comes from one
    inverse dynamics with the base's true acceleration in it: nothing is approximated, no force is invented.
    """

    def __init__(self, model: RobotModel) -> None:
        """Compile a robot for MuJoCo."""
        self._robot = model
        self._mujoco = mujoco = imported("mujoco", "MuJoCo simulates this robot and is not installed", "mujoco")
        self._model = m = compiled_tree(mujoco, model)
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
        """Set gravity (3,) [m/s2] and the base's motion (3, 3), as `BaseSamples` has them, for the next `update`."""
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


def _mass_writer(mujoco: Any, model: Any, data: Any, mass: Floats) -> Any:
    """Return the call that writes the mass matrix; MuJoCo 4 changed it."""
    try:
        mujoco.mj_fullM(model, data, mass)
    except TypeError:
        return lambda: mujoco.mj_fullM(model, mass, data.qM)
    return lambda: mujoco.mj_fullM(model, data, mass)
