import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from catenary.transmission.hysteresis import bouc_wen_step, maxwell_step

WIDTH = 3e-3
states = st.floats(-1.0, 1.0)
moves = st.floats(-2e-2, 2e-2)


@given(states, moves, st.integers(1, 50))
def test_bouc_wen_is_odd_and_bounded_and_depends_on_the_path_and_not_on_the_steps(state, stretching, pieces):
    z, at_once = state, bouc_wen_step(state, stretching, WIDTH)
    for _ in range(pieces):
        z = bouc_wen_step(z, stretching / pieces, WIDTH)
    assert_allclose(z, at_once, atol=1e-13)  # roundings of up to 50 steps
    assert abs(at_once) <= 1.0
    assert bouc_wen_step(-state, -stretching, WIDTH) == -at_once


@pytest.mark.parametrize("state", [-0.9, -0.2, 0.0, 0.6])
@pytest.mark.parametrize("stretching", [-7e-3, -1e-3, 2e-4, 5e-3])
def test_bouc_wen_solves_its_differential_equation(state, stretching):
    side = np.sign(stretching)

    def slope(_, z):
        return side / WIDTH * (1.0 - np.abs(z) * (0.5 * np.sign(side * z) + 0.5))

    solution = solve_ivp(slope, (0.0, abs(stretching)), [state], rtol=1e-9, atol=1e-9, max_step=WIDTH / 50)
    # the slope has a kink where z passes zero
    assert_allclose(bouc_wen_step(state, stretching, WIDTH), solution.y[0, -1], atol=1e-6)


def test_fresh_bouc_wen_state_nears_one_exponentially():
    assert_allclose(bouc_wen_step(0.0, 2.0 * WIDTH, WIDTH), 1.0 - math.exp(-2.0), rtol=1e-14)


@settings(max_examples=30)
@given(st.floats(0.1, 10.0), st.floats(-0.9, 0.9))
def test_bouc_wen_takes_work_over_a_closed_cycle(amplitude, start):
    path = amplitude * WIDTH * np.sin(np.linspace(0.0, 2.0 * np.pi, 500))
    z = start
    for _ in range(4):  # until the loop closes
        work = 0.0
        for ds in np.diff(path):
            after = bouc_wen_step(z, ds, WIDTH)
            work += 0.5 * (z + after) * ds
            z = after
    assert work > 0.0


def test_maxwell_branch_relaxes_with_its_time_constant():
    slow, step, constant = 0.0, 1e-3, 2.0
    for _ in range(2000):
        slow = maxwell_step(slow, 1.0, step, constant)
    assert_allclose(1.0 - slow, math.exp(-1.0), rtol=1e-3)  # explicit Euler: step / (2 constant) per constant


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_maxwell_branch_never_passes_the_stretch(slow, stretch):
    after = maxwell_step(slow, stretch, 1e-3, 60.0)
    assert min(slow, stretch) <= after <= max(slow, stretch)
