"""Table III of the calibration paper: joint errors over six unloaded hours beside a Kalman filter and other networks.

The paper quotes what others published of other robots. Here the others are built anew (peers/), learn from the same
zig-zags, 1/2 + 1/3 + 1/4, of the same robots, and are tested on the same motions: an unscented Kalman filter of
elastic joints that knows nominal links and motors' inertia and identifies stiffness, friction and fixed offset; and
120 LSTM units over five commands. Network and linear model are those of figure 6, without a guard, as the paper's are.

The filter is shown twice: with the stiffness that it identifies, and with the one that the simulated robot really has.
Gaussian process and two-phase calibration, which the paper has in table IV and in its introduction, stand here, too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from catenary.arrays import Floats
from papers.calibration.judging import by_joint, less, near
from papers.calibration.peer_hours import PEERS, PROCESS, UKF, UKF_TOLD, peer_cases, peer_errors, peer_hours
from papers.calibration.peers.elastic_joints import SOFTEST, STIFFEST
from papers.calibration.published import TABLE_3_OTHERS, TABLE_3_OURS, TABLE_4_OTHERS, TABLE_4_OURS, TIP_RAW
from papers.calibration.recordings import LEARNER, NETWORK, SETS
from papers.calibration.six_hours import DRAWN, OFFSET, RAW, cases_of, measured
from papers.experiment import CLEARLY, Case, Experiment, Judgement, Outcomes, Report, Scope, TitledTable
from papers.figures import METHOD_COLORS, legend_below, panels
from papers.kit import IN_UNITS, JOINTS, UNITS, by_count, by_robot, cells, table
from papers.plant.targets import fitted_to

OF_TABLE_4 = """Table IV of the calibration paper: errors of the tool's position over six unloaded hours, beside others.

Through forward kinematics, with joints 4 to 7 taken as accurate and a tool that does not bend, as the paper estimates
them; axes are the base's. The cases are table III's: the same models and peers, recordings and robots. The paper's
distance in hour 0 is the root of the sum of its squares in x, y and z, so RMSE is meant; so it is here.
"""
OURS = (RAW, OFFSET, "linear", NETWORK, LEARNER)
PICTURED = (*OURS[1:], *PEERS)
COLORS = METHOD_COLORS | dict(zip(PEERS, ("#8455a8", "#c3a6d8", "#b0413e", "#7a5c12", "#7fa3cf"), strict=True))
CALLED = {NETWORK: "network", "linear": "linear model"}
TITLE = "RMSE, least to greatest of hours 0 to 5, ± over robots in hour 5"
AXES = ("x [mm]", "y [mm]", "z [mm]", "distance [mm]")
PENG = ("Peng [12]", "RAVEN-II", "DNN")
SHARE = 0.3  # of the published ends that counts as reproduced
RAW_SHARE = 0.25  # of "around 20 mm"


def cases(scope: Scope) -> list[Case]:
    """Return figure 6's unloaded cases, those of further robots on the training set alone, and the peers'."""
    of_figure_6, further = (
        replace(scope, robots=part) for part in (scope.robots[: 1 + DRAWN], scope.robots[1 + DRAWN :])
    )
    ours = [*cases_of(of_figure_6, ("unloaded",)), *cases_of(further, ("unloaded",), sets=SETS[-1:])]
    return [*ours, *peer_cases(scope)]


def hours(o: Outcomes, method: str, kind: str = "errors") -> Floats:
    """Return what was measured of a method of ours or a peer after the one training set, (robots, hours, numbers)."""
    if method in PEERS:
        return peer_errors(o, method, kind)
    for name in (SETS[-1], SETS[0]):
        # ours has a guard, and is only right with it
        errors = measured(o, "unloaded", method, (name,), kind=kind)
        if errors.size:
            return by_robot(errors[:, 0])
    return np.empty((0, 6, 0))


def extremes(errors: Floats) -> tuple[Floats, Floats]:
    """Return errors in the hour in which their mean over robots is the least, and the greatest, (robots, numbers)."""
    mean, numbers = errors.mean(axis=0), range(errors.shape[2])
    return errors[:, mean.argmin(axis=0), numbers], errors[:, mean.argmax(axis=0), numbers]


def _table(
    o: Outcomes, kind: str, ours: Mapping[str, Any], others: Mapping[Any, Any], columns: Sequence[str]
) -> TitledTable:
    """Return the paper's table and what was reached here: least to greatest hour, spread over robots in hour 5."""
    content = [[f"{model}, paper", "RAVEN-II", *(f"{a:.3f}–{b:.3f}" for a, b in each)] for model, each in ours.items()]
    form = ".3f" if kind == "errors" else "g"
    content += [
        [f"{model}, {source}", robot, *("-" if value is None else f"{value:{form}}" for value in each)]
        for (source, robot, model), each in others.items()
    ]
    for method in (*OURS, *PEERS):
        errors = hours(o, method, kind)
        if errors.size:
            low, high = (each.mean(axis=0) for each in extremes(errors))
            last = errors[:, -1]
            spread = [""] * len(low) if len(last) < 2 else [f" ± {each:.3f}" for each in last.std(axis=0, ddof=1)]
            reached = [f"{a:.3f}–{b:.3f}{s}" for a, b, s in zip(low, high, spread, strict=True)]
            content.append([f"{method}, here", "simulated RAVEN-II", *reached])
    return table(TITLE, ["method", "robot", *columns], content)


def _picture(o: Outcomes, kind: str, ours: Mapping[str, Any], titles: Sequence[str]) -> Any:
    """Draw a panel for every number, every method by hour, and the range of the paper's network."""
    joints = kind == "errors"
    figure, axes = panels(len(titles), 3.4, sharey=False) if joints else panels(len(titles), 3.2, sharey=True)
    for k, (panel, title) in enumerate(zip(axes, titles, strict=True)):
        panel.axhspan(*ours[NETWORK][k], color=COLORS[NETWORK], alpha=0.12, linewidth=0)
        for method in PICTURED:
            errors = hours(o, method, kind)
            if errors.size:
                mean = errors.mean(axis=0)[:, k]
                panel.plot(range(len(mean)), mean, "o-", color=COLORS[method], ms=3, label=method)
        if joints:
            panel.axhline(TABLE_3_OTHERS["Haghighipanah [13]", "RAVEN-II", "UKF"][k], color=COLORS[UKF], ls=":")
            panel.set_ylim(bottom=0.0)
        panel.set_xlabel("hour")
        panel.set_title(title, fontsize=10)
    axes[0].set_ylim(bottom=0.0)
    legend_below(figure, axes[0], columns=5)
    return figure


def report_3(o: Outcomes) -> Report:
    """Return the paper's table, what it quotes beside what was reached here, and the errors hour by hour."""
    caption = "RMSE in every hour, mean over robots; bands: the paper's network; dotted: the published filter"
    return Report(
        [_table(o, "errors", TABLE_3_OURS, TABLE_3_OTHERS, IN_UNITS)],
        {caption: _picture(o, "errors", TABLE_3_OURS, IN_UNITS)},
        _stiffness(o),
    )


def _stiffness(o: Outcomes) -> list[str]:
    cable = np.array([result["identified"]["stiffness"] for result in o.of(peer_hours)])
    if not cable.size:
        return []
    mean = ", ".join(f"{value:.0f}" for value in cable.mean(axis=0))
    softest, stiffest = (
        ", ".join(f"{value:.0f}" for value in np.mean(np.isclose(cable, end, rtol=1e-2), axis=0) * len(cable))
        for end in (SOFTEST, STIFFEST)
    )
    return [
        f"The filter identifies {mean} Nm/rad, Nm/rad, N/m in the mean of {len(cable)} robots; on {softest} of them "
        f"joints 1, 2 and 3 end at the softest cable that it may choose, on {stiffest} at the stiffest. A soft cable "
        "stands in for what its model lacks, such as wrong ratios. With the robots' own stiffness it corrects what "
        "stretch there is, and no more."
    ]


def _below_filter(o: Outcomes, method: str) -> Judgement:
    (_, worst), (best, _), (known, _) = (extremes(hours(o, each)) for each in (method, UKF, UKF_TOLD))
    text = f"worst hour, filter's best, its best with the true stiffness: {by_joint(worst, best, known)}"
    return by_count(less(worst, best), text)


def _range(o: Outcomes, method: str) -> Judgement:
    ends = dict(zip(("least", "greatest"), extremes(hours(o, method)), strict=True))
    offset, _ = extremes(hours(o, OFFSET))
    reached = {f"{joint} {end}": values[:, j] for j, joint in enumerate(JOINTS) for end, values in ends.items()}
    published = dict(zip(reached, np.ravel(TABLE_3_OURS[method]), strict=True))
    return near(reached, published, SHARE, direction=less(ends["greatest"], offset))


# where the numbers go beyond the share, by the tables of this experiment and of table I
BEYOND = {
    NETWORK: "on joints 2 and 3 the network begins better than the paper's, and on joint 1 six hours add less than "
    "half of what they do there",
    "linear": "on joint 2 the linear model begins lower than the paper's table I and hour 0, to whose mean the "
    "simulated robot was fitted; on joint 1 six hours add half of what they do there",
}
TABLE_3 = Experiment(
    "calibration-table-3", "table III",
    "Joint errors over six hours beside a Kalman filter and a recurrent network", __doc__,
    cases, report_3, minutes=23.0,  # beside figure 6's cases
)  # fmt: skip

for model, called in CALLED.items():
    ends_told = "; ".join(f"{a} to {b} {unit}" for (a, b), unit in zip(TABLE_3_OURS[model], UNITS, strict=True))
    TABLE_3.claim(
        f"Over six unloaded hours the {called}'s errors stay in the range of table III",
        "II-K, table III",
        ends_told,
        f"least and greatest hour within {100 * SHARE:.0f} % of the published ends on all joints, mean over robots; "
        f"same direction: the greatest less than the fixed offset's least on every joint, {CLEARLY}",
        BEYOND[model],
        fitted=fitted_to(model, "hour 0"),
    )(partial(_range, method=model))
    TABLE_3.claim(
        f"In every hour the {called} is more accurate than an unscented Kalman filter",
        "II-K, table III",
        f"{ends_told}, against 1.195 deg, 1.242 deg, 0.927 mm of [13]",
        f"the worst hour less than the filter's best, {CLEARLY}, on all three joints, same recordings; same direction: "
        "on two",
        "on joint 1 the worst hour is drift, which the filter has as well, and its best hour has none. Its cable there "
        "comes out at the softest that it may choose on most robots (the remark below the table): its stretch under "
        "gravity stands in for wrong ratios, whose error the filter keeps when told the true stiffness",
    )(partial(_below_filter, method=model))


def report_4(o: Outcomes) -> Report:
    """Return the paper's table, what it quotes beside what was reached here, and the distance hour by hour."""
    caption = "RMSE in every hour, mean over robots; bands: the paper's network"
    return Report(
        [_table(o, "tip", TABLE_4_OURS, TABLE_4_OTHERS, AXES)], {caption: _picture(o, "tip", TABLE_4_OURS, AXES)}
    )


def _tip_range(o: Outcomes, method: str) -> Judgement:
    reached = dict(zip(("least", "greatest"), (e[:, 3] for e in extremes(hours(o, method, "tip"))), strict=True))
    offset = extremes(hours(o, OFFSET, "tip"))[0][:, 3]
    published = dict(zip(reached, TABLE_4_OURS[method][3], strict=True))
    return near(reached, published, SHARE, direction=[less(reached["greatest"], offset)])


TABLE_4 = Experiment(
    "calibration-table-4", "table IV", "Errors of the tool's position over six hours, beside other methods",
    OF_TABLE_4, cases, report_4, minutes=1.0,  # the cases are table III's
)  # fmt: skip


@TABLE_4.claim(
    "Without calibration the tool is about 20 mm from where the robot says",
    "II-A, figure 1",
    "around 20 mm",
    f"RMSE of the distance in hour 0 within {100 * RAW_SHARE:.0f} %, mean over robots; same direction: more than twice "
    "that after a fixed offset",
    fitted=True,
)
def _raw(o: Outcomes) -> Judgement:
    first = hours(o, RAW, "tip")[:, 0, 3]
    offset = extremes(hours(o, OFFSET, "tip"))[1][:, 3]
    more = bool(first.mean() > 2.0 * offset.mean())
    return near({"distance": first}, {"distance": TIP_RAW}, RAW_SHARE, direction=[more])


for model, called in CALLED.items():
    TABLE_4.claim(
        f"Over six unloaded hours the {called} places the tool within about a millimetre",
        "II-K, table IV",
        " to ".join(map(str, TABLE_4_OURS[model][3])) + " mm",
        f"least and greatest hour within {100 * SHARE:.0f} % of the published ends, mean over robots; same direction: "
        f"the greatest less than the fixed offset's least, {CLEARLY}",
        "it begins lower than the paper's, and its y stays far lower in later hours; joint 2 is lower, too (table III)",
        fitted=fitted_to(model, "hour 0"),
    )(partial(_tip_range, method=model))


def _below(ours: Mapping[str, Floats], theirs: Floats) -> tuple[list[bool], str]:
    """Return where methods' errors in x, y and z (robots, 3) are less than others, and the former in words."""
    holds = [each for errors in ours.values() for each in less(errors, np.broadcast_to(theirs, errors.shape))]
    return holds, "; ".join(f"{method} {', '.join(cells(errors))}" for method, errors in ours.items())


@TABLE_4.claim(
    "At once after training network and linear model are more accurate in x, y and z than Gaussian process regression",
    "II-K, table IV",
    "0.362, 0.301, 0.205 mm and 0.389, 0.351, 0.231 mm at best against 1.4, 1.4, 1.1 mm of [42]",
    f"hour 0, same recordings: less, {CLEARLY}, on all three axes for both; same direction: on more than half of the "
    "six",
    "the paper compares with a number from another recording; on the same one the process, which chooses a length for "
    "every input, does as well as both in y, as on joint 2 (table III). The learner is below it on all three axes",
)
def _below_process(o: Outcomes) -> Judgement:
    *ours, theirs = (hours(o, each, "tip")[:, 0, :3] for each in (*CALLED, PROCESS))
    holds, text = _below(dict(zip(CALLED, ours, strict=True)), theirs)
    return by_count(holds, f"{text} against {', '.join(cells(theirs))} mm")


@TABLE_4.claim(
    "In their best hour network and linear model are more accurate than the network of Peng [12]",
    "II-K, table IV",
    "0.362, 0.301, 0.205 mm and 0.389, 0.351, 0.231 mm at best against 0.818, 1.078, 0.518 mm of [12]",
    f"the least of six hours less than the published numbers of [12], {CLEARLY}, in x, y and z for both; same "
    "direction: in more than half of the six. That method, which learned from cameras, is not built anew here: a "
    "simulated robot is held against a real one; the linear model's three are implied by what it was fitted to",
    fitted=True,
)
def _below_peng(o: Outcomes) -> Judgement:
    ours = {method: extremes(hours(o, method, "tip"))[0][:, :3] for method in CALLED}
    holds, text = _below(ours, np.array(TABLE_4_OTHERS[PENG][:3], dtype=float))
    return by_count(holds, f"{text} mm")
