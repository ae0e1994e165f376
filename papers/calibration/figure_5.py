"""Figure 5 of the calibration paper: error against recording time, by the zig-zags' sparsity.

Sparsities 1/2 to 1/6 of direction J2-J3 and all combinations of them that take no longer than 1/2 + 1/3 + 1/4; five
recordings of 1/2, 1/3, 1/4, three of 1/5, 1/6; 20 minutes of random motion after each sparsity as its test. All is
recorded in one session from one homing, in the sparsities' order: the paper does not say in which. A combination is
tested on the motion after its finest sparsity. The network is the mean of its trainings. Models are asked wherever the
robot goes, as the paper's are.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from catenary import MotionLog
from catenary.arrays import Floats
from catenary.calibration.model import CalibrationModel
from papers import kit
from papers.calibration import authors, recordings
from papers.calibration.homings import outside
from papers.calibration.judging import changes, less, near, statement
from papers.calibration.published import DURATIONS, FIGURE_5_J1, FIGURE_5_J2, FIGURE_5_J2_POLYNOMIAL, FIGURE_5_J3
from papers.calibration.recordings import METHODS, NETWORK, SETS, baselines, fitted, mean, rmse, rows_of, unguarded
from papers.experiment import CLEARLY, Case, Experiment, Judgement, Outcomes, Report, Result, Robot, Scope, run
from papers.figures import METHOD_COLORS, legend_below, panels
from papers.kit import IN_UNITS, as_text, by_count, graded, grid, sample
from papers.plant.targets import fitted_to

RECORDINGS = {"1/2": 5, "1/3": 5, "1/4": 5, "1/5": 3, "1/6": 3}
MODELS = (NETWORK, "polynomial", "linear")
OFFSET = "fixed offset"
SHOWN = (*MODELS, OFFSET)
SHORT, LONG = 500.0, 800.0  # [s] below and above which the paper gives means
SHORTEST, LONGEST, ENOUGH_FOR_J3 = "1/2", "1/2+1/3+1/4", "1/2+1/3"
PAIR = (NETWORK, "linear")  # the models that the paper gives numbers of on every joint
# reasons, by measurement
SET_BETWEEN = (
    "on joint 1 network and linear model err after the shortest recording less than after the longest: nothing that "
    "they leave is for lack of data, and recordings that are combined here lie an hour apart, in which cables set (one "
    "after the other, table I, the same three sparsities leave 0.120 and 0.133 deg)"
)
# criteria
CLOSE = 0.30  # of a published number
NO_BETTER = 0.9  # of the fixed offset's error: no significant improvement
FLAT = 0.85  # of the error at 537 s: no considerable further improvement
CONSTANT = 0.10  # of the offset's error at the shortest


@dataclass(frozen=True)
class Session:
    """Recordings of one robot."""

    train: Mapping[str, Sequence[MotionLog]]  # by sparsity
    test: Mapping[str, MotionLog]

    def training(self, name: str) -> list[list[MotionLog]]:
        """Return the repetitions of a combination, each the recordings that it joins."""
        return [list(each) for each in zip(*(self.train[part] for part in parts(name)), strict=False)]


def parts(name: str) -> list[str]:
    """Return the sparsities of a combination, "1/2" and "1/3" of "1/2+1/3"."""
    return name.split("+")


def recorded(
    seed: Robot, counts: Mapping[str, int], finest: str, *, test_seconds: float = recordings.TEST_SECONDS
) -> Session:
    """Record a session as far as a sparsity and its test; what is recorded does not depend on how far it goes."""
    if isinstance(seed, str):
        return _of_authors(seed, parts_of=counts)
    plant = recordings.homed(seed)
    train: dict[str, list[MotionLog]] = {}
    test = {}
    for sparsity, count in counts.items():
        n = int(sparsity.removeprefix("1/"))
        train[sparsity] = [
            recordings.calibration_log(plant, recordings.draws(seed, 50, n, k), sparsities=(1.0 / n,))
            for k in range(count)
        ]
        test[sparsity] = recordings.random_log(plant, recordings.draws(seed, 51, n), test_seconds)
        if sparsity == finest:
            break
    return Session(train, test)


def _of_authors(root: str, parts_of: Iterable[str]) -> Session:
    folder, any_test = authors.tested(root, "J2-J3")
    zigzags = {f"1/{n}": [authors.read(path) for path in paths] for n, paths in folder.of().items()}
    test = {part: authors.read(folder.random.get(int(part[2:]), any_test)) for part in parts_of}
    return Session(zigzags, test)


@run(revision=1)
def sparsity_errors(
    seed: Robot, name: str, recordings: Mapping[str, int], networks: Sequence[int], test_seconds: float
) -> Result:
    """Fit every model to every repetition of a combination of sparsities, and test it on random motion.

    Returns:
        `seconds` of a training set; `outside`, the share of test rows outside the linear model's valid range, in which
        it is asked all the same; and by method, for every repetition, RMSE on J1 [deg], J2 [deg], J3 [mm].
    """
    finest = parts(name)[-1]
    session = recorded(seed, recordings, finest, test_seconds=test_seconds)
    results: dict[str, Any] = {method: [] for method in SHOWN}
    for training in session.training(name):
        models: list[CalibrationModel] = []
        for method in MODELS:
            seeds = networks if method == NETWORK else (0,)
            models = [fitted(training, replace(METHODS[method], seed=each)) for each in seeds]
            rows = rows_of(models[0], session.test[finest])
            results[method].append(mean([rmse(unguarded(model), rows) for model in models]))
        results[OFFSET].append(baselines(models[0], rows)[OFFSET])
        results["outside"] = outside(models[0], session.test[finest])
        results["seconds"] = round(sum(_seconds(log) for log in training), 1)
    return results


def _seconds(log: MotionLog) -> float:
    time = np.asarray(log.time)
    return float(time[-1] - time[0])


def cases(scope: Scope) -> list[Case]:
    """Return a case for every robot and combination."""
    counts, names, seconds = (
        ({"1/2": 1}, SETS[:1], 60.0) if scope.quick else (RECORDINGS, SETS, recordings.TEST_SECONDS)
    )
    common = {"recordings": counts, "networks": scope.networks_of, "test_seconds": seconds}
    return grid(sparsity_errors, {"seed": scope.robots, "name": names}, **common)


def repetitions(o: Outcomes, name: str, method: str) -> Floats:
    """Return the RMSE (robots, repetitions, 3) of a method trained with a combination."""
    return sample(o, sparsity_errors, method, name=name)


def by_robot(o: Outcomes, names: Sequence[str], method: str) -> Floats:
    """Return the RMSE (robots, 3) of a method, mean over combinations and their repetitions."""
    return kit.by_robot(np.mean([repetitions(o, name, method).mean(axis=1) for name in names], axis=0))


def deviations(o: Outcomes, name: str, method: str) -> Floats:
    """Return the standard deviation (robots, 3) over repetitions."""
    return kit.by_robot(repetitions(o, name, method).std(axis=1, ddof=1))


def combinations(o: Outcomes) -> dict[str, float]:
    """Return how long every combination that has run takes to record [s], the shortest first."""
    names = dict.fromkeys(args["name"] for args, _ in o.items(sparsity_errors))
    seconds = {name: float(sample(o, sparsity_errors, "seconds", name=name).mean()) for name in names}
    return dict(sorted(seconds.items(), key=lambda one: one[1]))


def short_and_long(o: Outcomes) -> tuple[list[str], list[str]]:
    """Return the combinations below 500 s and those above 800 s, each the shortest first."""
    seconds = combinations(o)
    return [n for n, time in seconds.items() if time < SHORT], [n for n, time in seconds.items() if time > LONG]


def report(o: Outcomes) -> Report:
    """Return a table per joint and the paper's picture."""
    seconds = combinations(o)

    def content(j: int) -> list[list[str]]:
        return [
            [
                name.replace("+", " + "),
                f"{time:.0f}",
                *(f"{repetitions(o, name, method)[..., j].ravel()}" for method in SHOWN),
            ]
            for name, time in seconds.items()
        ]

    title = "{}, RMSE, mean and spread over robots and recordings"
    caption = (
        "RMSE against recording time; shades are the standard deviation over recordings, mean over robots, crosses and "
        "dotted lines the paper's"
    )
    outside = sample(o, sparsity_errors, "outside").mean()
    remark = f"Test rows outside the models' valid range, where they are asked all the same: {100.0 * outside:.1f} %."
    tables = kit.joint_tables(title, ["sparsity", "time [s]", *SHOWN], content)
    return Report(tables, {caption: _picture(o, seconds)}, [remark])


def _picture(o: Outcomes, seconds: dict[str, float]) -> Any:
    figure, axes = panels(3, 3.6)
    times = np.array(list(seconds.values()))
    several = all(repetitions(o, name, OFFSET).shape[1] > 1 for name in seconds)
    for j, panel in enumerate(axes):
        for method in SHOWN:
            color = METHOD_COLORS[method]
            reached = np.array([repetitions(o, name, method).mean(axis=(0, 1))[j] for name in seconds])
            panel.plot(times, reached, "o-", color=color, label=method, ms=3, linewidth=1.2)
            if several:
                spread = np.array([deviations(o, name, method).mean(axis=0)[j] for name in seconds])
                panel.fill_between(times, reached - spread, reached + spread, color=color, alpha=0.2, linewidth=0)
        _published(panel, j)
        panel.set_ylim(0.0, 1.3 * max(repetitions(o, name, OFFSET).mean(axis=(0, 1))[j] for name in seconds))
        panel.set_title(IN_UNITS[j], fontsize=10)
        panel.set_xlabel("recording time [s]")
    legend_below(figure, axes[0], columns=4)
    return figure


def _published(panel: Any, joint: int) -> None:
    time = {"1/2": DURATIONS[1 / 2,], "1/2+1/3": DURATIONS[1 / 2, 1 / 3], LONGEST: DURATIONS[1 / 2, 1 / 3, 1 / 4]}
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


def _of(o: Outcomes, names: Sequence[str], methods: Sequence[str], joint: int) -> dict[str, Floats]:
    """Return the errors (robots,) of methods on a joint, mean over combinations."""
    return {method: by_robot(o, names, method)[:, joint] for method in methods}


def _longer_gains(
    o: Outcomes, joint: int, spans: Mapping[str, Sequence[str]], published: Mapping[str, Mapping[str, float]]
) -> Judgement:
    """Judge a joint's errors after shorter and longer recordings, in this order, by the paper's."""
    by_span = {span: _of(o, names, PAIR, joint) for span, names in spans.items()}
    reached = {f"{method} {span}": errors for span, each in by_span.items() for method, errors in each.items()}
    papers = {f"{method} {span}": published[span][method] for span in spans for method in PAIR}
    shorter, longer = by_span.values()
    return near(reached, papers, CLOSE, direction=[less(longer[m], shorter[m]) for m in PAIR])


EXPERIMENT = Experiment(
    "calibration-figure-5", "figure 5", "Calibration error by sparsity and recording time", __doc__,
    cases, report, minutes=52.0, drawn=2,
)  # fmt: skip


@EXPERIMENT.claim(
    "Joint 1 after 209 s: network and linear model improve on the fixed offset considerably",
    "II-F, figure 5",
    "network 0.232, linear 0.446, fixed offset 0.846 deg",
    f"all three within {100.0 * CLOSE:.0f} %; same direction: network below linear below fixed offset, {CLEARLY}",
    f"both models are better than the paper's, which were short of data: {SET_BETWEEN}",
)
def _joint_1_shortest(o: Outcomes) -> Judgement:
    reached = _of(o, [SHORTEST], (*PAIR, OFFSET), 0)
    direction = [less(reached[NETWORK], reached["linear"]), less(reached["linear"], reached[OFFSET])]
    return near(reached, FIGURE_5_J1[SHORTEST], CLOSE, direction=direction)


@EXPERIMENT.claim(
    "Joint 1 after 209 s: the polynomial shows no significant improvement",
    "II-F, figure 5",
    "0.834, fixed offset 0.846 deg",
    f"at least {NO_BETTER} times the fixed offset's error; same direction: the worst of the three, {CLEARLY}",
    "on joint 1 it errs after the shortest recording no more than after the longest: there, unlike the paper's, it is "
    "not short of data. Tried: a tool that stands 2 deg elsewhere in the test raises its error, and not the line's",
)
def _polynomial_shortest(o: Outcomes) -> Judgement:
    reached = _of(o, [SHORTEST], SHOWN, 0)
    worst = all(less(reached[m], reached["polynomial"]) for m in PAIR)
    no_better = reached["polynomial"].mean() >= NO_BETTER * reached[OFFSET].mean()
    return graded(no_better, worst, as_text(reached))


@EXPERIMENT.claim(
    "Joint 1 after 1013 s: all three models improve",
    "II-F, figure 5",
    "network 0.120, polynomial 0.119, linear 0.176 deg",
    f"all three within {100.0 * CLOSE:.0f} %; same direction: all three better than after 209 s, {CLEARLY}",
    SET_BETWEEN,
)
def _joint_1_longest(o: Outcomes) -> Judgement:
    first, reached = (_of(o, [name], MODELS, 0) for name in (SHORTEST, LONGEST))
    better = [less(reached[method], first[method]) for method in MODELS]
    return near(reached, FIGURE_5_J1[LONGEST], CLOSE, direction=better)


@EXPERIMENT.claim(
    "More sparsity, more error",
    "II-F, figure 5",
    "joint 1 by 0.112, 0.727 and 0.270 deg from 209 s to 1013 s; joint 2 network 0.288 to 0.203, linear 0.364 to 0.248 "
    "deg",
    f"mean above 800 s less than mean below 500 s, {CLEARLY}, for every joint and model; same direction: more than "
    "half of nine",
    f"the polynomial, which has most to learn, gains on joints 2 and 3; {SET_BETWEEN}",
)
def _more_sparsity(o: Outcomes) -> Judgement:
    holds, texts = [], []
    for method in MODELS:
        before, after = (by_robot(o, names, method) for names in short_and_long(o))
        holds += list(less(after, before))
        texts.append(f"{method} {changes(before, after)}")
    return by_count(holds, "from below 500 s to above 800 s: " + "; ".join(texts))


@EXPERIMENT.claim(
    "Joint 1: the standard deviation over recordings falls as sparsity gets smaller",
    "II-F, figure 5",
    "-",
    f"less at 1/2 + 1/3 + 1/4 than at 1/2, {CLEARLY}, for all three models; same direction: for two",
    "recordings of a simulated robot repeat each other, for network and linear model to thousandths of a degree, "
    "whatever their sparsity: what falls does so within the spread over robots",
)
def _deviation_falls(o: Outcomes) -> Judgement:
    holds, texts = [], []
    for method in MODELS:
        first, last = (deviations(o, name, method)[:, 0] for name in (SHORTEST, LONGEST))
        holds.append(less(last, first))
        texts.append(f"{method} {first:.4f} to {last:.4f}")
    return by_count(holds, "; ".join(texts))


@EXPERIMENT.claim(
    "Joint 1: the fixed offset does not gain by smaller sparsity",
    "II-F, figure 5",
    "-",
    f"error at 1/2 + 1/3 + 1/4 at least {1.0 - CONSTANT} times that at 1/2",
)
def _offset_constant(o: Outcomes) -> Judgement:
    first, last = (by_robot(o, [name], OFFSET)[:, 0] for name in (SHORTEST, LONGEST))
    close = last.mean() >= (1.0 - CONSTANT) * first.mean()
    return graded(close, False, f"{first} to {last}")


@EXPERIMENT.claim(
    "With little data the network is best",
    "II-F, III",
    "joint 1 0.232 against 0.446 and 0.834 deg; joint 2 0.288 against 0.364 deg; joint 3 0.202 against 0.307 mm",
    f"mean below 500 s less than the linear model's, {CLEARLY}, on every joint, and beside it less than the "
    "polynomial's; same direction: the former on two. Right after training; table V judges the same by the mean of six "
    "hours",
    "on joints 1 and 2 the network learns hardly more than the linear model from any recording (table I)",
)
def _network_needs_least(o: Outcomes) -> Judgement:
    short, _ = short_and_long(o)
    reached = {method: by_robot(o, short, method) for method in MODELS}
    linear, polynomial = (less(reached[NETWORK], reached[other]) for other in ("linear", "polynomial"))
    return statement(linear, polynomial, f"below 500 s: {as_text(reached, between='; ')}")


@EXPERIMENT.claim(
    "Joint 2 gains between 500 and 800 s",
    "II-F, figure 5",
    "network 0.288 to 0.203, linear 0.364 to 0.248 deg",
    f"all four within {100.0 * CLOSE:.0f} %; same direction: both models gain, {CLEARLY}",
    "joint 2 gains by several sparsities, not by time: 1/5 and 1/6 alone leave the network 0.21 deg, 1/2 + 1/4 0.147",
)
def _joint_2(o: Outcomes) -> Judgement:
    short, long = short_and_long(o)
    return _longer_gains(o, 1, {"short": short, "long": long}, FIGURE_5_J2)


@EXPERIMENT.claim(
    "Joint 2: the polynomial is unstable, and outperforms neither other even with the longest recording",
    "II-F, figure 5",
    "0.302 deg at the longest",
    "its standard deviation over recordings is the largest at more than half of the sparsities, and its error at the "
    "longest at least both others', mean over robots; same direction cannot be",
    fitted=fitted_to("polynomial", "figure 5, longest"),
)
def _joint_2_polynomial(o: Outcomes) -> Judgement:
    spread = {m: np.array([deviations(o, name, m).mean(axis=0)[1] for name in SETS]) for m in MODELS}
    last = _of(o, [LONGEST], MODELS, 1)
    largest = int(np.sum(spread["polynomial"] > np.maximum(*(spread[m] for m in PAIR))))
    no_better = all(last["polynomial"].mean() >= last[m].mean() for m in PAIR)
    text = f"largest spread at {largest} of {len(SETS)} sparsities; at the longest {as_text(last)}"
    return by_count([largest > len(SETS) / 2, no_better], text)


@EXPERIMENT.claim(
    "Joint 3: 537 s are better than less than 500 s",
    "II-F, figure 5",
    "network 0.202 to 0.121, linear 0.307 to 0.132 mm",
    f"all four within {100.0 * CLOSE:.0f} %; same direction: both models gain, {CLEARLY}",
    "joint 3 gains by finer zig-zags, not by time: 1/4 alone (483 s) leaves the network 0.086 mm, 1/2 + 1/3 0.108",
)
def _joint_3(o: Outcomes) -> Judgement:
    short, _ = short_and_long(o)
    return _longer_gains(o, 2, {"short": short, ENOUGH_FOR_J3: [ENOUGH_FOR_J3]}, FIGURE_5_J3)


@EXPERIMENT.claim(
    "Joint 3: no considerable further improvement beyond 537 s",
    "II-F, figure 5",
    "-",
    f"mean of all longer ones at least {FLAT} times the error at 1/2 + 1/3, for network and linear model; same "
    "direction cannot be",
)
def _joint_3_flat(o: Outcomes) -> Judgement:
    seconds = combinations(o)
    longer = [name for name, time in seconds.items() if time > seconds[ENOUGH_FOR_J3]]
    after, at = (_of(o, names, PAIR, 2) for names in (longer, [ENOUGH_FOR_J3]))
    ratios = {method: after[method] / at[method] for method in PAIR}
    return by_count([ratio.mean() >= FLAT for ratio in ratios.values()], f"error left of that: {as_text(ratios)}")
