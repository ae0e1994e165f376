"""What a prior gives a linear model by itself: the same model with the same play states, without it.

A da Vinci PSM (Hwang et al., RA-L 2020), four recordings; both models are fitted to the same rows and tested on the
last fifth. The linear model without a prior is a ridge regression, as `fit --model linear --play on` makes it.
"""

from pathlib import Path

import numpy as np

from catenary.calibration.fit_options import PLAY_SHARES, FitOptions
from catenary.reports.page import Table
from papers.beyond.few_minutes import LINEAR, MODELS, curve_of, stages
from papers.calibration.dvrk import JOINTS, RECORDINGS
from papers.experiment import Case, Experiment, Outcomes, Report, Result, Scope, TitledTable, after_headline, run

WITH, WITHOUT = "with", "without"
OPTIONS = {WITH: MODELS[LINEAR], WITHOUT: FitOptions(kind="linear", play=PLAY_SHARES)}


@run(revision=1)
def linear_curves(recording: str, data: Path) -> Result:
    """Return, with the prior and without, by length of training, rows and RMSE per joint [deg|mm]."""
    return {name: curve_of(recording, options, data) for name, options in OPTIONS.items()}


def cases(scope: Scope) -> list[Case]:
    """Return a case for every recording."""
    names = list(RECORDINGS)[: 1 if scope.quick else None]
    return [linear_curves.case(recording=name) for name in names]


def report(outcomes: Outcomes) -> Report:
    """Return the error with the prior over that without, by length of training."""
    rows = []
    results = [result for _, result in outcomes.items(linear_curves)]
    for stage in stages():
        over = np.array([
            np.divide(each[WITH][stage]["rmse"], each[WITHOUT][stage]["rmse"])
            for each in results
            if stage in each[WITH]
        ])  # fmt: skip
        if len(over):
            joints = [f"{value:.2f}" for value in np.exp(np.log(over).mean(axis=0))]
            middle = f"{np.exp(np.log(over).mean()):.2f}"
            rows.append([stage, *joints, middle, f"{over.min():.2f} to {over.max():.2f}"])
    table = Table(["training", *JOINTS, "all", "of single joints"], rows)
    title = "Linear model with play states: error with the prior over that without, geometric mean over recordings"
    return Report([TitledTable(title, table)] if rows else [])


EXPERIMENT = Experiment(
    name="beyond-prior-control",
    paper="beyond",
    place="beyond, few minutes",
    title="What the prior gives a linear model by itself",
    about=after_headline(__doc__),
    cases=cases,
    report=report,
    minutes=0.5,
    drawn=0,
    simulated=False,
    needs_data=True,
)
