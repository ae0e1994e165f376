"""Accuracy at once, accuracy after six hours, and the time of one correction, of every method in one picture.

The accuracy is that of table III: every method learns from the same 17 minutes of zig-zags of the same simulated robots
and is tested on the same six unloaded hours. The time is the processor's for one correction, as a servo loop at 1 kHz
would ask for it (latency.py says how each is run): it depends on the machine, and on how a method is written.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from catenary.arrays import Floats
from papers.beyond.latency import latencies
from papers.calibration import tables_3_and_4
from papers.calibration.peer_hours import PEERS
from papers.calibration.published import TABLE_3_OURS
from papers.calibration.recordings import BEST, NETWORK
from papers.calibration.six_hours import OFFSET
from papers.experiment import Case, Experiment, Outcomes, Report, Scope, TitledPicture
from papers.figures import legend_below, panels
from papers.kit import IN_UNITS, JOINTS, UNITS, cells, rows, table

METHODS = (OFFSET, "linear", "polynomial", NETWORK, BEST, *PEERS)
SERVO = 1000.0  # [us] of a loop's period
PUBLISHED = {NETWORK: 61e3, "linear": 380.0}  # [us] of an inference, table V


def cases(scope: Scope) -> list[Case]:
    """Return table III's cases, and the one that times every method."""
    timed = latencies.case(sparsity=1 / 2, seconds=4.0, every=20 if scope.quick else 1)
    return [*tables_3_and_4.cases(scope), timed]


def microseconds(o: Outcomes) -> dict[str, float]:
    """Return how long one correction of each method takes [us]."""
    return {name: value for result in o.of(latencies) for name, value in result.items()}


def present(o: Outcomes) -> list[str]:
    """Return the methods that have errors and times."""
    timed = microseconds(o)
    return [name for name in METHODS if name in timed and tables_3_and_4.hours(o, name).size]


def left(o: Outcomes, method: str) -> Floats:
    """Return what a method leaves of the fixed offset's error in hours 0 and 5 [%]: geometric mean over joints, (2,).

    Of the fixed offset in hour 0, both.
    """
    ends = tables_3_and_4.hours(o, method).mean(axis=0)[[0, -1]]
    offset = tables_3_and_4.hours(o, OFFSET).mean(axis=0)[0]
    shares: Floats = 100.0 * np.exp(np.mean(np.log(ends / offset), axis=1))
    return shares


def report(o: Outcomes) -> Report:
    """Return the table, the picture, and the sentence."""
    timed = microseconds(o)

    def row(name: str) -> list[str]:
        found, share = tables_3_and_4.hours(o, name), left(o, name)
        lost = cells(found[:, -1] - found[:, 0])
        return [name, *cells(found[:, 0]), *lost, f"{share[0]:.0f}, {share[1]:.0f}", f"{timed[name]:.1f}"]

    lost = [f"{joint} lost [{unit}]" for joint, unit in zip(JOINTS, UNITS, strict=True)]
    header = ["method", *IN_UNITS, *lost, "hours 0, 5 [% of offset]", "time [us]"]
    title = "RMSE in hour 0, what is lost until hour 5, both as a share of the fixed offset's in hour 0; one correction"
    caption = (
        "RMSE over the time of one correction: from hour 0 (dot) to hour 5 (arrow), mean over robots; dashed: a loop "
        "at 1 kHz; squares: the paper's network and linear model"
    )
    names = present(o)
    if not names:
        return Report()
    said = sentence({name: (*left(o, name), timed[name]) for name in names})
    return Report([table(title, header, rows(row, names))], [TitledPicture(caption, _picture(o))], [said])


def sentence(found: dict[str, Sequence[float]]) -> str:
    """Return what the numbers say in a sentence: by method, what is left in hours 0 and 5 [%] and the time [us]."""
    learned = {name: values for name, values in found.items() if name != OFFSET}
    first, last = (min(learned, key=lambda name, k=k: learned[name][k]) for k in (0, 1))  # type: ignore[misc]
    lost = [values[1] - values[0] for values in learned.values()]
    fast = [name for name, values in learned.items() if values[2] < SERVO]
    apart = [learned["linear"][k] - learned[best][k] for k, best in enumerate((first, last))]
    return (
        f"Right after calibration the {first} is best, with {learned[first][0]:.0f} % of the fixed offset's error left "
        f"and {learned[first][2]:.1f} us a correction; six hours later the {last}, with {learned[last][1]:.0f} % and "
        f"{learned[last][2]:.1f} us. The hours cost the methods {min(lost):.0f} to {max(lost):.0f} points; the linear "
        f"model lies {apart[0]:.0f} points behind the best at once and {apart[1]:.0f} after them. {len(fast)} of "
        f"{len(learned)} fit into a servo loop at 1 kHz."
    )


def _picture(o: Outcomes) -> Any:
    figure, axes = panels(3, 4.0)
    timed = microseconds(o)
    for j, panel in enumerate(axes):
        for name in present(o):
            mean = tables_3_and_4.hours(o, name).mean(axis=0)[[0, -1], j]
            color = tables_3_and_4.COLORS[name]
            panel.plot(timed[name], mean[0], "o", color=color, ms=5, label=name)
            arrow = {"arrowstyle": "->", "color": color, "lw": 1.5}
            panel.annotate("", (timed[name], mean[1]), (timed[name], mean[0]), arrowprops=arrow)
        for name, took in PUBLISHED.items():
            (low, high), color = TABLE_3_OURS[name][j], tables_3_and_4.COLORS[name]
            panel.plot(took, low, "s", mfc="none", color=color, ms=5)
            panel.annotate("", (took, high), (took, low), arrowprops={"arrowstyle": "->", "color": color})
        panel.axvline(SERVO, color="#8a94a3", ls="--", lw=0.8)
        panel.set_xscale("log")
        ends = [tables_3_and_4.hours(o, name).mean(axis=0)[:, j].max() for name in present(o)]
        panel.set_ylim(0.0, 1.08 * max(ends))
        panel.set_xlabel("one correction [us]")
        panel.set_title(f"{IN_UNITS[j]}", fontsize=10)
    legend_below(figure, axes[0], columns=5)
    return figure


# beside table III's cases
EXPERIMENT = Experiment(
    "beyond-accuracy-latency-drift", "beyond tables III and V", "Accuracy, latency and drift of every method", __doc__,
    cases, report, minutes=2.0,
)  # fmt: skip
