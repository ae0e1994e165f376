"""The Coriolis matrix by composite sums in the base frame, in the plain arithmetic of recursion.py.

Of all C with C(q, qd) qd the velocity torques, this is the one of Christoffel's symbols: M_dot - 2 C is skew
and C(q, a) b = C(q, b) a. It is

    C = sum over bodies of  m Jv^T Jv_dot + Jw^T I Jw_dot + Jw^T B Jw,    B = (w^ I - I w^ - (I w)^) / 2,

Jv and Jw the Jacobians of a body's centre of mass and its rotation, all in base axes. S. Echeandia,
P. Wensing, "Numerical methods to compute the Coriolis matrix and Christoffel symbols for rigid-body systems",
J. Comput. Nonlinear Dyn. 16 (2021), write the sum over bodies as a sum for each pair of joints. We do it with
three-vectors at the base's origin, where what a joint carries is a plain sum:

    joint j moves a point r at z_j x r + s_j, which changes at zd_j x r + z_j x rd + sd_j; then
    C_jk = z_j . (I zd_k + h x sd_k + D z_k) + s_j . (m sd_k - h x zd_k + z_k x p),

with the sums over the links that both joints carry of: mass m, first moment h, inertia I about the base's
origin, momentum p, and D = B + m ((c . cd) 1 - cd c^T), c a link's centre of mass and cd its velocity.
"""

from catenary.dynamics.vectors import (
    Numbers,
    Vector,
    add,
    column,
    cross,
    dot,
    put,
    put_column,
    row,
    scale,
    times,
    transpose_times,
)
from catenary.kernels.compiled import inlined
from catenary.robots.model import Tree


@inlined
def coriolis_recursion(
    tree: Tree,
    base_rotation: Numbers,
    base_position: Numbers,
    xd: Numbers,
    spin: Numbers,
    slide: Numbers,
    spin_rate: Numbers,
    slide_rate: Numbers,
    omega: Numbers,
    velocity: Numbers,
    mass: Numbers,
    moment: Numbers,
    inertia: Numbers,
    momentum: Numbers,
    turning: Numbers,
    matrix: Numbers,
) -> None:
    """Give the Christoffel Coriolis matrix of the tree coordinates.

    Args:
        tree: The robot's tree.
        base_rotation: (n + 1, 3, 3) R_base_i, as `place_links` gives them.
        base_position: (n + 1, 3) origins in the base frame [m].
        xd: (n,) tree velocities [rad/s or m/s].
        spin: (n, 3) written: z, angular part of each joint's motion.
        slide: (n, 3) written: s, its linear part at the base's origin.
        spin_rate: (n, 3) written: rate of z.
        slide_rate: (n, 3) written: rate of s.
        omega: (n + 1, 3) written: angular velocities of the links [rad/s].
        velocity: (n + 1, 3) written: velocities of the links' points at the base's origin [m/s].
        mass: (n + 1,) written: carried mass [kg].
        moment: (n + 1, 3) written: h [kg m].
        inertia: (n + 1, 3, 3) written: I [kg m2].
        momentum: (n + 1, 3) written: p [kg m/s].
        turning: (n + 1, 3, 3) written: D [kg m2/s].
        matrix: (n, n) written: C.
    """
    n = len(tree.parent)
    _clear(n, omega, velocity, mass, moment, inertia, momentum, turning)
    for i in range(n):
        parent = tree.parent[i]
        a = times(base_rotation, i, row(tree.axis, i))
        z = a
        s = cross(row(base_position, i), a)
        if tree.prismatic[i]:
            z = (0.0, 0.0, 0.0)
            s = a
        w = add(row(omega, parent), scale(xd[i], z))
        v = add(row(velocity, parent), scale(xd[i], s))
        put(spin, i, z)
        put(slide, i, s)
        put(omega, i, w)
        put(velocity, i, v)
        put(spin_rate, i, cross(w, z))
        put(slide_rate, i, add(cross(w, s), cross(v, z)))
        _put_link(tree, i, base_rotation, base_position, w, v, mass, moment, inertia, momentum, turning)
    for i in range(n - 1, -1, -1):
        parent = tree.parent[i]
        mass[parent] = mass[parent] + mass[i]
        put(moment, parent, add(row(moment, parent), row(moment, i)))
        put(momentum, parent, add(row(momentum, parent), row(momentum, i)))
        for k in range(3):
            put_column(inertia, parent, k, add(column(inertia, parent, k), column(inertia, i, k)))
            put_column(turning, parent, k, add(column(turning, parent, k), column(turning, i, k)))

    for i in range(n):
        for j in range(n):
            matrix[i, j] = 0.0
    for i in range(n):
        z = row(spin, i)
        s = row(slide, i)
        zd = row(spin_rate, i)
        sd = row(slide_rate, i)
        h = row(moment, i)
        p = row(momentum, i)
        # column i: what joint i's motion asks of the joints below it
        about = add(add(times(inertia, i, zd), cross(h, sd)), times(turning, i, z))
        along = add(add(scale(mass[i], sd), cross(zd, h)), cross(z, p))
        # row i: what the motion of the joints below asks of joint i
        from_zd = add(times(inertia, i, z), cross(h, s))
        from_sd = add(scale(mass[i], s), cross(z, h))
        from_z = add(transpose_times(turning, i, z), cross(p, s))
        matrix[i, i] = dot(z, about) + dot(s, along)
        j = tree.parent[i]
        while j >= 0:
            matrix[j, i] = dot(row(spin, j), about) + dot(row(slide, j), along)
            matrix[i, j] = (
                dot(row(spin_rate, j), from_zd) + dot(row(slide_rate, j), from_sd) + dot(row(spin, j), from_z)
            )
            j = tree.parent[j]


@inlined
def _clear(
    n: int,
    omega: Numbers,
    velocity: Numbers,
    mass: Numbers,
    moment: Numbers,
    inertia: Numbers,
    momentum: Numbers,
    turning: Numbers,
) -> None:
    """Set the base's rows to zero."""
    zero = (0.0, 0.0, 0.0)
    mass[n] = 0.0
    put(omega, n, zero)
    put(velocity, n, zero)
    put(moment, n, zero)
    put(momentum, n, zero)
    for k in range(3):
        put_column(inertia, n, k, zero)
        put_column(turning, n, k, zero)


@inlined
def _put_link(
    tree: Tree,
    i: int,
    base_rotation: Numbers,
    base_position: Numbers,
    w: Vector,
    v: Vector,
    mass: Numbers,
    moment: Numbers,
    inertia: Numbers,
    momentum: Numbers,
    turning: Numbers,
) -> None:
    """Write m, h, I, p and D of link i alone, which turns at w and moves at v at the base's origin."""
    m = tree.mass[i]
    c = add(row(base_position, i), times(base_rotation, i, row(tree.com, i)))
    cd = add(v, cross(w, c))
    mass[i] = m
    put(moment, i, scale(m, c))
    put(momentum, i, scale(m, cd))
    half = (  # columns of R I_com
        times(base_rotation, i, column(tree.inertia, i, 0)),
        times(base_rotation, i, column(tree.inertia, i, 1)),
        times(base_rotation, i, column(tree.inertia, i, 2)),
    )
    for k in range(3):  # I_com in base axes: R I_com R^T
        put_column(inertia, i, k, times(base_rotation, i, (half[0][k], half[1][k], half[2][k])))
    # B: as I is symmetric, (I w^) has the columns -(w^ I)^T, so w^ I - I w^ = (w^ I) + (w^ I)^T
    Iw = times(inertia, i, w)
    wI = (
        cross(w, column(inertia, i, 0)),
        cross(w, column(inertia, i, 1)),
        cross(w, column(inertia, i, 2)),
    )
    unit = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    for k in range(3):
        transposed = (wI[0][k], wI[1][k], wI[2][k])
        b = scale(0.5, add(add(wI[k], transposed), scale(-1.0, cross(Iw, unit[k]))))
        moving = add(scale(m * dot(c, cd), unit[k]), scale(-m * c[k], cd))
        put_column(turning, i, k, add(b, moving))
    # parallel-axis theorem, to the base's origin
    for k in range(3):
        shift = add(scale(m * dot(c, c), unit[k]), scale(-m * c[k], c))
        put_column(inertia, i, k, add(column(inertia, i, k), shift))
