import numpy as np
import pytest
from matplotlib.mathtext import MathTextParser
from numpy.testing import assert_allclose

from catenary.errors import MissingInertiaError
from catenary.gravity.formula import gravity_latex
from catenary.gravity.torque import gravity_torque
from catenary.robots.catalog import load_robot
from oracles.catalogue import robots_with_inertia
from oracles.latex import values
from oracles.random_trees import random_robot


def held(text: str, q: np.ndarray) -> list[float]:
    named = values(text.split("\n"), q)
    return [named[f"g_{{{j + 1}}}"] for j in range(len(q))]


@pytest.mark.parametrize("name", robots_with_inertia())
def test_formulas_give_the_torques_of_every_robot(name: str) -> None:
    model, rng = load_robot(name), np.random.default_rng(3)
    for gravity in ([0.0, 0.0, -9.81], [1.0, -2.0, -9.0]):
        text = gravity_latex(model, gravity)
        q = rng.uniform(-1.0, 1.0, model.n)
        expected = gravity_torque(model, q, gravity)
        # six digits a number, of sums of up to a hundred and some
        assert_allclose(held(text, q), expected, atol=2e-4 * max(1.0, np.abs(expected).max()))


def test_formulas_of_any_twists_give_the_torques(rng) -> None:
    for seed in range(12):
        model = random_robot(seed).model
        if model.missing_inertia:
            continue
        q = rng.uniform(-1.0, 1.0, model.n)
        expected = gravity_torque(model, q, [0.3, 0.2, -9.0])
        assert_allclose(
            held(gravity_latex(model, [0.3, 0.2, -9.0]), q),
            expected,
            atol=1e-3 * max(1.0, np.abs(expected).max()),
        )


def test_a_ur10e_is_written_in_six_short_lines_that_latex_reads() -> None:
    lines = gravity_latex(load_robot("ur10e")).split("\n")
    assert len(lines) == 6
    assert max(map(len, lines)) < 90
    assert lines[0] == "g_{1} = 0"  # a vertical axis
    parser = MathTextParser("path")
    for line in lines:
        parser.parse(f"${line}$")


def test_a_robot_without_masses_has_no_formulas_of_them() -> None:
    with pytest.raises(MissingInertiaError):
        gravity_latex(load_robot("dvrk_psm_motors"))
