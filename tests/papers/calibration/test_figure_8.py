"""Figure 8: polynomials in principal axes beside those of all inputs, sizes, and verdicts on made-up errors."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.testing import assert_allclose

from catenary.calibration.predictors import fit_polynomial
from papers.calibration import published
from papers.calibration.all_inputs import LARGER, all_inputs, principal, sizes
from papers.calibration.figure_8 import EXPERIMENT, cases
from papers.calibration.recordings import METHODS, fitted, rows_of
from papers.experiment import Outcomes, Scope
from tests.papers.calibration.test_six_hours import a_log


def outcomes(scale: float = 1.0) -> Outcomes:
    """Make up the paper's numbers; those of 138 inputs times a factor."""

    def errors(model: str, columns: str) -> list[float]:
        if model == "fixed offset":
            return [1.0, 1.1, 0.5]
        if columns == "16":
            return list(published.INPUTS_16.get(model, (1.0, 2.0, 1.0)))
        return [scale * value for value in published.INPUTS_138.get(model, (3.0, 3.0, 3.0))]

    def result(function: str, told: dict[str, Any]) -> dict[str, Any]:
        if function == all_inputs.name:
            found: dict[str, Any] = {
                model: {name: [errors(model, "all")] * 6 for name in told["sets"]}
                for model in ("polynomial", LARGER)
            }
            return found | {"ranks": {name: [40, 860, 840] for name in told["sets"]}}
        if function == sizes.name:
            return dict(published.PARAMETERS)
        return {
            model: {name: [{"errors": errors(model, told["columns"])}] * 6 for name in told["sets"]}
            for model in ("fixed offset", *told["models"])
        }

    scope = Scope(robots=(None, 1), networks=1)
    return Outcomes({case: result(case.function, case.arguments) for case in cases(scope)})


def test_the_papers_own_numbers_reproduce_every_claim() -> None:
    made = outcomes()
    assert {claim.judge(made).verdict for claim in EXPERIMENT.claims} == {"reproduced"}
    shown = EXPERIMENT.report(made)
    rows = {row[0]: row for row in shown.tables[0].table.rows}
    assert rows["larger network, 138"][3:6] == ["0.397 ± 0.000", "0.397 ± 0.000", "0.397"]
    assert all("±" in claim.judge(made).measured for claim in EXPERIMENT.claims[1:])
    assert len(shown.pictures[0].figure.axes) == 3


def test_inputs_that_cost_nothing_reproduce_no_loss() -> None:
    made = outcomes(0.3)
    told = {claim.says: claim.judge(made).verdict for claim in EXPERIMENT.claims}
    assert told["138 inputs: the network of 100-100 loses considerably"] == "not reproduced"
    assert (
        told["138 inputs ruin the linear model: it does not outperform the fixed offset"] == "not reproduced"
    )


def test_rows_tell_how_many_training_sets_and_trainings_they_rest_on() -> None:
    rows = {row[0]: row[1:3] for row in EXPERIMENT.report(outcomes()).tables[0].table.rows}
    assert rows["network, 138"] == ["11", "1"]  # as many as the made-up scope has
    assert rows["larger network, 138, stamp"] == ["6", "1"]
    assert rows["polynomial, 138"] == ["6", "-"]
    assert rows["linear, 16"] == ["11", "-"]


def test_a_larger_network_like_the_small_one_is_no_better() -> None:
    made = outcomes()
    alike = {
        case: {
            **result,
            LARGER: {name: [published.INPUTS_138["network"]] * 6 for name in case.arguments["sets"]},
        }
        if case.function == all_inputs.name
        else result
        for case, result in made._results.items()
    }
    told = {claim.says: claim.judge(Outcomes(alike)).verdict for claim in EXPERIMENT.claims}
    says = "The larger network is better than the small one with 138 inputs, but worse than the small one with 16"
    assert told[says] == "not reproduced"  # though it is worse than with 16 on every joint


def test_nothing_is_judged_before_it_is_measured() -> None:
    assert {claim.judge(Outcomes({})).verdict for claim in EXPERIMENT.claims} == {"not measured"}


def test_networks_and_linear_models_have_the_papers_sizes(rng: np.random.Generator) -> None:
    assert sizes() == published.PARAMETERS
    predictor = fitted([a_log(rng)], METHODS["linear"]).groups[0].predictor
    inputs, outputs = predictor.shape
    assert (inputs or 0) + 1 == 17  # II-H: parameters per joint
    assert outputs == 3


def test_polynomial_in_principal_axes_is_that_of_inputs_that_depend_on_each_other(
    rng: np.random.Generator,
) -> None:
    train, test = (rows_of(fitted([log], METHODS["linear"]), log) for log in (a_log(rng), a_log(rng)))
    mixed = rng.normal(size=(4, train.X.shape[1]))  # rank 4, as q and tau of a clean robot
    train = replace(train, X=train.X[:, :4] @ mixed)
    mean, scale, axes = principal(train)
    assert axes.shape == (mixed.shape[1], 4)
    small = fit_polynomial((train.X - mean) / scale @ axes, train.error)
    # all 16 inputs have 152 terms, of which the data determine 14
    whole = fit_polynomial(train.X, train.error)
    X = test.X[:, :4] @ mixed
    assert_allclose(small.predict((X - mean) / scale @ axes), whole.predict(X), atol=1e-8)
