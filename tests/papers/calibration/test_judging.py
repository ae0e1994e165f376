from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from papers.calibration import homings, table_5
from papers.calibration.homings import homing_errors
from papers.calibration.judging import less, near, statement
from papers.calibration.table_5 import speed
from papers.experiment import Outcomes
from papers.gravity.figures_9_and_10 import FIGURE_9
from papers.gravity.tracking import follow_sinusoids
from papers.results_files import judged

ROBOTS = np.array([[1.0, 1.0, 1.0], [2.0, 2.0, 2.0], [3.0, 3.0, 3.0]])


def test_less_is_by_more_than_the_margin_on_robots_that_differ_among_themselves() -> None:
    assert_array_equal(less(ROBOTS * [0.9, 0.96, 1.0], ROBOTS), [True, False, False])
    assert_array_equal(less(ROBOTS * [0.9, 0.7, 0.81], ROBOTS, 0.2), [False, True, False])


def test_a_gain_within_the_spread_over_robots_is_a_tie() -> None:
    gained = np.array([0.5, 0.9, 1.05])  # log ratios 0.69, 0.11, -0.05: mean 0.25, deviation 0.39
    assert not less(gained, np.ones(3))
    assert less(gained[:1], np.ones(1))  # one robot has no spread


@pytest.mark.parametrize(
    ("core", "beside", "verdict"),
    [
        ([True, True, True], [True, True, True], "reproduced"),
        ([True, True, False], [True, True, False], "same direction"),
        ([False, False, True], [True, True, True], "not reproduced"),  # four of six, but not the statement
        ([False], [True, True], "not reproduced"),
        ([True, True, False], [False, False, False], "not reproduced"),
    ],
)
def test_what_stands_beside_a_statement_does_not_carry_it(core: list[bool], beside: list[bool], verdict: str) -> None:
    assert statement(core, beside, "told").verdict == verdict


def test_numbers_are_near_in_the_mean_and_told_with_their_spread() -> None:
    reached = {"a": np.array([0.9, 1.1])}
    found = near(reached, {"a": 1.2}, 0.2, direction=[False])
    assert found.verdict == "reproduced"
    assert found.measured == "a 1.000 ± 0.141"
    assert near(reached, {"a": 1.5}, 0.2, direction=[True]).verdict == "same direction"
    assert near(reached, {"a": 1.5}, 0.2, direction=[True, False]).verdict == "not reproduced"


def homed(hit: int) -> Outcomes:
    """Return made-up homings of six robots, of which some err ten times as much on joint 2 after every homing."""
    results = {}
    for seed, seen in product((None, 1, 2, 3, 4, 5), (0, 1)):
        errors = np.full((5, 6, 3), 0.3)
        errors[:, 1:, 1] *= 10.0 if (seed or 0) < hit else 1.0
        case = homing_errors.case(
            seed=seed, seen=seen, networks=[0], ours=[], combinations=[], homings=5, test_seconds=1.0
        )
        chains = {homings.ONE: errors} if seen else {homings.NONE: errors, homings.BASELINE: np.full((5, 6, 3), 0.3)}
        results[case] = {chain: dict.fromkeys(homings.MODELS, each.tolist()) for chain, each in chains.items()}
    return Outcomes(results)


@pytest.mark.parametrize(
    ("hit", "drops", "within"), [(1, "not reproduced", "reproduced"), (4, "reproduced", "not reproduced")]
)
def test_one_robot_of_six_decides_no_claim_of_homings(hit: int, drops: str, within: str) -> None:
    found = {claim.says: judgement for claim, judgement in judged(homings.EXPERIMENT, homed(hit))}
    assert found["Joint 2: accuracy drops significantly over five homings that training did not see"].verdict == drops
    told = found["Joint 2: with one homing seen, errors stay within 0.413 deg and 0.493 deg"]
    assert told.verdict == within
    assert f"{0.3 if hit == 1 else 3.0:.3f} (mean " in told.measured


@pytest.mark.parametrize(("at_20", "verdict"), [(0.5, "reproduced"), (3.0, "same direction"), (9.0, "not reproduced")])
def test_a_gain_of_static_gravity_that_grows_with_the_tilt_is_not_negated(at_20: float, verdict: str) -> None:
    results = {}
    for base, gain in (("0", 5.0), ("20", at_20)):
        rms = {"pd": 1.0, "sg": 1.0 - gain / 100.0, "dg": 0.88}
        told = {f"{name} absolute": {"rms_error": [value] * 3} for name, value in rms.items()}
        results[follow_sinusoids.case(seed=None, base=base, way="increments", controllers=[])] = told
    (claim,) = [one for one in FIGURE_9.claims if "negated" in one.says]
    assert claim.judge(Outcomes(results)).verdict == verdict


@pytest.mark.parametrize(
    ("network", "verdict"), [(160.0, "reproduced"), (4.0, "same direction"), (1.1, "not reproduced")]
)
def test_times_are_judged_as_deployed_whatever_a_framework_takes_to_be_called(network: float, verdict: str) -> None:
    result = {"deployed": {"network": network, "linear": 1.0}, "framework": {"network": 1.0, "linear": 9.0}}
    (claim,) = [one for one in table_5.EXPERIMENT.claims if "160 times" in one.says]
    assert claim.judge(Outcomes({speed.case(sparsities=[], trainings=1, calls=1): result})).verdict == verdict
