import numpy as np
import pytest

from papers.experiment import Outcomes, Scope
from papers.regressor import payload
from papers.regressor.unknown_payload import LOOKED_AT, arm, payload_trials, trial


def test_a_heavy_load_is_noticed_at_once_and_its_probabilities_are_its_own() -> None:
    model = arm(3)
    rng = np.random.default_rng(5)
    results = [trial(model, rng, 0.1, loaded=True) for _ in range(4)]
    assert {len(one["seen"]) for one in results} == {len(LOOKED_AT)}
    heavy = [one for one in results if one["link"] > 1 and one["mass_kg"] > 0.5]
    assert heavy
    for one in heavy:
        assert payload.noticed(one["seen"][-1])
        assert one["seen"][-1]["among_likely"]


def test_arms_differ_by_their_seed_alone() -> None:
    assert (arm(1).tree.mass == arm(1).tree.mass).all()
    assert (arm(1).tree.mass != arm(2).tree.mass).any()


def seen(probability: float, right: bool, no_load: float = 0.0) -> list[dict[str, object]]:
    one = {
        "no_load": no_load,
        "right": right,
        "probability": probability,
        "likely": 1,
        "among_likely": right,
        "mass_error_kg": 0.1,
        "mass_error_there_kg": 0.1,
        "mass_std_kg": 0.1,
    }
    return [{"poses": poses, **one} for poses in LOOKED_AT]


def made_up() -> Outcomes:
    trials = [
        {"link": 2, "mass_kg": 0.3, "alarm": False, "seen": seen(0.8, number < 4)} for number in range(5)
    ]
    trials += [{"link": 0, "mass_kg": 0.0, "alarm": False, "seen": seen(0.9, False, 0.99)}]
    return Outcomes({case: {"trials": trials} for case in payload.cases(Scope(robots=(None,)))})


def test_a_statement_is_counted_by_the_probability_it_was_made_with() -> None:
    ((stated, right, count),) = payload.reliability(payload.trials_of(made_up(), payload.USUAL))
    assert stated == pytest.approx(0.8)
    assert right == pytest.approx(0.8)
    assert count == 5 * len(LOOKED_AT)  # unloaded trials state no link


def test_report_tells_detection_links_and_masses() -> None:
    report = payload.report(made_up())
    assert [len(one.table.rows) for one in report.tables] == [6, 1, 6, 1, 6, 1, 1, 4]
    first = report.tables[0].table.rows[0]
    assert first[:4] == ["1", "5", "100 %", "80 %"]
    assert report.tables[0].table.rows[-1][:3] == ["false alarms", "7", "0 %"]
    assert len(report.pictures) == 1


def loads(right: int) -> list[dict[str, object]]:
    return [
        {"link": 2, "mass_kg": 0.3, "alarm": False, "seen": seen(0.95, number < right)} for number in range(5)
    ]


def test_a_remark_says_where_statements_are_overconfident() -> None:
    (said,) = payload.overconfident(loads(3), "told")
    assert said == "Overconfident, told: stated 95.0 % on average, right 60.0 % of 25."
    assert not payload.overconfident(loads(5), "told")


def test_each_bin_of_stated_probabilities_counts_not_the_many_that_are_sure() -> None:
    sure = [{"link": 2, "mass_kg": 1.0, "alarm": False, "seen": seen(1.0, True)} for _ in range(100)]
    case = payload.cases(Scope(robots=(None,)))[0]
    judge = payload.CLAIMS[0].judge
    found = judge(Outcomes({case: {"trials": [*loads(3), *sure]}}))
    assert found.verdict == "not reproduced"
    assert found.measured == "stated 95.0 % right 60.0 %, 100.0 % right 100.0 % (1 of 2)"
    assert judge(Outcomes({case: {"trials": [*loads(5), *sure]}})).verdict == "reproduced"


def test_what_a_share_may_lack_is_two_standard_errors() -> None:
    assert payload.as_stated(0.8, 0.73, 100)  # 2 sqrt(0.8 0.2 / 100) = 0.08
    assert not payload.as_stated(0.8, 0.71, 100)
    assert payload.as_stated(0.8, 1.0, 100)


def test_statements_of_this_package_are_not_listed_as_a_papers() -> None:
    assert payload.EXPERIMENT.paper == "beyond"


@pytest.mark.parametrize(("right", "verdict"), [(5, "reproduced"), (3, "not reproduced")])
def test_claims_are_judged_on_the_estimator_as_it_comes(right: int, verdict: str) -> None:
    results = {}
    for case in payload.cases(Scope(robots=(None,))):
        usual = (case.arguments["noise_ratio"], case.arguments["told_sizes"]) == payload.USUAL
        results[case] = {"trials": loads(right if usual else 5 - right)}
    assert [claim.judge(Outcomes(results)).verdict for claim in payload.CLAIMS] == [verdict] * 2
    assert {claim.judge(Outcomes({})).verdict for claim in payload.CLAIMS} == {"not measured"}


def test_every_arm_runs_under_every_condition() -> None:
    cases = payload.cases(Scope())
    assert len(cases) == 18
    assert {case.function for case in cases} == {payload_trials.name}
