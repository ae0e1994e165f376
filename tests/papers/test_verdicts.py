"""Verdicts, tables and sentences on results that are made up, on both sides of each criterion, of all experiments."""

import pytest

from papers.catalog import MODULES, experiment
from papers.experiment import Outcomes
from papers.results_files import judged
from tests.papers.made_up import beyond, calibration, gravity, regressor
from tests.papers.made_up.row import Row

ROWS = [*calibration.ROWS, *gravity.ROWS, *regressor.ROWS, *beyond.ROWS]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.experiment}: {row.told}")
def test_made_up_results_are_judged_and_shown_as_they_are(row: Row) -> None:
    one, outcomes = experiment(row.experiment), row.outcomes()
    found = [judgement for _, judgement in judged(one, outcomes)]
    assert len(row.verdicts) == len(found)
    letters = "".join(each.verdict[0] for each in found)
    assert "".join(x if wanted != "." else "." for x, wanted in zip(letters, row.verdicts, strict=True)) == row.verdicts
    told = [each.measured for each, wanted in zip(found, row.spread, strict=bool(row.spread)) if wanted == "y"]
    assert [measured for measured in told if "±" not in measured] == []
    if row.shows:
        report = one.report(outcomes)
        lines = [" | ".join(line) for titled in report.tables for line in titled.table.rows]
        text = "\n".join([*lines, *report.remarks, *(each.measured for each in found)])
        assert [words for words in row.shows if words not in text] == [], text


@pytest.mark.parametrize("name", MODULES)
def test_every_claim_is_tried_where_it_holds_and_where_it_does_not(name: str) -> None:
    tried = [row.verdicts for row in ROWS if row.experiment == name]
    for number, claim in enumerate(experiment(name).claims):
        letters = {verdicts[number] for verdicts in tried}
        assert "r" in letters, claim.says
        assert letters & set("sn"), claim.says
    assert {found.verdict for _, found in judged(experiment(name), Outcomes({}))} <= {"not measured"}
