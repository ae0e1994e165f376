"""Draw docs/images/causes.png: a torque as recorded, as explained, and as the arm asks for without the cause."""

import io
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes

from catenary.arrays import Floats
from catenary.identification.explanations.evidence import Evidence
from catenary.identification.explanations.findings import find_explanation
from catenary.identification.identify_options import IdentifyOptions
from catenary.identification.samples import prepare
from catenary.robots.catalog import load_robot
from known_torques import TRUTHS, Truth, known_torques
from tests.pictures import save
from tests.truth.torques import FINDING

SHOWN = {  # truths, and the joint that is drawn
    "J3 backwards": 2, "J2 10 deg off": 1, "torques of J2 and J3 swapped": 2, "J3 times 1.25": 2,
    "gravity taken out, UR5e": 1, "3 kg on a UR10e": 1, "J2's zero leaps by 15 Nm": 1, "J2's sign turns": 1,
}  # fmt: skip
LINES = (("recorded", "#5b6675"), ("explained", "#1f77b4"), ("without the cause", "#d9822b"))


def torques(truth: Truth, joint: int) -> tuple[Floats, tuple[Floats, ...]]:
    """Return time (N,), and the torque of a joint as recorded, as explained, and without the cause, (N,) each [Nm]."""
    model = load_robot(truth.robot)
    evidence = Evidence(model, prepare(known_torques(truth), model, IdentifyOptions(), within_limits=False))
    found = find_explanation(evidence)
    rows, supposed, fit = evidence.rows, found.supposed, found.fit
    time, beta = rows.samples.time[rows.at], fit.beta
    arm = evidence.columns(supposed)[0] @ beta  # in the arm's own joints
    explained = np.empty_like(arm)
    explained[:, list(supposed.torque_order)] = arm * supposed.gains
    for turned, after in supposed.turned:
        explained[time > after, turned] *= -1.0
    plain = beta[: len(beta) - sum(len(one.sizes) for one in supposed.added)].copy()
    for link in supposed.loads:
        load, which = evidence.belief.load, evidence.over_spreads(supposed)[1]
        body, _ = evidence.body(link, load, fit, which, supposed.loads)
        plain[: evidence.shown] -= (evidence.onto[evidence.belief.own(link)].T @ load @ body)[: evidence.shown]
    without = evidence.columns(evidence.plain)[0] @ plain
    return time, tuple(each[:, joint] for each in (rows.torques(evidence.plain), explained, without))


def panel(axis: Axes, truth: Truth, joint: int) -> None:
    """Draw one cause."""
    time, lines = torques(truth, joint)
    for values, (label, colour) in zip(lines, LINES, strict=True):
        axis.plot(time, values, color=colour, linewidth=2.4 if label == "recorded" else 1.0, label=label)
    axis.set_title(f"{FINDING[str(truth.cause)]}: {truth.name}", fontsize=8)
    axis.tick_params(labelsize=7)


def main() -> None:
    figure, axes = pyplot.subplots(4, 2, figsize=(9.0, 9.0), sharex=True, layout="constrained")
    of = {truth.name: truth for truth in TRUTHS}
    for axis, (name, joint) in zip(axes.flat, SHOWN.items(), strict=True):
        panel(axis, of[name], joint)
    axes.flat[0].legend(fontsize=7)
    figure.supxlabel("time [s]", fontsize=8)
    figure.supylabel("torque of the joint [Nm]", fontsize=8)
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png", dpi=110)
    save(drawn.getvalue(), Path(sys.argv[1]) / "causes.png")


if __name__ == "__main__":
    main()
