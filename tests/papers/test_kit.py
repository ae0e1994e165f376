"""What experiments are written with: samples tell mean and spread, tables and claims leave out what has not run."""

import pytest

from oracles.sweep_cases import quick, summed
from papers.experiment import Outcomes
from papers.kit import Missing, as_text, by_robot, cells, grid, rows, sample, table, unless_missing

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
    assert as_text({"a": found[:, 1], "b": found[:, 2]}, ".0f", " deg") == "a 2 ± 0 deg, b 4 ± 0 deg"


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
