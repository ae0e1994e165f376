"""Memory in the wrist of a real arm: fixed offset, network, recurrent network, and play states.

Joints 4 to 6 of a dVRK PSM hang on long cables through the instrument; where they stand depends on where they came
from. Four recordings (Hwang et al., RA-L 2020), each model trained on the first 80 % and tested on the rest, five
trainings each. The network is the calibration paper's, which knows the present command only; the recurrent one knows
four more; play states (Prandtl-Ishlinskii) remember the last turn of each joint, however long ago it was. The cases
are those of calibration-dvrk.
"""

from typing import Any

from catenary.arrays import Floats
from papers.calibration import dvrk
from papers.calibration.dvrk import JOINTS, RECURRENT, errors
from papers.experiment import Case, Experiment, Outcomes, Report, Scope, TitledPicture
from papers.figures import legend_below, panels
from papers.kit import by_robot, cells, table

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
    told = [(case, case.arguments) for case in dvrk.cases(scope)]
    return [case for case, each in told if each.get("kind") in KINDS or each.get("peer") == RECURRENT]


def on_wrist(o: Outcomes) -> dict[str, dict[str, Floats]]:
    """Return by recording and model shown the errors of J4 to J6, (trainings, 3) [deg]."""
    found = {recording: errors(o, recording) for recording in dvrk.RECORDINGS}
    return {
        recording: {name: by_robot(each[name][:, WRIST]) for name in SHOWN if name in each}
        for recording, each in found.items()
        if each
    }


def shares(o: Outcomes) -> dict[str, Floats]:
    """Return what each model leaves of the fixed offset's error on the wrist, (recordings, 3), mean over trainings."""
    found: dict[str, list[Floats]] = {}
    for of_all in on_wrist(o).values():
        for name, values in of_all.items() if OFFSET in of_all else ():
            found.setdefault(name, []).append(values.mean(axis=0) / of_all[OFFSET].mean(axis=0))
    return {name: by_robot(each) for name, each in found.items()}


def report(o: Outcomes) -> Report:
    """Return errors by recording, what is left of the fixed offset's over all, and the sentence."""
    names, left = [JOINTS[j] for j in WRIST], shares(o)
    content = [
        [f"{recording}, {SHOWN[name]}", *cells(values, 2)]
        for recording, of_all in on_wrist(o).items()
        for name, values in of_all.items()
    ]
    summary = [[SHOWN[name], *cells(100.0 * values, 0)] for name, values in left.items()]
    caption = "RMSE of the wrist by recording; lines: least to greatest training"
    return Report(
        [
            table("RMSE [deg], mean and spread over trainings", ["recording, model", *names], content),
            table("RMSE [% of the fixed offset's], mean and spread over recordings", ["model", *names], summary),
        ],
        [TitledPicture(caption, _picture(o))],
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


def _picture(o: Outcomes) -> Any:
    figure, axes = panels(3, 3.4)
    found = on_wrist(o)
    labels = [name.removesuffix("_train").replace("_", "\n") for name in found]
    for k, panel in enumerate(axes):
        for m, (name, told) in enumerate(SHOWN.items()):
            for r, of_all in enumerate(found.values()):
                if name in of_all:
                    values, at = of_all[name][:, k], r + 0.16 * (m - 2)
                    panel.bar(at, values.mean(), 0.15, color=COLORS[name], label=told if r == 0 else None)
                    panel.vlines(at, values.min(), values.max(), color="#1c2430", lw=0.8)
        panel.set_xticks(range(len(labels)), labels, fontsize=8)
        panel.set_title(f"{JOINTS[WRIST[k]]} [deg]", fontsize=10)
    legend_below(figure, axes[0], columns=5)
    return figure


EXPERIMENT = Experiment(
    "beyond-wrist-memory", "beyond II-K", "Wrist memory on a real arm", __doc__,
    cases, report, minutes=1.0, drawn=0, simulated=False, needs_data=True,  # the cases are calibration-dvrk's
)  # fmt: skip
