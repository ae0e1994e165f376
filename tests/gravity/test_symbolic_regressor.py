import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.gravity.gravity_regressor import gravity_regressor
from catenary.gravity.symbolic_regressor import Terms, terms_text
from catenary.robots.catalog import load_robot
from oracles.random_trees import Floats
from papers.regressor.decomposition import full_entry


def number(terms: Terms, q: Floats) -> float:
    functions = {"c": np.cos, "s": np.sin, "q": lambda x: x}
    return sum(
        factor * np.prod([functions[kind](sum(f * q[k] for k, f in angle)) for kind, angle in atoms])
        for atoms, factor in terms.items()
    )


@pytest.mark.parametrize(
    ("terms", "text", "latex"),
    [
        ({}, "0", "0"),
        ({(): -0.5}, "-0.5", "-0.5"),
        ({(("c", ((0, 1.0), (1, 1.0))),): 1.0}, "c12", "c_{12}"),
        ({(("c", ((0, 1.0),)), ("s", ((1, 1.0),))): -1.0}, "-c1 s2", "-c_{1} s_{2}"),
        ({(("c", ((0, 1.0),)),): 0.25, (("s", ((0, 1.0),)),): -1.0}, "0.25 c1 - s1", "0.25 c_{1} - s_{1}"),
        ({(("s", ((0, 1.0), (1, -1.0))),): 1.0}, "s(q1-q2)", r"\sin(q_{1}-q_{2})"),
        ({(("c", ((0, 2.0),)),): 1.0}, "c(2 q1)", r"\cos(2 q_{1})"),
        ({(("q", ((0, 1.0),)), ("s", ((1, 1.0),))): 2.0}, "2 q1 s2", "2 q_{1} s_{2}"),
        ({(("c", ((0, 1.0), (9, 1.0))),): 1.0}, "c1,10", "c_{1,10}"),
        ({(("s", ((11, 1.0),)),): 1.0}, "s(q12)", r"\sin(q_{12})"),  # s12 is of joints 1 and 2
    ],
)
def test_sums_of_products_are_written_shortly(terms: Terms, text: str, latex: str) -> None:
    assert terms_text(terms) == text
    assert terms_text(terms, latex=True) == latex


def test_entries_of_the_full_regressor_are_its_own(random_robots, rng) -> None:
    models = [load_robot("planar_3r")]
    models += [robot.model for robot in random_robots[:20] if len(robot.model.link_names) < 4]
    compared = 0
    for model in models:
        n = len(model.link_names)
        q, gravity = rng.normal(size=model.n), rng.normal(size=3)
        full = gravity_regressor(model, q, gravity)[:, : 3 * n * (n + 1)].reshape(model.n, n, n + 1, 3)
        for r, k, j, along in np.ndindex(*full.shape):
            terms = full_entry(model, k, j - 1, np.eye(3)[along], gravity, r)
            if terms is not None:
                assert_allclose(number(terms, q), full[r, k, j, along], atol=1e-9, err_msg=model.name)
                compared += 1
    assert compared > 300
