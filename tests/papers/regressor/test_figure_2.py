import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import gravity_torque, load_robot
from catenary.robots.catalog import robot_names
from papers.experiment import Outcomes, Scope
from papers.regressor import figure_2
from papers.regressor.decomposition import NO_EFFECT, decomposition, with_bodies


@pytest.fixture(scope="module")
def outcomes() -> Outcomes:
    cases = figure_2.cases(Scope(quick=True))
    return Outcomes({case: case.load()(**case.arguments) for case in cases})


def test_every_robot_of_the_catalogue_is_taken_apart() -> None:
    assert {case.arguments["robot"] for case in figure_2.cases(Scope())} == set(robot_names())


def test_steps_lead_from_36_entries_to_3_parameters(outcomes: Outcomes) -> None:
    tables = {one.title.split(":")[0]: one.table for one in figure_2.report(outcomes).tables}
    steps = tables["Its 36 parameters"].rows
    assert len(steps) == 7
    assert steps[-1][0] == "the 30 others"
    planar = next(row for row in tables["Every robot of the catalogue"].rows if row[0] == "planar_3r")
    assert planar[1:5] == ["3 x 36", "30", "0", "6 to 3"]


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


def test_verdicts_follow_what_is_printed(outcomes: Outcomes) -> None:
    assert {claim.judge(outcomes).verdict for claim in figure_2.CLAIMS} == {"reproduced"}
    (planar, right), (raven, other) = (
        (case, case.load()(**case.arguments)) for case in figure_2.cases(Scope(quick=True))
    )
    wrong = Outcomes({planar: {**right, "entries": [["c1", "c12", "c123"]] * 3}, raven: other})
    assert figure_2.CLAIMS[1].judge(wrong).verdict == "not reproduced"
    assert figure_2.CLAIMS[0].judge(Outcomes({})).verdict == "not measured"
