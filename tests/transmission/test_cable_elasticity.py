import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from catenary.simulation.cable_parameters import load_cable_arm
from catenary.transmission.cable_elasticity import (
    MAX_LOSS,
    RANDOM_MODULUS,
    beyond_backlash,
    bouc_wen_step,
    joint_forces,
    joints_of,
    loss_rate,
    maxwell_step,
    next_draw,
    set_rate,
    tension_of,
    tensions_for,
    wander_step,
    winding_of,
)

STIFFNESS, SHARE, WIDTH, SLOW, BACKLASH = 300.0, 0.65, 4e-3, 0.1, 2e-3
stretches = st.floats(-1.0, 1.0)
states = st.floats(-1.0, 1.0)
moves = st.floats(-2e-2, 2e-2)


@given(stretches, st.sampled_from([0.2, 0.0]))
def test_backlash_is_felt_as_nothing_inside_and_shortens_what_is_outside(stretch, width):
    expected = np.sign(stretch) * max(0.0, abs(stretch) - 0.5 * width)
    assert_allclose(beyond_backlash(stretch, width), expected, atol=1e-16)


def test_a_closed_cycle_takes_work_even_across_the_backlash():
    rng = np.random.default_rng(5)
    for _ in range(20):
        # a random closed path of the cable's ends, small steps; the same cycle until its loop has settled
        corners = rng.uniform(-8e-3, 8e-3, size=rng.integers(2, 6))
        corners = np.append(corners, corners[0])
        path = np.concatenate([np.linspace(a, b, 400) for a, b in pairwise(corners)])
        state, slow, work = 0.0, 0.0, 0.0
        for _ in range(3):
            work, before, last = 0.0, path[0], None
            for pulled in path:
                stretch = beyond_backlash(pulled, BACKLASH)
                state = bouc_wen_step(state, stretch - beyond_backlash(before, BACKLASH), WIDTH)
                slow = maxwell_step(slow, stretch, 1e-3, 60.0)
                tension = tension_of(stretch, 0.0, state, slow, STIFFNESS, SHARE, WIDTH, SLOW, 0.0)
                if last is not None:
                    work += 0.5 * (tension + last) * (pulled - before)
                before, last = pulled, tension
        assert work > 0.0


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


def test_maxwell_branch_relaxes_with_its_time_constant():
    slow, step, constant = 0.0, 1e-3, 2.0
    for _ in range(2000):
        slow = maxwell_step(slow, 1.0, step, constant)
    assert_allclose(1.0 - slow, math.exp(-1.0), rtol=1e-3)  # explicit Euler: step / (2 constant) per constant


tensions = st.floats(-100.0, 100.0)


def test_set_nears_its_largest_value_exponentially_with_travel():
    slack, rate, most, step = 0.0, 1e-3, 0.02, 0.01
    for _ in range(2000):  # 20 rad of travel without tension
        slack += step * set_rate(0.0, 1.5, 1.0, 1.0, slack, rate, most)
    assert_allclose(slack, most * (1.0 - math.exp(-0.5 * rate * 20.0 / most)), rtol=1e-3)  # Euler steps


@given(tensions)
def test_set_grows_with_tension_on_the_side_on_which_the_cable_is_laid(tension):
    plus = set_rate(tension, 1.5, 1.0, 1.0, 0.0, 1.0, 1.0)
    minus = set_rate(tension, 1.5, -1.0, 1.0, 0.0, 1.0, 1.0)
    assert_allclose(plus - minus, 2.0 * tension / 1.5, atol=1e-9)
    assert_allclose(plus + minus, 1.0, atol=1e-9)


@given(tensions, st.floats(0.0, 5.0), st.floats(0.0, MAX_LOSS))
def test_stiffness_is_lost_and_never_regained_and_nothing_happens_at_rest(tension, speed, loss):
    assert loss_rate(tension, 1.5, speed, loss, 1e-4) >= 0.0
    assert loss_rate(tension, 1.5, 0.0, loss, 1e-4) == set_rate(tension, 1.5, 1.0, 0.0, 0.0, 1e-3, 0.02) == 0.0


def test_loss_of_stiffness_ends_at_its_largest_share():
    loss = 0.0
    for _ in range(3000):
        loss += loss_rate(6.0, 1.5, 1.0, loss, 1e-3)
    assert_allclose(loss, MAX_LOSS * (1.0 - np.exp(-4e-3 * 3000 / MAX_LOSS)), rtol=1e-6)


def test_random_numbers_are_those_that_park_and_miller_published():
    number = 1.0
    for _ in range(10_000):
        number = next_draw(number)
    assert number == 1_043_618_065  # Communications of the ACM 31 (1988), page 1195


@pytest.mark.parametrize("steps", [20, 80])
def test_set_wanders_by_travel_either_way_however_slowly(steps):
    way, wander, rng = 4.0, 1e-4, np.random.default_rng(steps)
    ends = []
    for number in rng.integers(1, int(RANDOM_MODULUS), 1000):
        slack, drawn = 0.0, float(number)
        for _ in range(steps):
            drawn = next_draw(drawn)
            slack = wander_step(slack, drawn, way / steps, wander, 1.0)
        ends.append(slack)
    assert_allclose(np.std(ends), wander * math.sqrt(way), rtol=0.1)  # of 1000 walks, 4 standard errors
    assert abs(np.mean(ends)) < 4.0 * wander * math.sqrt(way / 1000)


@given(st.floats(-0.02, 0.02), st.integers(1, int(RANDOM_MODULUS) - 1), st.floats(-1e-3, 1e-3))
def test_set_never_wanders_beyond_its_largest_value_and_stays_at_rest(slack, number, way):
    assert abs(wander_step(slack, float(number), way, 0.1, 0.02)) <= 0.02
    assert (
        wander_step(slack, float(number), 0.0, 0.1, 0.02) == wander_step(slack, float(number), way, 0.0, 0.02) == slack
    )


FIRMWARE = load_cable_arm().firmware
share = st.floats(-2.0, 2.0)
triple = st.tuples(share, share, share)


@given(triple, triple, triple)
def test_coupling_has_an_inverse_and_keeps_power(coupling, qd, tension):
    # a few roundings of numbers < 20
    assert_allclose(joints_of(coupling, winding_of(coupling, qd)), qd, atol=1e-13)
    assert_allclose(joint_forces(coupling, tensions_for(coupling, tension)), tension, atol=1e-13)
    at_cables = np.dot(tension, winding_of(coupling, qd))
    assert_allclose(np.dot(joint_forces(coupling, tension), qd), at_cables, atol=1e-13)


def test_elbow_and_insertion_cables_wind_with_the_joints_before_them():
    # raven2 source: m1 = TR1 q1, m2 = TR2 (q2 + c01 q1), m3 = TR3 (q3 + c02 q1 + c12 q2)
    assert_allclose(winding_of((0.1, 0.02, 0.03), (1.0, 0.0, 0.0)), (1.0, 0.1, 0.02))
    assert_allclose(winding_of((0.1, 0.02, 0.03), (0.0, 1.0, 0.0)), (0.0, 1.0, 0.03))
    assert_allclose(winding_of((0.1, 0.02, 0.03), (0.0, 0.0, 1.0)), (0.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("q", "motor"),
    [
        ([np.deg2rad(30), np.deg2rad(90), 0.40], [71.312, 200.141, 899.637]),  # home
        (FIRMWARE.stop_value[:3], [0.0, 291.632, 1254.971]),
    ],
)
def test_nominal_motor_angles_are_those_of_the_robot(q, motor):
    # raven2 description, printed to 1e-3 rad
    assert_allclose(FIRMWARE.ratio[:3] * winding_of(FIRMWARE.coupling, q), motor, atol=5e-4)
