import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.coriolis_recursion import coriolis_recursion
from catenary.dynamics.inverse_dynamics import coriolis_matrix, inverse_dynamics
from catenary.dynamics.mass_matrix import mass_matrix
from catenary.dynamics.recursion import (
    composite_body_recursion,
    gravity_recursion,
    newton_euler_recursion,
    place_joints,
    place_links,
)
from catenary.gravity.torque import gravity_torque
from oracles.plain_numbers import empty, symbols, values
from oracles.random_trees import RandomRobot


@pytest.mark.parametrize("seed", [3, 8, 17])
def test_recursions_run_on_numbers_that_only_add_and_multiply(
    random_robots: list[RandomRobot], seed: int
) -> None:
    m = random_robots[seed].model
    n = len(m.link_names)
    rng = np.random.default_rng(seed)
    q, qd, qdd = rng.normal(size=(3, m.n))
    gravity = rng.normal(size=3)
    x = m.coupling @ q + m.offset
    xd, xdd = symbols(m.coupling @ qd), symbols(m.coupling @ qdd)

    rotation, position = empty(n, 3, 3), empty(n, 3)
    place_joints(m.tree, symbols(x), symbols(np.sin(x)), symbols(np.cos(x)), rotation, position)

    torque = empty(n)
    g = symbols(gravity)
    work = empty(n + 1), empty(n + 1, 3), empty(n + 1, 3)
    gravity_recursion(m.tree, rotation, position, (g[0], g[1], g[2]), *work, torque)
    assert_allclose(m.coupling.T @ values(torque), gravity_torque(m, q, gravity), atol=1e-12)

    matrix = empty(n, n)
    composite_body_recursion(
        m.tree, rotation, position, empty(n + 1), empty(n + 1, 3), empty(n + 1, 3, 3), matrix
    )
    assert_allclose(m.coupling.T @ values(matrix) @ m.coupling, mass_matrix(m, q), atol=1e-12)

    omega, alpha, acceleration = empty(n + 1, 3), empty(n + 1, 3), empty(n + 1, 3)
    omega[n] = alpha[n] = symbols(np.zeros(3))
    acceleration[n] = symbols(-gravity)
    newton_euler_recursion(
        m.tree,
        rotation,
        position,
        xd,
        xdd,
        omega,
        alpha,
        acceleration,
        empty(n + 1, 3),
        empty(n + 1, 3),
        torque,
    )
    assert_allclose(m.coupling.T @ values(torque), inverse_dynamics(m, q, qd, qdd, gravity), atol=1e-11)

    base_rotation, base_position = empty(n + 1, 3, 3), empty(n + 1, 3)
    place_links(m.tree, rotation, position, base_rotation, base_position)
    joints = [empty(n, 3) for _ in range(4)]
    links = [empty(n + 1, 3), empty(n + 1, 3), empty(n + 1), empty(n + 1, 3)]
    sums = [empty(n + 1, 3, 3), empty(n + 1, 3), empty(n + 1, 3, 3)]
    coriolis_recursion(m.tree, base_rotation, base_position, xd, *joints, *links, *sums, matrix)
    assert_allclose(m.coupling.T @ values(matrix) @ m.coupling, coriolis_matrix(m, q, qd), atol=1e-11)
