"""Figure 6: verdicts and report on made-up hours."""

from typing import Any

from papers.calibration import published
from papers.calibration.figure_6 import EXPERIMENT, SHOWN
from papers.calibration.sessions import HOURS
from papers.calibration.six_hours import cases_of, six_hours
from papers.experiment import Outcomes, Scope


def outcomes(loss: dict[str, float], joint_1: float = 1.0) -> Outcomes:
    """Make up errors that start at the paper's and grow by `loss` of the paper's growth; joint 1's by more."""

    def hours(condition: str, model: str) -> list[dict[str, Any]]:
        known = published.SIX_HOURS[condition]
        first, last = known.get(model, known["linear"])
        told = []
        for hour in HOURS[condition]:
            share = loss[condition] * hour / 5.0
            errors = [a + share * (b - a) for a, b in zip(first, last, strict=True)]
            errors[0] = first[0] + joint_1 * (errors[0] - first[0])
            told.append({"errors": errors, "guarded": errors, "tip": [1.0] * 4, "outside": 0.0})
        return told

    def result(arguments: dict[str, Any]) -> dict[str, Any]:
        return {
            model: {name: hours(arguments["condition"], model) for name in arguments["sets"]}
            for model in SHOWN
        }

    cases = [
        case for case in cases_of(Scope(robots=(None, 1), networks=1)) if case.function == six_hours.name
    ]
    return Outcomes({case: result(case.arguments) for case in cases})


def verdicts(made: Outcomes) -> list[str]:
    return [claim.judge(made).verdict for claim in EXPERIMENT.claims]


def test_the_papers_own_hours_reproduce_all_but_what_needs_the_polynomial_or_short_training() -> None:
    told = dict(
        zip(
            [claim.says for claim in EXPERIMENT.claims],
            verdicts(outcomes(dict.fromkeys(HOURS, 1.0))),
            strict=True,
        )
    )
    failed = {says for says, verdict in told.items() if verdict != "reproduced"}
    assert failed == {
        "Idle hours alone ruin the polynomial on joint 1",  # made up like the linear model
        "Longer training is better in hour 5",  # all training sets are made up alike
    }


def test_a_robot_that_load_does_not_wear_reproduces_no_claim_about_load() -> None:
    made = outcomes({"idle": 0.0, "unloaded": 1.0, "loaded": 0.0})
    told = {claim.says: claim.judge(made).verdict for claim in EXPERIMENT.claims}
    assert told["Under 500 g joint 1 loses about twice as much"] == "not reproduced"
    assert (
        told["500 g make linear model and network lose more than no load does, on every joint"]
        == "not reproduced"
    )
    assert (
        told["Six unloaded hours: fixed offset, linear model and network lose accuracy on every joint"]
        == "reproduced"
    )


def test_nothing_is_judged_before_it_is_measured() -> None:
    assert set(verdicts(Outcomes({}))) == {"not measured"}


def test_the_report_shows_every_condition_and_model_beside_the_paper() -> None:
    shown = EXPERIMENT.report(outcomes(dict.fromkeys(HOURS, 1.0)))
    rows = {row[0]: row for row in shown.tables[0].table.rows}
    assert len(rows) == len(HOURS) * len(SHOWN)
    first = rows["loaded, network"]
    assert first[1].startswith(first[2])
    assert first[3].startswith(first[4])
    assert len(shown.pictures[0].figure.axes) == 9
