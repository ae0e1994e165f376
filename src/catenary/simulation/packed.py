"""The arm's many small arrays as a few long ones: handing an array to compiled code costs 0.2 us, in every tick.

`*_of` give the named arrays as views of a long one, in Python and in compiled code alike; their slices follow the order
of the fields, which `pack` and the tests hold to.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.kernels.compiled import inlined
from catenary.robots.model import Tree
from catenary.simulation.cable_parameters import Cable, Firmware
from catenary.simulation.cable_physics import ArmState
from catenary.simulation.firmware import ControlState, TickLog

# numbers in each
TREE, CABLE, FIRMWARE, ARM, CONTROL, CONTROL_WHOLE, LOG = 84, 118, 110, 38, 84, 17, 66


def pack(arrays: tuple[Any, ...]) -> Floats:
    """Every floating-point array of a named tuple, one after the other."""
    return np.concatenate([np.ravel(a) for a in arrays if a.dtype == np.float64])


def pack_tree(tree: Tree) -> Floats:
    """The numbers of a tree of three joints: rotation, origin, axis, mass, com, inertia."""
    return pack(tree)


@inlined
def tree_of(parent: NDArray[np.int64], prismatic: NDArray[np.bool_], flat: Floats) -> Tree:
    """A tree of three joints from its long array (TREE,)."""
    return Tree(
        parent,
        prismatic,
        flat[0:27].reshape((3, 3, 3)),
        flat[27:36].reshape((3, 3)),
        flat[36:45].reshape((3, 3)),
        flat[45:48],
        flat[48:57].reshape((3, 3)),
        flat[57:84].reshape((3, 3, 3)),
    )


@inlined
def cable_of(flat: Floats) -> Cable:
    """An arm's parameters from their long array (CABLE,)."""
    return Cable(
        flat[0:3],
        flat[3:6],
        flat[6:9],
        flat[9:12],
        flat[12:15],
        flat[15:18],
        flat[18:21],
        flat[21:24],
        flat[24:27],
        flat[27:30],
        flat[30:33],
        flat[33:36],
        flat[36:39],
        flat[39:42],
        flat[42:45],
        flat[45:48],
        flat[48:51],
        flat[51:54],
        flat[54:57],
        flat[57:60],
        flat[60:63],
        flat[63:66],
        flat[66:69],
        flat[69:72],
        flat[72:75],
        flat[75:78],
        flat[78:81],
        flat[81:84],
        flat[84:87],
        flat[87:90],
        flat[90:94],
        flat[94:98],
        flat[98:102],
        flat[102:106],
        flat[106:110],
        flat[110:114],
        flat[114:118],
    )


@inlined
def firmware_of(flat: Floats) -> Firmware:
    """A firmware's parameters from their long array (FIRMWARE,)."""
    return Firmware(
        flat[0:7],
        flat[7:10],
        flat[10:17],
        flat[17:24],
        flat[24:31],
        flat[31:38],
        flat[38:45],
        flat[45:52],
        flat[52:59],
        flat[59:66],
        flat[66:73],
        flat[73:80],
        flat[80:87],
        flat[87:94],
        flat[94:101],
        flat[101:108],
        flat[108:109],
        flat[109:110],
    )


@inlined
def arm_of(flat: Floats) -> ArmState:
    """An arm's state from its long array (ARM,)."""
    return ArmState(
        flat[0:7],
        flat[7:14],
        flat[14:17],
        flat[17:20],
        flat[20:23],
        flat[23:26],
        flat[26:29],
        flat[29:32],
        flat[32:35],
        flat[35:38],
    )


@inlined
def control_of(flat: Floats, whole: NDArray[np.int64]) -> ControlState:
    """A firmware's state from its long arrays (CONTROL,) and (CONTROL_WHOLE,)."""
    return ControlState(
        flat[0:7],
        flat[7:14],
        flat[14:21],
        flat[21:28],
        flat[28:35],
        flat[35:42],
        flat[42:49],
        flat[49:56],
        flat[56:63],
        flat[63:70],
        flat[70:77],
        flat[77:84],
        whole[0:7],
        whole[7:14],
        whole[14:17],
    )


@inlined
def log_of(flat: Floats) -> TickLog:
    """A log of T ticks from its table (T, LOG)."""
    return TickLog(
        flat[:, 0:7],
        flat[:, 7:14],
        flat[:, 14:21],
        flat[:, 21:28],
        flat[:, 28:35],
        flat[:, 35:42],
        flat[:, 42:49],
        flat[:, 49:56],
        flat[:, 56:63],
        flat[:, 63:66],
    )
