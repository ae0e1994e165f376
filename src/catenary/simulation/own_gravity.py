"""Gravity compensation of the robot's own: what its firmware adds to the torques of its PD. Compiled.

[RAVEN-II source, branches master and crtk: grav_comp.cpp, rt_raven.cpp, init.cpp] Once homed, whether the pedal is down
or not, the torques that hold the three positioning joints are added to what the PD asks for, at the reported positions
and under the vector `grav_dir`. Each joint's torque goes to its own motor by its ratio alone: the cables' coupling is
left out. Homing has none of it, nor have torques that somebody commands. The robot has no switch for it; here there is.
"""

import math
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np

from catenary.arrays import Floats
from catenary.dynamics.recursion import gravity_recursion, place_joints
from catenary.errors import InputError
from catenary.kernels.compiled import inlined
from catenary.robots.model import Tree
from catenary.simulation.cable_parameters import Firmware
from catenary.simulation.firmware import ControlState
from catenary.simulation.records import POSITIONING, PerJoint, Record

NOMINAL = (0, 0, 980)  # [cm/s2] grav_dir on a level base, z down; nothing public ever writes another
MOST = 32_767  # [cm/s2] of a component
# grav_dir's axes in the base's, whose z points up: turned by 180 deg about y
_AXES = np.array([-1.0, 1.0, -1.0])

_Matrices = Annotated[Floats, "f8", (POSITIONING, 3, 3)]
_Vectors = Annotated[Floats, "f8", (POSITIONING, 3)]
_Codes = Annotated[Floats, "i8", (POSITIONING,)]


class OwnGravity(Record):
    """What the firmware knows of the arm's weight, and scratch. The arm's links have the fields of a `Tree`."""

    weighs: bool  # whether its torques are added
    gravity: PerJoint  # that it goes by, in base axes [m/s2]
    parent: _Codes
    prismatic: _Codes
    rotation: _Matrices
    origin: _Vectors
    axis: _Vectors
    mass: PerJoint  # [kg]; no load
    com: _Vectors  # [m]
    sine: PerJoint
    cosine: PerJoint
    turned: _Matrices
    place: _Vectors
    carried: Annotated[Floats, "f8", (POSITIONING + 1,)]
    moment: Annotated[Floats, "f8", (POSITIONING + 1, 3)]
    link_gravity: Annotated[Floats, "f8", (POSITIONING + 1, 3)]
    torque: PerJoint  # at the joints [Nm, Nm, N]


def own_gravity(links: Tree) -> OwnGravity:
    """Return the compensation of an arm of these links, switched off."""
    of_links = ("parent", "prismatic", "rotation", "origin", "axis", "mass", "com")
    return OwnGravity(**{name: getattr(links, name) for name in of_links})


def gravity_of(grav_dir: Sequence[int]) -> Floats:
    """Return gravity (3,) in base axes [m/s2] from the robot's integers [cm/s2], whose z points down.

    Raises:
        InputError: Not three whole numbers of at most 32767 cm/s2.
    """
    given = np.asarray(grav_dir, dtype=float)
    if given.shape != (3,) or not (np.abs(given) <= MOST).all() or (given != np.round(given)).any():
        raise InputError(f"grav_dir: expected three whole numbers [cm/s2] of at most {MOST}, got {grav_dir}")
    gravity: Floats = _AXES * given / 100.0
    return gravity


def grav_dir_of(gravity: Floats) -> tuple[int, int, int]:
    """Return the robot's integers [cm/s2] of gravity (3,) in base axes [m/s2]."""
    x, y, z = np.round(100.0 * _AXES * gravity).astype(int).tolist()
    return x, y, z


@inlined
def weigh(firmware: Firmware, own: OwnGravity, control: ControlState) -> None:
    """Write the motor torques that hold the links at the reported positions [Nm at the gearbox's output]."""
    links: Any = own  # it has a tree's fields
    for j in range(POSITIONING):
        own.sine[j] = math.sin(control.joint[j])
        own.cosine[j] = math.cos(control.joint[j])
    place_joints(links, control.joint, own.sine, own.cosine, own.turned, own.place)
    gravity_recursion(
        links,
        own.turned,
        own.place,
        (own.gravity[0], own.gravity[1], own.gravity[2]),
        own.carried,
        own.moment,
        own.link_gravity,
        own.torque,
    )
    for j in range(POSITIONING):
        control.gravity_torque[j] = own.torque[j] / firmware.ratio[j] * firmware.gearbox[j]
