"""Memory in the wrist of a real arm: fixed offset, network, recurrent network, and play states.

Joints 4 to 6 of a dVRK PSM hang on long cables through the instrument; where they stand depends on where they came
from. Four recordings (Hwang et al., RA-L 2020), each model trained on the first 80 % and tested on the rest, five
trainings each. The network is the calibration paper's, which knows the present command only; the recurrent one knows
four more; play states (Prandtl-Ishlinskii) remember the last turn of each joint, however long ago it was. The cases
are those of calibration-dvrk.
"""

from typing import TYPE_CHECKING

import numpy as np

from catenary.arrays import Floats
from catenary.reports.page import Table
from papers.calibration import dvrk
from papers.calibration.dvrk import JOINTS, RECURRENT, errors
from papers.claims import mean_and_spread
from papers.experiment import Case, Experiment, Outcomes, Report, Scope, TitledPicture, TitledTable, after_headline
from papers.figures import legend_below, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WRIST = (3, 4, 5)
OFFSET, NETWORK, LINEAR_PLAY, BEST = "fixed offset", "neural, paper", "linear, play", "neural, best"
# as they stand in dvrk's results; and what they are called here
SHOWN = {
    OFFSET: "fixed offset",
    NETWORK: "network, no memory",
    RECURRENT: "recurrent, 4 commands",
    LINEAR_PLAY: "linear, play states",
    BEST: "network of ours, play states",
}
COLORS = dict(zip(SHOWN, ("#8a94a3", "#d9622b", "#b0413e", "#7fa3cf", "#2f8f6b"), strict=True))
KINDS = ("linear", NETWORK, BEST)


def cases(scope: Scope) -> list[Case]:
    """Return those cases of calibration-dvrk that hold the models shown."""
    return [
        case
        for case in dvrk.cases(scope)
        if case.arguments.get("kind") in KINDS or case.arguments.get("peer") == RECURRENT
    ]


def shares(outcomes: Outcomes) -> dict[str, Floats]:
    """Return what each model leaves of the fixed offset's error on the wrist, (recordings, 3), mean over trainings."""
    found: dict[str, list[Floats]] = {}
    for recording in dvrk.RECORDINGS:
        of_all = errors(outcomes, recording)
        for name in SHOWN:
            if name in of_all and OFFSET in of_all:
                share = of_all[name].mean(axis=0) / of_all[OFFSET].mean(axis=0)
                found.setdefault(name, []).append(share[list(WRIST)])
    return {name: np.array(rows) for name, rows in found.items()}


def report(outcomes: Outcomes) -> Report:
    """Return errors by recording, what is left of the fixed offset's over all, and the sentence."""
    rows = []
    for recording in dvrk.RECORDINGS:
        of_all = errors(outcomes, recording)
        rows += [
            [f"{recording}, {told}", *(mean_and_spread(of_all[name][:, j], 2) for j in WRIST)]
            for name, told in SHOWN.items()
            if name in of_all
        ]
    if not rows:
        return Report()
    names = [JOINTS[j] for j in WRIST]
    left = shares(outcomes)
    summary = [
        [SHOWN[name], *(mean_and_spread(100.0 * values[:, k], 0) for k in range(3))] for name, values in left.items()
    ]
    return Report(
        [
            TitledTable("RMSE [deg], mean and spread over trainings", Table(["recording, model", *names], rows)),
            TitledTable(
                "RMSE [% of the fixed offset's], mean and spread over recordings", Table(["model", *names], summary)
            ),
        ],
        [TitledPicture("RMSE of the wrist by recording; lines: least to greatest training", _picture(outcomes))],
        [sentence(left)],
    )


def sentence(left: dict[str, Floats]) -> str:
    """Return what the numbers say: shares of the fixed offset's error (recordings, 3) by model."""
    told = [
        f"the {SHOWN[name]} {100.0 * values.mean():.0f} % ({100.0 * values.min():.0f} to {100.0 * values.max():.0f})"
        for name, values in left.items()
        if name != OFFSET
    ]
    count = len(left[OFFSET])
    return (
        f"Of the fixed offset's error on the wrist of a real dVRK arm, over three joints and {count} "
        f"recording{'s' if count > 1 else ''}, there remain after " + ", after ".join(told) + "."
    )


def _picture(outcomes: Outcomes) -> "Figure":
    figure, axes = panels(3, 3.4)
    present = [name for name in dvrk.RECORDINGS if errors(outcomes, name)]
    for k, panel in enumerate(axes):
        for m, (name, told) in enumerate(SHOWN.items()):
            for r, recording in enumerate(present):
                of_all = errors(outcomes, recording)
                if name not in of_all:
                    continue
                values = of_all[name][:, WRIST[k]]
                at = r + 0.16 * (m - 2)
                panel.bar(at, values.mean(), 0.15, color=COLORS[name], label=told if r == 0 else None)
                panel.vlines(at, values.min(), values.max(), color="#1c2430", lw=0.8)
        labels = [name.removesuffix("_train").replace("_", "\n") for name in present]
        panel.set_xticks(range(len(present)), labels, fontsize=8)
        panel.set_title(f"{JOINTS[WRIST[k]]} [deg]", fontsize=10)
    legend_below(figure, axes[0], columns=5)
    return figure


EXPERIMENT = Experiment(
    name="beyond-wrist-memory",
    paper="beyond",
    place="beyond II-K",
    title="Wrist memory on a real arm",
    about=after_headline(__doc__),
    cases=cases,
    report=report,
    minutes=1.0,  # the cases are calibration-dvrk's
    drawn=0,
    simulated=False,
    needs_data=True,
)
