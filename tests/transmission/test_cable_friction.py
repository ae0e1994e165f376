import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import lsq_linear

from catenary.transmission.cable_friction import coulomb, coulomb_coupled, coupled_friction, dragged

speeds = st.floats(-10.0, 10.0)
bounds = st.floats(0.0, 10.0)


def random_case(rng, n=3):
    """Inverse inertia, largest impulses and velocities, about as often sticking as slipping."""
    root = rng.normal(size=(n, n))
    return np.linalg.inv(root @ root.T + 0.2 * np.eye(n)), rng.uniform(0.0, 2.0, n), rng.normal(size=n)


def settled(inverse_inertia, impulse, velocity, sweeps=1000):
    after, given_ = velocity.copy(), np.zeros(len(velocity))
    coulomb_coupled(inverse_inertia, impulse, after, given_, sweeps)
    return after, given_


@given(speeds, bounds)
def test_coulomb_stops_exactly_what_it_can_stop_and_never_turns_round(velocity, most):
    after = coulomb(velocity, most)
    assert 0.0 <= after * np.sign(velocity) <= abs(velocity)
    if abs(velocity) <= most:
        assert after == 0.0
    else:
        assert_allclose(abs(velocity) - abs(after), most, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("seed", range(20))
def test_coupled_coulomb_minimises_the_energy_that_is_left(seed):
    # the complementarity problem is the optimality of: least 1/2 p A p - p v, |p| <= impulse
    A, impulse, velocity = random_case(np.random.default_rng(seed))
    L = np.linalg.cholesky(A)
    best = lsq_linear(L.T, np.linalg.solve(L, velocity), bounds=(-impulse, impulse), method="bvls", tol=1e-14)
    after, impulses = settled(A, impulse, velocity)
    assert_allclose(impulses, best.x, atol=1e-7)  # of bvls
    assert_allclose(after, velocity - A @ impulses, atol=1e-12)
    for v, p, most in zip(after, impulses, impulse, strict=True):
        assert abs(v) < 1e-9 if abs(p) < most - 1e-9 else v * p >= -1e-9


@pytest.mark.parametrize("sweeps", [1, 4, 1000])
@pytest.mark.parametrize("seed", range(20))
def test_coupled_coulomb_adds_no_energy_in_any_number_of_sweeps_from_zero(seed, sweeps):
    # each sweep only lowers what the settled search minimises, and from zero that is energy taken
    A, impulse, velocity = random_case(np.random.default_rng(seed))
    after, _ = settled(A, impulse, velocity, sweeps)
    M = np.linalg.inv(A)
    assert after @ M @ after <= velocity @ M @ velocity * (1.0 + 1e-12)


def test_constant_push_below_friction_ends_in_exact_rest():
    # steps of a push that friction can hold, each search starting from the last step's impulses
    A, _, _ = random_case(np.random.default_rng(3))
    push = np.array([0.1, -0.2, 0.05])
    impulse, velocity, impulses = np.full(3, 1.0), np.zeros(3), np.zeros(3)
    for _ in range(400):
        velocity += A @ push
        coulomb_coupled(A, impulse, velocity, impulses, 4)
    assert_allclose(velocity, 0.0, atol=1e-14)


@given(st.lists(speeds, min_size=1, max_size=30), st.floats(0.01, 10.0), st.floats(0.1, 10.0))
def test_a_spring_that_ends_in_dry_friction_is_one_element_of_the_coupled_law(x, most, stiffness):
    law = coupled_friction([[1.0 / stiffness]], [[1.0]], [[most]], [1e9])
    force, at, stored = 0.0, x[0], 0.0
    for here, lag in zip(x, law.lag(np.array(x)[:, None])[:, 0, 0], strict=True):
        before, force = force, dragged(force, here - at, stiffness, most)
        assert_allclose(force, -stiffness * lag, atol=1e-9)
        # of the work done on it along a straight way, what is not stored in the spring was rubbed away
        stick = (force - before) / stiffness
        work = 0.5 * (before + force) * stick + force * (here - at - stick)
        stored_now = 0.5 * force**2 / stiffness
        assert work - (stored_now - stored) >= -1e-9
        at, stored = here, stored_now
