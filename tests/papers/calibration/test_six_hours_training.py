"""Claims of the polynomial and of the length of training: verdicts on made-up hours."""

from papers.calibration.sessions import HOURS
from papers.calibration.six_hours_training import CLAIMS, considerably_better
from papers.experiment import Outcomes
from tests.papers.calibration.test_figure_6 import outcomes

PAPERS = outcomes(dict.fromkeys(HOURS, 1.0))
ALIKE = outcomes(dict.fromkeys(HOURS, 1.0), short=(1.0, 1.0), polynomial=1.0)


def verdicts(made: Outcomes) -> dict[str, str]:
    return {claim.says: claim.judge(made).verdict for claim in CLAIMS}


def test_every_claim_holds_where_short_training_and_the_polynomial_are_worse_as_the_paper_says() -> None:
    assert {says for says, verdict in verdicts(PAPERS).items() if verdict != "reproduced"} == set()


def test_training_sets_and_models_that_are_alike_reproduce_none() -> None:
    told = verdicts(ALIKE)
    assert (
        told.pop("Idle hours alone ruin the polynomial on joint 1") == "reproduced"
    )  # made up as the paper's
    assert told.pop("Six hours of motion ruin the polynomial on joint 1") == "reproduced"
    assert set(told.values()) == {"not reproduced"}


def test_a_gain_of_three_per_cent_is_a_tie() -> None:
    told = verdicts(outcomes(dict.fromkeys(HOURS, 1.0), short=(1.03, 1.03)))
    assert told["Longer training is better in hour 5"] == "not reproduced"
    says = "Unloaded, joint 1, after hour 3: longer training helps the linear model, and the network less"
    assert told[says] == "not reproduced"


def test_considerably_better_is_by_a_fifth() -> None:
    assert considerably_better(PAPERS, "loaded", "linear").all()  # 1 over 1.3
    assert not considerably_better(PAPERS, "loaded", "network").any()  # 1 over 1.1
    assert considerably_better(Outcomes({}), "loaded", "linear").size == 0


def test_nothing_is_judged_before_it_is_measured() -> None:
    assert set(verdicts(Outcomes({})).values()) == {"not measured"}
