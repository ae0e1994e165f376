import numpy as np
import sympy as sp
from numpy.testing import assert_allclose

from catenary import gravity_torque, load_robot, mass_matrix, potential_energy
from catenary.spatial import LEVEL
from oracles import two_link_symbols as symbols
from papers.tutorial.two_link import controllers, motion, simulate

ARM = load_robot("two_link")
POSES = np.random.default_rng(1).uniform(-np.pi, np.pi, (10, 2))


def at(expression: sp.Matrix, q: np.ndarray) -> np.ndarray:
    return np.array(expression.subs({symbols.q0: q[0], symbols.q1: q[1]}), dtype=float)


def test_mass_matrix_and_gravity_torque_are_those_of_the_symbols() -> None:
    M, g = (each.subs(symbols.NUMBERS) for each in (symbols.mass_matrix(), symbols.gravity_torque()))
    for q in POSES:
        assert_allclose(mass_matrix(ARM, q), at(M, q), atol=1e-12)
        assert_allclose(gravity_torque(ARM, q, LEVEL), at(g, q)[:, 0], atol=1e-12)


def test_jacobians_are_those_that_the_page_prints() -> None:
    q0, q1, L0, L1 = symbols.q0, symbols.q1, symbols.L0, symbols.L1
    s0, c0, s01, c01 = sp.sin(q0), sp.cos(q0), sp.sin(q0 + q1), sp.cos(q0 + q1)
    J0 = sp.Matrix([[-L0 / 2 * s0, 0], [0, 0], [L0 / 2 * c0, 0], [0, 0], [-1, 0], [0, 0]])
    J1 = sp.Matrix(
        [
            [-L0 * s0 - L1 / 2 * s01, -L1 / 2 * s01],
            [0, 0],
            [L0 * c0 + L1 / 2 * c01, L1 / 2 * c01],
            [0, 0],
            [-1, -1],
            [0, 0],
        ]
    )
    for ours, printed in zip(symbols.jacobians(), (J0, J1), strict=True):
        assert sp.simplify(ours - printed) == sp.zeros(6, 2)


def test_the_tutorials_cosine_would_give_another_potential_energy() -> None:
    q = np.array([0.4, -0.7])
    printed = 9.81 * (0.5 * np.sin(q[0]) + np.sin(q[0]) + 0.25 * np.cos(q.sum()))
    assert abs(potential_energy(ARM, q, LEVEL) - printed) > 1.0


def test_the_tutorials_transform_multiplied_out_turns_twice() -> None:
    q0, q1, L0 = symbols.q0, symbols.q1, symbols.L0
    com = symbols.along(q1) / 4
    as_printed = sp.simplify(symbols.turned(q1) * com + L0 * symbols.along(q0))
    assert sp.simplify(as_printed - (L0 * symbols.along(q0) + symbols.along(2 * q1) / 4)) == sp.zeros(3, 1)
    corrected = symbols.turned(q0) * com + L0 * symbols.along(q0)
    assert sp.simplify(corrected - (L0 * symbols.along(q0) + symbols.along(q0 + q1) / 4)) == sp.zeros(3, 1)


def test_unforced_arm_keeps_its_energy() -> None:
    class Limp:
        def torque(self, state, reference):
            return np.zeros(2)

    run = simulate(ARM, Limp(), motion())
    qd = np.gradient(run.q, run.time, axis=0)
    kinetic = 0.5 * np.einsum("kj,kij,ki->k", qd, mass_matrix(ARM, run.q), qd)
    energy = kinetic + potential_energy(ARM, run.q, LEVEL)
    assert kinetic.max() > 2.0
    assert_allclose(energy[1:-1], energy[1], atol=0.01)  # velocities are central differences over 1 ms


def test_every_term_does_what_the_page_says() -> None:
    runs = {name: simulate(ARM, controller, motion()) for name, controller in controllers(ARM).items()}
    worst = {name: np.abs(run.error).max() for name, run in runs.items()}
    at_rest = {name: np.abs(run.error[-1]).max() for name, run in runs.items()}
    assert worst["PD, inertia, gravity, Coriolis"] < 0.01 * worst["PD, inertia, gravity"]
    for name, left in at_rest.items():
        assert (left > 1e-3) == ("gravity" not in name), name
