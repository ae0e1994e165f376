import pytest

from oracles.sweep_cases import summed
from papers import catalog
from papers.calibration.table_1 import direction_errors
from papers.calibration.table_2 import more_epochs
from papers.catalog import MODULES, experiment, named
from papers.claims import by_count, mean_and_spread
from papers.experiment import Case, Experiment, Outcomes, Scope

ARGUMENTS = {"seed": None, "direction": "J1", "networks": [0], "sparsities": [0.5], "test_seconds": 60.0}


def test_a_case_is_named_by_function_arguments_and_revision() -> None:
    case = direction_errors.case(**ARGUMENTS)
    assert case.key == direction_errors.case(**dict(reversed(ARGUMENTS.items()))).key
    assert case.key != direction_errors.case(**ARGUMENTS | {"seed": 1}).key
    assert case.key != Case(case.function, case.revision + 1, case.text).key
    assert case.load() is direction_errors
    assert case.arguments == ARGUMENTS


def test_a_case_of_other_arguments_is_refused() -> None:
    with pytest.raises(TypeError, match="sparsities"):
        direction_errors.case(seed=1, direction="J1", networks=[0], test_seconds=1.0)
    with pytest.raises(ValueError, match="JSON"):
        direction_errors.case(**ARGUMENTS | {"test_seconds": float("nan")})


def test_outcomes_are_found_by_function_and_arguments() -> None:
    cases = [direction_errors.case(**ARGUMENTS | {"seed": seed}) for seed in (1, 2)]
    outcomes = Outcomes({case: {"raw": number} for number, case in enumerate(cases)})
    assert outcomes.of(direction_errors) == [{"raw": 0}, {"raw": 1}]
    assert outcomes.of(direction_errors, seed=2) == [{"raw": 1}]
    assert outcomes.of(direction_errors, direction="J2") == []


def test_how_often_networks_are_trained_is_what_cases_are_called_with() -> None:
    assert Outcomes({summed.case(number=1, folder="here"): {}}).trainings == []
    five = direction_errors.case(**ARGUMENTS | {"networks": [0, 1, 2, 3, 4]})
    none = direction_errors.case(**ARGUMENTS | {"networks": []})
    assert Outcomes({five: {}, none: {}}).trainings == [5]
    one = more_epochs.case(seed=1, training_set="1/2", epochs=[2], network=0)
    assert Outcomes({one: {}, five: {}}).trainings == [1, 5]


@pytest.mark.parametrize(
    ("holds", "verdict"),
    [
        ([True, True], "reproduced"),
        ([True, True, False], "same direction"),
        ([True, False], "not reproduced"),
        ([], "not measured"),
    ],
)
def test_a_claim_of_several_parts_holds_as_far_as_these_do(holds: list[bool], verdict: str) -> None:
    assert by_count(holds, "told").verdict == verdict


def test_spread_is_that_of_a_sample() -> None:
    assert mean_and_spread([1.0, 3.0], 1) == "2.0 ± 1.4"
    assert mean_and_spread([1.0]) == "1.000"
    assert mean_and_spread([]) == "-"


@pytest.mark.parametrize("name", MODULES)
def test_every_experiment_says_what_it_is_and_what_it_would_run(name: str) -> None:
    one: Experiment = experiment(name)
    assert one.name == name
    # regressor-payload stands on the regressor's page and claims nothing of the paper's
    assert name.startswith(f"{one.paper}-") or one.paper == "beyond"
    assert one.about
    assert one.minutes > 0.0
    for claim in one.claims:
        assert all((claim.says, claim.place, claim.published, claim.criterion))
    if not one.needs_data:
        quick, whole = one.cases(Scope(robots=(None,), networks=1, quick=True)), one.cases(Scope())
        assert quick
        assert len({case.key for case in whole}) == len(set(whole))


def test_names_and_their_beginnings_choose_experiments() -> None:
    assert named(["all"]) == list(MODULES)
    assert named(["calibration-table-1", "calibration-table-1"]) == ["calibration-table-1"]
    assert "calibration-table-1" in named(["calibration"])
    with pytest.raises(catalog.InputError, match="calibration-table-1"):
        named(["table-1"])
