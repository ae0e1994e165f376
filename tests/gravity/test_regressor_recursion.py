import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.dynamics.recursion import place_joints
from catenary.gravity.compact import compact_regressor
from catenary.gravity.regressor import gravity_regressor
from catenary.gravity.regressor_recursion import (
    compact_recursion,
    full_recursion,
    spread_of,
    turn_links,
)
from oracles.plain_numbers import empty, symbols, values
from oracles.random_trees import RandomRobot


@pytest.mark.parametrize("seed", [3, 8, 17])
def test_recursions_run_on_numbers_that_only_add_and_multiply(
    random_robots: list[RandomRobot], seed: int
) -> None:
    m = random_robots[seed].model
    n = len(m.link_names)
    rng = np.random.default_rng(seed)
    q, gravity = rng.normal(size=m.n), rng.normal(size=3)
    x = m.coupling @ q + m.offset
    g = symbols(gravity)
    down = (g[0], g[1], g[2])
    rotation, position = empty(n, 3, 3), empty(n, 3)
    place_joints(m.tree, symbols(x), symbols(np.sin(x)), symbols(np.cos(x)), rotation, position)
    turned, axis = empty(n, 3, 3), empty(n, 3)
    turn_links(m.tree, rotation, turned, axis)
    spread = spread_of(m.coupling)

    full = empty(*gravity_regressor(m, q, gravity).shape)
    full_recursion(m.tree, symbols(x), turned, axis, down, spread, full)
    assert_allclose(values(full), gravity_regressor(m, q, gravity), atol=1e-12)

    regressor = compact_regressor(m)
    compact = empty(m.n, len(regressor.expressions))
    compact_recursion(m.tree, symbols(x), turned, axis, down, regressor.columns, spread, compact)
    assert_allclose(values(compact), regressor.Z(q, gravity), atol=1e-12)


def test_spread_is_the_coupling_without_its_zeros(random_robots: list[RandomRobot]) -> None:
    for robot in random_robots:
        coupling = robot.model.coupling
        start, coordinate, weight = spread_of(coupling)
        back = np.zeros_like(coupling)
        for i in range(len(coupling)):
            for s in range(start[i], start[i + 1]):
                back[i, coordinate[s]] = weight[s]
        assert (back == coupling).all()
        assert (weight != 0.0).all()
