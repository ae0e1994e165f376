"""Masses that an arm carries, as part of the arm."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import Floats, as_array, frozen
from catenary.errors import InputError
from catenary.robots.assembly import LinkInertia
from catenary.robots.model import RobotModel, Tree

PAYLOAD_PLACE = (0.0, 0.0, -0.47)  # [m] in the insertion's frame: the tool's wrist


class Payload(NamedTuple):
    """A point mass on a robot."""

    mass: float  # [kg]
    frame: str | None = None  # the tip when None
    position: ArrayLike = (0.0, 0.0, 0.0)  # (3,) [m] in that frame


def carrying(model: RobotModel, payload: Payload) -> RobotModel:
    """Give the robot with a payload as part of the link that carries it.

    Raises:
        InputError: A negative or infinite mass, a position of another shape, no such frame, or one of the base.
    """
    mass = float(as_array("payload mass", payload.mass, ()))
    if mass < 0.0:
        raise InputError(f"payload mass: expected zero or more kg, got {mass}")
    link, pose = model.frame(payload.frame)
    if link < 0:
        raise InputError(
            f'robot "{model.name}": frame "{payload.frame}" is fixed to the base: no joint would carry the payload'
        )
    place = pose.rotation @ as_array("payload position", payload.position, (3,)) + pose.position
    return replace(model, tree=_with_point_mass(model.tree, link, mass, place))


def with_payload(model: RobotModel, mass: float) -> Tree:
    """The tree of a RAVEN-II's three positioning joints, with a point mass [kg] at the tool's wrist."""
    return _with_point_mass(model.tree, 2, mass, np.array(PAYLOAD_PLACE))


def _with_point_mass(tree: Tree, link: int, mass: float, place: Floats) -> Tree:
    if mass == 0.0:
        return tree
    own = LinkInertia(float(tree.mass[link]), tree.com[link], tree.inertia[link])
    carried = own.plus(LinkInertia(mass, place, np.zeros((3, 3))))
    masses, coms, inertias = tree.mass.copy(), tree.com.copy(), tree.inertia.copy()
    masses[link], coms[link], inertias[link] = carried.mass, carried.com, carried.inertia
    # read-only like the rest of the tree: compiled code would be compiled once more for another kind of array
    return tree._replace(mass=frozen(masses), com=frozen(coms), inertia=frozen(inertias))
