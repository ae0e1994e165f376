import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from catenary.dynamics.actuation_loads import actuation_columns, known_torque, lever_load
from catenary.robots.actuation import (
    Actuation,
    Friction,
    KnownTorque,
    LeverSpring,
    MotorInertia,
    Spring,
    actuation_terms,
)

C = np.array([1.0, -0.5])
ALL = Actuation(
    friction=(Friction("a", C),),
    motor_inertia=(MotorInertia("m", C),),
    springs=(Spring("s", C), Spring("l", C, LeverSpring(0.01, 0.1, 0.06, 23.0))),
)
finite = st.floats(-3.0, 3.0)


def columns(q, qd, qdd, actuation=ALL, smoothing=0.0):
    rows = [np.atleast_2d(np.asarray(v, dtype=float)) for v in (q, qd, qdd)]
    return actuation_columns(actuation_terms(actuation), *rows, smoothing)[0]


def test_terms_come_in_the_order_of_the_columns():
    kinds = [term.kind for term in actuation_terms(ALL)]
    assert kinds == ["coulomb", "viscous", "offset", "motor_inertia", "spring", "spring"]


def test_at_rest_constants_and_springs_are_left():
    assert [t.kind for t in actuation_terms(ALL, static=True)] == ["offset", "spring", "spring"]


def test_every_effect_acts_along_its_combination():
    across = np.array([0.5, 1.0])
    assert_allclose(across @ columns([0.3, 0.8], [1, 2], [3, 4]), 0.0, atol=1e-15)


@given(st.tuples(finite, finite), st.tuples(finite, finite))
def test_a_rotor_takes_the_power_that_its_kinetic_energy_gains(qd, qdd):
    power = np.asarray(qd) @ columns([0, 0], qd, qdd)[:, 3]
    step = 1e-6
    ahead, behind = (0.5 * (C @ (np.asarray(qd) + s * np.asarray(qdd))) ** 2 for s in (step, -step))
    assert_allclose(power, (ahead - behind) / (2 * step), atol=1e-6)  # exact for a parabola but for rounding


def test_a_spring_on_a_lever_is_the_gradient_of_its_energy():
    lever = LeverSpring(arm=0.0075, anchor=0.1035, rest=0.0613, angle_deg=203.0)

    def energy(s):
        end = lever.arm * np.array([np.cos(lever.angle + s), np.sin(lever.angle + s)])
        return 0.5 * (np.linalg.norm(end - [lever.anchor, 0.0]) - lever.rest) ** 2

    for s in np.linspace(-2.0, 2.0, 9):
        slope = (energy(s + 1e-5) - energy(s - 1e-5)) / 2e-5
        assert_allclose(lever_load(lever, np.array(s)), slope, atol=1e-11)  # central difference, h = 1e-5


def test_smoothed_coulomb_friction_is_the_sign_far_from_rest():
    fast, slow = (columns([0, 0], [speed, 0], [0, 0], smoothing=0.02) for speed in (1.0, 1e-3))
    assert_allclose(fast[:, 0], C, atol=1e-12)
    assert_allclose(slow[:, 0], C * 0.05, rtol=1e-3)  # tanh x = x - x^3 / 3


def test_known_torques_are_polynomials_high_power_first():
    known = KnownTorque("cable", C, np.array([0.0, 2.0]), np.array([3.0, 0.0, 1.0]))
    q = np.array([[0.5, 1.0], [1.0, 0.0]])
    assert_allclose(known_torque(Actuation(known_torques=(known,)), q), [[0.0, 2.0], [0.0, 8.0]])
