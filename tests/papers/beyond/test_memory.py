"""What the tables of longer memories say of results, without running them."""

from papers.beyond import memory
from papers.beyond.memory import (
    AROUND,
    EXPERIMENT,
    FORWARD,
    LATER,
    NETWORKS,
    TODAY,
    chosen_forwards,
    memory_errors,
    report,
)
from papers.experiment import Outcomes, Scope


def made_up(*, forward: dict[str, float], later: dict[str, float]) -> Outcomes:
    """Return results whose wrist errors are 4 deg times these factors, by candidate."""
    results = {}
    for case in memory.cases(Scope()):
        name = case.arguments["candidate"]
        told = {
            test: [0.1, 0.1, 0.1, *[4.0 * by.get(name, 1.0)] * 3]
            for test, by in ((FORWARD, forward), (LATER, later), (AROUND, {}))
        }
        results[case] = told
    return Outcomes(results)


def test_the_choice_is_by_forward_blocks_and_never_by_the_last_fifth() -> None:
    outcomes = made_up(forward={NETWORKS[2]: 0.8, NETWORKS[3]: 0.9}, later={NETWORKS[3]: 0.5})
    assert chosen_forwards(outcomes) == NETWORKS[2]
    verdict = EXPERIMENT.claims[0].judge(outcomes)
    assert verdict.verdict == "not reproduced"
    assert verdict.measured.startswith("+0.0 %")


def test_the_goal_is_a_tenth_of_the_mean_error() -> None:
    for factor, verdict in ((0.89, "reproduced"), (0.95, "same direction"), (1.1, "not reproduced")):
        outcomes = made_up(forward={NETWORKS[2]: 0.8}, later={NETWORKS[2]: factor})
        assert EXPERIMENT.claims[0].judge(outcomes).verdict == verdict


def test_tables_tell_every_candidate_and_the_sentence_the_chosen_one() -> None:
    outcomes = made_up(forward={NETWORKS[2]: 0.8}, later={NETWORKS[2]: 0.95})
    told = report(outcomes)
    networks, linear, rmse = (table.table.rows for table in told.tables)
    assert [row[0] for row in networks] == list(NETWORKS)
    assert [row[0] for row in linear] == list(memory.CANDIDATES)
    assert networks[2][1:3] == ["-20.0", "-5.0"]
    assert [row[1] for row in rmse] == [TODAY, NETWORKS[2]] * 4
    assert "-20.0 % there and -5.0 % on the last fifth" in told.remarks[0]
    assert len(told.pictures[0].figure.axes) == 1


def test_a_quick_run_is_of_one_recording_and_without_networks() -> None:
    cases = memory.cases(Scope(quick=True))
    assert {case.arguments["recording"] for case in cases} == {"insertion_train"}
    assert not any(case.arguments["network"] for case in cases)
    told = report(
        Outcomes({case: {LATER: [1.0] * 6, FORWARD: [1.0] * 6, AROUND: [1.0] * 6} for case in cases})
    )
    assert len(told.tables) == 1
    assert EXPERIMENT.claims[0].judge(Outcomes({})).verdict == "not measured"
    assert memory_errors.needs_data
