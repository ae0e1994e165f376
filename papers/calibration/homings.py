"""Figure 9 of the calibration paper: 0 to 5 homings between training and test.

Two datasets. In the first all training comes before the first test; in the second the same sparsities, the first part
of them before the first test and the rest after the first homing. A test of 20 minutes comes before the first homing,
after each, and after the fifth; every homing begins where the motion ended. The baseline is the first dataset's robot
with the same motions and no homing. Models are fitted to five combinations of sparsities of 7 to 17 minutes and their
errors averaged, as the paper does without naming its combinations; the shade is the standard deviation over them.

Network and linear model take all 16 inputs and are asked wherever the robot is, as the paper's are. Beside them stand
the same with our valid range, outside which the fixed offset is taken, a linear model of the positioning joints alone,
and our network, which takes no tool position.

All else than which error is less is judged by medians over robots: homing draws the registration anew on every robot,
so that one of six may be hit ten times as hard as the others, and be the mean.
"""

from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from catenary import CablePlant, MotionLog
from catenary.arrays import Floats
from catenary.calibration.evaluate import evaluate
from catenary.calibration.fit_options import FitOptions
from catenary.calibration.model import CalibrationModel
from catenary.workflows.project.calibrate import POSITIONING_INPUTS
from papers.calibration import authors, published, recordings
from papers.calibration.judging import BY_ONE_SESSION, CONSIDERABLE, by_one_session, less, statement
from papers.experiment import Case, Experiment, Judgement, Outcomes, Report, Result, Robot, Scope, run
from papers.figures import legend_below, panels
from papers.kit import IN_UNITS, Missing, as_text, by_count, by_robot, cells, grid, joint_tables, median, rows

TESTS = 900  # number of the first test motion among a robot's draws
Tests = dict[str, list[MotionLog]]  # by chain
Between = Callable[[CablePlant], None]  # what is done to a robot between two test motions
MODELS = (recordings.NETWORK, "linear")
GUARDED = {name: f"{name}, valid range" for name in MODELS}
BASELINE, NONE, ONE = "no homing", "none seen", "one seen"
CHAINS = (BASELINE, NONE, ONE)
POSITIONING = "linear, positioning joints"
METHODS_SHOWN = (*MODELS, *GUARDED.values(), POSITIONING, recordings.LEARNER)
TOOLS = ("roll", "wrist", "jaw1", "jaw2")
HOMINGS = 5
# sparsities before the first test, and those after it where the training sees a homing
COMBINATIONS = (
    ((1 / 2,), (1 / 2,)),
    ((1 / 2,), (1 / 3,)),
    ((1 / 2,), (1 / 4,)),
    ((1 / 3,), (1 / 4,)),
    ((1 / 2, 1 / 3), (1 / 4,)),
)
COLORS = {BASELINE: "#8a94a3", NONE: "#d9622b", ONE: "#2f8f6b"}
# reasons, by measurement
BY_THE_TOOL = (
    "the linear model's joint 3 errs more after homings by the tool's positions, which homing moves; without them it "
    "errs hardly more than before, as the network does"
)
# criteria
FLAT = 1.5  # greatest over least error of a curve that does not change
WORSE = 1.5  # error after five homings over the error before
BETTER = 0.8  # greatest error with one homing seen over that with none


def home_here(plant: CablePlant) -> None:
    """Home from wherever the motion ended, as the robot does."""
    plant.home()


def stay(plant: CablePlant) -> None:
    """Go on without homing."""


def random_tests(
    plant: CablePlant,
    seed: int | None,
    numbers: Sequence[int],
    seconds: float,
    between: Between,
    *,
    columns: Sequence[str] = (),
) -> list[MotionLog]:
    """Record test motions by their numbers, and do something between each two of them.

    A number's motion is the same whatever was done before, so that chains with and without homing can be compared.
    """
    logs = []
    for place, number in enumerate(numbers):
        if place:
            between(plant)
        logs.append(recordings.random_log(plant, recordings.draws(seed, TESTS, number), seconds, columns=columns))
    return logs


@run(revision=1)
def homing_errors(
    seed: Robot,
    seen: int,
    networks: Sequence[int],
    ours: Sequence[int],
    combinations: Sequence[Sequence[Sequence[float]]],
    homings: int,
    test_seconds: float,
) -> Result:
    """Train on both parts of every combination, home again and again, and test after each homing.

    Args:
        seen: Homings between the parts, 0 or 1.
        ours: Seeds of our network, which is fitted to the last combination; none leaves it out.

    Returns:
        By chain of tests and method: for every combination, RMSE after 0, 1 ... homings on J1 [deg], J2 [deg], J3
        [mm]. `outside`: share of test rows beyond the network's valid range.
    """
    parts, tests = _recorded(seed, seen, combinations, homings, test_seconds)
    reached: dict[str, dict[str, list[Any]]] = {chain: {"outside": [], "tool": []} for chain in tests}
    for combination in combinations:
        train = [part[s] for part, used in zip(parts, combination, strict=True) for s in used]
        for name in MODELS:
            models = _trainings(train, recordings.METHODS[name], networks)
            _add(reached, name, [recordings.unguarded(model) for model in models], tests)
            _add(reached, GUARDED[name], models, tests)
        for chain, logs in tests.items():
            reached[chain]["outside"].append([outside(models[0], log) for log in logs])
            reached[chain]["tool"].append([tool_shift(train, log) for log in logs])
        _add(
            reached,
            POSITIONING,
            [recordings.fitted(train, FitOptions(kind="linear", inputs=POSITIONING_INPUTS))],
            tests,
        )
    if ours:
        _add(reached, recordings.LEARNER, _trainings(train, recordings.METHODS[recordings.LEARNER], ours), tests)
    return reached


def _recorded(
    seed: Robot, seen: int, combinations: Sequence[Sequence[Sequence[float]]], homings: int, test_seconds: float
) -> tuple[list[dict[float, MotionLog]], Tests]:
    """Return both parts of the training, by sparsity, and the tests of each chain."""
    if isinstance(seed, str):
        folder = authors.homed(seed, seen)
        parts = [{1 / n: authors.read(paths[0]) for n, paths in folder.of(homings=k).items()} for k in (0, seen)]
        return parts, {ONE if seen else NONE: [authors.read(path) for _, path in sorted(folder.homings.items())]}
    plant = recordings.homed(seed)
    first = _part(plant, seed, 0, [before for before, _ in combinations])
    if seen:
        tests: Tests = {ONE: random_tests(plant, seed, [0], test_seconds, home_here)}
        plant.home()
        second = _part(plant, seed, 1, [after for _, after in combinations])
        tests[ONE] += random_tests(plant, seed, range(1, homings + 1), test_seconds, home_here)
    else:
        second = _part(plant, seed, 1, [after for _, after in combinations])
        numbers = range(homings + 1)
        tests = {BASELINE: random_tests(deepcopy(plant), seed, numbers, test_seconds, stay)}
        tests[NONE] = random_tests(plant, seed, numbers, test_seconds, home_here)
    return [first, second], tests


def _part(plant: CablePlant, seed: int | None, number: int, used: Sequence[Sequence[float]]) -> dict[float, MotionLog]:
    sparsities = sorted({sparsity for each in used for sparsity in each}, reverse=True)
    return {
        s: recordings.calibration_log(plant, recordings.draws(seed, number, round(1 / s)), sparsities=(s,))
        for s in sparsities
    }


def _trainings(train: Sequence[MotionLog], options: FitOptions, networks: Sequence[int]) -> list[CalibrationModel]:
    seeds = networks if options.kind == "neural" else (0,)
    return [recordings.fitted(train, replace(options, seed=network)) for network in seeds]


def _add(
    reached: dict[str, dict[str, list[Any]]], method: str, models: Sequence[CalibrationModel], tests: Tests
) -> None:
    for chain, logs in tests.items():
        of_tests = []
        for log in logs:
            rows = recordings.rows_of(models[0], log)
            of_tests.append(recordings.mean([recordings.rmse(model, rows) for model in models]))
        reached[chain].setdefault(method, []).append(of_tests)


def outside(model: CalibrationModel, log: MotionLog) -> float:
    """Return the share of a recording's rows outside a model's valid range."""
    return evaluate(model, recordings.rows_of(model, log)).joints[0].outside_valid_range


def tool_shift(train: Sequence[MotionLog], test: MotionLog) -> float:
    """Return the greatest distance of a tool joint's mean from its mean in training, over its spread there."""
    shifts = []
    for joint in TOOLS:
        before = np.concatenate([log.signals[f"q:{joint}"] for log in train])
        shifts.append(abs(test.signals[f"q:{joint}"].mean() - before.mean()) / before.std())
    return float(max(shifts))


def errors(o: Outcomes, chain: str, method: str) -> Floats:
    """Return RMSE (robots, combinations, 1 + homings, 3) of a method along a chain of tests."""
    samples = [result[chain][method] for result in o.of(homing_errors) if method in result.get(chain, {})]
    if not samples:
        raise Missing(f"{chain}, {method}")
    return by_robot(samples)


def per_robot(o: Outcomes, chain: str, method: str) -> Floats:
    """Return RMSE (robots, 1 + homings, 3) of a method along a chain of tests, the mean over combinations."""
    return by_robot(errors(o, chain, method).mean(axis=1))


def cases(scope: Scope) -> list[Case]:
    """Return a case for every robot and dataset."""
    combinations, homings, seconds = (
        ((((1.0,), (1.0,)),), 1, 30.0) if scope.quick else (COMBINATIONS, HOMINGS, recordings.TEST_SECONDS)
    )
    return grid(
        homing_errors, {"seed": scope.robots, "seen": (0, 1)}, networks=scope.networks_of,
        ours=() if scope.quick else (0,), combinations=combinations, homings=homings, test_seconds=seconds,
    )  # fmt: skip


def report(o: Outcomes) -> Report:
    """Return a table per joint, and the picture in the paper's form."""
    count = max(len(each) for result in o.of(homing_errors) for chain in result.values() for each in chain["outside"])

    def content(j: int) -> list[list[str]]:
        def row(chain: str, method: str) -> list[str]:
            return [chain, method, *cells(per_robot(o, chain, method)[..., j])]

        return rows(row, CHAINS, METHODS_SHOWN)

    header = ["training", "model", *(f"{k} homings" if k != 1 else "1 homing" for k in range(count))]
    caption = (
        "RMSE after homings: mean over robots and combinations of sparsities; shades are the standard deviation over "
        "combinations. Crosses and dotted lines are the paper's"
    )
    tables = joint_tables("{}, RMSE, mean of combinations, spread over robots", header, content)
    return Report(tables, {caption: _picture(o)}, _remarks(o))


def _remarks(o: Outcomes) -> list[str]:
    remarks = []
    for chain in CHAINS:
        if results := [result[chain] for result in o.of(homing_errors) if chain in result]:
            outside, far = (np.mean([each[what] for each in results], axis=(0, 1)) for what in ("outside", "tool"))
            listed = ", ".join(f"{100.0 * share:.0f} %" for share in outside)
            remarks += [
                f"Rows outside the valid range of models of 16 inputs, {chain}: {listed}.",
                f"Farthest tool joint from where it stood in training, in standard deviations of that, {chain}: "
                f"{', '.join(f'{each:.1f}' for each in far)}.",
            ]
    return remarks


def _picture(o: Outcomes) -> Any:
    figure, axes = panels(3, 5.4, rows=2, sharex=True)
    for row, method in enumerate(MODELS):
        for j in range(3):
            panel = axes[3 * row + j]
            for chain in (each for each in CHAINS if any(each in result for result in o.of(homing_errors))):
                reached = errors(o, chain, method)[..., j]
                middle, spread = reached.mean(axis=(0, 1)), reached.std(axis=1).mean(axis=0)
                homings, color = np.arange(len(middle)), COLORS[chain]
                panel.plot(homings, middle, "o-", color=color, label=f"here, {chain}", ms=3)
                panel.fill_between(homings, middle - spread, middle + spread, color=color, alpha=0.18, linewidth=0)
            _published(panel, method, j)
            panel.set_ylim(bottom=0.0)
            panel.set_title(f"{method}, {IN_UNITS[j]}", fontsize=10)
            if row == 1:
                panel.set_xlabel("homings")
    legend_below(figure, *axes)
    return figure


def _published(panel: Any, method: str, joint: int) -> None:
    if joint == 0:
        for seen, chain in enumerate((NONE, ONE)):
            for value in published.HOMINGS_J1[method, seen]:
                panel.axhline(value, color=COLORS[chain], linestyle=":", linewidth=1)
    elif joint == 1:
        panel.plot([0, HOMINGS], published.HOMINGS_J2[method], "x", color=COLORS[NONE], label="paper, none seen")
        panel.axhline(published.HOMINGS_J2_SEEN[method], color=COLORS[ONE], linestyle=":", linewidth=1)
    else:
        for value in published.HOMINGS_J3:
            panel.axhline(value, color="#1c2430", linestyle=":", linewidth=1)


def _flat(o: Outcomes, joint: int, *, outliers: int) -> Judgement:
    holds, texts = [], []
    for method, chain in product(MODELS, (NONE, ONE)):
        samples = per_robot(o, chain, method)[..., joint]
        order = np.argsort(median(samples))
        least, greatest = samples[:, order[0]], samples[:, order[-1 - outliers]]
        holds.append(bool(median(greatest) <= FLAT * median(least)))
        texts.append(f"{method}, {chain} {least:.3m} to {greatest:.3m}")
    return by_count(holds, "; ".join(texts))


def _greatest(o: Outcomes, chain: str, method: str) -> Floats:
    """Return joint 2's errors (robots,) after that homing after which their median is the greatest."""
    samples = per_robot(o, chain, method)[:, 1:, 1]
    return samples[:, median(samples).argmax()]


EXPERIMENT = Experiment(
    "calibration-figure-9", "figure 9", "Calibration after homing again", __doc__, cases, report, minutes=27.0
)


@EXPERIMENT.claim(
    "Joint 1: no obvious drop in accuracy by homing, seen in training or not",
    "II-I, figure 9",
    "network 0.117-0.146 and 0.133-0.152, linear 0.155-0.207 and 0.163-0.218 deg",
    f"greatest over least of the six at most {FLAT}, medians over robots, for both models and datasets; same "
    "direction: for more than half",
    "after homings the tool stands within a few standard deviations of where it stood in training, see below the "
    "tables, so that its positions among the inputs cost joint 1 nothing",
)
def _joint_1(o: Outcomes) -> Judgement:
    return _flat(o, 0, outliers=0)


@EXPERIMENT.claim(
    "Joint 2: accuracy drops significantly over five homings that training did not see",
    "II-I, figure 9",
    "network 0.255 to 0.627, linear 0.317 to 0.712 deg",
    f"error after five homings at least {WORSE} times that before, mean of both models: {BY_ONE_SESSION}",
    "A homing shifts joint 2's registration only where joint 2 meets its stop before joint 1 (beyond-rehoming), from a "
    "minority of the poses where a motion ends, and every homing draws it anew: errors come and go, they do not add "
    "up. The paper's growth is that of a registration wrong by more than half a degree, as where joint 2 is hit here "
    "(six of 30 homings)",
)
def _joint_2(o: Outcomes) -> Judgement:
    ends = {method: per_robot(o, NONE, method)[:, [0, -1], 1].T for method in MODELS}
    text = "; ".join(f"{method} {first:.3m} to {last:.3m}" for method, (first, last) in ends.items())
    first, last = np.mean([*ends.values()], axis=0)
    return by_one_session([last - WORSE * first], text)


@EXPERIMENT.claim(
    "Joint 2: one homing in the training data keeps errors lower",
    "II-I, figure 9",
    "greatest of five: network 0.627, 0.413; linear 0.712, 0.493 deg",
    f"greatest error after a homing at most {BETTER} times that with none seen, mean of both models: {BY_ONE_SESSION}",
    "which robots are hit, and after which homing, is drawn anew every time: most homings hit none, and seeing one "
    "says little about another",
)
def _one_seen(o: Outcomes) -> Judgement:
    greatest = {m: [_greatest(o, chain, m) for chain in (NONE, ONE)] for m in MODELS}
    text = "; ".join(f"{method} {none:.3m}, {one:.3m}" for method, (none, one) in greatest.items())
    none, one = np.mean([*greatest.values()], axis=0)
    return by_one_session([BETTER * none - one], f"greatest of five with none seen, one seen: {text}")


@EXPERIMENT.claim(
    "Joint 2: with one homing seen, errors stay within 0.413 deg and 0.493 deg",
    "II-I",
    "network 0.413, linear 0.493 deg",
    "greatest error of five, median over robots, no larger for both models",
    "every homing hits a minority of the robots, so that the median is that of one that was not hit",
)
def _one_seen_within(o: Outcomes) -> Judgement:
    greatest = {method: _greatest(o, ONE, method) for method in MODELS}
    holds = [median(each) <= published.HOMINGS_J2_SEEN[method] for method, each in greatest.items()]
    return by_count(holds, as_text(greatest, ".3m"))


@EXPERIMENT.claim(
    "Joint 3: close accuracy whether homing was seen or not, but for an outlier",
    "II-I, figure 9",
    "0.113-0.202 mm",
    f"without the greatest of six, greatest over least at most {FLAT}, medians over robots, for both models and "
    "datasets; same direction: for more than half",
    BY_THE_TOOL,
)
def _joint_3(o: Outcomes) -> Judgement:
    return _flat(o, 2, outliers=1)


@EXPERIMENT.claim(
    "Homing hurts joint 2 considerably, joints 1 and 3 not",
    "II-I, III, figure 9",
    "joint 2 by 2.2 to 2.5 times, joints 1 and 3 not obviously",
    "of errors after homings over those of the same motions without, mean over homings, median over robots, joint 2's "
    f"is the greatest, and more by {100.0 * CONSIDERABLE:.0f} % and the spread over robots, for both models; beside "
    f"it, those of joints 1 and 3 are less than {1.0 + CONSIDERABLE}; same direction cannot be for one model alone",
    f"joint 2 is hit in six homings of 30, on four robots of six; {BY_THE_TOOL}",
)
def _joint_2_most(o: Outcomes) -> Judgement:
    hurt, spared, texts = [], [], []
    for method in MODELS:
        homed, stayed = (per_robot(o, chain, method)[:, 1:].mean(axis=1) for chain in (NONE, BASELINE))
        grown = homed / stayed
        hurt.append(bool(less(stayed, homed, CONSIDERABLE)[1] and median(grown).argmax() == 1))
        spared += [ratio < 1.0 + CONSIDERABLE for ratio in median(grown)[[0, 2]]]
        texts.append(f"{method} {by_robot(grown):.2m}")
    return statement(hurt, spared, "error over that without homing: " + "; ".join(texts))
