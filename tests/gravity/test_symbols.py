import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.gravity import compact_regressor as symbols
from catenary.gravity.gravity_regressor import carried
from catenary.robots.catalog import load_robot
from oracles.random_trees import RandomRobot


def test_expressions_have_the_values_of_the_parameters(random_robots: list[RandomRobot]) -> None:
    for robot in random_robots:
        m = robot.model
        moment, mass = carried(m.tree)
        for link in range(len(m.link_names)):
            for axis, expected in ((0, moment[link, 0]), (2, moment[link, 2]), (None, mass[link])):
                expression = (
                    symbols.mass_expression(m, link) if axis is None else symbols.moment_expression(m, link, axis)
                )
                table = symbols.symbols_of(m, [expression])
                total = 0.0
                for length, i in symbols.monomials(expression):
                    factor = table[length].value if length else 1.0
                    total += factor * table[f"m{i + 1}"].value
                assert_allclose(total, expected, atol=1e-12)


def test_planar_arm_has_the_papers_symbols() -> None:
    arm = load_robot("planar_3r")
    assert symbols.moment_expression(arm, 0, 1) == ()
    table = symbols.symbols_of(arm, [symbols.moment_expression(arm, 0, 0)])
    assert table["l1"] == ("from link1 to link2, along x of link1 [m]", 0.4)
    assert table["lg1"] == ("centre of mass of link1, along x [m]", 0.2)
    assert table["m3"] == ("mass of link3 [kg]", 1.0)


@pytest.mark.parametrize(
    ("expression", "text", "latex"),
    [
        ((), "0", "0"),
        ((symbols.Product("", (0, 1)),), "m1+m2", "m_{1}+m_{2}"),
        ((symbols.Product("l2,5x", (4,)),), "l2,5x m5", "l_{2,5x} m_{5}"),
        ((symbols.Product("lg12z", (11,)),), "lg12z m12", "l_{g12z} m_{12}"),
        ((symbols.Product("l1", (1, 2, 3, 4, 5, 8)),), "l1 (m2+...+m6+m9)", r"l_{1} (m_{2}+\dots+m_{6}+m_{9})"),
    ],
)
def test_expressions_are_written_as_in_the_paper(expression: symbols.Expression, text: str, latex: str) -> None:
    assert symbols.expression_text(expression) == text
    assert symbols.expression_text(expression, latex=True) == latex


def test_massless_links_have_no_mass_and_others_do_whatever_their_numbers() -> None:
    arm = load_robot("raven2_full")
    assert symbols.carried_masses(arm, 0) == (0, 1, 2)
    assert (arm.tree.com[2] == np.zeros(3)).all()  # a placeholder
    assert symbols.expression_text(symbols.moment_expression(arm, 2, 0)) == "lg3x m3"
