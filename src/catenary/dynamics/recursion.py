"""The recursions over a tree of links, each written once.

They are plain arithmetic: + - * on numbers, loops over the tree, `if` on its structure. They take sines and
cosines instead of angles, and the caller passes every array they write. So the same functions run in
compiled code, in Python, and on symbols.

Conventions shared by all of them:
- Links come parents first; link i moves in its parent by the tree coordinate x[i].
- `rotation` (n, 3, 3) and `position` (n, 3) are R_parent_i and the origin of frame i in the parent, as
  `place_joints` gives them. Quantities of link i are expressed in frame i unless a docstring says base.
- Work arrays are written or overwritten and have n + 1 rows. The last row is the base's: the parent index -1 of a root
  link reaches it. `mass` [kg] and `moment` [kg m] are what each joint carries and its first moment about the joint's
  frame origin, `omega` and `alpha` angular velocities and accelerations [rad/s, rad/s2].

From the robot's coordinates to its tree, and torques and matrices back: tree coordinate = coupling @ q + offset. Power
is the same on both sides if tau = coupling.T @ tree torque, and kinetic energy if M = coupling.T @ tree matrix @
coupling. A constant coupling adds no velocity terms, so the Coriolis matrix goes the same way.

Sources: J. Luh, M. Walker, R. Paul, "On-line computational scheme for mechanical manipulators", ASME J. Dyn.
Sys. Meas. Control 102 (1980); M. Walker, D. Orin, "Efficient dynamic computer simulation of robotic
mechanisms", same journal 104 (1982); R. Featherstone, Rigid Body Dynamics Algorithms, Springer 2008.
"""

import math
from typing import Any

from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.kernels.compiled import inlined
from catenary.robots.model import Tree

Vector = tuple[Any, Any, Any]  # three numbers: floats, or symbols when a recursion is traced
Numbers = NDArray[Any]  # an array of such numbers


@inlined
def row(array: Numbers, i: int) -> Vector:
    """Return row i of an (n, 3) array as a vector.

    Args:
        array, i: (n, 3), and index of the row.
    """
    return array[i, 0], array[i, 1], array[i, 2]


@inlined
def put(array: Numbers, i: int, v: Vector) -> None:
    """Write a vector into row i of an (n, 3) array.

    Args:
        array, i, v: (n, 3), written; index of the row; vector (3,).
    """
    array[i, 0] = v[0]
    array[i, 1] = v[1]
    array[i, 2] = v[2]


@inlined
def column(matrices: Numbers, i: int, k: int) -> Vector:
    """Return column k of matrix i of an (n, 3, 3) array."""
    return matrices[i, 0, k], matrices[i, 1, k], matrices[i, 2, k]


@inlined
def put_column(matrices: Numbers, i: int, k: int, v: Vector) -> None:
    """Write a vector into column k of matrix i of an (n, 3, 3) array."""
    matrices[i, 0, k] = v[0]
    matrices[i, 1, k] = v[1]
    matrices[i, 2, k] = v[2]


@inlined
def add(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined
def scale(factor: Any, a: Vector) -> Vector:
    """Return factor * a."""
    return factor * a[0], factor * a[1], factor * a[2]


@inlined
def dot(a: Vector, b: Vector) -> Any:
    """Return the scalar product a . b.

    Args:
        a, b: Vectors (3,).
    """
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a: Vector, b: Vector) -> Vector:
    """Return the cross product a x b.

    Args:
        a, b: Vectors (3,).
    """
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def times(matrices: Numbers, i: int, v: Vector) -> Vector:
    """Return matrices[i] @ v; with R_parent_i it takes a vector from frame i to its parent."""
    return (
        matrices[i, 0, 0] * v[0] + matrices[i, 0, 1] * v[1] + matrices[i, 0, 2] * v[2],
        matrices[i, 1, 0] * v[0] + matrices[i, 1, 1] * v[1] + matrices[i, 1, 2] * v[2],
        matrices[i, 2, 0] * v[0] + matrices[i, 2, 1] * v[1] + matrices[i, 2, 2] * v[2],
    )


@inlined
def transpose_times(matrices: Numbers, i: int, v: Vector) -> Vector:
    """Return matrices[i].T @ v; with R_parent_i it takes a vector from the parent's axes to those of frame i.

    Args:
        matrices, i, v: (n, 3, 3); index of the matrix; vector (3,).
    """
    return (
        matrices[i, 0, 0] * v[0] + matrices[i, 1, 0] * v[1] + matrices[i, 2, 0] * v[2],
        matrices[i, 0, 1] * v[0] + matrices[i, 1, 1] * v[1] + matrices[i, 2, 1] * v[2],
        matrices[i, 0, 2] * v[0] + matrices[i, 1, 2] * v[1] + matrices[i, 2, 2] * v[2],
    )


@inlined
def place_joints(tree: Tree, x: Numbers, sine: Numbers, cosine: Numbers, rotation: Numbers, position: Numbers) -> None:
    """Compute the pose of every link in its parent.

    A revolute joint turns by Rodrigues' formula, R = c 1 + s [a]x + (1 - c) a a^T; a prismatic one moves its frame
    along its axis.

    Args:
        x: Coordinates (n,), read of prismatic joints [m].
        sine, cosine: Sines and cosines of the angles (n,), read of revolute joints.
        rotation, position: R_parent_i (n, 3, 3), and origins in the parent (n, 3) [m], written.
    """
    for i in range(len(tree.parent)):
        a = row(tree.axis, i)
        origin = row(tree.origin, i)
        if tree.prismatic[i]:
            put(position, i, add(origin, scale(x[i], times(tree.rotation, i, a))))
            for k in range(3):
                put_column(rotation, i, k, column(tree.rotation, i, k))
        else:
            put(position, i, origin)
            s = sine[i]
            c = cosine[i]
            # written so that an axis along x, y or z leaves plain ones, zeros, s and c
            xx = a[0] * a[0]
            yy = a[1] * a[1]
            zz = a[2] * a[2]
            xy = a[0] * a[1] * (1.0 - c)
            xz = a[0] * a[2] * (1.0 - c)
            yz = a[1] * a[2] * (1.0 - c)
            first = (xx + c * (1.0 - xx), xy + s * a[2], xz - s * a[1])
            second = (xy - s * a[2], yy + c * (1.0 - yy), yz + s * a[0])
            third = (xz + s * a[1], yz - s * a[0], zz + c * (1.0 - zz))
            put_column(rotation, i, 0, times(tree.rotation, i, first))
            put_column(rotation, i, 1, times(tree.rotation, i, second))
            put_column(rotation, i, 2, times(tree.rotation, i, third))


@inlined
def place_links(
    tree: Tree, rotation: Numbers, position: Numbers, base_rotation: Numbers, base_position: Numbers
) -> None:
    """Place every link in the base frame: forward kinematics.

    Writes R_base_i (n + 1, 3, 3), of which the last is the identity, and origins (n + 1, 3) in the base frame [m].
    """
    n = len(tree.parent)
    for r in range(3):
        base_position[n, r] = 0.0
        for k in range(3):
            base_rotation[n, r, k] = 1.0 if r == k else 0.0
    for i in range(n):
        parent = tree.parent[i]
        put(base_position, i, add(row(base_position, parent), times(base_rotation, parent, row(position, i))))
        for k in range(3):
            put_column(base_rotation, i, k, times(base_rotation, parent, column(rotation, i, k)))


@inlined
def first_moments(tree: Tree, rotation: Numbers, position: Numbers, mass: Numbers, moment: Numbers) -> None:
    """Sum, for every joint, the mass it carries and its first moment; in the last rows the whole robot's in the base.

    moment_i = m_i c_i + sum over children k of (R_k moment_k + mass_k p_k)
    """
    n = len(tree.parent)
    mass[n] = 0.0
    put(moment, n, (0.0, 0.0, 0.0))
    for i in range(n):
        mass[i] = tree.mass[i]
        put(moment, i, scale(tree.mass[i], row(tree.com, i)))
    for i in range(n - 1, -1, -1):
        parent = tree.parent[i]
        seen = add(times(rotation, i, row(moment, i)), scale(mass[i], row(position, i)))
        mass[parent] = mass[parent] + mass[i]
        put(moment, parent, add(row(moment, parent), seen))


@inlined
def gravity_recursion(
    tree: Tree,
    rotation: Numbers,
    position: Numbers,
    gravity: Vector,
    mass: Numbers,
    moment: Numbers,
    link_gravity: Numbers,
    torque: Numbers,
) -> None:
    """Compute the torques and forces that hold every joint against gravity.

    Forward, gravity into the links; backward, the first moment of what each joint carries. Then a revolute
    joint holds -a . (moment x g) and a prismatic one -a . g mass, which is the sum of A. Lewis,
    B. Hannaford, "Dynamically evaluated gravity compensation for the RAVEN surgical robot", 2014, eq. 1-3,
    with each carried link counted once instead of once per joint.

    Args:
        rotation, position: R_parent_i (n, 3, 3), and origins in the parent (n, 3) [m].
        gravity: Free-fall acceleration in base axes [m/s2].
        mass, moment: Mass that each joint carries (n,) [kg], its first moment in frame i (n, 3) [kg m], written.
        link_gravity: Gravity in each link's axes (n + 1, 3), written; the base's last.
        torque: Torques of the tree's joints (n,) [Nm or N], written.
    """
    n = len(tree.parent)
    put(link_gravity, n, gravity)
    for i in range(n):
        put(link_gravity, i, transpose_times(rotation, i, row(link_gravity, tree.parent[i])))
    first_moments(tree, rotation, position, mass, moment)
    for i in range(n):
        a = row(tree.axis, i)
        g = row(link_gravity, i)
        if tree.prismatic[i]:
            torque[i] = -(dot(a, g) * mass[i])
        else:
            torque[i] = -dot(a, cross(row(moment, i), g))


@inlined
def link_motion(
    tree: Tree,
    rotation: Numbers,
    position: Numbers,
    i: int,
    xd: Numbers,
    xdd: Numbers,
    omega: Numbers,
    alpha: Numbers,
    acceleration: Numbers,
) -> tuple[Vector, Vector, Vector]:
    """Write and return a link's angular velocity and acceleration, and its origin's acceleration less gravity."""
    parent = tree.parent[i]
    a = row(tree.axis, i)
    w = transpose_times(rotation, i, row(omega, parent))
    dw = transpose_times(rotation, i, row(alpha, parent))
    r = row(position, i)
    # the parent's acceleration at this frame's origin
    a_origin = transpose_times(
        rotation, i, add(row(acceleration, parent), _at(row(omega, parent), row(alpha, parent), r))
    )
    if tree.prismatic[i]:
        coriolis = scale(2.0 * xd[i], cross(w, a))
        a_origin = add(a_origin, add(scale(xdd[i], a), coriolis))
    else:
        dw = add(dw, add(scale(xdd[i], a), scale(xd[i], cross(w, a))))
        w = add(w, scale(xd[i], a))
    put(omega, i, w)
    put(alpha, i, dw)
    put(acceleration, i, a_origin)
    return w, dw, a_origin


@inlined
def newton_euler_recursion(
    tree: Tree,
    rotation: Numbers,
    position: Numbers,
    xd: Numbers,
    xdd: Numbers,
    omega: Numbers,
    alpha: Numbers,
    acceleration: Numbers,
    force: Numbers,
    moment: Numbers,
    torque: Numbers,
) -> None:
    """Compute the torques of a motion: recursive Newton-Euler (Luh, Walker, Paul 1980).

    The caller writes the base's motion into the last rows of `omega`, `alpha` and `acceleration`, gravity as
    an upward acceleration: acceleration[n] = a_base - gravity.

    Args:
        rotation, position: R_parent_i (n, 3, 3), and origins in the parent (n, 3) [m].
        xd, xdd: Velocities and accelerations of the tree's coordinates (n,).
        omega: Angular velocities in each link's axes (n + 1, 3) [rad/s], written but for the last row.
        alpha: Angular accelerations, as `omega` [rad/s2].
        acceleration: Accelerations of the origins, as `omega` [m/s2].
        force: Force by which the parent acts on link i and all beyond it (n + 1, 3) [N], written.
        moment: Its moment about the origin of frame i (n + 1, 3) [Nm], written.
        torque: Torques along the joints (n,) [Nm or N], written.
    """
    n = len(tree.parent)
    put(force, n, (0.0, 0.0, 0.0))
    put(moment, n, (0.0, 0.0, 0.0))
    for i in range(n):
        w, dw, a_origin = link_motion(tree, rotation, position, i, xd, xdd, omega, alpha, acceleration)
        # Newton at the centre of mass, Euler about it, both seen from the frame's origin
        c = row(tree.com, i)
        f = scale(tree.mass[i], add(a_origin, _at(w, dw, c)))
        spin = add(times(tree.inertia, i, dw), cross(w, times(tree.inertia, i, w)))
        put(force, i, f)
        put(moment, i, add(spin, cross(c, f)))
    for i in range(n - 1, -1, -1):
        parent = tree.parent[i]
        a = row(tree.axis, i)
        f = row(force, i)
        m = row(moment, i)
        torque[i] = dot(a, f) if tree.prismatic[i] else dot(a, m)
        f = times(rotation, i, f)
        m = add(times(rotation, i, m), cross(row(position, i), f))
        put(force, parent, add(row(force, parent), f))
        put(moment, parent, add(row(moment, parent), m))


@inlined
def _at(w: Vector, dw: Vector, r: Vector) -> Vector:
    """Return the acceleration at r in a body turning about its origin: dw x r + w x (w x r)."""
    return add(cross(dw, r), cross(w, cross(w, r)))


@inlined
def composite_body_recursion(
    tree: Tree, rotation: Numbers, position: Numbers, mass: Numbers, moment: Numbers, inertia: Numbers, matrix: Numbers
) -> None:
    """Compute the mass matrix: composite rigid bodies (Walker, Orin 1982; Featherstone 2008, table 6.2).

    Locked beyond joint i, the robot is one body. Accelerating it by joint i alone takes a force and a moment,
    whose parts along joint i and the joints before it are a column of the matrix.

    Args:
        rotation, position: R_parent_i (n, 3, 3), and origins in the parent (n, 3) [m].
        mass, moment: Mass that each joint carries (n,) [kg], and its first moment (n, 3) [kg m], written.
        inertia: Its inertia about the frame's origin (n, 3, 3) [kg m2], written.
        matrix: Mass matrix of the tree's coordinates (n, n), written.
    """
    n = len(tree.parent)
    first_moments(tree, rotation, position, mass, moment)
    for i in range(n):
        for k in range(3):
            put_column(inertia, i, k, column(tree.inertia, i, k))
        _add_shifted(inertia, i, tree.mass[i], (0.0, 0.0, 0.0), row(tree.com, i))
    for k in range(3):
        put_column(inertia, n, k, (0.0, 0.0, 0.0))
    for i in range(n - 1, -1, -1):
        parent = tree.parent[i]
        half = (  # columns of R I
            times(rotation, i, column(inertia, i, 0)),
            times(rotation, i, column(inertia, i, 1)),
            times(rotation, i, column(inertia, i, 2)),
        )
        for k in range(3):  # columns of R I R^T down to the diagonal, as it is symmetric
            turned = times(rotation, i, (half[0][k], half[1][k], half[2][k]))
            for l in range(k + 1):
                entry = inertia[parent, l, k] + turned[l]
                inertia[parent, l, k] = entry
                inertia[parent, k, l] = entry
        _add_shifted(inertia, parent, mass[i], times(rotation, i, row(moment, i)), row(position, i))

    for i in range(n):
        for j in range(n):
            matrix[i, j] = 0.0
    for i in range(n):
        a = row(tree.axis, i)
        if tree.prismatic[i]:
            f = scale(mass[i], a)
            m = cross(row(moment, i), a)
            matrix[i, i] = dot(a, f)
        else:
            f = cross(a, row(moment, i))
            m = times(inertia, i, a)
            matrix[i, i] = dot(a, m)
        child = i
        j = tree.parent[i]
        while j >= 0:
            f = times(rotation, child, f)
            m = add(times(rotation, child, m), cross(row(position, child), f))
            along = dot(row(tree.axis, j), f) if tree.prismatic[j] else dot(row(tree.axis, j), m)
            matrix[i, j] = along
            matrix[j, i] = along
            child = j
            j = tree.parent[j]


@inlined
def _add_shifted(inertia: Numbers, i: int, mass: float, moment: Vector, r: Vector) -> None:
    """Add to inertia[i] what moving a body by r adds to its inertia about a fixed point.

    With first moment h about that point before the move (parallel-axis theorem):
    (2 r . h + m r . r) 1 - (r h^T + h r^T + m r r^T).
    """
    diagonal = 2.0 * dot(r, moment) + mass * dot(r, r)
    for k in range(3):
        for l in range(k + 1):
            outer = r[k] * moment[l] + moment[k] * r[l] + mass * r[k] * r[l]
            entry = inertia[i, l, k] - outer
            if k == l:
                entry = entry + diagonal
            inertia[i, l, k] = entry
            inertia[i, k, l] = entry


@inlined
def place_tree(
    tree: Tree, coupling: Floats, offset: Floats, q: Floats, work: Floats, rotation: Floats, position: Floats
) -> None:
    """Compute the pose of every link in its parent, at a robot's coordinates.

    Args:
        coupling, offset: Tree coordinates per robot coordinate (n_tree, n), and at zero (n_tree,).
        q: Coordinates (n,) [rad or m].
        work: Scratch (3, n_tree).
        rotation, position: R_parent_i (n_tree, 3, 3), and origins in the parent (n_tree, 3) [m], written.
    """
    x, sine, cosine = work[0], work[1], work[2]
    to_tree(coupling, q, x)
    for i in range(len(offset)):
        x[i] += offset[i]
        sine[i] = math.sin(x[i])
        cosine[i] = math.cos(x[i])
    place_joints(tree, x, sine, cosine, rotation, position)


@inlined
def to_tree(coupling: Floats, rates: Floats, tree_rates: Floats) -> None:
    """Write coupling @ rates: velocities or accelerations of the tree's joints."""
    for i in range(coupling.shape[0]):
        total = 0.0
        for k in range(coupling.shape[1]):
            total += coupling[i, k] * rates[k]
        tree_rates[i] = total


@inlined
def to_robot(coupling: Floats, tree_torque: Floats, torque: Floats) -> None:
    """Compute torques along a robot's coordinates from those of its tree: coupling^T tau.

    Args:
        coupling: Tree coordinates per robot coordinate (n_tree, n).
        tree_torque: Torques of the tree's joints (n_tree,) [Nm or N].
        torque: Torques along the coordinates (n,) [Nm or N], written.
    """
    for k in range(coupling.shape[1]):
        total = 0.0
        for i in range(coupling.shape[0]):
            total += coupling[i, k] * tree_torque[i]
        torque[k] = total


@inlined
def to_robot_columns(coupling: Floats, tree_columns: Floats, columns: Floats) -> None:
    """Write tree_columns @ coupling: a Jacobian's columns along the robot's coordinates."""
    for r in range(len(tree_columns)):
        to_robot(coupling, tree_columns[r], columns[r])


@inlined
def to_robot_matrix(coupling: Floats, tree_matrix: Floats, work: Floats, matrix: Floats) -> None:
    """Write coupling.T @ tree_matrix @ coupling; work (n_tree, n) is overwritten."""
    to_robot_columns(coupling, tree_matrix, work)
    for k in range(coupling.shape[1]):
        for l in range(coupling.shape[1]):
            total = 0.0
            for i in range(coupling.shape[0]):
                total += coupling[i, k] * work[i, l]
            matrix[k, l] = total
