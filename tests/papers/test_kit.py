"""What experiments are written with: samples tell mean and spread, tables and claims leave out what has not run."""

import numpy as np
import pytest

from oracles.sweep_cases import quick, summed
from papers.calibration.homings import homing_errors
from papers.experiment import Experiment, Judgement, Outcomes, Report, Scope
from papers.kit import Missing, by_count, by_robot, cells, grid, rows, sample, table, told, unless_missing
from papers.results_files import judged

REST = {"ours": [], "combinations": [], "test_seconds": 1.0}
CASES = grid(quick, {"folder": ("a", "b"), "number": (1, 2)})
OUTCOMES = Outcomes({
    case: {"error": [float(case.arguments["number"]), 2.0, 4.0]} for case in CASES if case.arguments["folder"] == "a"
})  # fmt: skip


def test_a_sample_tells_mean_and_spread_and_joint_by_joint() -> None:
    found = sample(OUTCOMES, quick, "error", folder="a")
    assert f"{found[:, 0]:.1f}" == "1.5 ± 0.7"
    assert f"{found:.1f}" == "J1 1.5 ± 0.7, J2 2.0 ± 0.0, J3 4.0 ± 0.0"
    assert f"{found[:, 0].mean():.2f}" == "1.50"
    assert f"{by_robot([3.0])}" == "3.000"  # one robot has no spread
    assert f"{by_robot([1.0, 1.2, 9.8]):.1m}" == "1.2 (mean 4.0 ± 5.0)"
    assert cells(found, 0) == ["2 ± 1", "2 ± 0", "4 ± 0"]
    assert told({"a": found[:, 1], "b": found[:, 2]}, ".0f", " deg") == "a 2 ± 0 deg, b 4 ± 0 deg"


def test_a_grid_has_every_combination_the_last_axis_fastest() -> None:
    assert [tuple(case.arguments.values()) for case in CASES] == [("a", 1), ("a", 2), ("b", 1), ("b", 2)]
    with pytest.raises(TypeError):
        grid(quick, {"number": (1,)})  # an argument is missing


def test_a_drawn_robot_has_fewer_trainings_than_the_nominal_one_and_one_case_each() -> None:
    robots = {"seed": (None, 7)}
    cases = grid(homing_errors, robots, networks=Scope().networks_of, **dict.fromkeys(("seen", "homings"), 0), **REST)
    assert [case.arguments["networks"] for case in cases] == [[0, 1, 2, 3, 4], [0, 1]]
    assert Scope(networks=1).networks_of(7) == [0]
    outcomes = Outcomes({case: {} for case in cases})
    assert outcomes.trainings == [2, 5]
    assert outcomes.nominal is not None
    assert outcomes.nominal.trainings == [5]
    assert outcomes.nominal.nominal is None  # no other robot has run


def test_what_has_not_run_is_missing_and_left_out_of_tables_and_remarks() -> None:
    with pytest.raises(Missing, match="quick"):
        sample(OUTCOMES, quick, "error", folder="b")
    with pytest.raises(Missing):
        sample(OUTCOMES, quick, "another step", folder="a")
    with pytest.raises(Missing):
        sample(OUTCOMES, summed, "error")

    def row(folder: str, joint: int) -> list[object]:
        return [folder, sample(OUTCOMES, quick, "error", joint, folder=folder)]

    made = table("Errors", "folder | error", rows(row, ("a", "b"), (1, 2)))
    assert made.table.header == ["folder", "error"]
    assert made.table.rows == [["a", "2.000 ± 0.000"], ["a", "4.000 ± 0.000"]]
    say = unless_missing(lambda outcomes: f"{sample(outcomes, quick, 'error', 0):.0f} deg")
    assert say(OUTCOMES) == ["2 ± 1 deg"]
    assert say(Outcomes({})) == []


def test_claims_stand_in_their_order_and_a_judge_that_misses_a_case_makes_one_not_measured() -> None:
    one = Experiment("beyond-kit", "I", "Kit", "Headline.\n\nAbout.", lambda _: CASES, lambda _: Report(), minutes=1.0)

    @one.claim("It is two", "I", "2", "equal", "since it is", fitted=True)
    def of_a(outcomes: Outcomes) -> Judgement:
        return by_count(sample(outcomes, quick, "error", 1, folder="a") == 2.0, "2")

    @one.claim("It is three", "II", "3", "equal")
    def of_b(outcomes: Outcomes) -> Judgement:
        return by_count(np.equal(sample(outcomes, quick, "error", 1, folder="b"), 3.0), "3")

    assert [(claim.says, claim.why, claim.fitted) for claim in one.claims] == [
        ("It is two", "since it is", True), ("It is three", "", False),
    ]  # fmt: skip
    assert [found.verdict for _, found in judged(one, OUTCOMES)] == ["reproduced", "not measured"]
    assert [found.verdict for _, found in judged(one, Outcomes({}))] == ["not measured"] * 2
    assert (one.paper, one.about) == ("beyond", "About.")
