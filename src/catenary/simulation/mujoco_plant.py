"""Simulation of any robot on a moving base: MuJoCo rigid-body dynamics, couplings, friction, springs and stops."""

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import replace
from typing import Any, Literal
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_array
from catenary.errors import InputError, LimitError, imported
from catenary.gravity.payload import Payload
from catenary.plant import Column, JointState
from catenary.robots.mjcf import LEAST_INERTIA, LEAST_MASS
from catenary.robots.model import RobotModel
from catenary.simulation.base_motion import BaseSamples, BaseTimeline, FixedBase, MovingBase, imu_reading
from catenary.simulation.joint_hardware import (
    DriveParameters,
    JointHardware,
    StepMotion,
    TreeTerms,
    begin_step,
    drive_parameters,
    end_stage,
    finish_step,
    new_motion,
    require_stable,
)
from catenary.simulation.simulated_plant import PERIOD, SimulatedPlant
from catenary.spatial import quaternion_from_rotation

_ROUNDING = 1e-9  # tolerance of the triangle inequality, relative to the largest moment


def tree_mjcf(model: RobotModel) -> str:
    """Return the tree as MJCF, on a base body with a free joint, without gravity.

    Body and joint i have the name of link i; the body's frame is frame i of the tree. The joints are the tree's,
    uncoupled: the simulation sets tree coordinates = coupling q + offset.
    """
    model.require_inertia()
    children: list[list[int]] = [[] for _ in range(len(model.link_names) + 1)]
    for i, parent in enumerate(model.tree.parent):
        children[parent].append(i)  # those of the base (-1) come last
    # written from the leaves, since children come after their parents
    body = [""] * len(model.link_names)
    for i in reversed(range(len(body))):
        body[i] = _body(model, i, "".join(body[c] for c in children[i]))
    links = "".join(body[c] for c in children[-1])
    return (
        f"<mujoco model={quoteattr(model.name)}>\n"
        '<compiler angle="radian"/>\n'
        '<option gravity="0 0 0"><flag contact="disable"/></option>\n'
        f"<worldbody><body name={quoteattr(model.base)}><freejoint/>"
        f'<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/>\n{links}</body></worldbody>\n</mujoco>\n'
    )


def _body(model: RobotModel, i: int, inside: str) -> str:
    tree, name = model.tree, quoteattr(model.link_names[i])
    moments, axes = _principal(model, i)
    return (
        f'<body name={name} pos="{_text(tree.origin[i])}" '
        f'quat="{_text(quaternion_from_rotation(tree.rotation[i]))}">'
        f'<joint name={name} type="{"slide" if tree.prismatic[i] else "hinge"}" axis="{_text(tree.axis[i])}"/>'
        f'<inertial mass="{max(tree.mass[i], LEAST_MASS):.17g}" pos="{_text(tree.com[i])}" '
        f'quat="{_text(quaternion_from_rotation(axes))}" diaginertia="{_text(moments)}"/>\n{inside}</body>\n'
    )


def _principal(model: RobotModel, i: int) -> tuple[Floats, Floats]:
    """Return the principal moments (3,) in ascending order, and their axes as columns, right-handed."""
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
    # a rod's moments (0, I, I) may violate the inequality by rounding, and MuJoCo has no tolerance
    moments[0] += max(0.0, moments[2] - moments[1] - moments[0])
    return moments, axes


def _text(values: Floats) -> str:
    return " ".join(f"{v:.17g}" for v in values)


class MujocoDynamics:
    """MuJoCo's M and h of M xdd + h = tree torque, for the tree's joints; independent of catenary's recursions.

    The base is MuJoCo's free body at the origin, with given rotation and acceleration. Base axes are MuJoCo's world
    axes at that instant; h comes from one inverse dynamics with the base's true acceleration.
    """

    def __init__(self, model: RobotModel) -> None:
        self._robot = model
        self._mujoco = mujoco = imported("mujoco", "MuJoCo simulates this robot and is not installed", "mujoco")
        text = tree_mjcf(model)
        try:
            self._model = m = mujoco.MjModel.from_xml_string(text)
        except ValueError as error:
            raise InputError(f'robot "{model.name}": MuJoCo refuses it: {str(error).strip()}') from error
        self._data = d = mujoco.MjData(m)
        joints = [m.joint(name) for name in model.link_names]
        self.dof: NDArray[np.int64] = np.array([joint.dofadr[0] for joint in joints], dtype=np.int64)
        self.at: NDArray[np.int64] = np.array([joint.qposadr[0] for joint in joints], dtype=np.int64)
        # write positions at `at`, velocities at `dof`; `update` computes the terms
        self.tree = TreeTerms(d.qpos, d.qvel, np.zeros((m.nv, m.nv)), np.zeros(m.nv))
        self._gravity, self._qdd = m.opt.gravity, d.qacc  # views: MuJoCo creates a new one at every access
        self.tree.q[:] = 0.0
        self.tree.q[3] = 1.0  # the base's quaternion
        self._write_mass = _mass_writer(mujoco, m, d, self.tree.mass)

    def __deepcopy__(self, memo: dict[int, Any]) -> "MujocoDynamics":
        """Return a copy in the same state, whose arrays are views into its own MuJoCo data."""
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
    """Return the function that writes the mass matrix; its signature changed in MuJoCo 4."""
    try:
        mujoco.mj_fullM(model, data, mass)
    except TypeError:
        return lambda: mujoco.mj_fullM(model, mass, data.qM)
    return lambda: mujoco.mj_fullM(model, data, mass)


_BANDWIDTH = 200.0  # [rad/s] a steady motion lags by 2 / _BANDWIDTH, 10 ms
_STICTION_BAND = 1e-4  # [rad|m] from its setpoint within which the servo lets a joint stick


def servo_torques(joints: DriveParameters, motion: StepMotion, tree: TreeTerms, target: Floats) -> Floats:
    """Return the torques of an ideal position servo: computed torque on the driven parts.

    a = w² (target - theta) - 2 w theta', tau = M a + h + damping + friction, with w the _BANDWIDTH and friction fed
    forward as F clip(error / _STICTION_BAND, -1, 1): within that band a joint may stick. `motion` and `tree` are at
    the start of a step, target (n,) are motor positions [rad|m]; returns (n,) [Nm|N].
    """
    n, dof, drive, elastic = len(joints.drive), joints.dof, joints.drive, joints.elastic
    position, rate = motion.start, motion.start_rate
    mass = joints.coupling.T @ tree.mass[np.ix_(dof, dof)] @ joints.coupling + np.diag(joints.inertia[:n])
    bias = joints.coupling.T @ tree.bias[dof]
    pull = joints.stiffness * (position[n:] - position[elastic])
    pull += joints.spring_damping * (rate[n:] - rate[elastic])
    error = target - position[drive]
    a = np.zeros(len(position))
    a[drive] = _BANDWIDTH * (_BANDWIDTH * error - 2.0 * rate[drive])
    # elastic joints accelerate under their springs and load the rigid ones: M_ee a_e = pull - h_e - M_er a_r
    load = pull - bias[elastic] - mass[elastic] @ a[:n]
    a[elastic] = np.linalg.solve(mass[np.ix_(elastic, elastic)], load)
    torque: Floats = bias + mass @ a[:n]
    torque[elastic] = joints.inertia[n:] * a[n:] + pull
    torque += joints.damping[drive] * rate[drive]
    torque += joints.friction[drive] * np.clip(error / _STICTION_BAND, -1.0, 1.0)
    return torque


class MujocoPlant(SimulatedPlant):
    """Simulated robot, given by its model. Brakes hold it while it is not enabled; absolute encoders: always homed.

    M(q) qdd + h(q, qd, gravity, base motion) = tau - damping qd - friction, by Runge-Kutta's fourth-order method:
    MuJoCo computes M and h of the tree's joints, and the model's coupling projects them on q exactly. Friction and
    joint limits act as impulses at the end of each step: a joint sticks without creep, unlike with MuJoCo's own
    friction, and stops at its limits without bouncing. The simulation is deterministic, bit for bit.

    Torques of `servo_jf` are limited to the model's effort limits. An ideal servo (`servo_torques`) follows `servo_jp`:
    the setpoint moves within the model's velocity and joint limits; after a jump that needs more than the effort
    limits, the arm lags and overshoots, as a real one does.

    Examples:
        >>> plant = catenary.MujocoPlant(catenary.load_robot("two_link"))
        >>> plant.home()
        >>> for _ in range(500):
        ...     plant.servo_jp(np.array([0.3, 0.2]))
        ...     plant.wait()
        >>> plant.measured_js().q.round(2)
        array([0.3, 0.2])
    """

    def __init__(
        self,
        model: RobotModel,
        *,
        base: MovingBase | None = None,
        start: ArrayLike | None = None,
        hardware: JointHardware | None = None,
        payload: Payload | None = None,
        substeps: int = 1,
    ) -> None:
        """Create a robot, powered on and disabled.

        Args:
            model: Robot whose links all have inertia.
            base: Motion of the base; level and fixed when None.
            start: (n,) positions at power-on [rad|m]; zero when None, the middle of the range for joints whose limits
                exclude zero.
            hardware: Friction, rotors, springs; ideal drives when None.
            payload: Body carried by the robot; none when None.
            substeps: Physics steps per tick of 1 ms; the error for stiff springs or dampers states the number needed.

        Raises:
            LimitError: `start` is outside the joint limits.
            InputError: A joint moves no mass, or springs or dampers are too stiff for the step.
        """
        if substeps < 1:
            raise InputError(f"substeps: expected at least 1, got {substeps}")
        self.model = model
        self._hardware = JointHardware() if hardware is None else hardware
        self._substeps, self._step = substeps, PERIOD / substeps
        timeline = BaseTimeline(FixedBase() if base is None else base, self._step / 2.0)
        super().__init__(timeline, is_homed=True)
        n = model.n
        self.joint_names, self.joint_units = model.joint_names, model.joint_units
        self.columns = (
            Column("jpos", "rad|m", n),
            Column("jvel", "rad/s|m/s", n),
            Column("jpos_d", "rad|m", n),
            Column("tau", "Nm|N", n),  # commanded
            Column("effort", "Nm|N", n),  # applied, within the effort limits
            Column("q_true", "rad|m", n),  # of the links, behind their springs
            Column("accelerometer", "m/s2", 3),
            Column("gyroscope", "rad/s", 3),
        )
        q = _start(model, start)
        self.attach(payload)
        self._motion = new_motion(n, len(self._joints.inertia))
        self._motion.start[:] = np.append(q, q[self._joints.elastic])  # springs relaxed
        self._mode: Literal["brakes", "position", "torque"] = "brakes"
        self._command = np.zeros(n)  # commanded torques
        self._effort = np.zeros(n)  # applied torques
        self.pushed_by = np.zeros(n)  # external torques, such as of an operator's hand [Nm|N]
        self._setpoint = self._motion.start[self._joints.drive]
        self._effort_limit = np.array(model.effort_limit)
        self._setpoint_step = model.velocity_limit * PERIOD
        require_stable(self._joints, self._mass_matrix(), self._step, model.joint_names)
        begun = deepcopy(self._motion)  # compile the functions of a tick
        end_stage(self._joints, begun, self._dynamics.tree, self._effort, 0, self._step)
        finish_step(self._joints, begun, self._step)

    # properties of a Plant

    @property
    def lower(self) -> Floats:
        """Lower joint limits (n,) [rad|m]."""
        return np.array(self.model.lower)

    @property
    def upper(self) -> Floats:
        """Upper joint limits (n,) [rad|m]."""
        return np.array(self.model.upper)

    @property
    def velocity_limit(self) -> Floats:
        """Velocity limits (n,) [rad/s|m/s], infinity where the model has none."""
        return np.array(self.model.velocity_limit)

    def measured_js(self) -> JointState:
        """Return the joint state: of the rotors of elastic joints, of the others themselves."""
        motion, drive = self._motion, self._joints.drive
        rotors = motion.start[self.model.n :].copy()
        return self._joint_state(motion.start[drive], motion.start_rate[drive], self._command.copy(), rotors)

    def setpoint_js(self) -> JointState:
        """Return the setpoint of the position servo."""
        return self.measured_js()._replace(q=self._setpoint.copy(), qd=np.zeros(self.model.n))

    def telemetry(self) -> Mapping[str, Floats]:
        """Return the latest sample of every column of `columns`."""
        motion, drive = self._motion, self._joints.drive
        specific_force, rate = imu_reading(self._base_now())  # of an ideal sensor at the base's origin, in base axes
        link = motion.start[: self.model.n]
        joints = motion.start[drive], motion.start_rate[drive], self._setpoint, self._command, self._effort, link
        sampled = (*joints, specific_force[0], rate[0])
        return {column.name: values.copy() for column, values in zip(self.columns, sampled, strict=True)}

    # commands of a Plant

    def servo_jf(self, tau: Floats) -> None:
        """Command joint torques (n,) [Nm|N]; they act until the next command, and the setpoint follows the robot."""
        self._require_ready()
        self._command[:] = as_array("servo_jf", tau, (self.model.n,))
        self._target = None
        self._mode = "torque"

    def wait(self) -> None:
        """Advance by one tick of 1 ms; a diverging motion puts the robot in FAULT."""
        if self._mode == "position" and self._target is not None:
            step = np.clip(self._target - self._setpoint, -self._setpoint_step, self._setpoint_step)
            self._setpoint = np.clip(self._setpoint + step, self.model.lower, self.model.upper)
            self._target = None
        for part in range(self._substeps):
            if self._mode == "brakes":
                break
            if not self._advance(part):
                self._set_state("FAULT", f"its motion diverged in tick {self._tick}, at {self.time:.3f} s")
        self._tick += 1
        if self._mode == "torque":  # no jump when the servo takes over
            self._setpoint = self._motion.start[self._joints.drive]

    # simulator only

    def attach(self, payload: Payload | None) -> None:
        """Replace the payload, at the arm's present velocity; None removes it."""
        # masses are constants in MuJoCo: the robot is compiled with its payload
        dynamics = MujocoDynamics(self.model if payload is None else payload.on(self.model))
        self._dynamics, self.payload = dynamics, payload
        self._joints = drive_parameters(self.model, self._hardware, dynamics.dof, dynamics.at)

    def detach(self) -> None:
        """Remove the payload."""
        self.attach(None)

    def set_coulomb_friction(self, friction: ArrayLike) -> None:
        """Replace Coulomb friction, a scalar for all joints or (n,) [Nm|N]."""
        self._hardware = replace(self._hardware, friction=friction)
        self._joints = drive_parameters(self.model, self._hardware, self._dynamics.dof, self._dynamics.at)

    def _base_now(self) -> BaseSamples:
        return self._base_at(0)

    def _base_at(self, half_steps: int) -> BaseSamples:
        """Return gravity (1, 3) and motion (1, 3, 3) of the base, a number of half steps after the last tick."""
        return self._base.rows(2 * self._substeps * self._tick + half_steps, 1)[0]

    def _update(self, half_steps: int) -> None:
        """Compute the rigid-body terms at the state set by `begin_step` or `end_stage`."""
        gravity, motion = self._base_at(half_steps)
        self._dynamics.move_base(gravity[0], motion[0])
        self._dynamics.update()

    def _mass_matrix(self) -> Floats:  # (nz, nz), of all moving parts
        begin_step(self._joints, self._motion, self._dynamics.tree)
        self._update(0)
        dof, coupling, n = self._joints.dof, self._joints.coupling, self.model.n
        mass = np.diag(self._joints.inertia)
        mass[:n, :n] += coupling.T @ self._dynamics.tree.mass[np.ix_(dof, dof)] @ coupling
        return mass

    def _advance(self, part: int) -> bool:
        """Integrate one step; return false, with the state unchanged, if it fails."""
        joints, motion, tree, step = self._joints, self._motion, self._dynamics.tree, self._step
        begin_step(joints, motion, tree)
        for stage, half_steps in enumerate((0, 1, 1, 2)):
            self._update(2 * part + half_steps)
            if stage == 0 and part == 0:  # the servo's torques, limited by the drives
                if self._mode == "position":
                    self._command[:] = servo_torques(joints, motion, tree, self._setpoint)
                np.clip(self._command, -self._effort_limit, self._effort_limit, out=self._effort)
                self._effort += self.pushed_by
            if not end_stage(joints, motion, tree, self._effort, stage, step):
                return False
        return finish_step(joints, motion, step)

    def _control_position(self) -> None:
        self._mode = "position"

    def _state_changed(self) -> None:
        self._mode = "position" if self._moves else "brakes"
        self._motion.start_rate[:] = 0.0  # the brakes hold at once
        self._setpoint = self._motion.start[self._joints.drive]
        self._target = None
        self._command[:], self._effort[:] = 0.0, 0.0

    def _begin_homing(self) -> None:
        if not self._is_homed:
            self._is_homed = True
            self._state_changed()

    def _unhomed(self) -> None:
        self._set_state(self._state)


def _start(model: RobotModel, start: ArrayLike | None) -> Floats:
    if start is None:
        with np.errstate(invalid="ignore"):
            middle = 0.5 * (model.lower + model.upper)
        holds_zero = (model.lower <= 0.0) & (model.upper >= 0.0)
        limit = np.where(np.isfinite(model.lower), model.lower, model.upper)
        return np.asarray(np.where(holds_zero, 0.0, np.where(np.isfinite(middle), middle, limit)))
    q = as_array("start", start, (model.n,)).copy()
    for name, value, low, high in zip(model.joint_names, q, model.lower, model.upper, strict=True):
        if not low <= value <= high:
            raise LimitError(f'start: joint "{name}": {value:g} is outside [{low:g}, {high:g}]')
    return q
