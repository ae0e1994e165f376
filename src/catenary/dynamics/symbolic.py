"""A robot's quantities as straight lines of operations: the recursions, run on symbols.

Every moving link is traced as two: one that is fixed, which turns and shifts by the constant part of the joint's
place, and one that only turns about, or moves along, its axis. So a vector is turned by the constant part first
(four products for a twist about x, none for a quarter turn) and by the joint then (four), where their product
would take up to nine, and entries of it besides. The recursions do not know.

Torques of gravity need every link's mass and its centre, those of motion and masses its inertia too.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.dynamics.actuation_loads import ActuationLoads, load_along
from catenary.dynamics.recursion import (
    add,
    composite_body_recursion,
    cross,
    dot,
    gravity_recursion,
    newton_euler_recursion,
    place_joints,
    place_links,
    row,
    scale,
    times,
    transpose_times,
)
from catenary.errors import InputError
from catenary.kernels.tracing import Line, Term, Trace, TracedFunctions
from catenary.robots.link_inertia import LinkInertia
from catenary.robots.model import Frame, RobotModel, Tree

Terms = NDArray[np.object_]
# products of rotations that are meant to be 0 or 1 miss it by some 1e-16; far less than any robot is measured to
_EXACT_RATIO = 1e-15


class Placed(NamedTuple):
    """A robot on symbols: its links placed in their parents, as recursions take them."""

    trace: Trace
    tree: Tree  # every link of the model is two here: 2 i is fixed, 2 i + 1 moves
    coupling: Floats  # (2 n_tree, n)
    turn: Floats  # (n_tree, 3, 3) R_link_traced: where a joint's axis is odd, its link is traced along it
    q: Terms  # (n,) the input
    x: Terms  # (2 n_tree,) displacements of the tree's joints [rad|m]
    rotation: Terms  # (2 n_tree, 3, 3)
    position: Terms  # (2 n_tree, 3)


def placed(model: RobotModel) -> Placed:
    """Start a trace of a robot at coordinates q, the input array `q`."""
    trace = Trace()
    tree, coupling, offset, turn = _in_two(model)
    q = trace.inputs("q", model.n)
    m = len(tree.parent)
    x, sine, cosine = new_terms(m), new_terms(m), new_terms(m)
    for i in range(m):
        place: Term = float(offset[i])
        for k in range(model.n):
            place = q[k] * coupling[i, k] + place
        x[i] = place
        sine[i], cosine[i] = (0.0, 1.0) if tree.prismatic[i] else trace.sine_cosine(place)
    rotation, position = new_terms(m, 3, 3), new_terms(m, 3)
    place_joints(tree, x, sine, cosine, rotation, position)
    return Placed(trace, tree, coupling, turn, q, x, rotation, position)


def gravity_line(model: RobotModel) -> Line:
    """Trace the torques (n,) that hold the arm; inputs q (n,) and gravity (3,)."""
    model.require_masses()
    p = placed(model)
    m = len(p.tree.parent)
    g = p.trace.inputs("gravity", 3)
    torque, work = new_terms(m), (new_terms(m + 1), new_terms(m + 1, 3), new_terms(m + 1, 3))
    gravity_recursion(p.tree, p.rotation, p.position, (g[0], g[1], g[2]), *work, torque)
    return p.trace.line(_to_robot(p.coupling, torque))


def mass_matrix_line(model: RobotModel) -> Line:
    """Trace the mass matrix (n, n), row by row; input q (n,)."""
    model.require_inertia()
    p = placed(model)
    return p.trace.line([entry for row in mass_matrix_terms(p) for entry in row])


def mass_matrix_terms(p: Placed) -> list[list[Term]]:
    """Return the mass matrix, row by row."""
    m, n = len(p.tree.parent), p.coupling.shape[1]
    matrix = new_terms(m, m)
    composite_body_recursion(
        p.tree, p.rotation, p.position, new_terms(m + 1), new_terms(m + 1, 3), new_terms(m + 1, 3, 3), matrix
    )
    half = [_to_robot(p.coupling, matrix[i]) for i in range(m)]  # rows of tree matrix @ coupling
    entries = np.array(half, dtype=object)
    columns = [_to_robot(p.coupling, entries[:, l]) for l in range(n)]
    # symmetric to the last digit: the upper triangle is the lower one
    return [[columns[min(k, l)][max(k, l)] for l in range(n)] for k in range(n)]


def holding_line(model: RobotModel) -> Line:
    """Trace the torques (n,) that hold the arm on a base that moves; inputs q (n,) and gravity, omega, alpha (3,)."""
    model.require_inertia()
    p = placed(model)
    still = np.zeros(model.n)
    return p.trace.line(newton_euler_terms(p, still, still))


def inverse_dynamics_line(model: RobotModel, loads: ActuationLoads | None = None, *, moving_base: bool = True) -> Line:
    """Trace the torques (n,) of a motion; inputs q, qd, qdd (n,) and gravity (3,), omega and alpha of a moving base."""
    model.require_inertia()
    p = placed(model)
    qd, qdd = p.trace.inputs("qd", model.n), p.trace.inputs("qdd", model.n)
    links = newton_euler_terms(p, qd, qdd, moving_base=moving_base)
    return p.trace.line(links if loads is None else _with_loads(p, loads, qd, qdd, links))


def newton_euler_terms(p: Placed, qd: Terms | Floats, qdd: Terms | Floats, *, moving_base: bool = True) -> list[Term]:
    """Return the torques of a motion; gravity, and a moving base's rates, become inputs."""
    return _to_robot(p.coupling, _newton_euler(p, qd, qdd, moving_base=moving_base)[2])


def carried_load_line(model: RobotModel, frame: Frame, body: LinkInertia) -> Line:
    """Trace the force and moment by which a body loads the frame that carries it, in its axes, about its origin.

    Args:
        model: The robot, whose own links need no inertia.
        frame: Frame that carries the body.
        body: Its mass, centre of mass and inertia.

    Returns:
        A line of inputs q, qd, qdd (n,) and gravity (3,), with six results [N, Nm].
    """
    tree, (link, pose) = model.tree, frame
    own = Tree(link, False, pose.rotation, pose.position, [0.0, 0.0, 1.0], body.mass, body.com, body.inertia)  # type: ignore[arg-type]
    weightless = tree._replace(mass=0.0 * tree.mass, inertia=0.0 * tree.inertia)
    grown = Tree(*(np.concatenate([each, np.asarray(one)[None]]) for each, one in zip(weightless, own, strict=True)))
    coupling, offset = np.vstack([model.coupling, np.zeros(model.n)]), np.append(model.offset, 0.0)
    p = placed(replace(model, tree=grown, coupling=coupling, offset=offset, axes_of_com=np.ones((0, 3), dtype=bool)))
    qd, qdd = p.trace.inputs("qd", model.n), p.trace.inputs("qdd", model.n)
    force, moment, _ = _newton_euler(p, qd, qdd, moving_base=False)
    return p.trace.line([-component for part in (force, moment) for component in part[len(p.tree.parent) - 1]])


def _newton_euler(p: Placed, qd: Terms | Floats, qdd: Terms | Floats, *, moving_base: bool) -> tuple[Terms, ...]:
    """Return forces, moments and torques (m, ...) of a motion, as the recursion writes them."""
    m = len(p.tree.parent)
    omega, alpha, acceleration, torque = (new_terms(m + 1, 3), new_terms(m + 1, 3), new_terms(m + 1, 3), new_terms(m))
    acceleration[m] = -p.trace.inputs("gravity", 3)
    omega[m], alpha[m] = 0.0, 0.0
    if moving_base:
        omega[m], alpha[m] = p.trace.inputs("omega", 3), p.trace.inputs("alpha", 3)
    rates = _to_tree(p.coupling, qd), _to_tree(p.coupling, qdd)
    work = new_terms(m + 1, 3), new_terms(m + 1, 3)
    newton_euler_recursion(p.tree, p.rotation, p.position, *rates, omega, alpha, acceleration, *work, torque)
    return *work, torque


def forward_kinematics_line(model: RobotModel, frame: str | None = None) -> Line:
    """Trace the pose of a frame in the base: rows of (R_base_frame, origin), (3, 4); input q (n,)."""
    target = model.frame(frame)
    p = placed(model)
    m = len(p.tree.parent)
    rotations, positions = new_terms(m + 1, 3, 3), new_terms(m + 1, 3)
    place_links(p.tree, p.rotation, p.position, rotations, positions)
    link = 2 * target.link + 1 if target.link >= 0 else m
    turn = p.turn[target.link] if target.link >= 0 else np.eye(3)
    R, origin = _rounded(turn.T @ target.pose.rotation), turn.T @ target.pose.position
    results: list[Term] = []
    for r in range(3):
        turned = rotations[link, r]
        results += [sum_of_terms(turned[j] * R[j, k] for j in range(3)) for k in range(3)]
        results.append(sum_of_terms([*(turned[j] * origin[j] for j in range(3)), positions[link, r]]))
    return p.trace.line(results)


def gravity_regressor_line(model: RobotModel) -> Line:
    """Trace what masses and first moments add to the torques that hold the arm; inputs q (n,) and gravity (3,).

    Rows are the robot's coordinates, columns per link its mass [kg] and first moment about the origin of its frame
    [kg m]: m, mx, my, mz. A joint along z through o holds, of a point mass m at r that it carries, m (r - o) . (z x g)
    if it turns and -m z . g if it slides.
    """
    p = placed(model)
    m, n = len(p.tree.parent), len(model.tree.parent)
    gravity = p.trace.inputs("gravity", 3)
    g = (gravity[0], gravity[1], gravity[2])
    rotations, positions = new_terms(m + 1, 3, 3), new_terms(m + 1, 3)
    place_links(p.tree, p.rotation, p.position, rotations, positions)
    columns = np.full((4 * n, m), 0.0, dtype=object)
    for k in range(n):
        i = 2 * k + 1
        while i >= 0:
            z = times(rotations, i, row(p.tree.axis, i))
            if p.tree.prismatic[i]:
                columns[4 * k, i] = -dot(z, g)
            elif i % 2 == 1:
                turning = cross(z, g)
                away = add(row(positions, 2 * k + 1), scale(-1.0, row(positions, i)))
                columns[4 * k, i] = dot(away, turning)
                traced = transpose_times(rotations, 2 * k + 1, turning)
                for r in range(3):
                    columns[4 * k + 1 + r, i] = sum_of_terms(traced[j] * p.turn[k, r, j] for j in range(3))
            i = p.tree.parent[i]
    entries = np.array([_to_robot(p.coupling, column) for column in columns], dtype=object)
    return p.trace.line(list(entries.T.ravel()))


def new_terms(*shape: int) -> Terms:
    """Return an array for numbers or symbols."""
    return np.empty(shape, dtype=object)


def _in_two(model: RobotModel) -> tuple[Tree, Floats, Floats, Floats]:
    """Return a model's tree, coupling and offset with every link as two, axes along x, y or z, and `turn`."""
    tree = model.tree
    n = len(tree.parent)
    turn = np.array([_turn_to(axis) for axis in tree.axis])  # R of the new link frame in the old one
    rotation = np.tile(np.eye(3), (2 * n, 1, 1))
    axis, com, inertia = np.zeros((2 * n, 3)), np.zeros((2 * n, 3)), np.zeros((2 * n, 3, 3))
    axis[::2] = [0.0, 0.0, 1.0]
    parent, prismatic = np.full(2 * n, -1), np.zeros(2 * n, dtype=bool)
    origin, mass = np.zeros((2 * n, 3)), np.zeros(2 * n)
    coupling, offset = np.zeros((2 * n, model.n)), np.zeros(2 * n)
    for i in range(n):
        before = np.eye(3) if tree.parent[i] < 0 else turn[tree.parent[i]]
        parent[2 * i] = 2 * tree.parent[i] + 1 if tree.parent[i] >= 0 else -1
        parent[2 * i + 1] = 2 * i
        rotation[2 * i] = _rounded(before.T @ tree.rotation[i] @ turn[i])
        origin[2 * i] = before.T @ tree.origin[i]
        axis[2 * i + 1] = _rounded(turn[i].T @ tree.axis[i])
        prismatic[2 * i + 1] = tree.prismatic[i]
        mass[2 * i + 1] = tree.mass[i]
        com[2 * i + 1] = turn[i].T @ tree.com[i]
        inertia[2 * i + 1] = turn[i].T @ tree.inertia[i] @ turn[i]
        coupling[2 * i + 1], offset[2 * i + 1] = model.coupling[i], model.offset[i]
    return Tree(parent, prismatic, rotation, origin, axis, mass, com, inertia), coupling, offset, turn


def _turn_to(axis: Floats) -> Floats:
    """Return a rotation whose z is the axis; none if the axis is x, y or z already."""
    if np.max(np.abs(axis)) > 1.0 - _EXACT_RATIO:
        return np.eye(3)
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])


def _rounded(R: Floats) -> Floats:
    """Return a rotation with its entries that are nearly 0 or 1 exactly so."""
    rounded = np.round(R)
    return np.where(np.abs(R - rounded) < _EXACT_RATIO, rounded, R)


def sum_of_terms(terms: Any) -> Term:
    """Return a sum of numbers and symbols."""
    total: Term = 0.0
    for term in terms:
        total = term + total
    return total


def _to_tree(coupling: Floats, rates: Terms | Floats) -> Terms:
    x = new_terms(len(coupling))
    for i, shares in enumerate(coupling):
        x[i] = sum_of_terms(rates[k] * shares[k] for k in range(len(shares)))
    return x


def _to_robot(coupling: Floats, tree_values: Terms) -> list[Term]:
    return [
        sum_of_terms(tree_values[i] * float(coupling[i, k]) for i in range(len(coupling)) if coupling[i, k] != 0.0)
        for k in range(coupling.shape[1])
    ]


Rates = Sequence[Term] | Terms


def forward_dynamics_line(model: RobotModel, loads: ActuationLoads | None) -> Line:
    """Trace the accelerations (n,) by M = L D L^T; inputs q, qd, tau (n,) and gravity (3,)."""
    model.require_inertia()
    if loads is not None and loads.depends_on_load:
        raise InputError(
            f'robot "{model.name}": its friction depends on the load, and so on the accelerations: forward_dynamics of '
            "it is no line of operations; leave that part out of its loads"
        )
    p, n = placed(model), model.n
    qd, tau = p.trace.inputs("qd", n), p.trace.inputs("tau", n)
    still = [0.0] * n
    bias = newton_euler_terms(p, qd, still, moving_base=False)  # type: ignore[arg-type]  # zeros, as symbols would be
    M = mass_matrix_terms(p)
    if loads is not None:
        bias = _with_loads(p, loads, qd, still, bias)
        M = [[M[i][j] + float(added) for j, added in enumerate(row)] for i, row in enumerate(loads.rotors)]
    x: list[Term] = [tau[k] - bias[k] for k in range(n)]
    L: list[list[Term]] = [[0.0] * n for _ in range(n)]
    D: list[Term] = []
    for j in range(n):
        scaled = [L[j][k] * D[k] for k in range(j)]
        D.append(M[j][j] - sum_of_terms(L[j][k] * scaled[k] for k in range(j)))
        for i in range(j + 1, n):
            reduced = M[i][j] - sum_of_terms(L[i][k] * scaled[k] for k in range(j))
            L[i][j] = reduced / D[j]
    for i in range(n):
        x[i] = x[i] - sum_of_terms(L[i][k] * x[k] for k in range(i))
    x = [x[i] / D[i] for i in range(n)]
    for i in reversed(range(n)):
        x[i] = x[i] - sum_of_terms(L[k][i] * x[k] for k in range(i + 1, n))
    return p.trace.line(x)


def friction_line(loads: ActuationLoads) -> Line:
    """Trace the torques (n,) of friction and constants; inputs qd (n,), and where it depends on it carried (n,)."""
    trace, n = Trace(), loads.n
    qd = trace.inputs("qd", n)
    return trace.line(_friction_terms(trace, loads, qd, trace.inputs("carried", n) if loads.depends_on_load else qd))


def drives_line(loads: ActuationLoads) -> Line:
    """Trace the torques (n,) of rotors, springs and known torques; inputs q and qdd (n,)."""
    trace = Trace()
    return trace.line(_drive_terms(trace, loads, trace.inputs("q", loads.n), trace.inputs("qdd", loads.n)))


def _with_loads(p: Placed, loads: ActuationLoads, qd: Terms, qdd: Rates, links: list[Term]) -> list[Term]:
    carried = [a + b for a, b in zip(links, _drive_terms(p.trace, loads, p.q, qdd), strict=True)]
    return [a + b for a, b in zip(carried, _friction_terms(p.trace, loads, qd, carried), strict=True)]


def _drive_terms(trace: Trace, loads: ActuationLoads, q: Terms, qdd: Rates) -> list[Term]:
    out: list[Term] = [0.0] * loads.n
    for known in loads.actuation.known_torques:
        s = _along(known.combination, q)
        load: Term = 0.0
        for coefficient in known.polynomial:
            load = load * s + float(coefficient)
        _add(out, known.along, load)
    for term, value in zip(loads.terms, map(float, loads.values), strict=True):
        if term.friction is None:
            c = term.combination
            along = load_along(term, _along(c, q), 0.0, _along(c, qdd), 0.0, 0.0, TracedFunctions(trace))
            _add(out, c, value * along)
    return out


def _friction_terms(trace: Trace, loads: ActuationLoads, qd: Terms, carried: Rates) -> list[Term]:
    out: list[Term] = [0.0] * loads.n
    smooth = loads.actuation.coulomb_velocity
    for term, value in zip(loads.terms, map(float, loads.values), strict=True):
        if term.friction is not None:
            c = term.combination
            along = load_along(term, 0.0, _along(c, qd), 0.0, _along(c, carried), smooth, TracedFunctions(trace))
            _add(out, c, value * along)
    return out


def _add(out: list[Term], along: Floats, load: Term) -> None:
    for k, factor in enumerate(along):
        if factor != 0.0:
            out[k] = out[k] + load * float(factor)


def _along(combination: Floats, values: Rates) -> Term:
    return sum_of_terms(values[k] * float(factor) for k, factor in enumerate(combination) if factor != 0.0)
