from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.transmission.elasticity import beyond_backlash, tension_of
from catenary.transmission.hysteresis import bouc_wen_step, maxwell_step

STIFFNESS, SHARE, WIDTH, SLOW, BACKLASH = 300.0, 0.65, 4e-3, 0.1, 2e-3
stretches = st.floats(-1.0, 1.0)


@given(stretches, st.sampled_from([0.2, 0.0]))
def test_backlash_is_felt_as_nothing_inside_and_shortens_what_is_outside(stretch, width):
    expected = np.sign(stretch) * max(0.0, abs(stretch) - 0.5 * width)
    assert_allclose(beyond_backlash(stretch, width), expected, atol=1e-16)


@given(stretches, stretches)
def test_linear_cable_is_a_spring_and_a_damper(stretch, rate):
    tension = tension_of(stretch, rate, 0.7, 0.0, STIFFNESS, 1.0, WIDTH, 0.0, 2.0)
    assert_allclose(tension, STIFFNESS * stretch + 2.0 * rate, rtol=1e-14, atol=1e-300)


def test_fresh_cable_has_its_whole_stiffness():
    small = 1e-9  # against a width of 4e-3: the hysteretic part has not yielded
    state = bouc_wen_step(0.0, small, WIDTH)
    tension = tension_of(small, 0.0, state, small, STIFFNESS, SHARE, WIDTH, 0.0, 0.0)
    assert_allclose(tension, STIFFNESS * small, rtol=1e-6)


def test_yielded_cable_has_its_elastic_stiffness():
    far, further = (
        tension_of(s, 0.0, 1.0, s, STIFFNESS, SHARE, WIDTH, 0.0, 0.0) for s in (50 * WIDTH, 50 * WIDTH + 1e-3)
    )
    assert_allclose((further - far) / 1e-3, SHARE * STIFFNESS, rtol=1e-9)


def test_sudden_stretch_is_stiffer_than_a_held_one_by_the_slow_share():
    sudden, held = (tension_of(1e-3, 0.0, 0.0, s, STIFFNESS, 1.0, WIDTH, SLOW, 0.0) for s in (0.0, 1e-3))
    assert_allclose(sudden / held, 1.0 + SLOW, rtol=1e-12)


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
