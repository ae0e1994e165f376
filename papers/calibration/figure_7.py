"""Figure 7 of the calibration paper: examples of calibrated positions right after calibration, in hour 2 and in hour 5.

The unloaded six hours of figure 6 on the nominal robot; models are trained at sparsity 1/6, networks once. Each section
is a minute and a half from the beginning of its hour. The figure is an example: no claim rests on it.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from catenary.arrays import Floats
from papers.calibration.recordings import LEARNER, NETWORK, fitted, rows_of, unguarded
from papers.calibration.six_hours import DENOMINATORS, HOUR, MODELS, OFFSET, TEST_RATE, fit_options, left_by, recorded
from papers.experiment import NOMINAL, Case, Experiment, Outcomes, Report, Result, Robot, Scope, run
from papers.figures import METHOD_COLORS, panels
from papers.gravity.raven_base import SHOWN
from papers.kit import IN_UNITS, rows, table

HOURS = (0, 2, 5)
SECONDS = 90.0  # of a section
DIGITS = 4  # of positions in deg and mm
TRUTH = "external encoder"


@run(revision=1)
def sections(
    seed: Robot,
    training_set: str,
    models: Sequence[str],
    seconds: float,
    zigzags: Sequence[int] = DENOMINATORS,
    hour_seconds: float = HOUR,
) -> Result:
    """Return true and calibrated positions at the beginning of hours 0, 2 and 5, unloaded.

    Returns:
        By hour, `time` [s] and by name, true positions and those of each model, rows of J1 [deg], J2 [deg], J3 [mm].
    """
    session = recorded(seed, "unloaded", zigzags=zigzags, hour_seconds=hour_seconds)
    training = session.training(training_set)
    fits = {model: fitted(training, fit_options(model, "error")) for model in (OFFSET, *models)}
    content: dict[str, dict[str, list[float] | list[list[float]]]] = {}
    for hour in HOURS:
        log = session.test[hour]
        count = round(seconds * TEST_RATE)
        truth = np.asarray(log.q_encoder)[:count]
        section = {"time": np.asarray(log.time)[:count], TRUTH: SHOWN * truth}
        for name, model in fits.items():
            residual = left_by(model if name == LEARNER else unguarded(model), rows_of(model, log))[:count]
            section[name] = SHOWN * (truth - residual)
        content[str(hour)] = {name: np.round(values, DIGITS).tolist() for name, values in section.items()}
    return content


def cases(scope: Scope) -> list[Case]:
    """Return the nominal robot's case."""
    if scope.quick:
        few = {"training_set": "1/2", "models": ["linear", NETWORK], "seconds": 30.0, "zigzags": [2]}
        return [sections.case(seed=NOMINAL, hour_seconds=60.0, **few)]
    return [sections.case(seed=NOMINAL, training_set="1/6", models=list(MODELS), seconds=SECONDS)]


def report(o: Outcomes) -> Report:
    """Return the sections' errors, their positions as the paper draws them, and what is left of the errors."""
    (result,) = o.of(sections)
    names = [name for name in result["0"] if name not in ("time", TRUTH)]

    def row(name: str) -> list[str]:
        residuals = [_array(result, hour, TRUTH) - _array(result, hour, name) for hour in HOURS]
        return [name, *(f"{value:.3f}" for each in residuals for value in np.sqrt(np.mean(each**2, axis=0)))]

    header = ["model", *(f"hour {hour}, {joint}" for hour in HOURS for joint in IN_UNITS)]
    return Report(
        [table("RMSE of the sections that are drawn", header, rows(row, names))],
        # positions themselves lie on one another
        {"Remaining errors over time, in sections of three hours": _picture(result, names)},
    )


def _array(result: Result, hour: int, name: str) -> Floats:
    return np.array(result[str(hour)][name])


def _picture(result: Result, names: Sequence[str]) -> Any:
    """Draw true less calibrated positions of joints by hours."""
    figure, axes = panels(3, 6.0, rows=3, sharex=True, sharey="row")
    for place, panel in enumerate(axes):
        j, hour = place // 3, HOURS[place % 3]
        time, truth = _array(result, hour, "time"), _array(result, hour, TRUTH)[:, j]
        for name in names:
            residual = truth - _array(result, hour, name)[:, j]
            panel.plot(time, residual, color=METHOD_COLORS[name], linewidth=0.9, label=name)
        panel.axhline(0.0, color="black", linewidth=0.6)
        if j == 0:
            panel.set_title(f"hour {hour}", fontsize=10)
        if place % 3 == 0:
            panel.set_ylabel(IN_UNITS[j])
        if j == 2:
            panel.set_xlabel("time [s]")
    handles = axes[0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=6, frameon=False, fontsize=9)
    return figure


EXPERIMENT = Experiment(
    "calibration-figure-7", "figure 7", "Calibrated positions in hours 0, 2 and 5", __doc__,
    cases, report, minutes=1.0, drawn=0,
)  # fmt: skip
