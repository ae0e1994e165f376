"""The regressor paper's decomposition and evaluation, its dual arm and its estimators, held against closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import gravity_regressor, gravity_torque, load_robot
from catenary.identification.samples import Samples
from catenary.spatial import LEVEL
from papers.regressor import figure_2
from papers.regressor import unknown_payload as payload
from papers.regressor.decomposition import NO_EFFECT, decomposition, with_bodies
from papers.regressor.figure_2 import full_kernel
from papers.regressor.recorded_arms import law, least_squares, replayed
from papers.regressor.unknown_payload import LOOKED_AT, arm, trial


def test_what_the_picture_shows_gives_the_torques_of_gravity() -> None:
    result = decomposition("raven2")
    arm = with_bodies(load_robot("raven2"), np.random.default_rng(1))
    before, after = figure_2.patterns(result)
    assert before.shape == (3, 37)
    assert after.shape == (3, len(result["parameters"]))
    # a coordinate that a parameter is coloured for feels it on a level base
    felt = np.abs(gravity_torque(arm, [0.3, 0.4, 0.5], [0.0, 0.0, -9.81])) > 0.0
    assert ((after > 0).any(axis=1) == felt).all()
    assert result["groups"].count(NO_EFFECT) == 1
    assert_allclose(result["largest_difference_Nm"], 0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["planar_3r", "ur5e", "dvrk_mtm_motors"])
def test_full_regressor_as_a_line_of_operations_is_the_papers(name: str, rng: np.random.Generator) -> None:
    model = load_robot(name)
    q, gravity = rng.normal(size=model.n), rng.normal(size=3)
    expected = gravity_regressor(model, q, gravity)
    assert_allclose(full_kernel(model)(q, gravity), expected, atol=1e-12 * np.abs(expected).max())


PLANAR = load_robot("planar_3r")


def held(count: int) -> Samples:
    """Poses of an arm without friction, held at rest."""
    q = np.random.default_rng(0).uniform(-1.0, 1.0, size=(count, 3))
    zero = np.zeros_like(q)
    tau = gravity_torque(PLANAR, q, LEVEL)
    return Samples("made", q, zero, zero, tau, zero, np.arange(float(count)), 1.0)


def test_an_estimator_hears_the_first_rows_alone_and_foretells_the_others() -> None:
    samples = held(30)
    ahead, learnt = replayed(least_squares(PLANAR, samples.tau), samples, static=True, until=20)
    assert_allclose(ahead[0], 0.0)
    assert_allclose(ahead[20:], learnt[20:])
    assert np.abs(learnt[20:] - samples.tau[20:]).max() < 0.15 * np.abs(samples.tau).max()


def test_the_law_knows_the_pose_that_it_heard_last() -> None:
    samples = held(6)
    _, learnt = replayed(law(PLANAR), samples, static=True, until=4)
    # 2 s at 4 / s, and the damping of Z^+
    assert_allclose(learnt[3], samples.tau[3], atol=0.02 * np.abs(samples.tau).max())


def test_a_heavy_load_is_noticed_at_once_and_its_probabilities_are_its_own() -> None:
    model = arm(3)
    rng = np.random.default_rng(5)
    results = [trial(model, rng, 0.1, loaded=True) for _ in range(4)]
    assert {len(one["seen"]) for one in results} == {len(LOOKED_AT)}
    heavy = [one for one in results if one["link"] > 1 and one["mass_kg"] > 0.5]
    assert heavy
    for one in heavy:
        assert payload.noticed(one["seen"][-1])
        assert one["seen"][-1]["among_likely"]
