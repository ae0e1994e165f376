"""Gravity as regressor times parameters, g = Z(q, gravity) s: the paper's form, and that of masses and moments.

The paper keeps, for every joint, what it carries as seen along every frame's axes; Z depends on the arm's
geometry alone, s on masses and centres of mass. Neither Z needs a model with inertia.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catenary.arrays import Floats, as_array, as_batch
from catenary.dynamics.inverse_dynamics import gravity_rows
from catenary.dynamics.kinematics import link_poses
from catenary.dynamics.torque_regressor import PER_LINK, torque_regressor
from catenary.errors import InputError
from catenary.robots.model import RobotModel, Tree

_STANDARD_LABELS = ("m", "mx", "my", "mz")  # mass, and first moment about the frame's origin
CARRIED_MASS = 3  # in place of an axis 0, 1, 2


class RegressorColumn(NamedTuple):
    """Meaning of a regressor's column: a first moment on a link, or the mass on a prismatic joint."""

    link: int  # index into the tree
    along: int  # axis of the link's frame along which the moment lies, or CARRIED_MASS


class GravityParameters(NamedTuple):
    """A robot's parameter vector, and what its entries are."""

    values: Floats  # (p,)
    labels: tuple[str, ...]  # (p,)
    units: tuple[str, ...]  # (p,) "kg" or "kg m"


def gravity_regressor(model: RobotModel, q: ArrayLike, gravity: ArrayLike) -> Floats:
    """Return the regressor Z(q, gravity) of the paper, with Z s = g for the s that `gravity_parameters` gives.

    Block row k holds -gravity^T [z_k]x [1 R_1 ... R_n] in block column k, zeros elsewhere; the paper has
    g_c e_z^T, the level base's. [gravity-regressor paper, section II] Beyond the paper: any gravity vector; trees,
    whose joints are stacked in the tree's order (body, arm 1, arm 2, as the paper does); coordinates that move
    several joints, by coupling^T; prismatic joints, each with one more column, for the mass it carries.

    Args:
        model: The robot; needs no inertia.
        q: Positions (n,) or (N, n) [rad or m].
        gravity: Free-fall acceleration in base axes, down, (3,) or (N, 3) [m/s2].

    Returns:
        (n, p) or (N, n, p), p = 3 n_tree (n_tree + 1) + number of prismatic joints.

    Examples:
        >>> arm = catenary.load_robot("two_link")
        >>> catenary.gravity_regressor(arm, [0.3, 0.5], [0.0, 0.0, -9.81]).shape
        (2, 18)
    """
    rows, single = as_batch("q", q, model.n)
    out = _full(model, rows, gravity_rows(gravity, len(rows)))
    return out[0] if single else out


def full_kernel(model: RobotModel) -> Callable[[Floats, Floats], Floats]:
    """Return `kernel(q, gravity)`, the paper's Z (n, p) at one configuration; not compiled, NaN in gives NaN out."""
    return lambda q, gravity: _full(model, q[None], gravity[None])[0]


def _full(model: RobotModel, rows: Floats, gravities: Floats) -> Floats:
    tree, N, n = model.tree, len(rows), len(model.tree.parent)
    arm = _placed(model, rows, gravities)
    frames = np.concatenate([np.broadcast_to(np.eye(3), (N, 1, 3, 3)), arm.rotation], axis=1)
    blocks = np.einsum("Nka,Njab->Nkjb", arm.pull, frames).reshape(N, n, 3 * (n + 1))
    moments: Floats = np.einsum("kr,Nkc->Nrkc", model.coupling, blocks).reshape(N, model.n, 3 * n * (n + 1))
    if not tree.prismatic.any():
        return moments
    masses = [RegressorColumn(int(link), CARRIED_MASS) for link in np.flatnonzero(tree.prismatic)]
    return np.concatenate([moments, _columns(model, masses, rows, arm)], axis=2)


def regressor_columns(model: RobotModel, columns: Sequence[RegressorColumn], q: Floats, gravity: Floats) -> Floats:
    """Return chosen columns (N, n, len(columns)) of the regressor; inputs are not checked.

    The mass that a prismatic joint with axis z carries asks -gravity . z of the joint itself and, because the joint
    moves it by x along z, x times what a first moment along z asks of the revolute joints before it.
    """
    return _columns(model, columns, q, _placed(model, q, gravity))


def gravity_parameters(model: RobotModel) -> GravityParameters:
    """Return the parameters s of `gravity_regressor`: per joint and frame, the first moment of what the joint carries.

    Entry (k, j) is sum over the links i that joint k carries, of m_i times the part of link i's centre of mass, as
    seen from frame k, that lies along frame j's axes: D_ik p + d_i p_c of the paper. On the way from k to i that is
    the step from frame j to the next one, taken with prismatic joints at zero, or the centre of mass in frame i = j.
    At the end the masses that prismatic joints carry.
    """
    model.require_masses()
    tree = model.tree
    n = len(tree.parent)
    moment, mass = carried(tree)
    moments = carries(tree)[:, :, None] * moment
    values = np.concatenate([np.zeros((n, 1, 3)), moments], axis=1).ravel()
    values = np.append(values, mass[tree.prismatic])
    units = ("kg m",) * (3 * n * (n + 1)) + ("kg",) * int(tree.prismatic.sum())
    return GravityParameters(values, full_labels(model), units)


def full_labels(model: RobotModel) -> tuple[str, ...]:
    """Return the names of the parameters (p,) of `gravity_regressor`."""
    frames = (model.base, *model.link_names)
    moments = [
        f"carried by {link}, along {axis} of {frame}" for link in model.link_names for frame in frames for axis in "xyz"
    ]
    slides = np.flatnonzero(model.tree.prismatic)
    return (*moments, *(f"mass carried by {model.link_names[link]}" for link in slides))


def standard_gravity_regressor(model: RobotModel, q: ArrayLike, gravity: ArrayLike) -> Floats:
    """Return the regressor of every link's mass and first moment (m, m c), with Z s = g.

    The columns of (m, m c) of `torque_regressor` at rest; they are dependent: see identification/base_parameters.py.
    For q (n,) or (N, n) and gravity (3,) or (N, 3) in base axes [m/s2]: (n, 4 n_links) or (N, n, 4 n_links); link i has
    columns 4 i (mass) to 4 i + 3 (moments about x, y, z of the origin of frame i).
    """
    rows, single = as_batch("q", q, model.n)
    zeros, links = np.zeros_like(rows), len(model.link_names)
    Y = torque_regressor(model, rows, zeros, zeros, gravity).reshape(*rows.shape, links, PER_LINK)
    Z = Y[..., : len(_STANDARD_LABELS)].reshape(*rows.shape, links * len(_STANDARD_LABELS))
    return Z[0] if single else Z


def standard_gravity_parameters(model: RobotModel) -> GravityParameters:
    """Return the parameters of `standard_gravity_regressor`: m [kg], m c [kg m] of every link, in its frame."""
    model.require_masses()
    mass = model.tree.mass[:, None]
    values = np.hstack([mass, mass * model.tree.com]).ravel()
    return GravityParameters(values, standard_labels(model), ("kg", "kg m", "kg m", "kg m") * len(mass))


def standard_labels(model: RobotModel) -> tuple[str, ...]:
    """Name the parameters of `standard_gravity_regressor`: "m(elbow)", "mx(elbow)", ..."""
    return tuple(f"{kind}({link})" for link in model.link_names for kind in _STANDARD_LABELS)


def carried(tree: Tree) -> tuple[Floats, Floats]:
    """Return first moments (n, 3) about the frames' origins, and masses (n,), of links with all that they carry.

    What a link carries is lumped at its joints. Each child's whole load counts where its frame's origin is with its
    joint at zero: masses beyond it are counted along the child's own axes.
    """
    mass = np.array(tree.mass)
    moment = tree.mass[:, None] * tree.com
    for i in range(len(mass) - 1, -1, -1):
        parent = tree.parent[i]
        if parent >= 0:
            mass[parent] += mass[i]
            moment[parent] += mass[i] * tree.origin[i]
    return moment, mass


def carried_links(tree: Tree, joint: int) -> set[int]:
    """Return the links that a joint carries, its own included."""
    return set(np.flatnonzero(carries(tree)[joint]).tolist())


def carries(tree: Tree) -> NDArray[np.bool_]:
    """Return the links that each joint carries, as flags (n, n)."""
    flags = np.eye(len(tree.parent), dtype=bool)
    for i in np.flatnonzero(tree.parent >= 0):
        flags[:, i] |= flags[:, tree.parent[i]]
    return flags


def require_parameters(name: str, values: ArrayLike, labels: Sequence[str]) -> Floats:
    """Return a parameter vector as an array."""
    array = as_array(name, values, (len(labels),), finite=False)
    for k in np.flatnonzero(~np.isfinite(array)).tolist():
        raise InputError(f"{name}[{k}] ({labels[k]}) is {array[k]}: expected a finite number")
    return array


class _Placed(NamedTuple):
    """An arm at N configurations, all in the base frame; a joint is pulled if it turns, pushed if it slides."""

    rotation: Floats  # (N, n_tree, 3, 3) R_base_i
    pull: Floats  # (N, n_tree, 3) z x gravity: what a first moment v asks is v . pull = -gravity . (z x v) [m/s2]
    push: Floats  # (N, n_tree) -gravity . z, what a mass asks [m/s2]


def _placed(model: RobotModel, q: Floats, gravity: Floats) -> _Placed:
    rotation, _ = link_poses(model, q)
    axes = np.einsum("Nkab,kb->Nka", rotation, model.tree.axis)
    slides = model.tree.prismatic
    pull = np.cross(axes, gravity[:, None, :]) * ~slides[:, None]
    return _Placed(rotation, pull, -np.sum(axes * gravity[:, None, :], axis=2) * slides)


def _columns(model: RobotModel, columns: Sequence[RegressorColumn], q: Floats, arm: _Placed) -> Floats:
    n = len(model.tree.parent)
    # (n_tree, n, n_tree) of a coordinate in what a joint holds of a link; 0 if it carries it not
    shares = model.coupling[:, :, None] * carries(model.tree).reshape(n, 1, n)
    # (N, n, n_tree, 3) of every link's first moment along the axes of its frame
    moments = np.einsum("krj,Nkjb->Nrjb", shares, np.einsum("Nka,Njab->Nkjb", arm.pull, arm.rotation))
    out = np.empty((*q.shape, len(columns)))
    for c, (link, along) in enumerate(columns):
        if along != CARRIED_MASS:
            out[..., c] = moments[..., link, along]
            continue
        coupling = model.coupling[link]
        x = q @ coupling + model.offset[link]
        of_moment = moments[..., link, :] @ model.tree.axis[link]
        out[..., c] = arm.push[:, link, None] * coupling + x[:, None] * of_moment
    return out
