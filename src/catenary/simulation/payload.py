"""A mass carried at the tool's wrist, as part of the arm."""

import numpy as np

from catenary.arrays import frozen
from catenary.robots.assembly import LinkInertia
from catenary.robots.model import RobotModel, Tree

PAYLOAD_PLACE = (0.0, 0.0, -0.47)  # [m] in the insertion's frame: the tool's wrist


def with_payload(model: RobotModel, mass: float) -> Tree:
    """The tree of an arm of three joints, with a point mass [kg] at the tool's wrist."""
    tree = model.tree
    if mass == 0.0:
        return tree
    link = LinkInertia(float(tree.mass[2]), tree.com[2], tree.inertia[2])
    carried = link.plus(LinkInertia(mass, np.array(PAYLOAD_PLACE), np.zeros((3, 3))))
    masses, coms, inertias = tree.mass.copy(), tree.com.copy(), tree.inertia.copy()
    masses[2], coms[2], inertias[2] = carried.mass, carried.com, carried.inertia
    # read-only like the rest of the tree: compiled code would be compiled once more for another kind of array
    return tree._replace(mass=frozen(masses), com=frozen(coms), inertia=frozen(inertias))
