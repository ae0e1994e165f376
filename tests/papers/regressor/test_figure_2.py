import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import gravity_torque, load_robot
from catenary.robots.catalog import robot_names
from papers.experiment import Outcomes, Scope
from papers.regressor import figure_2
from papers.regressor.decomposition import NO_EFFECT, decomposition, with_bodies
from papers.regressor.evaluation_time import evaluation


@pytest.fixture(scope="module")
def outcomes() -> Outcomes:
    cases = figure_2.cases(Scope(quick=True))
    return Outcomes({case: case.load()(**case.arguments) for case in cases})


def test_every_robot_of_the_catalogue_is_taken_apart() -> None:
    cases = figure_2.cases(Scope())
    assert {case.arguments["robot"] for case in cases if case.function == decomposition.name} == set(
        robot_names()
    )
    timed = {case.arguments["robot"] for case in cases if case.function == evaluation.name}
    assert timed == {name for name in robot_names() if not load_robot(name).tree.prismatic.any()}


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


@pytest.mark.parametrize(
    ("ratios", "verdict"),
    [
        ((1.5, 8.0, 2.0), "reproduced"),
        ((1.5, 8.0, 0.9), "same direction"),
        ((0.9, 0.8, 2.0), "not reproduced"),
    ],
)
def test_time_is_judged_by_measured_ratios_and_not_by_columns(
    outcomes: Outcomes, ratios: tuple[float, ...], verdict: str
) -> None:
    results = {
        evaluation.case(robot=name, repeats=1): {"full_us": ratio, "compact_us": 1.0, "ratio": ratio}
        for name, ratio in zip(("planar_3r", "dual_arm_19", "panda"), ratios, strict=True)
    }
    results |= {decomposition.case(**told): result for told, result in outcomes.items(decomposition)}
    judged = figure_2.CLAIMS[4].judge(Outcomes(results))
    assert judged.verdict == verdict
    assert judged.measured.startswith(f"full over compact: planar_3r {ratios[0]:.1f}, dual_arm_19")
    assert figure_2.report(Outcomes(results)).tables[-1].table.rows[1][-1] == f"{ratios[1]:.2f}"


def test_verdicts_follow_what_is_printed(outcomes: Outcomes) -> None:
    assert {claim.judge(outcomes).verdict for claim in figure_2.CLAIMS} == {"reproduced"}
    (planar, right), (raven, other) = (
        (case, case.load()(**case.arguments)) for case in figure_2.cases(Scope(quick=True))[:2]
    )
    wrong = Outcomes({planar: {**right, "entries": [["c1", "c12", "c123"]] * 3}, raven: other})
    assert figure_2.CLAIMS[1].judge(wrong).verdict == "not reproduced"
    assert figure_2.CLAIMS[0].judge(Outcomes({})).verdict == "not measured"
