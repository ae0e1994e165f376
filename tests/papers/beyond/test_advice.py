"""What the tables of chosen kinds say of results, without running them."""

from papers.beyond.advice import EXPERIMENT, dvrk_advice, report
from papers.beyond.intervals import LATER
from papers.experiment import Outcomes


def result(*tests: str, auto: float) -> dict[str, object]:
    errors = {"offset": [4.0], "linear": [2.0], "polynomial": [1.0], "neural": [3.0], "auto": [auto]}
    on_blocks = {"offset": 4.0, "linear": 2.0, "neural": 1.9}
    choice = [{"joint": "J1", "unit": "deg", "chosen": "linear", "errors": on_blocks}]
    return {"tests": dict.fromkeys(tests, errors), "choice": choice}


def test_tables_say_by_how_much_another_kind_was_better_and_verdicts_count_them() -> None:
    same = dvrk_advice.case(recording="random_train", others=[])
    other = dvrk_advice.case(recording="random_train", others=["error_exp1"])
    outcomes = Outcomes({same: result(LATER, auto=1.0), other: result("error_exp1", auto=1.2)})
    blocks, later, elsewhere = (table.table.rows for table in report(outcomes).tables)
    assert [row[1:] for row in blocks] == [
        ["offset", "4"], ["linear", "**2**"], ["polynomial", "-"], ["neural", "1.9"]
    ]  # fmt: skip
    assert later == [["random_train", "1 linear"]]
    assert elsewhere == [["random_train", "error_exp1", "1.2 linear (+20.0 % than polynomial)"]]
    on_later, on_others = (claim.judge(outcomes) for claim in EXPERIMENT.claims)
    assert on_later.verdict == "reproduced"
    assert (on_others.verdict, on_others.measured) == (
        "not reproduced",
        "0% of 1 joints and tests; 1.20 times at worst",
    )
