"""Figure 5 of the calibration paper: error against recording time, by the zig-zags' sparsity.

Sparsities 1/2 to 1/6 of direction J2-J3 and all combinations of them that take no longer than 1/2 + 1/3 + 1/4; five
recordings of 1/2, 1/3, 1/4, three of 1/5, 1/6; 20 minutes of random motion after each sparsity as its test. All is
recorded in one session from one homing, in the sparsities' order: the paper does not say in which. A combination is
tested on the motion after its finest sparsity. The network is the mean of five trainings. Models are asked wherever the
robot goes, as the paper's are.

One error is less than another where it is so by more than 5 % and by more than the spread over robots of their ratio.
That margin was added after a first run, in which differences of the third digit had counted.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from catenary.reports.page import Table
from papers.calibration.figure_5_claims import CLAIMS, LONGEST
from papers.calibration.published import DURATIONS, FIGURE_5_J1, FIGURE_5_J2, FIGURE_5_J2_POLYNOMIAL, FIGURE_5_J3
from papers.calibration.recordings import JOINTS, SETS, TEST_SECONDS, UNITS
from papers.calibration.sparsities import (
    LONG,
    OFFSET,
    RECORDINGS,
    SHORT,
    SHOWN,
    combinations,
    deviation,
    middle,
    repetitions,
    sparsity_errors,
)
from papers.claims import mean_and_spread
from papers.experiment import Case, Experiment, Outcomes, Report, Scope, TitledPicture, TitledTable, after_headline
from papers.figures import METHOD_COLORS, legend_below, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def cases(scope: Scope) -> list[Case]:
    """Return a case for every robot and combination."""
    recordings, names, seconds = ({"1/2": 1}, SETS[:1], 60.0) if scope.quick else (RECORDINGS, SETS, TEST_SECONDS)
    return [
        sparsity_errors.case(
            seed=seed, name=name, recordings=recordings, networks=scope.network_seeds, test_seconds=seconds
        )
        for seed in scope.robots
        for name in names
    ]


def report(outcomes: Outcomes) -> Report:
    """Return a table per joint and the paper's picture."""
    seconds = combinations(outcomes)
    tables = []
    for j, (joint, unit) in enumerate(zip(JOINTS, UNITS, strict=True)):
        rows = [
            [
                name.replace("+", " + "),
                f"{time:.0f}",
                *(mean_and_spread(repetitions(outcomes, name, method)[..., j].ravel()) for method in SHOWN),
            ]
            for name, time in seconds.items()
        ]
        tables.append(
            TitledTable(
                f"{joint} [{unit}], RMSE, mean and spread over robots and recordings",
                Table(["sparsity", "time [s]", *SHOWN], rows),
            )
        )
    caption = (
        "RMSE against recording time; shades are the standard deviation over recordings, mean over robots, crosses and "
        "dotted lines the paper's"
    )
    outside = np.mean([result["outside"] for result in outcomes.of(sparsity_errors)])
    remark = f"Test rows outside the models' valid range, where they are asked all the same: {100.0 * outside:.1f} %."
    return Report(tables, [TitledPicture(caption, _picture(outcomes, seconds))], [remark])


def _picture(outcomes: Outcomes, seconds: dict[str, float]) -> "Figure":
    figure, axes = panels(3, 3.6)
    names, times = list(seconds), np.array(list(seconds.values()))
    several = all(repetitions(outcomes, name, OFFSET).shape[1] > 1 for name in names)
    for j, panel in enumerate(axes):
        for method in SHOWN:
            reached = np.array([middle(outcomes, name, method)[j] for name in names])
            panel.plot(times, reached, "o-", color=METHOD_COLORS[method], label=method, ms=3, linewidth=1.2)
            if several:
                spread = np.array([deviation(outcomes, name, method)[j] for name in names])
                panel.fill_between(
                    times, reached - spread, reached + spread, color=METHOD_COLORS[method], alpha=0.2, linewidth=0
                )
        _published(panel, j)
        offset = max(middle(outcomes, name, OFFSET)[j] for name in names)
        panel.set_ylim(0.0, 1.3 * offset)
        panel.set_title(f"{JOINTS[j]} [{UNITS[j]}]", fontsize=10)
        panel.set_xlabel("recording time [s]")
    legend_below(figure, axes[0], columns=4)
    return figure


def _published(panel: Any, joint: int) -> None:
    time = {"1/2": DURATIONS[1 / 2,], "1/2+1/3": DURATIONS[1 / 2, 1 / 3], LONGEST: DURATIONS[1 / 2, 1 / 3, 1 / 4]}
    for name, values in (FIGURE_5_J1, FIGURE_5_J2, FIGURE_5_J3)[joint].items():
        for method, value in values.items():
            color = METHOD_COLORS[method]
            if name in time:
                panel.plot(time[name], value, "x", color=color, ms=7)
            else:
                span = (200.0, SHORT) if name == "short" else (LONG, time[LONGEST])
                panel.hlines(value, *span, color=color, linestyle=":", linewidth=1.2)
    if joint == 1:
        panel.plot(time[LONGEST], FIGURE_5_J2_POLYNOMIAL, "x", color=METHOD_COLORS["polynomial"], ms=7)


EXPERIMENT = Experiment(
    name="calibration-figure-5",
    paper="calibration",
    place="figure 5",
    title="Calibration error by sparsity and recording time",
    about=after_headline(__doc__),
    cases=cases,
    report=report,
    minutes=140.0,
    claims=CLAIMS,
    drawn=2,
)
