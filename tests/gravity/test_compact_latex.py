"""The regressor's LaTeX read back: what stands on paper gives the numbers."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.gravity.compact import compact_regressor
from catenary.robots.catalog import load_robot

ATOM = {"c": np.cos, "s": np.sin}


def value(text: str, q: np.ndarray) -> float:
    """Evaluate a sum of products such as -0.5 c_{1} s_{23} + \\cos(q_{1}-q_{2})."""
    text = re.sub(r"\\(cos|sin)\(([^)]*)\)", r"np.\1(\2)", text)
    text = re.sub(r"(?<![\w}])([cs])_\{([\d,]+)\}", lambda m: f"({float(ATOM[m[1]](_sum(m[2], q)))!r})", text)
    text = re.sub(r"q_\{(\d+)\}", lambda m: f"({float(q[int(m[1]) - 1])!r})", text)
    words = re.sub(r"(?<=[\d)]) (?=[\d(n])", " * ", text)
    return float(eval(words, {"np": np}))


def _sum(indices: str, q: np.ndarray) -> float:
    return sum(q[int(k) - 1] for k in (indices.split(",") if "," in indices else indices))


@pytest.mark.parametrize("name", ["raven2", "planar_3r", "panda", "ur10e", "iiwa14", "gen3"])
def test_a_whole_regressor_on_paper_gives_its_numbers(name, rng):
    regressor = compact_regressor(load_robot(name))
    first, *defined = regressor.latex().split("\n")
    body = first.split(r"\begin{bmatrix}")[1].split(r"\end{bmatrix}")[0]
    table = [[cell.strip() for cell in row.split(" & ")] for row in body.split(r"\\")]
    named = dict(line.split(" = ", 1) for line in defined if line.startswith("Z"))
    written = [[named.get(cell, cell) for cell in row] for row in table]
    assert "Z" not in str(written)  # every entry is there
    for q in rng.uniform(-1.0, 1.0, size=(3, regressor.model.n)):
        Z = [[value(cell, q) for cell in row] for row in written]
        assert_allclose(Z, regressor.Z(q, [0.0, 0.0, -1.0]), atol=2e-5)  # six digits a number
