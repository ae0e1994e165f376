"""Figure 8 of the calibration paper: 16 inputs or all 138 columns of the robot's state, and a larger network.

The unloaded six hours of figure 6; errors are means over the hours. The paper lists what the 138 columns are, a time
stamp among them: "138" has the robot's period in its place, "138, stamp" the stamp itself, which in every test lies
beyond all training. No model has a guard here, as in the paper. Claims are judged with the stamp. That variant was
added after the linear model without it had turned out to lose little on the nominal robot: both are shown.

Second-order polynomials of 138 inputs have 9729 terms. But the inputs depend on each other: in their principal axes,
those with a singular value above 1e-9 of the largest, a polynomial spans the same functions with far fewer terms,
and least squares there are solved as everywhere (singular values, smallest solution).

The larger network, 600-500-400, takes six minutes of one processor for the longest training set, forty for all
eleven: it is trained once, on the three shortest and the three longest sets, on two robots.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.neural import PAPER_LARGER
from catenary.reports.page import Table
from papers.calibration import published
from papers.calibration.all_inputs import ALL, LARGER, all_inputs, by_set, sizes
from papers.calibration.recordings import JOINTS, NETWORK, SETS, UNITS
from papers.calibration.six_hours import LONGEST, OFFSET, SHORTEST, cases_of
from papers.claims import NOT_MEASURED, by_count, mean_and_spread
from papers.experiment import (
    Case,
    Claim,
    Experiment,
    Judgement,
    Outcomes,
    Report,
    Scope,
    TitledPicture,
    TitledTable,
    after_headline,
)
from papers.figures import METHOD_COLORS, log_scale, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS_SHOWN = {"16": "16", "all": "138", "stamped": "138, stamp"}
GROUPS = ((*SHORTEST, LONGEST[0]), LONGEST[1:])  # of training sets of the larger network, a case each
SHOWN = (NETWORK, LARGER, "linear", "polynomial")
COLORS = METHOD_COLORS | {LARGER: "#7d3cae"}
# criteria
CONSIDERABLE = 1.5  # error of 138 inputs over that of 16; the network's are 2.1, 2.9 and 2.3 in the paper
CLOSE = 0.25  # share of a published error within which ours reproduces it


def cases(scope: Scope) -> list[Case]:
    """Return the unloaded cases of figure 6, the same with 138 inputs, and the polynomial and larger network."""
    few = {"zigzags": [2], "hour_seconds": 60.0} if scope.quick else {}
    groups = (SETS[:1],) if scope.quick else GROUPS
    models = ("linear",) if scope.quick else ("linear", NETWORK)
    variants = ALL[:1] if scope.quick else ALL
    found = cases_of(scope, ("unloaded",))
    for columns in variants:
        found += cases_of(scope, ("unloaded",), models, columns=columns)
    return [
        *found,
        sizes.case(),
        *(
            all_inputs.case(
                seed=seed,
                columns=columns,
                sets=list(sets),
                network=0,
                epochs=2 if scope.quick else PAPER_LARGER.epochs,
                **few,
            )
            for seed in scope.robots
            for columns in variants
            for sets in groups
        ),
    ]


def report(outcomes: Outcomes) -> Report:
    """Return errors by model and inputs, parameters, ranks, and the paper's picture."""
    header = ["model, inputs"]
    for joint, unit in zip(JOINTS, UNITS, strict=True):
        header += [f"{joint} [{unit}]", "3 longest", "paper"]
    rows = []
    for model in SHOWN:
        for columns, inputs in COLUMNS_SHOWN.items():
            found = by_set(outcomes, model, columns)
            if not found:
                continue
            longest = [found[name] for name in LONGEST if name in found]
            cells = [f"{model}, {inputs}"]
            paper = (published.INPUTS_16 if columns == "16" else published.INPUTS_138).get(model)
            for j in range(len(JOINTS)):
                cells.append(mean_and_spread(np.mean([each[:, j] for each in found.values()], axis=0)))
                cells.append(
                    mean_and_spread(np.mean([each[:, j] for each in longest], axis=0)) if longest else "-"
                )
                cells.append("-" if paper is None else f"{paper[j]:.3f}")
            rows.append(cells)
    title = "RMSE, mean of six unloaded hours, over all training sets and over the three longest"
    tables = [TitledTable(title, Table(header, rows))]
    for counted in outcomes.of(sizes):
        tables.append(
            TitledTable(
                "Weights and biases",
                Table(
                    ["network", "here", "paper"],
                    [
                        [name, f"{counted[name]:,}", f"{wanted:,}"]
                        for name, wanted in published.PARAMETERS.items()
                    ],
                ),
            )
        )
    ranks = [
        [f"{COLUMNS_SHOWN[told['columns']]}, {name}", *(str(value) for value in values)]
        for told, result in outcomes.items(all_inputs, seed=None)
        for name, values in result["ranks"].items()
    ]
    tables.append(
        TitledTable(
            "Rank of the 138 inputs, nominal robot, and the polynomial's terms in their principal axes",
            Table(["inputs, training set", "rank", "terms", "rank of the terms"], ranks),
        )
    )
    caption = "RMSE, mean of six unloaded hours; boxes are training sets, each the mean over robots"
    return Report(tables, [TitledPicture(caption, _picture(outcomes))])


def _picture(outcomes: Outcomes) -> "Figure":
    figure, axes = panels(3, 3.6)
    for j, panel in enumerate(axes):
        labels: list[str] = []
        places: list[float] = []
        at = 0.0
        for model in SHOWN:
            for columns, inputs in COLUMNS_SHOWN.items():
                found = by_set(outcomes, model, columns)
                if not found:
                    continue
                panel.boxplot(
                    [[each[:, j].mean() for each in found.values()]],
                    positions=[at],
                    widths=0.6,
                    patch_artist=True,
                    manage_ticks=False,
                    boxprops={"facecolor": COLORS[model], "alpha": 0.6},
                    medianprops={"color": "black"},
                    flierprops={"marker": ".", "markersize": 3},
                )
                labels.append(inputs)
                places.append(at)
                at += 1.0
            at += 0.5
        panel.set_xticks(places, labels, rotation=70, fontsize=8)
        log_scale(panel)
        panel.set_title(f"{JOINTS[j]} [{UNITS[j]}]", fontsize=10)
    handles = [axes[0].plot([], [], color=COLORS[model], linewidth=4)[0] for model in SHOWN]
    figure.legend(handles, SHOWN, loc="outside lower center", ncols=len(SHOWN), frameon=False, fontsize=9)
    return figure


def mean_error(outcomes: Outcomes, model: str, columns: str, sets: Sequence[str]) -> Floats:
    """Return the mean over training sets, hours and robots, (3,); empty where a set is missing."""
    found = by_set(outcomes, model, columns, sets)
    if len(found) < len(sets):
        return np.empty(0)
    averaged: Floats = np.mean([each.mean(axis=0) for each in found.values()], axis=0)
    return averaged


def _in_text(errors: Floats) -> str:
    return ", ".join(f"{joint} {error:.3f}" for joint, error in zip(JOINTS, errors, strict=True))


def _selected(outcomes: Outcomes) -> Judgement:
    parts, told = [], []
    for model, wanted in published.INPUTS_16.items():
        errors = mean_error(outcomes, model, "16", SETS)
        if not len(errors):
            return NOT_MEASURED
        parts += list(np.abs(errors - wanted) <= CLOSE * np.array(wanted))
        told.append(f"{model} {_in_text(errors)}")
    return by_count(parts, "; ".join(told))


def _network_worse(outcomes: Outcomes) -> Judgement:
    few = mean_error(outcomes, NETWORK, "16", LONGEST)
    many = {columns: mean_error(outcomes, NETWORK, columns, LONGEST) for columns in ALL}
    if not all(len(each) for each in (few, *many.values())):
        return NOT_MEASURED
    told = "; ".join(
        f"{COLUMNS_SHOWN[columns]} {_in_text(each / few)} times" for columns, each in many.items()
    )
    return by_count(many["stamped"] >= CONSIDERABLE * few, told)


def _larger_between(outcomes: Outcomes) -> Judgement:
    few = mean_error(outcomes, NETWORK, "16", LONGEST)
    small, larger = (mean_error(outcomes, model, "stamped", LONGEST) for model in (NETWORK, LARGER))
    if not all(len(each) for each in (few, small, larger)):
        return NOT_MEASURED
    told = "; ".join(
        f"{joint} {few[j]:.3f} < {larger[j]:.3f} < {small[j]:.3f}" for j, joint in enumerate(JOINTS)
    )
    return by_count([*(larger < small), *(larger > few)], told)


def _linear_ruined(outcomes: Outcomes) -> Judgement:
    offset = mean_error(outcomes, OFFSET, "16", LONGEST)
    many = {columns: mean_error(outcomes, "linear", columns, LONGEST) for columns in ALL}
    if not all(len(each) for each in (offset, *many.values())):
        return NOT_MEASURED
    told = "; ".join(f"{COLUMNS_SHOWN[columns]} {_in_text(each)}" for columns, each in many.items())
    return by_count(many["stamped"] >= offset, f"fixed offset {_in_text(offset)}; {told}")


def _polynomial_worse(outcomes: Outcomes) -> Judgement:
    linear, polynomial = (
        mean_error(outcomes, model, "stamped", LONGEST) for model in ("linear", "polynomial")
    )
    if not len(linear) or not len(polynomial):
        return NOT_MEASURED
    return by_count(polynomial > linear, f"polynomial {_in_text(polynomial)}; linear {_in_text(linear)}")


def _counted(outcomes: Outcomes) -> Judgement:
    counted = outcomes.of(sizes)
    if not counted:
        return NOT_MEASURED
    told = ", ".join(f"{name} {counted[0][name]:,}" for name in published.PARAMETERS)
    return by_count([counted[0][name] == wanted for name, wanted in published.PARAMETERS.items()], told)


_CLEAN = (
    "the simulated state has as many columns but not as many measurements: 138 have the rank told in the table, the "
    "other arm is parked, and nothing but the time stamp moves on by itself; rows without it and with it tell its part"
)

CLAIMS = (
    Claim(
        "Networks have 12,103, 24,303 and 585,503 parameters",
        "II-H",
        "12,103, 24,303, 585,503",
        "equal",
        _counted,
    ),
    Claim(
        "16 inputs: accurate on average over six hours, from short training to long",
        "II-H",
        "network 0.328, 0.264, 0.167; linear 0.361, 0.355, 0.167 (deg, deg, mm)",
        f"within {100.0 * CLOSE:.0f} % for both models on all joints; same direction: more than half are",
        _selected,
    ),
    Claim(
        "138 inputs: the network of 100-100 loses considerably",
        "II-H",
        "0.700 deg, 0.754 deg, 0.388 mm after the three longest",
        f"at least {CONSIDERABLE} times the error of 16 inputs on every joint, with the time stamp, which the paper's "
        "list has; same direction: on two",
        _network_worse,
        _CLEAN,
    ),
    Claim(
        "The larger network is better than the small one with 138 inputs, but worse than the small one with 16",
        "II-H",
        "0.397 deg, 0.565 deg, 0.229 mm",
        "on every joint, three longest training sets, with the time stamp; same direction: more than half of the six",
        _larger_between,
        _CLEAN,
    ),
    Claim(
        "138 inputs ruin the linear model: it does not outperform the fixed offset",
        "II-H",
        "1.985 deg, 1.834 deg, 1.352 mm",
        "error at least that of the fixed offset on every joint, three longest training sets, with the time stamp",
        _linear_ruined,
        _CLEAN,
    ),
    Claim(
        "138 inputs: the polynomial is worse than the linear model",
        "II-H",
        "no numbers",
        "on every joint, three longest training sets, with the time stamp; same direction: on two",
        _polynomial_worse,
    ),
)

EXPERIMENT = Experiment(
    name="calibration-figure-8",
    paper="calibration",
    place="figure 8",
    title="16 inputs or all 138",
    about=after_headline(__doc__),
    cases=cases,
    report=report,
    minutes=220.0,
    claims=CLAIMS,
    drawn=1,
)
