"""What the tables of few minutes say of results, without running them."""

import numpy as np
import pytest

from papers.beyond.few_minutes import (
    ALL,
    BEST,
    EXPERIMENT,
    HALF,
    PAPER,
    PRIOR,
    TENTH,
    gains,
    ratios,
    recorded_curve,
    report,
    simulated_curves,
)
from papers.calibration.dvrk import RECORDINGS
from papers.experiment import Outcomes


def curve(tenth: float, half: float, whole: float) -> dict[str, object]:
    return {
        name: {"rows": 10, "rmse": [error] * 6}
        for name, error in ((TENTH, tenth), (HALF, half), (ALL, whole))
    }


@pytest.fixture
def outcomes() -> Outcomes:
    found = {}
    for name in RECORDINGS:
        for seed, more in ((0, 0.1), (1, -0.1)):  # the mean over trainings is what counts
            paper = recorded_curve.case(recording=name, model=PAPER, seed=seed)
            best = recorded_curve.case(recording=name, model=BEST, seed=seed)
            found[paper] = curve(4.0, 3.0, 2.0 + more)
            found[best] = curve(1.5 + more, 1.5, 1.0)
    return Outcomes(found)


def test_part_of_a_recording_is_held_against_all_of_it_over_the_mean_of_trainings(outcomes: Outcomes) -> None:
    np.testing.assert_allclose(ratios(outcomes, BEST, TENTH, PAPER)["random_train"], 0.75)
    np.testing.assert_allclose(ratios(outcomes, BEST, HALF, BEST)["random_train"], 1.5)
    verdicts = {claim.says: claim.judge(outcomes).verdict for claim in EXPERIMENT.claims}
    assert (
        verdicts[f"`{BEST}` of {TENTH} of a recording errs no more than `{PAPER}` of all of it."]
        == "reproduced"
    )
    assert (
        verdicts[f"`{BEST}` of {HALF} of a recording errs no more than `{BEST}` of all of it."]
        == "not reproduced"
    )


def test_tables_have_a_row_for_every_length_of_training(outcomes: Outcomes) -> None:
    tables = report(outcomes).tables
    assert len(tables) == len(RECORDINGS) + 1
    assert [row[0] for row in tables[0].table.rows] == [
        f"{model}, {stage}" for model in (PAPER, BEST) for stage in (TENTH, HALF, ALL)
    ]
    assert [row[-1] for row in tables[-1].table.rows] == ["6 of 6"] * 4 + ["0 of 6"] * 4


def test_the_prior_is_held_against_the_same_rows_without_it_real_arms_apart_from_simulated_ones() -> None:
    found = {
        recorded_curve.case(recording="random_train", model=BEST, seed=0): curve(2.0, 1.0, 1.0),
        recorded_curve.case(recording="random_train", model=PRIOR, seed=0): curve(1.0, 1.0, 1.0),
        simulated_curves.case(seed=1, models=[BEST, PRIOR], training=1.0, test=1.0): {
            BEST: {TENTH: {"rows": 10, "rmse": [1.0] * 3}},
            PRIOR: {TENTH: {"rows": 10, "rmse": [1.5] * 3}},
        },
    }
    outcomes = Outcomes(found)
    over = gains(outcomes, PRIOR, TENTH)
    np.testing.assert_allclose(over["real"], np.full((1, 6), 0.5))
    np.testing.assert_allclose(over["simulated"], np.full((1, 3), 1.5))
    rows = report(outcomes).tables[-1].table.rows
    assert [row[0] for row in rows][:1] == [f"{PRIOR}, real, {TENTH}"]
    assert rows[-1][1:] == ["1.50", "1.50", "1.50", "-", "-", "-", "1.50", "1.50 to 1.50"]
