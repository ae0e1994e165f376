"""The arm with linear cables in MuJoCo: links, rotors as armature, cables as fixed tendons, a base that can be driven."""

import mujoco
import numpy as np
from numpy.typing import NDArray

from catenary.robots.model import Tree
from catenary.simulation.base_motion import RockingBase
from catenary.simulation.cable_parameters import Cable
from catenary.spatial import quaternion_from_rotation
from oracles.mujoco_trees import inertial, text

Floats = NDArray[np.float64]
HEAVY = 1e6  # [kg m2] of the hinge that drives the base: the arm cannot push it


def cable_arm_xml(tree: Tree, cable: Cable, base: RockingBase | None, timestep: float) -> str:
    links = ""
    for i in (2, 1, 0):
        kind = "slide" if tree.prismatic[i] else "hinge"
        links = (
            f'<body pos="{text(tree.origin[i])}" quat="{text(quaternion_from_rotation(tree.rotation[i]))}">'
            f'<joint name="q{i}" type="{kind}" axis="{text(tree.axis[i])}"/>'
            f"{inertial(tree.mass[i], tree.com[i], tree.inertia[i])}"
            f"{links}</body>"
        )
    if base is not None:
        lever = np.asarray(base.lever)
        links = (
            f'<body pos="{text(lever)}"><joint name="base" axis="{text(base.axis)}" pos="{text(-lever)}" '
            f'armature="{HEAVY}"/><inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/>{links}</body>'
        )
    # the rotors stand on the world, so that a rocking base does not drag them along: the plant leaves that out
    rotors = "".join(
        f'<body><joint name="m{j}" axis="0 0 1" armature="{cable.rotor_inertia[j]:.17g}" '
        f'damping="{cable.rotor_damping[j]:.17g}"/>'
        '<inertial mass="1e-9" pos="0 0 0" diaginertia="1e-14 1e-14 1e-14"/></body>'
        for j in range(3)
    )
    c01, c02, c12 = cable.coupling
    winding = [{0: 1.0}, {0: c01, 1: 1.0}, {0: c02, 1: c12, 2: 1.0}]
    tendons = ""
    for j in range(3):
        ratio = cable.ratio[j] * (1.0 + cable.ratio_error[j])
        joints = "".join(f'<joint joint="q{i}" coef="{-c:.17g}"/>' for i, c in winding[j].items())
        tendons += (
            f'<fixed springlength="0" stiffness="{cable.stiffness[j]:.17g}" damping="{cable.damping[j]:.17g}">'
            f'<joint joint="m{j}" coef="{1.0 / ratio:.17g}"/>{joints}</fixed>'
        )
    return (
        f'<mujoco><compiler angle="radian"/><option timestep="{timestep}" integrator="RK4" gravity="0 0 -9.81"/>'
        f"<worldbody>{links}{rotors}</worldbody><tendon>{tendons}</tendon></mujoco>"
    )


class MujocoCableArm:
    """The arm in motion; its base, if it has one, is written into the simulation before every step."""

    def __init__(self, tree: Tree, cable: Cable, base: RockingBase | None = None, timestep: float = 2.5e-4) -> None:
        self._base, self._timestep = base, timestep
        self._model = mujoco.MjModel.from_xml_string(cable_arm_xml(tree, cable, base, timestep))
        self._data = mujoco.MjData(self._model)
        names = [f"q{i}" for i in range(3)] + [f"m{j}" for j in range(3)]
        self._at = np.array([self._model.joint(name).dofadr[0] for name in names])

    def place(self, q: Floats, qd: Floats, rotor: Floats, rotor_velocity: Floats, time: float) -> None:
        self._data.qpos[self._at] = [*q, *rotor]
        self._data.qvel[self._at] = [*qd, *rotor_velocity]
        self._data.time = time

    @property
    def q(self) -> Floats:
        return self._data.qpos[self._at[:3]].copy()

    @property
    def rotor(self) -> Floats:
        return self._data.qpos[self._at[3:]].copy()

    def step(self, shaft_torque: Floats, seconds: float) -> None:
        """Advance with constant torques (3,) of the motors."""
        self._data.qfrc_applied[self._at[3:]] = shaft_torque
        for _ in range(round(seconds / self._timestep)):
            if self._base is not None:
                self._drive_base(self._base)
            mujoco.mj_step(self._model, self._data)

    def _drive_base(self, base: RockingBase) -> None:
        w = 2.0 * np.pi * base.frequency
        phase = w * self._data.time
        self._data.joint("base").qpos = base.mean + base.amplitude * np.sin(phase)
        self._data.joint("base").qvel = base.amplitude * w * np.cos(phase)
        # the acceleration in the middle of the step, which is held over it
        middle = phase + 0.5 * w * self._timestep
        self._data.joint("base").qfrc_applied = -HEAVY * base.amplitude * w * w * np.sin(middle)
