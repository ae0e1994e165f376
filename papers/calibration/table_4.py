"""Table IV of the calibration paper: errors of the tool's position over six unloaded hours, beside other methods.

Through forward kinematics, with joints 4 to 7 taken as accurate and a tool that does not bend, as the paper estimates
them; axes are the base's. The cases are table III's: the same models and peers, recordings and robots. The paper's
distance in hour 0 is the root of the sum of its squares in x, y and z, so RMSE is meant; so it is here.

One error is less than another where it is so by more than 5 % and by more than the spread over robots of their ratio.
That margin was added after a first run.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from catenary.arrays import Floats
from catenary.reports.page import Table
from papers.calibration.judging import CLEARLY, less, near
from papers.calibration.peer_hours import PEERS, PROCESS
from papers.calibration.published import TABLE_4_OTHERS, TABLE_4_OURS, TIP_RAW
from papers.calibration.recordings import BEST, NETWORK
from papers.calibration.six_hours import OFFSET, RAW
from papers.calibration.table_3 import COLORS, SHARE, cases, extremes, hours, rows_of_ours
from papers.claims import by_count, mean_and_spread
from papers.experiment import Claim, Experiment, Judgement, Outcomes, Report, TitledPicture, TitledTable, after_headline
from papers.figures import legend_below, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AXES = ("x", "y", "z", "distance")
PENG = ("Peng [12]", "RAVEN-II", "DNN")
RAW_SHARE = 0.25  # of "around 20 mm"


def report(outcomes: Outcomes) -> Report:
    """Return the paper's table, what it quotes beside what was reached here, and the distance hour by hour."""
    rows = [
        [f"{model}, paper", "RAVEN-II", *(f"{a:.3f}–{b:.3f}" for a, b in errors)]
        for model, errors in TABLE_4_OURS.items()
    ]
    rows += [
        [f"{model}, {source}", robot, *("-" if value is None else f"{value:g}" for value in errors)]
        for (source, robot, model), errors in TABLE_4_OTHERS.items()
    ]
    rows += rows_of_ours(outcomes, "tip")
    header = ["method", "robot", *(f"{axis} [mm]" for axis in AXES)]
    return Report(
        [TitledTable("RMSE, least to greatest of hours 0 to 5, ± over robots in hour 5", Table(header, rows))],
        [TitledPicture("RMSE in every hour, mean over robots; bands: the paper's network", _picture(outcomes))],
    )


def _picture(outcomes: Outcomes) -> "Figure":
    figure, axes = panels(4, 3.2, sharey=True)
    for k, panel in enumerate(axes):
        panel.axhspan(*TABLE_4_OURS[NETWORK][k], color=COLORS[NETWORK], alpha=0.12, linewidth=0)
        for method in (OFFSET, "linear", NETWORK, BEST, *PEERS):
            found = hours(outcomes, method, "tip")
            if found.size:
                mean = found.mean(axis=0)[:, k]
                panel.plot(range(len(mean)), mean, "o-", color=COLORS[method], ms=3, label=method)
        panel.set_xlabel("hour")
        panel.set_title(f"{AXES[k]} [mm]", fontsize=10)
    axes[0].set_ylim(bottom=0.0)
    legend_below(figure, axes[0], columns=5)
    return figure


def _range(outcomes: Outcomes, method: str) -> Judgement:
    low, high = (each[:, 3] for each in extremes(hours(outcomes, method, "tip")))
    offset = extremes(hours(outcomes, OFFSET, "tip"))[0][:, 3]
    reached = {"least": low, "greatest": high}
    published = dict(zip(reached, TABLE_4_OURS[method][3], strict=True))
    return near(reached, published, SHARE, direction=[less(high, offset)])


def _in_text(values: Floats) -> str:
    return ", ".join(mean_and_spread(each) for each in values.T)


def _below_process(outcomes: Outcomes, methods: Sequence[str]) -> Judgement:
    process = hours(outcomes, PROCESS, "tip")
    theirs = process[:, 0, :3]
    holds, told = [], []
    for method in methods:
        ours = hours(outcomes, method, "tip")[:, 0, :3]
        holds += list(less(ours, theirs))
        told.append(f"{method} {_in_text(ours)}")
    return by_count(holds, f"{'; '.join(told)} against {_in_text(theirs)} mm")


def _below_peng(outcomes: Outcomes, methods: Sequence[str]) -> Judgement:
    theirs = np.array(TABLE_4_OTHERS[PENG][:3], dtype=float)
    holds, told = [], []
    for method in methods:
        best, _ = extremes(hours(outcomes, method, "tip"))
        holds += list(less(best[:, :3], np.tile(theirs, (len(best), 1))))
        told.append(f"{method} {_in_text(best[:, :3])}")
    return by_count(holds, f"{'; '.join(told)} mm")


def _raw(outcomes: Outcomes) -> Judgement:
    found = hours(outcomes, RAW, "tip")
    first = found[:, 0, 3]
    offset = extremes(hours(outcomes, OFFSET, "tip"))[1][:, 3]
    more = bool(first.mean() > 2.0 * offset.mean())
    return near({"distance": first}, {"distance": TIP_RAW}, RAW_SHARE, direction=[more])


BEGINS = (
    "it begins lower than the paper's, whose own first hour is less accurate than its table I, to which the simulated "
    "robot was fitted; and its y stays far lower in later hours, as joint 2 does (table III)"
)


def _range_claim(method: str, name: str) -> Claim:
    low, high = TABLE_4_OURS[method][3]
    return Claim(
        f"Over six unloaded hours the {name} places the tool within about a millimetre",
        "II-K, table IV",
        f"{low} to {high} mm",
        f"least and greatest hour within {100 * SHARE:.0f} % of the published ends, mean over robots; same direction: "
        f"the greatest less than the fixed offset's least, {CLEARLY}",
        lambda outcomes: _range(outcomes, method),
        why=BEGINS,
        fitted=method == "linear",
    )


CLAIMS = (
    Claim(
        "Without calibration the tool is about 20 mm from where the robot says",
        "II-A, figure 1",
        "around 20 mm",
        f"RMSE of the distance in hour 0 within {100 * RAW_SHARE:.0f} %, mean over robots; same direction: more than "
        "twice that after a fixed offset",
        _raw,
        fitted=True,
    ),
    _range_claim(NETWORK, "network"),
    _range_claim("linear", "linear model"),
    Claim(
        "At once after training network and linear model are more accurate in x, y and z than Gaussian process "
        "regression",
        "II-K, table IV",
        "0.362, 0.301, 0.205 mm and 0.389, 0.351, 0.231 mm at best against 1.4, 1.4, 1.1 mm of [42]",
        f"hour 0, same recordings: less, {CLEARLY}, on all three axes for both; same direction: on more than half of "
        "the six",
        lambda outcomes: _below_process(outcomes, (NETWORK, "linear")),
        why="the paper compares with a number from another recording; on the same one the process, which chooses a "
        "length for every input, is held back less than the paper's network by its fixed penalty. Our network, whose "
        "penalty is chosen on the data, is below it on all three axes",
    ),
    Claim(
        "In their best hour network and linear model are more accurate than the network of Peng [12]",
        "II-K, table IV",
        "0.362, 0.301, 0.205 mm and 0.389, 0.351, 0.231 mm at best against 0.818, 1.078, 0.518 mm of [12]",
        f"the least of six hours less than the published numbers of [12], {CLEARLY}, in x, y and z for both; same "
        "direction: in more than half of the six. That method, which learned from cameras, is not built anew here: a "
        "simulated robot is held against a real one; the linear model's three are implied by what it was fitted to",
        lambda outcomes: _below_peng(outcomes, (NETWORK, "linear")),
        fitted=True,
    ),
)

EXPERIMENT = Experiment(
    name="calibration-table-4",
    paper="calibration",
    place="table IV",
    title="Errors of the tool's position over six hours, beside other methods",
    about=after_headline(__doc__),
    cases=cases,
    report=report,
    minutes=1.0,  # the cases are table III's
    claims=CLAIMS,
)
