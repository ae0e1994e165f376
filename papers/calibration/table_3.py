"""Table III of the calibration paper: joint errors over six unloaded hours beside a Kalman filter and other networks.

The paper quotes what others published of other robots. Here the others are built anew (peers/), learn from the same
zig-zags, 1/2 + 1/3 + 1/4, of the same robots, and are tested on the same motions: an unscented Kalman filter of
elastic joints that knows nominal links and motors' inertia and identifies stiffness, friction and fixed offset; and
120 LSTM units over five commands. Network and linear model are those of figure 6, without a guard, as the paper's are.

The filter is shown twice: with the stiffness that it identifies, and with the one that the simulated robot really has.
Gaussian process and two-phase calibration, which the paper has in table IV and in its introduction, stand here, too.

One error is less than another where it is so by more than 5 % and by more than the spread over robots of their ratio.
That margin was added after a first run.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from catenary.arrays import Floats
from catenary.reports.page import Table
from papers.calibration.judging import CLEARLY, by_joint, less, near
from papers.calibration.peer_hours import PEERS, RECURRENT, UKF, UKF_TOLD, peer_cases, peer_errors, peer_hours
from papers.calibration.peers.elastic_joints import SOFTEST, STIFFEST
from papers.calibration.published import TABLE_3_OTHERS, TABLE_3_OURS
from papers.calibration.recordings import BEST, JOINTS, NETWORK, SETS, UNITS
from papers.calibration.six_hours import MODELS, OFFSET, RAW, cases_of, measured
from papers.claims import by_count
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
from papers.figures import METHOD_COLORS, legend_below, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OURS = (RAW, OFFSET, "linear", NETWORK, BEST)
SIMULATED = "simulated RAVEN-II"
PEER_COLORS = {
    UKF: "#8455a8",
    UKF_TOLD: "#c3a6d8",
    RECURRENT: "#b0413e",
    "Gaussian process": "#7a5c12",
    "two-phase": "#7fa3cf",
}
COLORS = METHOD_COLORS | PEER_COLORS
SHARE = 0.3  # of the published ends that counts as reproduced


def cases(scope: Scope) -> list[Case]:
    """Return figure 6's unloaded cases that hold the training set, and the peers'."""
    ours = cases_of(scope, ("unloaded",), MODELS)
    return [*(case for case in ours if _training(case.arguments["sets"])), *peer_cases(scope)]


def _training(sets: Sequence[str]) -> bool:
    return SETS[-1] in sets or list(sets) == [SETS[0]]


def hours(outcomes: Outcomes, method: str, kind: str = "errors") -> Floats:
    """Return what was measured of a method of ours or a peer after the one training set, (robots, hours, numbers)."""
    if method in PEERS:
        return peer_errors(outcomes, method, kind)
    for name in (SETS[-1], SETS[0]):
        # ours has a guard, and is only right with it
        found = measured(outcomes, "unloaded", method, (name,), kind=kind)
        if found.size:
            return found[:, 0]
    return np.empty((0, 6, 0))


def ends(outcomes: Outcomes, method: str, kind: str = "errors") -> tuple[Floats, Floats]:
    """Return the least and the greatest of six hours, each the mean over robots, (numbers,)."""
    low, high = extremes(hours(outcomes, method, kind))
    return low.mean(axis=0), high.mean(axis=0)


def extremes(found: Floats) -> tuple[Floats, Floats]:
    """Return errors in the hour in which their mean over robots is the least, and the greatest, (robots, numbers)."""
    mean, numbers = found.mean(axis=0), range(found.shape[2])
    return found[:, mean.argmin(axis=0), numbers], found[:, mean.argmax(axis=0), numbers]


def rows_of_ours(outcomes: Outcomes, kind: str) -> list[list[str]]:
    """Return a row for every method that was run here: least to greatest hour, and the spread over robots in hour 5."""
    rows = []
    for method in (*OURS, *PEERS):
        found = hours(outcomes, method, kind)
        if not found.size:
            continue
        low, high = ends(outcomes, method, kind)
        last = found[:, -1]
        spread = [""] * len(low) if len(last) < 2 else [f" ± {s:.3f}" for s in last.std(axis=0, ddof=1)]
        rows.append(
            [f"{method}, here", SIMULATED] + [f"{a:.3f}–{b:.3f}{s}" for a, b, s in zip(low, high, spread, strict=True)]
        )
    return rows


def report(outcomes: Outcomes) -> Report:
    """Return the paper's table, what it quotes beside what was reached here, and the errors hour by hour."""
    rows = [
        [f"{model}, paper", "RAVEN-II", *(f"{a:.3f}–{b:.3f}" for a, b in errors)]
        for model, errors in TABLE_3_OURS.items()
    ]
    rows += [
        [f"{model}, {source}", robot, *(f"{value:.3f}" for value in errors)]
        for (source, robot, model), errors in TABLE_3_OTHERS.items()
    ]
    rows += rows_of_ours(outcomes, "errors")
    header = ["method", "robot", *(f"{j} [{u}]" for j, u in zip(JOINTS, UNITS, strict=True))]
    return Report(
        [TitledTable("RMSE, least to greatest of hours 0 to 5, ± over robots in hour 5", Table(header, rows))],
        [
            TitledPicture(
                "RMSE in every hour, mean over robots; bands: the paper's network; dotted: the published filter",
                _picture(outcomes),
            )
        ],
        _remarks(outcomes),
    )


def _remarks(outcomes: Outcomes) -> list[str]:
    found = np.array([result["identified"]["stiffness"] for result in outcomes.of(peer_hours)])
    if not found.size:
        return []
    told = ", ".join(f"{value:.0f}" for value in found.mean(axis=0))
    softest, stiffest = (
        ", ".join(f"{value:.0f}" for value in np.mean(np.isclose(found, end, rtol=1e-2), axis=0) * len(found))
        for end in (SOFTEST, STIFFEST)
    )
    return [
        f"The filter identifies {told} Nm/rad, Nm/rad, N/m in the mean of {len(found)} robots; on {softest} of them "
        f"joints 1, 2 and 3 end at the softest cable that it may choose, on {stiffest} at the stiffest. A soft cable "
        "stands in for what its model lacks, such as wrong ratios. With the robots' own stiffness it corrects what "
        "stretch there is, and no more."
    ]


def _picture(outcomes: Outcomes) -> "Figure":
    figure, axes = panels(3, 3.4)
    for j, panel in enumerate(axes):
        low, high = TABLE_3_OURS[NETWORK][j]
        panel.axhspan(low, high, color=COLORS[NETWORK], alpha=0.12, linewidth=0)
        for method in (OFFSET, "linear", NETWORK, BEST, *PEERS):
            found = hours(outcomes, method)
            if found.size:
                panel.plot(
                    range(found.shape[1]), found.mean(axis=0)[:, j], "o-", color=COLORS[method], ms=3, label=method
                )
        panel.axhline(TABLE_3_OTHERS["Haghighipanah [13]", "RAVEN-II", "UKF"][j], color=COLORS[UKF], ls=":")
        panel.set_ylim(bottom=0.0)
        panel.set_xlabel("hour")
        panel.set_title(f"{JOINTS[j]} [{UNITS[j]}]", fontsize=10)
    legend_below(figure, axes[0], columns=5)
    return figure


def _below_filter(outcomes: Outcomes, method: str) -> Judgement:
    (_, worst), (best, _), (known, _) = (extremes(hours(outcomes, each)) for each in (method, UKF, UKF_TOLD))
    told = f"worst hour, filter's best, its best with the true stiffness: {by_joint(worst, best, known)}"
    return by_count(less(worst, best), told)


def _range(outcomes: Outcomes, method: str) -> Judgement:
    low, high = extremes(hours(outcomes, method))
    offset, _ = extremes(hours(outcomes, OFFSET))
    reached, published = {}, {}
    for j, joint in enumerate(JOINTS):
        for end, values, place in (("least", low, 0), ("greatest", high, 1)):
            reached[f"{joint} {end}"] = values[:, j]
            published[f"{joint} {end}"] = TABLE_3_OURS[method][j][place]
    return near(reached, published, SHARE, direction=less(high, offset))


# where the numbers go beyond the share, by the tables of this experiment and of table I
BEYOND = {
    NETWORK: "on joint 2 the network begins better than the paper's, and on joint 3 worse: as far as table I has it. "
    "What six hours add is close to the paper's",
    "linear": "on joint 2 the paper's hour 0 is worse than its own table I, to which the simulated robot was fitted: "
    "the linear model begins lower there",
}


def _claims(method: str, name: str) -> tuple[Claim, Claim]:
    published = "; ".join(f"{a} to {b} {unit}" for (a, b), unit in zip(TABLE_3_OURS[method], UNITS, strict=True))
    return (
        Claim(
            f"Over six unloaded hours the {name}'s errors stay in the range of table III",
            "II-K, table III",
            published,
            f"least and greatest hour within {100 * SHARE:.0f} % of the published ends on all joints, mean over "
            f"robots; same direction: the greatest less than the fixed offset's least on every joint, {CLEARLY}",
            lambda outcomes: _range(outcomes, method),
            why=BEYOND[method],
            fitted=method == "linear",
        ),
        Claim(
            f"In every hour the {name} is more accurate than an unscented Kalman filter",
            "II-K, table III",
            f"{published}, against 1.195 deg, 1.242 deg, 0.927 mm of [13]",
            f"the worst hour less than the filter's best, {CLEARLY}, on all three joints, same recordings; same "
            "direction: on two",
            lambda outcomes: _below_filter(outcomes, method),
            why="on joint 1 the worst hour is drift, which the filter has as well, and its best hour has none. Its "
            "cable there comes out several times softer than the real one (the remark below the table): its stretch "
            "under gravity stands in for wrong ratios, whose error the filter keeps when told the true stiffness",
        ),
    )


EXPERIMENT = Experiment(
    name="calibration-table-3",
    paper="calibration",
    place="table III",
    title="Joint errors over six hours beside a Kalman filter and a recurrent network",
    about=after_headline(__doc__),
    cases=cases,
    report=report,
    minutes=40.0,  # beside figure 6's cases
    claims=(*_claims(NETWORK, "network"), *_claims("linear", "linear model")),
)
