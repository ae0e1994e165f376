"""Which path earns its minutes: zig-zags, random motion, and a designed motion, for the same time and on the same test.

Each path trains the calibration paper's models for as long as its zig-zags take, 1/2 alone and 1/2 + 1/3 + 1/4, on
the robot just homed; 20 minutes of random motion, the same for all paths of a robot, test them. So random motion for
training is of the test's own kind, not its copy. The paper's models take its 16 inputs and are asked everywhere, the
network is the mean of its trainings; the learner is `catenary fit`'s, with its valid range. It is also fitted to the
first minutes of the longer recordings. Paths differ in two things: how often each joint turns back, and how much of
its range they cover. To tell these apart, the paper's zig-zag J2-J3 and the designed motion are run both in that zig-
zag's range and in the whole box.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import gcd
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from catenary import random_sinusoids, record_simulated, zigzag
from catenary.arrays import Floats, as_array
from catenary.calibration.fit_options import FitOptions
from catenary.errors import InputError
from catenary.trajectories.reference import Trajectory
from catenary.trajectories.sinusoids import FASTEST_SPEEDS, SLOWEST_SPEEDS, TURN_TIME_S
from catenary.trajectories.smoothed_path import BrokenLine, SmoothedPath
from catenary.trajectories.zigzag import CALIBRATION_LOWER, CALIBRATION_UPPER, DIRECTIONS, Direction, zigzag_rows
from papers.calibration import recordings
from papers.calibration.figure_3 import reversals
from papers.calibration.recordings import LEARNER
from papers.experiment import Case, Experiment, Judgement, Outcomes, Report, Result, Scope, TitledTable, run
from papers.figures import legend_below, panels
from papers.kit import IN_UNITS, JOINTS, by_count, cells, grid, rows, sample, table

ZIGZAG: Direction = "J2-J3"
WIDE, RANDOM = "J2-J3, whole box", "random"
DESIGNED, NARROW = "designed", "designed, range of J2-J3"
PATHS = (*DIRECTIONS, WIDE, RANDOM, NARROW, DESIGNED)
LENGTHS = ((1 / 2,), recordings.SPARSITIES)  # of the recordings, as those zig-zags take
SHORT, LONG = (list(each) for each in LENGTHS)
PAPERS = (recordings.NETWORK, "linear")
MODELS = (*PAPERS, LEARNER)
MINUTES = (1, 2, 4, 8)
COLORS = {WIDE: "#c9a227", RANDOM: "#1c2430", NARROW: "#d9622b", DESIGNED: "#2f8f6b"}
ZIGZAG_COLOR = "#4b6b94"
EXPLAINS = -0.5  # rank correlation of reversals and error, at most


def crossings(duration: float, widths: Floats, speeds: Floats) -> list[int]:
    """Return how often joints cross ranges (n,) [rad|m] in [s] at about these speeds: no two with a common divisor."""
    chosen: list[int] = []
    for wish in duration * speeds / widths:
        free = [k for k in range(2, int(2 * wish) + 1) if all(gcd(k, other) == 1 for other in chosen)]
        if not free:
            raise InputError(f"duration: {duration:g} s leave no time to cross a joint's range twice")
        chosen.append(min(free, key=lambda k: abs(k - wish)))
    return chosen


def designed(
    duration: float, *, lower: ArrayLike = CALIBRATION_LOWER, upper: ArrayLike = CALIBRATION_UPPER
) -> SmoothedPath:
    """Return the motion [s] of three joints between two ends (3,) [rad|m], at the middle of random motion's speeds.

    A cable's error depends on where the joint is and on which side of its friction and slack the last move left it. So
    each joint crosses its range at constant speed and turns back at the ends, which shows it in both directions
    everywhere; the numbers of crossings have no common divisor, so that over the whole motion any position of one joint
    meets all positions of the others, as a zig-zag's sweeps do.
    """
    low, high = as_array("lower", lower, (3,)), as_array("upper", upper, (3,))
    counts = crossings(duration, high - low, (SLOWEST_SPEEDS + FASTEST_SPEEDS) / 2.0)
    lines = []
    for j, count in enumerate(counts):
        times = np.linspace(0.0, duration - TURN_TIME_S, count + 1)
        lines.append(BrokenLine(times, np.where(np.arange(count + 1) % 2, high[j], low[j]), TURN_TIME_S))
    return SmoothedPath(lines)


def trajectory(name: str, sparsities: Sequence[float], rng: np.random.Generator) -> Trajectory:
    """Return a path by its name, as long as the zig-zags J2-J3 of these sparsities take."""
    for direction in DIRECTIONS:
        if name == direction:
            return zigzag(direction, sparsities)
    seconds = zigzag(ZIGZAG, sparsities).duration
    if name == RANDOM:
        return random_sinusoids(rng, seconds)
    if name == DESIGNED:
        return designed(seconds)
    width = CALIBRATION_UPPER - CALIBRATION_LOWER
    rows = np.concatenate([zigzag_rows(ZIGZAG, sparsity) for sparsity in sparsities])
    low, high = rows.min(axis=0), rows.max(axis=0)
    if name == NARROW:
        return designed(seconds, lower=low, upper=high)
    # the box in which the zig-zag's range is the whole calibration box
    wider = width**2 / (high - low)
    lower = CALIBRATION_LOWER - (low - CALIBRATION_LOWER) * wider / width
    return zigzag(ZIGZAG, sparsities, lower=lower, upper=lower + wider)


@run(revision=2)
def path_errors(
    seed: int | None,
    name: str,
    sparsities: Sequence[float],
    networks: Sequence[int],
    minutes: Sequence[float],
    test_seconds: float,
) -> Result:
    """Train the paper's models along a path, and the learner, on its first minutes too; test on random motion after it.

    Returns:
        `seconds`; by joint `reversals`, and `range`, the share of the box that is covered; by method, and by minutes of
        the learner, RMSE on J1 [deg], J2 [deg], J3 [mm].
    """
    plant = recordings.homed(seed)
    rng = recordings.draws(seed, 60, PATHS.index(name), len(sparsities))
    path = trajectory(name, sparsities, rng)
    train = record_simulated(plant, path, name, rng)
    test = recordings.random_log(plant, recordings.draws(seed, 61), test_seconds)
    q, _, _ = path.sample(np.arange(0.0, path.duration, 0.05))
    errors: dict[str, object] = {
        "seconds": round(path.duration, 1),
        "reversals": [reversals(column) for column in q.T],
        "range": [round(float(each), 3) for each in np.ptp(q, axis=0) / (CALIBRATION_UPPER - CALIBRATION_LOWER)],
    }
    for method in PAPERS:
        seeds = networks if method == recordings.NETWORK else (0,)
        models = [recordings.fitted([train], replace(recordings.METHODS[method], seed=each)) for each in seeds]
        rows = recordings.rows_of(models[0], test)
        errors[method] = recordings.mean([recordings.rmse(recordings.unguarded(model), rows) for model in models])
        errors |= recordings.baselines(models[0], rows)
    since = np.asarray(train.time) - np.asarray(train.time)[0]
    for part, seconds in {LEARNER: np.inf, **{f"{each:g}": 60.0 * each for each in minutes}}.items():
        model = recordings.fitted([recordings.at_rows(train, np.flatnonzero(since < seconds))], FitOptions())
        errors[part] = recordings.rmse(model, recordings.rows_of(model, test))
    return errors


def cases(scope: Scope) -> list[Case]:
    """Return a case for every robot, path and length."""
    lengths, names, seconds = (
        (LENGTHS[:1], (ZIGZAG, DESIGNED), 60.0) if scope.quick else (LENGTHS, PATHS, recordings.TEST_SECONDS)
    )
    axes = {"seed": scope.robots, "sparsities": lengths, "name": names}
    return grid(path_errors, axes, networks=scope.networks_of, minutes=MINUTES, test_seconds=seconds)


def of(o: Outcomes, name: str, sparsities: Sequence[float], what: str) -> Floats:
    """Return what a path has by joint, (robots, 3)."""
    return sample(o, path_errors, what, name=name, sparsities=list(sparsities))


def middle(o: Outcomes, name: str, sparsities: Sequence[float], what: str) -> Floats:
    """Return what a path has by joint, mean over robots, (3,)."""
    return np.asarray(of(o, name, sparsities, what).mean(axis=0))


def seconds_of(o: Outcomes, sparsities: Sequence[float]) -> str:
    """Return how long the designed motion of a length takes."""
    return f"{o.of(path_errors, name=DESIGNED, sparsities=list(sparsities))[0]['seconds']:.0f} s"


def _run(o: Outcomes, sparsities: Sequence[float]) -> list[str]:
    return [name for name in PATHS if o.of(path_errors, name=name, sparsities=list(sparsities))]


def report(o: Outcomes) -> Report:
    """Return a table per length, what reversals and range are worth, and the picture."""
    lengths = [length for length in LENGTHS if _run(o, length)]
    tables = [_paths_table(o, length) for length in lengths]
    if all(len(_run(o, length)) == len(PATHS) for length in LENGTHS):
        tables += [_factors(o), _by_minutes(o)]
    caption = (
        "RMSE of a joint against how often it turned back in training; full marks are the network, open ones the "
        f"linear model, crosses the learner, squares the zig-zag {ZIGZAG}"
    )
    return Report(tables, {caption: _picture(o, lengths)})


def _paths_table(o: Outcomes, length: Sequence[float]) -> TitledTable:
    def row(name: str) -> list[str]:
        return [
            *(name, *(f"{count:.0f}" for count in middle(o, name, length, "reversals"))),
            *(f"{100.0 * share:.0f} %" for share in middle(o, name, length, "range")),
            *(each for model in MODELS for each in cells(of(o, name, length, model))),
        ]

    header = ["path", *(f"reversals {joint}" for joint in JOINTS), *(f"range {joint}" for joint in JOINTS)]
    header += [f"{model} {joint}" for model in MODELS for joint in IN_UNITS]
    return table(f"{seconds_of(o, length)} of recording, RMSE", header, rows(row, PATHS))


def _factors(o: Outcomes) -> TitledTable:
    changes = {
        "more reversals, zig-zag's range": (NARROW, ZIGZAG),
        "more reversals, whole box": (DESIGNED, WIDE),
        "whole box, zig-zag": (WIDE, ZIGZAG),
        "whole box, designed": (DESIGNED, NARROW),
        "both": (DESIGNED, ZIGZAG),
    }

    def row(change: str, length: Sequence[float]) -> list[str]:
        after, before = ([middle(o, name, length, model) for model in MODELS] for name in changes[change])
        ratios = np.concatenate(after) / np.concatenate(before)
        return [change, seconds_of(o, length).removesuffix(" s"), *(f"{each:.2f}" for each in ratios)]

    header = ["what changes", "time [s]", *(f"{model} {joint}" for model in MODELS for joint in JOINTS)]
    return table("Error left of what it was, by what changes", header, rows(row, changes, LENGTHS))


def _by_minutes(o: Outcomes) -> TitledTable:
    def row(name: str, minutes: float) -> list[str]:
        errors = sample(o, path_errors, f"{minutes:g}", name=name, sparsities=LONG)
        return [name, f"{minutes:g}", *cells(errors)]

    title = "Learner fitted to the first minutes of the longer recording, RMSE"
    return table(title, ["path", "minutes", *IN_UNITS], rows(row, (ZIGZAG, DESIGNED, RANDOM), MINUTES))


def _picture(o: Outcomes, lengths: Sequence[Sequence[float]]) -> Any:
    figure, axes = panels(3, 3.0 * len(lengths) + 0.5, rows=len(lengths))
    for place, panel in enumerate(axes):
        length, j = lengths[place // 3], place % 3
        for name in _run(o, length):
            color, label = COLORS.get(name, ZIGZAG_COLOR), name if name in COLORS else "zig-zags"
            x = middle(o, name, length, "reversals")[j]
            y = [middle(o, name, length, model)[j] for model in MODELS]
            marker = "s" if name in (ZIGZAG, WIDE) else "o"
            panel.plot([x] * len(y), y, color=color, linewidth=0.6, alpha=0.5)
            panel.plot(x, y[0], marker, color=color, ms=6, label=label)
            panel.plot(x, y[1], marker, color=color, ms=6, fillstyle="none")
            panel.plot(x, y[2], "x", color=color, ms=6)
        panel.set_ylim(bottom=0.0)
        if j == 0:
            panel.set_ylabel("RMSE")
        panel.set_title(f"{IN_UNITS[j]}, {seconds_of(o, length)}", fontsize=10)
        if place // 3 == len(lengths) - 1:
            panel.set_xlabel(f"reversals of {JOINTS[j]}")
    legend_below(figure, axes[0])
    return figure


def _less(o: Outcomes, name: str, others: Sequence[str]) -> Judgement:
    """Judge whether a path's network is better on every joint and for both lengths than with any of other paths."""
    holds, measured = [], []
    for length in LENGTHS:
        own = middle(o, name, length, recordings.NETWORK)
        least = np.min([middle(o, other, length, recordings.NETWORK) for other in others], axis=0)
        holds += list(own < least)
        measured.append(f"{seconds_of(o, length)}: {_pairs(own, least)}")
    return by_count(holds, "J1, J2, J3; " + "; ".join(measured))


def _pairs(own: Floats, other: Floats) -> str:
    return ", ".join(f"{a:.3f} against {b:.3f}" for a, b in zip(own, other, strict=True))


EXPERIMENT = Experiment(
    "beyond-paths", "beyond", "Which path earns its minutes", __doc__, cases, report, minutes=25.0, drawn=2
)


@EXPERIMENT.claim(
    "The more often a joint turns back in training, the smaller its error",
    "expected",
    "-",
    f"rank correlation of reversals and error over all paths at most {EXPLAINS}, for every joint and model, longer "
    "recordings; same direction: more than half of six",
    "on joint 1 the range counts as well: most zig-zags leave it a good half of its own, and there its linear model "
    "gains nothing by turning back more often",
)
def _reversals_explain(o: Outcomes) -> Judgement:
    from scipy.stats import spearmanr

    holds, measured = [], []
    for model in PAPERS:
        ranks = []
        for j in range(3):
            counts, errors = ([middle(o, name, LONG, what)[j] for name in PATHS] for what in ("reversals", model))
            ranks.append(float(spearmanr(counts, errors).statistic))
        holds += [rank <= EXPLAINS for rank in ranks]
        measured.append(f"{model} {', '.join(f'{rank:.2f}' for rank in ranks)}")
    return by_count(holds, "rank correlation on J1, J2, J3: " + "; ".join(measured))


@EXPERIMENT.claim(
    "In the zig-zag's range, more reversals alone lower the network's error",
    "expected",
    "-",
    "less with the designed motion in the range of J2-J3 than with the zig-zag J2-J3, on every joint and for both "
    "lengths; same direction: more than half of six",
    "joint 1 has a good half of its range there, and the test has all of it; in the whole box the same change helps "
    "joint 1 most",
)
def _reversals_in_range(o: Outcomes) -> Judgement:
    return _less(o, NARROW, [ZIGZAG])


@EXPERIMENT.claim(
    "Random motion is worth more than the zig-zag J2-J3 of the same length",
    "expected",
    "-",
    "the network's error is less, on every joint and for both lengths; same direction: more than half of six",
)
def _random_better(o: Outcomes) -> Judgement:
    return _less(o, RANDOM, [ZIGZAG])


@EXPERIMENT.claim(
    "The designed motion is worth more than the best of the seven zig-zags of the same length",
    "expected",
    "-",
    "the network's error is less than the least of the seven, on every joint and for both lengths; same direction: "
    "more than half of six",
    "it crosses every range at one speed; random motion, whose speeds vary, is better on joint 3 after the longer time",
)
def _designed_best(o: Outcomes) -> Judgement:
    return _less(o, DESIGNED, DIRECTIONS)


@EXPERIMENT.claim(
    "A fifth of the time is enough: the designed motion for as long as 1/2 takes, against J2-J3 at 1/2 + 1/3 + 1/4",
    "expected",
    "-",
    "the network's error is not greater, on every joint; same direction: on two",
    "on joint 3 the network gains by minutes along every path, whatever they are spent on; the linear model is as good "
    "after a fifth of the time on joints 1 and 2",
)
def _short_enough(o: Outcomes) -> Judgement:
    short, long = middle(o, DESIGNED, SHORT, recordings.NETWORK), middle(o, ZIGZAG, LONG, recordings.NETWORK)
    return by_count(short <= long, f"J1, J2, J3: {_pairs(short, long)}")


@EXPERIMENT.claim(
    "Random motion for as long as 1/2 takes is enough for the learner, against the network of all of J2-J3",
    "expected",
    "-",
    "the learner's error after the shorter time is not greater than the network's along J2-J3 at 1/2 + 1/3 + 1/4, on "
    "every joint; same direction: on two",
)
def _learner_short_enough(o: Outcomes) -> Judgement:
    short, long = middle(o, RANDOM, SHORT, LEARNER), middle(o, ZIGZAG, LONG, recordings.NETWORK)
    return by_count(short <= long, f"J1, J2, J3: {_pairs(short, long)}")


@EXPERIMENT.claim(
    "The learner errs less than the network, whatever the path",
    "expected",
    "-",
    "its error is less for every path, joint and length; same direction: for more than half",
)
def _learner_less(o: Outcomes) -> Judgement:
    learner, network = (
        np.array([middle(o, name, length, model) for length in LENGTHS for name in PATHS])
        for model in (LEARNER, recordings.NETWORK)
    )
    ratio = learner / network
    median, worst = np.median(ratio), np.unravel_index(ratio.argmax(), ratio.shape)
    name = PATHS[int(worst[0]) % len(PATHS)]
    measured = f"error over the network's {median:.2f} in the median, {ratio.max():.2f} at most: {name}, "
    return by_count((ratio < 1.0).ravel(), measured + JOINTS[int(worst[1])])
