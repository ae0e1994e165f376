"""Gravity torques as the RAVEN paper writes them: a sum over the carried links, for every joint.

Lewis, Hannaford 2014, eq. 1-3: tau_i = -z . sum_k i_r_k x (i_g m_k), and for a prismatic joint the negative z
component of sum_k i_g m_k; here with any axis in place of z.
"""

import numpy as np
from numpy.typing import NDArray

from catenary.robots.model import Tree

Floats = NDArray[np.float64]


def carries(tree: Tree, joint: int, link: int) -> bool:
    while link > joint:
        link = int(tree.parent[link])
    return link == joint


def paper_gravity_torque(tree: Tree, rotations: Floats, positions: Floats, gravity: Floats) -> Floats:
    """Torques of the tree's joints, from the links' poses in the base (n, 3, 3), (n, 3)."""
    torque = np.zeros(len(tree.parent))
    for i, axis in enumerate(tree.axis):
        R_i_base = rotations[i].T
        g_i = R_i_base @ gravity
        total = np.zeros(3)
        for k, mass in enumerate(tree.mass):
            if not carries(tree, i, k):
                continue
            r_k = R_i_base @ (rotations[k] @ tree.com[k] + positions[k] - positions[i])
            total += g_i * mass if tree.prismatic[i] else np.cross(r_k, g_i * mass)
        torque[i] = -axis @ total
    return torque
