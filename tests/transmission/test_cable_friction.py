from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose
from scipy.optimize import lsq_linear

from catenary.errors import InputError
from catenary.transmission.cable_friction import (
    CoupledFriction,
    coulomb,
    coulomb_coupled,
    coupled_friction,
    drag_along,
    dragged,
)

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


FAR = 1e9  # a step that is never split
repeatable = settings(derandomize=True, deadline=None)  # the first call compiles


def drawn(rng, n=2, m=2, longest=FAR, systems=1):
    """Springs and friction elements of random directions."""
    root = rng.normal(size=(n, n))
    return coupled_friction(
        np.linalg.inv(root @ root.T + 0.3 * np.eye(n)),
        np.eye(m, n) + 0.4 * rng.normal(size=(m, n)),
        rng.uniform(0.1, 1.5, (systems, m)),
        np.full(n, longest),
    )


def path(rng, rows=40, n=2, size=1.0):
    return np.cumsum(size * rng.normal(size=(rows, n)), axis=0)


def finer(x, times):
    """The same path in smaller steps."""
    shares = np.arange(1, times + 1)[:, None] / times
    return np.vstack([x[:1], *[a + shares * (b - a) for a, b in pairwise(x)]])


@repeatable
@given(arrays(np.float64, st.integers(1, 30), elements=st.floats(-100.0, 100.0, width=32)), st.floats(0.0, 50.0))
def test_one_element_on_one_joint_is_play(x, half_width):
    spring = 2.5
    friction = coupled_friction([[1.0 / spring]], [[1.0]], [[half_width * spring]], [FAR])
    z, at = x + friction.lag(x[:, None])[:, 0, 0], x[0]
    for q, joint in zip(x, z, strict=True):
        at = min(max(at, q - half_width), q + half_width)
        assert_allclose(joint, at, rtol=0.0, atol=1e-10)  # rounding of numbers up to 150, added up


@pytest.mark.parametrize(("n", "m"), [(1, 1), (2, 2), (2, 1), (2, 3), (3, 3), (4, 2)])
def test_a_step_minimises_spring_energy_and_friction(n, m):
    # the dual: least 1/2 s G s - s A (x - z_before), |s| <= mu; with z = x - C A' s
    rng = np.random.default_rng(n * 10 + m)
    friction = drawn(rng, n, m)
    x = path(rng, 30, n)
    A, mu = friction.directions, friction.thresholds[0]
    C = friction.lever @ np.linalg.pinv(A.T)  # on the directions' span, which is all that counts
    L = np.linalg.cholesky(A @ C @ A.T + 1e-13 * np.eye(m))
    z = x + friction.lag(x)[:, 0]
    for before, q, joint in zip(z, x[1:], z[1:], strict=False):
        best = lsq_linear(L.T, np.linalg.solve(L, A @ (q - before)), bounds=(-mu, mu), method="bvls", tol=1e-14)
        assert_allclose(joint, q - friction.lever @ best.x, atol=1e-3 if m > n else 1e-6)  # sweeps, bvls


@pytest.mark.parametrize("seed", range(5))
def test_the_motors_work_is_stored_or_dissipated_and_none_is_made(seed):
    rng = np.random.default_rng(seed)
    C = np.array([[1.4, -0.6], [-0.6, 0.95]])
    friction = coupled_friction(C, np.eye(2), [[0.7, 1.8]], [FAR, FAR])
    K = np.linalg.inv(C)
    x = finer(path(rng, 30), 400)
    lag = friction.lag(x)[:, 0]
    stored = 0.5 * np.einsum("ti,ij,tj->t", lag, K, lag)
    forces = -lag @ K
    work = 0.5 * np.einsum("ti,ti->t", forces[1:] + forces[:-1], np.diff(x, axis=0))
    lost = np.abs(np.diff(x + lag, axis=0)) @ friction.thresholds[0]
    assert_allclose(work.sum(), stored[-1] + lost.sum(), rtol=2e-3)  # trapezoids at corners, 400 steps a line
    # no step gives more than was stored and put in
    assert np.all(work - np.diff(stored) >= -1e-9 - 0.5 * np.abs(np.diff(x, axis=0)).max() ** 2)


@pytest.mark.parametrize("seed", range(5))
def test_speed_and_time_do_not_count(seed):
    rng = np.random.default_rng(seed)
    friction, x = drawn(rng, 3, 3), finer(path(rng, 20, 3), 50)
    waiting = np.repeat(x, rng.integers(1, 4, len(x)), axis=0)
    place = np.flatnonzero(np.r_[np.any(np.diff(waiting, axis=0), axis=1), True])
    assert_allclose(friction.lag(waiting)[place], friction.lag(x), atol=1e-9)  # sweeps that wait settle further


def test_splitting_steps_converges():
    rng, errors = np.random.default_rng(0), []
    for _ in range(8):
        x, friction = path(rng, 100, 3), drawn(rng, 3, 3)
        at = [friction._replace(longest=np.full(3, step)).lag(x) for step in (1.0, 0.25, 0.0625, 0.001)]
        errors.append([np.abs(each - at[-1]).mean() for each in at[:-1]])
        assert_allclose(at[-1], friction.lag(finer(x, 3000))[::3000], atol=2e-3)  # split by hand
    first, second, third = np.mean(errors, axis=0)
    assert first > 1e-3  # whole steps do miss what slips first
    assert second < 0.5 * first  # first order in the step: a quarter each time
    assert third < 0.5 * second


def test_a_state_carried_row_by_row_gives_the_bits_of_the_whole_path():
    rng = np.random.default_rng(0)
    friction, x = drawn(rng, 2, 3, longest=0.3, systems=4), path(rng)
    whole, state = friction.lag(x), np.full(2 + 4 * 3, np.nan)
    for row, expected in zip(x, whole, strict=True):
        lag = np.empty((1, 8))
        drag_along(row[None], *friction, state, lag)
        assert np.array_equal(lag.reshape(4, 2), expected)


@pytest.mark.parametrize(
    "wrong",
    [
        {"compliance": [[1.0, 2.0], [2.0, 1.0]]},
        {"compliance": [[1.0, 0.2], [0.1, 1.0]]},
        {"directions": [[0.0, 0.0], [0.0, 1.0]]},
        {"thresholds": [[1.0, -1.0]]},
        {"thresholds": [[1.0]]},
        {"longest": [0.0, 1.0]},
    ],
)
def test_what_is_no_friction_is_refused(wrong):
    right = {"compliance": np.eye(2), "directions": np.eye(2), "thresholds": [[1.0, 1.0]], "longest": [1.0, 1.0]}
    assert isinstance(coupled_friction(**right), CoupledFriction)
    with pytest.raises(InputError):
        coupled_friction(**right | wrong)
