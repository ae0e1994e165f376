"""Figure 5 of the calibration paper: error against recording time, by the zig-zags' sparsity.

Sparsities 1/2 to 1/6 of direction J2-J3 and all combinations of them that take no longer than 1/2 + 1/3 + 1/4; five
recordings of 1/2, 1/3, 1/4, three of 1/5, 1/6; 20 minutes of random motion after each sparsity as its test. All is
recorded in one session from one homing, in the sparsities' order: the paper does not say in which. A combination is
tested on the motion after its finest sparsity. The network is the mean of five trainings. Models are asked wherever the
robot goes, as the paper's are.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from catenary.reports.page import Table
from papers.calibration.published import (
    DURATIONS,
    FIGURE_5_J1,
    FIGURE_5_J2,
    FIGURE_5_J2_POLYNOMIAL,
    FIGURE_5_J3,
)
from papers.calibration.recordings import JOINTS, NETWORK, SETS, TEST_SECONDS, UNITS
from papers.calibration.sparsities import (
    LONG,
    MODELS,
    OFFSET,
    RECORDINGS,
    SHORT,
    SHOWN,
    combinations,
    deviation,
    mean_of,
    middle,
    repetitions,
    short_and_long,
    sparsity_errors,
)
from papers.claims import NOT_MEASURED, by_count, graded, mean_and_spread, within
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

SHORTEST, LONGEST, ENOUGH_FOR_J3 = "1/2", "1/2+1/3+1/4", "1/2+1/3"
PAIR = (NETWORK, "linear")  # the models that the paper gives numbers of on every joint
# reasons, by measurement
LEARNED = (
    "network and linear model err after 203 s as after 1015 s, within the spread over robots: what they leave of the "
    "simulated robot's errors is not for lack of data. The paper's robot has something that takes longer to learn; "
    "its recordings are not public"
)
# criteria
CLOSE = 0.30  # of a published number
NO_BETTER = 0.9  # of the fixed offset's error: no significant improvement
FLAT = 0.85  # of the error at 537 s: no considerable further improvement
CONSTANT = 0.10  # of the offset's error at the shortest


def cases(scope: Scope) -> list[Case]:
    """Return a case for every robot and combination."""
    recordings, names, seconds = (
        ({"1/2": 1}, SETS[:1], 60.0) if scope.quick else (RECORDINGS, SETS, TEST_SECONDS)
    )
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
                    times,
                    reached - spread,
                    reached + spread,
                    color=METHOD_COLORS[method],
                    alpha=0.2,
                    linewidth=0,
                )
        _published(panel, j)
        offset = max(middle(outcomes, name, OFFSET)[j] for name in names)
        panel.set_ylim(0.0, 1.3 * offset)
        panel.set_title(f"{JOINTS[j]} [{UNITS[j]}]", fontsize=10)
        panel.set_xlabel("recording time [s]")
    legend_below(figure, axes[0], columns=4)
    return figure


def _published(panel: Any, joint: int) -> None:
    time = {
        "1/2": DURATIONS[1 / 2,],
        "1/2+1/3": DURATIONS[1 / 2, 1 / 3],
        LONGEST: DURATIONS[1 / 2, 1 / 3, 1 / 4],
    }
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


def _complete(outcomes: Outcomes) -> bool:
    return set(combinations(outcomes)) >= set(SETS)


def _told(values: dict[str, float]) -> str:
    return ", ".join(f"{name} {value:.3f}" for name, value in values.items())


def _joint_1_shortest(outcomes: Outcomes) -> Judgement:
    if not _complete(outcomes):
        return NOT_MEASURED
    reached = {m: float(middle(outcomes, SHORTEST, m)[0]) for m in (*PAIR, OFFSET)}
    order = reached[NETWORK] < reached["linear"] < reached[OFFSET]
    return within(reached, FIGURE_5_J1[SHORTEST], CLOSE, direction=[order])


def _polynomial_shortest(outcomes: Outcomes) -> Judgement:
    if not _complete(outcomes):
        return NOT_MEASURED
    reached = {m: float(middle(outcomes, SHORTEST, m)[0]) for m in SHOWN}
    told = _told(reached)
    worst = reached["polynomial"] > max(reached[m] for m in PAIR)
    return graded(reached["polynomial"] >= NO_BETTER * reached[OFFSET], worst, told)


def _joint_1_longest(outcomes: Outcomes) -> Judgement:
    if not _complete(outcomes):
        return NOT_MEASURED
    reached, first = (
        {m: float(middle(outcomes, name, m)[0]) for m in MODELS} for name in (LONGEST, SHORTEST)
    )
    return within(reached, FIGURE_5_J1[LONGEST], CLOSE, direction=[reached[m] < first[m] for m in MODELS])


def _more_sparsity(outcomes: Outcomes) -> Judgement:
    if not _complete(outcomes):
        return NOT_MEASURED
    short, long = short_and_long(outcomes)
    holds, told = [], []
    for method in MODELS:
        before, after = mean_of(outcomes, short, method), mean_of(outcomes, long, method)
        holds += list(after < before)
        told.append(
            f"{method} {', '.join(f'{a:.3f} to {b:.3f}' for a, b in zip(before, after, strict=True))}"
        )
    return by_count(holds, "J1, J2, J3 below 500 s to above 800 s: " + "; ".join(told))


def _deviation_falls(outcomes: Outcomes) -> Judgement:
    if not _complete(outcomes):
        return NOT_MEASURED
    ends = {m: [float(deviation(outcomes, name, m)[0]) for name in (SHORTEST, LONGEST)] for m in MODELS}
    told = "; ".join(f"{method} {first:.4f} to {last:.4f}" for method, (first, last) in ends.items())
    return by_count([last < first for first, last in ends.values()], told)


def _offset_constant(outcomes: Outcomes) -> Judgement:
    if not _complete(outcomes):
        return NOT_MEASURED
    first, last = (float(middle(outcomes, name, OFFSET)[0]) for name in (SHORTEST, LONGEST))
    close = last >= (1.0 - CONSTANT) * first
    return Judgement("reproduced" if close else "not reproduced", f"{first:.3f} to {last:.3f}")


def _network_needs_least(outcomes: Outcomes) -> Judgement:
    if not _complete(outcomes):
        return NOT_MEASURED
    short, _ = short_and_long(outcomes)
    reached = {method: mean_of(outcomes, short, method) for method in MODELS}
    others = [method for method in MODELS if method != NETWORK]
    holds = [bool(reached[NETWORK][j] < reached[other][j]) for other in others for j in range(3)]
    told = "; ".join(f"{m} {', '.join(f'{e:.3f}' for e in errors)}" for m, errors in reached.items())
    return by_count(holds, "J1, J2, J3 below 500 s: " + told)


def _joint_2(outcomes: Outcomes) -> Judgement:
    if not _complete(outcomes):
        return NOT_MEASURED
    reached, published = {}, {}
    for span, names in zip(("short", "long"), short_and_long(outcomes), strict=True):
        for method in PAIR:
            reached[f"{method} {span}"] = float(mean_of(outcomes, names, method)[1])
            published[f"{method} {span}"] = FIGURE_5_J2[span][method]
    better = [reached[f"{m} long"] < reached[f"{m} short"] for m in PAIR]
    return within(reached, published, CLOSE, direction=better)


def _joint_2_polynomial(outcomes: Outcomes) -> Judgement:
    if not _complete(outcomes):
        return NOT_MEASURED
    spread = {m: np.array([deviation(outcomes, name, m)[1] for name in SETS]) for m in MODELS}
    last = {m: float(middle(outcomes, LONGEST, m)[1]) for m in MODELS}
    largest = int(np.sum(spread["polynomial"] > np.maximum(*(spread[m] for m in PAIR))))
    worst = last["polynomial"] > max(last[m] for m in PAIR)
    told = f"largest spread at {largest} of {len(SETS)} sparsities; at the longest {_told(last)}"
    return by_count([largest > len(SETS) / 2, worst], told)


def _joint_3(outcomes: Outcomes) -> Judgement:
    if not _complete(outcomes):
        return NOT_MEASURED
    short, _ = short_and_long(outcomes)
    reached, published = {}, {}
    for method in PAIR:
        for span, error in (
            ("short", mean_of(outcomes, short, method)),
            (ENOUGH_FOR_J3, middle(outcomes, ENOUGH_FOR_J3, method)),
        ):
            reached[f"{method} {span}"] = float(error[2])
            published[f"{method} {span}"] = FIGURE_5_J3[span][method]
    better = [reached[f"{m} {ENOUGH_FOR_J3}"] < reached[f"{m} short"] for m in PAIR]
    return within(reached, published, CLOSE, direction=better)


def _joint_3_flat(outcomes: Outcomes) -> Judgement:
    if not _complete(outcomes):
        return NOT_MEASURED
    seconds = combinations(outcomes)
    longer = [name for name, time in seconds.items() if time > seconds[ENOUGH_FOR_J3]]
    ratios = {m: _ratio(outcomes, longer, m) for m in PAIR}
    return by_count([ratio >= FLAT for ratio in ratios.values()], f"error left of that: {_told(ratios)}")


def _ratio(outcomes: Outcomes, longer: Sequence[str], method: str) -> float:
    return float(mean_of(outcomes, longer, method)[2] / middle(outcomes, ENOUGH_FOR_J3, method)[2])


CLAIMS = (
    Claim(
        "Joint 1 after 209 s: network and linear model improve on the fixed offset considerably",
        "II-F, figure 5",
        "network 0.232, linear 0.446, fixed offset 0.846 deg",
        f"all three within {100.0 * CLOSE:.0f} %; same direction: network < linear < fixed offset",
        _joint_1_shortest,
    ),
    Claim(
        "Joint 1 after 209 s: the polynomial shows no significant improvement",
        "II-F, figure 5",
        "0.834, fixed offset 0.846 deg",
        f"at least {NO_BETTER} times the fixed offset's error; same direction: the worst of the three models",
        _polynomial_shortest,
        why="the polynomial starves on 203 s on joints 2 and 3, which these zig-zags sweep (2.9 and 2.6 times the "
        "linear model's error), and not on joint 1",
    ),
    Claim(
        "Joint 1 after 1013 s: all three models improve",
        "II-F, figure 5",
        "network 0.120, polynomial 0.119, linear 0.176 deg",
        f"all three within {100.0 * CLOSE:.0f} %; same direction: all three better than after 209 s",
        _joint_1_longest,
        why=f"only the network gains, by a tenth: {LEARNED}",
    ),
    Claim(
        "More sparsity, more error",
        "II-F, figure 5",
        "joint 1 by 0.112, 0.727 and 0.270 deg from 209 s to 1013 s; joint 2 network 0.288 to 0.203, linear 0.364 to "
        "0.248 deg",
        "mean above 800 s is less than mean below 500 s, for every joint and model; same direction: more than half of "
        "nine",
        _more_sparsity,
    ),
    Claim(
        "Joint 1: the standard deviation over recordings falls as sparsity gets smaller",
        "II-F, figure 5",
        "-",
        "less at 1/2 + 1/3 + 1/4 than at 1/2, for all three models; same direction: for two",
        _deviation_falls,
    ),
    Claim(
        "Joint 1: the fixed offset does not gain by smaller sparsity",
        "II-F, figure 5",
        "-",
        f"error at 1/2 + 1/3 + 1/4 at least {1.0 - CONSTANT} times that at 1/2",
        _offset_constant,
    ),
    Claim(
        "With little data the network is best",
        "II-F, III",
        "joint 1 0.232 against 0.446 and 0.834 deg; joint 2 0.288 against 0.364 deg; joint 3 0.202 against 0.307 mm",
        "mean below 500 s less than the linear model's and the polynomial's, on every joint; same direction: more than "
        "half of six",
        _network_needs_least,
    ),
    Claim(
        "Joint 2 gains between 500 and 800 s",
        "II-F, figure 5",
        "network 0.288 to 0.203, linear 0.364 to 0.248 deg",
        f"all four within {100.0 * CLOSE:.0f} %; same direction: both models gain",
        _joint_2,
        why=LEARNED,
    ),
    Claim(
        "Joint 2: the polynomial is unstable, and worse than both others even with the longest recording",
        "II-F, figure 5",
        "0.302 deg at the longest",
        "its standard deviation over recordings is the largest at more than half of the sparsities, and its error at "
        "the longest the largest; same direction cannot be",
        _joint_2_polynomial,
    ),
    Claim(
        "Joint 3: 537 s are better than less than 500 s",
        "II-F, figure 5",
        "network 0.202 to 0.121, linear 0.307 to 0.132 mm",
        f"all four within {100.0 * CLOSE:.0f} %; same direction: both models gain",
        _joint_3,
    ),
    Claim(
        "Joint 3: no considerable further improvement beyond 537 s",
        "II-F, figure 5",
        "-",
        f"mean of all longer ones at least {FLAT} times the error at 1/2 + 1/3, for network and linear model; same "
        "direction cannot be",
        _joint_3_flat,
    ),
)

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
