"""Rigid links on a moving base, as a simulated arm needs them: bias torques and the mass matrix. Compiled."""

import math
from typing import Annotated

from catenary.arrays import Floats
from catenary.dynamics.recursion import composite_body_recursion, newton_euler_recursion, place_joints
from catenary.kernels.compiled import inlined
from catenary.robots.model import Tree
from catenary.simulation.records import Record

_PerLink = Annotated[Floats, "f8", ("link",)]
_Vectors = Annotated[Floats, "f8", ("node", 3)]


class TreeWork(Record):
    """Scratch for `tree_dynamics`, whose results are `bias` and `matrix`."""

    sine: _PerLink
    cosine: _PerLink
    rotation: Annotated[Floats, "f8", ("link", 3, 3)]
    position: Annotated[Floats, "f8", ("link", 3)]
    # the recursions' rows are the links', then the base's
    omega: _Vectors
    alpha: _Vectors
    acceleration: _Vectors
    force: _Vectors
    moment: _Vectors
    mass: Annotated[Floats, "f8", ("node",)]
    first_moment: _Vectors
    inertia: Annotated[Floats, "f8", ("node", 3, 3)]
    matrix: Annotated[Floats, "f8", ("link", "link")]  # mass matrix [kg m2, kg m, kg]
    bias: _PerLink  # torques of velocity, gravity and a moving base [Nm, N]
    zero: _PerLink  # accelerations at which the bias is taken: stays zero


@inlined
def tree_dynamics(
    tree: Tree, x: Floats, xd: Floats, gravity: Floats, base_motion: Floats, work: TreeWork
) -> None:
    """Write a tree's bias torques and its mass matrix, in its own coordinates.

    Args:
        tree: The links.
        x: (n,) or more, its coordinates [rad|m].
        xd: (n,) or more, their rates.
        gravity: (3,) in base axes [m/s2].
        base_motion: (3, 3) angular velocity, angular acceleration, linear acceleration of the base, base axes.
        work: Scratch; `bias` and `matrix` are the result.
    """
    n = len(tree.parent)
    for j in range(n):
        work.sine[j] = math.sin(x[j])
        work.cosine[j] = math.cos(x[j])
    place_joints(tree, x, work.sine, work.cosine, work.rotation, work.position)
    for r in range(3):
        work.omega[n, r] = base_motion[0, r]
        work.alpha[n, r] = base_motion[1, r]
        work.acceleration[n, r] = base_motion[2, r] - gravity[r]
    newton_euler_recursion(
        tree,
        work.rotation,
        work.position,
        xd,
        work.zero,
        work.omega,
        work.alpha,
        work.acceleration,
        work.force,
        work.moment,
        work.bias,
    )
    composite_body_recursion(
        tree,
        work.rotation,
        work.position,
        work.mass,
        work.first_moment,
        work.inertia,
        work.matrix,
    )


@inlined
def invert_symmetric(m: Floats, inverse: Floats) -> None:
    """Write the inverse of a symmetric 3 x 3 matrix, by cofactors, into the first three rows and columns."""
    a = m[1, 1] * m[2, 2] - m[1, 2] * m[1, 2]
    b = m[0, 2] * m[1, 2] - m[0, 1] * m[2, 2]
    c = m[0, 1] * m[1, 2] - m[0, 2] * m[1, 1]
    scale = 1.0 / (m[0, 0] * a + m[0, 1] * b + m[0, 2] * c)
    inverse[0, 0] = scale * a
    inverse[0, 1] = inverse[1, 0] = scale * b
    inverse[0, 2] = inverse[2, 0] = scale * c
    inverse[1, 1] = scale * (m[0, 0] * m[2, 2] - m[0, 2] * m[0, 2])
    inverse[1, 2] = inverse[2, 1] = scale * (m[0, 1] * m[0, 2] - m[0, 0] * m[1, 2])
    inverse[2, 2] = scale * (m[0, 0] * m[1, 1] - m[0, 1] * m[0, 1])
