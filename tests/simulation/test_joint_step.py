import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.simulation.joint_step import factorise, solve_factored


@pytest.mark.parametrize("n", [1, 2, 7, 19])
def test_factor_solves_a_positive_definite_system(n: int) -> None:
    rng = np.random.default_rng(n)
    root, b = rng.normal(size=(n, n)), rng.normal(size=n)
    A = root @ root.T + np.eye(n)
    L, x = np.tril(A), b.copy()  # only the lower triangle is read
    assert factorise(L)
    assert_allclose(np.tril(L) @ np.tril(L).T, A, atol=1e-12 * n)
    solve_factored(L, x)
    assert_allclose(x, np.linalg.solve(A, b), atol=1e-10)


@pytest.mark.parametrize("A", [[[0.0]], [[-1.0]], [[np.nan]], [[1.0, 2.0], [2.0, 1.0]]])
def test_what_is_not_positive_definite_is_said_to_be_so(A: list[list[float]]) -> None:
    assert not factorise(np.array(A))
