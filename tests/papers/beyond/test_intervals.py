"""What the tables of intervals say of results, without running them."""

from papers.beyond.intervals import LATER, dvrk_coverage, raven_coverage, report
from papers.experiment import Outcomes


def found(*held: float, verdict: str = "held") -> dict[str, object]:
    return {"held": held, "half_width": [0.5] * len(held), "verdict": [verdict] * len(held), "outside": 0.25}


def test_tables_hold_shares_widths_and_flags_and_the_remark_counts_them() -> None:
    six = dvrk_coverage.case(recording="random_train", kind="neural, best", others=["error_exp1"])
    raven = raven_coverage.case(seed=None, kind="linear", seconds=60.0, pause=60.0)
    made = report(
        Outcomes(
            {
                six: {LATER: found(*[0.9] * 6), "error_exp1": found(*[0.5] * 6, verdict="too narrow")},
                raven: {LATER: found(0.84, 0.9, 0.9, verdict="below, which may be chance")},
            }
        )
    )
    later, elsewhere, simulated = (table.table.rows for table in made.tables)
    assert later == [["random_train", "neural, best", *["90 % ± 0.5"] * 6, "25 %"]]
    assert elsewhere == [["random_train", "error_exp1", *["50 %! ± 0.5"] * 6, "25 %"]]
    assert simulated[0][3] == "84 %? ± 0.5"
    assert "6 joints and models, median 90 % held; 6 between 85 and 95 %" in made.remarks[1]
    assert "6 below, of which 6 are flagged as too narrow" in made.remarks[2]
