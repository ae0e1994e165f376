import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.gravity.compact_regressor import compact_regressor
from catenary.gravity.gravity_regressor import CARRIED_MASS, gravity_regressor
from catenary.gravity.written_terms import SharedTerms, Terms, mass_entries, moment_entries, terms_text
from catenary.robots.catalog import load_robot, robot_names
from catenary.robots.model import RobotModel
from oracles.latex import value, values
from oracles.random_trees import Floats, random_robot
from papers.regressor.decomposition import full_entry


def number(terms: Terms, q: Floats) -> float:
    functions = {"c": np.cos, "s": np.sin, "q": lambda x: x}
    return sum(
        factor * np.prod([functions[kind](sum(f * q[k] for k, f in angle)) for kind, angle in atoms])
        for atoms, factor in terms.items()
    )


def assert_entries_are_those_of_Z(model: RobotModel, rng: np.random.Generator) -> int:
    regressor = compact_regressor(model)
    q, gravity = rng.normal(size=model.n), rng.normal(size=3)
    Z = np.zeros((model.n, len(regressor.expressions)))
    written = 0
    for (link, along), target in zip(regressor.columns, regressor.targets, strict=True):
        if along == CARRIED_MASS:
            entries = mass_entries(model, link, gravity)
        else:
            entries = moment_entries(model, link, np.eye(3)[along], gravity)
        for r, terms in enumerate(entries):
            if terms is None:
                Z[r, target] = np.nan  # too long to write
            else:
                Z[r, target] += number(terms, q)
                written += 1
    expected = regressor.Z(q, gravity)
    assert_allclose(np.where(np.isnan(Z), expected, Z), expected, atol=1e-9, err_msg=model.name)
    return written


def test_entries_written_out_are_those_of_the_regressor(random_robots, rng):
    models = [robot.model for robot in random_robots[:36] if len(robot.model.link_names) < 6]
    assert sum(assert_entries_are_those_of_Z(model, rng) for model in models) > 200


@pytest.mark.parametrize("name", robot_names())
def test_entries_of_the_catalogue_are_those_of_the_regressor(name: str) -> None:
    model = load_robot(name)
    if len(model.link_names) <= 6:
        assert assert_entries_are_those_of_Z(model, np.random.default_rng(1)) > 0


def test_angles_of_parallel_joints_add_up() -> None:
    arm = load_robot("planar_3r")
    entries = moment_entries(arm, 2, np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, -1.0]))
    assert entries == 3 * [{(("c", ((0, 1.0), (1, 1.0), (2, 1.0))),): pytest.approx(1.0)}]


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


def test_every_entry_in_shared_terms_is_that_of_the_regressor(rng) -> None:
    checked = 0
    for seed in range(30):
        model = random_robot(seed).model
        regressor = compact_regressor(model)
        q, gravity = rng.uniform(-1.0, 1.0, model.n), rng.normal(size=3)
        shared = SharedTerms(model, gravity)
        Z = np.zeros((model.n, len(regressor.expressions)))
        texts = [
            (r, target, terms_text(shared.entry(r, link, along), latex=True))
            for (link, along), target in zip(regressor.columns, regressor.targets, strict=True)
            for r in range(model.n)
        ]
        named = values([f"{name} = {terms_text(t, latex=True)}" for name, t in shared.definitions.items()], q)
        for r, target, text in texts:
            Z[r, target] += value(text, q, named)
        assert_allclose(Z, regressor.Z(q, gravity), atol=2e-4)  # six digits at each of several steps
        checked += Z.size
    assert checked > 500
