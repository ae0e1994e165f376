"""Other rules for choosing kinds and for intervals, tried on training data alone, and what any rule could reach.

A da Vinci PSM (Hwang et al., RA-L 2020), the first 80 % of nine recordings. Each fifth of them is left out as if it
were the test; a rule sees the other four only, each predicted by models of the remaining ones. The recordings' last
fifths, on which `auto` and intervals are judged elsewhere, are not looked at. Kinds are chosen for other recordings by
blocks of time and by regions of the joint space, left out in turn. "Known afterwards": the one kind, or half-width,
that is best over all fifths of a recording; no rule that does not see the test does better than that but by chance.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.calibration.conformal import block_quantile, time_blocks
from catenary.calibration.dataset import calibration_data, error_limits
from catenary.calibration.evaluate import CrossValidation, evaluate
from catenary.calibration.fit_options import COVERAGE, FOLDS, FitOptions
from catenary.calibration.fit_rows import fit
from catenary.calibration.kind_choice import SIMPLEST_FIRST, choose
from papers.beyond.advice import WITHIN
from papers.beyond.fifths import Fifths, as_validation, fifths_of, rows_of
from papers.beyond.intervals import KINDS, RECORDINGS, TRAININGS
from papers.calibration.dvrk import limit_of, log_of
from papers.experiment import Case, Experiment, Outcomes, Plain, Report, Result, Scope, run
from papers.kit import filled, table

AUTO, LEAST, AFTERWARDS = "that of `auto`", "the least error", "one kind, known afterwards"
BEFORE, LAST, BOTH = "blocks, each by those before it", "the last block alone", "blocks both ways"
MEAN, WEIGHTED = "mean of all kinds within a tenth", "weighted mean of all kinds"
REGIONS, EITHER = "regions", "the simpler by blocks and by regions"
OURS, WITHOUT, RECENT, IN_ORDER = (
    "ours",
    "without the block to come",
    "later blocks weigh more",
    "each by those before it",
)
MEAN_FIFTH, WIDEST, CONSTANT = "mean of the fifths' own", "widest of the fifths' own", "known afterwards"
CLOSE_KINDS = 1.1  # times the least error, up to which kinds are averaged
FORGETTING = 0.5  # of the rows, after which a block weighs 1/e
LOW, HIGH = 0.85, 0.95
INTERVAL_MODELS = {"linear, play": KINDS["linear, play"], "neural": FitOptions(kind="neural")}


@run(revision=1)
def fifths_left_out(recording: str, data: Path) -> Result:
    """Return for every fifth left out the RMSE of kinds and means, what rules choose, shares that intervals hold."""
    kinds: dict[str, FitOptions] = {kind: FitOptions(kind=kind) for kind in SIMPLEST_FIRST}
    fifths = fifths_of(recording, kinds | {"linear, play": INTERVAL_MODELS["linear, play"]}, data)
    names = [kind for kind in kinds if (kind, (0,)) in fifths.errors]
    tests = []
    for x in range(FOLDS):
        others = [k for k in range(FOLDS) if k != x]
        seen = {kind: fifths.validation(kind, others, (x,)) for kind in names}
        test = {kind: fifths.unseen(kind, [x]) for kind in names}
        rules = {AUTO: _chosen(seen), LEAST: _least(seen)}
        if x == FOLDS - 1:
            early = {kind: fifths.validation(kind, others[1:], before=True) for kind in names}
            rules[BEFORE] = _chosen(early)
            rules[LAST] = _chosen({kind: _late(fifths, kind, others, x) for kind in names})
            rules[BOTH] = _chosen({kind: _joined(fifths, seen[kind], early[kind], others) for kind in names})
        errors = test | {name: _averaged(seen, test, weights) for name, weights in MEANS.items()}
        held = {name: _held(fifths, name, x, others) for name in INTERVAL_MODELS}
        tests.append({
            "rmse": {name: _rms(each).tolist() for name, each in errors.items()},
            "chosen": rules,
            "held": held,
        })  # fmt: skip
    return {"tests": tests, "rows": len(fifths.block)}


def _rms(errors: Floats) -> Floats:
    rms: Floats = np.sqrt(np.square(errors).mean(axis=0))
    return rms


def _chosen(seen: Mapping[str, CrossValidation]) -> list[str]:
    return [choice.chosen for choice in choose(seen)]


def _least(seen: Mapping[str, CrossValidation]) -> list[str]:
    rmse = np.array([[joint.rmse_mean for joint in each.spread] for each in seen.values()])
    return [list(seen)[k] for k in rmse.argmin(axis=0)]


def _late(fifths: Fifths, kind: str, others: Sequence[int], x: int) -> CrossValidation:
    """Return errors on the last of the other fifths, cut in two."""
    errors = fifths.unseen(kind, [others[-1]], (x,))
    halves = np.arange(len(errors)) * 2 // len(errors)
    return as_validation(fifths.data, errors, halves, np.zeros(len(errors), dtype=np.int64))


def _joined(fifths: Fifths, seen: CrossValidation, early: CrossValidation, others: Sequence[int]) -> CrossValidation:
    """Return errors of two cross-validations as if of two recordings."""
    block = np.concatenate([fifths.block[fifths.block == k] for k in others])
    later = block[block != others[0]]
    return as_validation(
        fifths.data,
        np.vstack([seen.after_model, early.after_model]),
        np.concatenate([block, later + FOLDS]),
        np.concatenate([seen.recording, early.recording + seen.recording.max() + 1]),
    )


def _within_a_tenth(errors: Floats) -> Floats:
    """Return equal weights of the kinds whose errors (N, kinds) are within CLOSE_KINDS of the least, (kinds,)."""
    rms = _rms(errors)
    close = (rms <= CLOSE_KINDS * rms.min()).astype(float)
    return np.asarray(close / close.sum())


def _least_squares(errors: Floats) -> Floats:
    """Return weights, none negative, of sum 1, of the least mean square of the weighted errors (N, kinds)."""
    from scipy.optimize import nnls

    # a heavy row holds the sum at 1
    heavy = 1e3 * np.sqrt(np.square(errors).sum(axis=0).max())
    rows = np.vstack([errors, np.full(errors.shape[1], heavy)])
    weights, _ = nnls(np.linalg.qr(rows)[1], np.linalg.qr(rows)[0].T @ np.append(np.zeros(len(errors)), heavy))
    return np.asarray(weights / weights.sum())


MEANS: dict[str, Callable[[Floats], Floats]] = {MEAN: _within_a_tenth, WEIGHTED: _least_squares}


def _averaged(
    seen: Mapping[str, CrossValidation], test: Mapping[str, Floats], weights: Callable[[Floats], Floats]
) -> Floats:
    """Return a test's errors of the mean of the kinds, weighted joint by joint by what was seen."""
    joints = range(len(next(iter(seen.values())).spread))
    of_joints = []
    for j in joints:
        found = weights(np.column_stack([each.after_model[:, j] for each in seen.values()]))
        of_joints.append(np.column_stack([errors[:, j] for errors in test.values()]) @ found)
    return np.column_stack(of_joints)


def _held(fifths: Fifths, name: str, x: int, others: list[int]) -> dict[str, Plain]:
    """Return the share of a fifth's errors that half-widths of each rule hold, joint by joint."""
    seen = fifths.validation(name, others, (x,))
    rules = {rule: half_widths(seen.after_model, seen.recording, rule) for rule in INTERVALS}
    if x == FOLDS - 1:
        early = fifths.validation(name, others[1:], before=True)
        rules[IN_ORDER] = half_widths(early.after_model, early.recording, OURS)
    everything = np.abs(fifths.unseen(name, range(FOLDS)))
    rules[CONSTANT] = np.quantile(everything, COVERAGE, axis=0)
    # a width known afterwards is of models that saw four fifths: so is the test
    test = np.abs(fifths.unseen(name, [x]))
    return {rule: (test <= widths).mean(axis=0).tolist() for rule, widths in rules.items()}


INTERVALS = (OURS, WITHOUT, RECENT, MEAN_FIFTH, WIDEST)


def half_widths(errors: Floats, recording: NDArray[np.int64], rule: str) -> Floats:
    """Return half-widths of a rule from errors (N, n) in the order of time, (n,)."""
    scores, block = np.abs(errors), time_blocks(recording, level=COVERAGE)
    if rule == OURS:
        return np.array([block_quantile(each, block, COVERAGE) for each in scores.T])
    if rule in (MEAN_FIFTH, WIDEST):
        fifth = np.arange(len(scores)) * FOLDS // len(scores)
        own = np.array([np.quantile(scores[fifth == k], COVERAGE, axis=0) for k in range(FOLDS)])
        return np.asarray(own.mean(axis=0) if rule == MEAN_FIFTH else own.max(axis=0))
    blocks = int(block.max()) + 1
    weight = np.ones(blocks)
    if rule == RECENT:
        weight = np.exp((np.arange(blocks) - blocks + 1.0) / (FORGETTING * blocks))
    share = weight[block] / np.bincount(block)[block]
    beyond = weight.max() if rule == RECENT else 0.0  # the block to come
    widths = []
    for each in scores.T:
        order = np.argsort(each, kind="stable")
        held = np.cumsum(share[order]) / (weight.sum() + beyond)
        widths.append(each[order[min(int(np.searchsorted(held, COVERAGE)), len(each) - 1)]])
    return np.array(widths)


@run(revision=1)
def elsewhere(recording: str, data: Path) -> Result:
    """Return RMSE of kinds fitted to a whole recording on the others, and what blocks and regions choose."""
    by_blocks: dict[str, CrossValidation] = {}
    by_regions: dict[str, CrossValidation] = {}
    tests: dict[str, dict[str, Plain]] = {name: {} for name in RECORDINGS if name != recording}
    for kind in SIMPLEST_FIRST:
        options = FitOptions(kind=kind)
        inputs, rows = rows_of(recording, options, data, 0.0)
        for found, block in ((by_blocks, rows.blocks(FOLDS)), (by_regions, regions(rows.q_nominal))):
            errors = np.empty_like(rows.error)
            for k in range(FOLDS):
                model = fit(rows.rows(block != k), inputs, options)
                errors[block == k] = evaluate(model, rows.rows(block == k)).after_model
            found[kind] = as_validation(rows, errors, block, rows.recording)
        model = fit(rows, inputs, options)
        for name, errors_of in tests.items():
            log = log_of(name, data)
            other = calibration_data([log], inputs.features, max_error=error_limits(limit_of(name), log))
            errors_of[kind] = _rms(evaluate(model, other).after_model).tolist()
    blocks, region = _chosen(by_blocks), _chosen(by_regions)
    simpler = [min(pair, key=SIMPLEST_FIRST.index) for pair in zip(blocks, region, strict=True)]
    chosen = {AUTO: blocks, LEAST: _least(by_blocks), REGIONS: region, EITHER: simpler}
    return {"tests": tests, "chosen": chosen}


def regions(q: Floats) -> NDArray[np.int64]:
    """Return which of FOLDS regions of the joint space positions (N, n) lie in, (N,): Lloyd's algorithm."""
    from scipy.cluster.vq import kmeans2

    spread = q.std(axis=0)
    standard = (q - q.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)
    return np.asarray(kmeans2(standard, FOLDS, seed=0, minit="++")[1], dtype=np.int64)


def cases(scope: Scope) -> list[Case]:
    """Return a case for the fifths of every recording, and for the others after each of the long ones."""
    if scope.quick:
        return [fifths_left_out.case(recording="error_exp2")]
    return [fifths_left_out.case(recording=recording) for recording in RECORDINGS] + [
        elsewhere.case(recording=recording) for recording in TRAININGS
    ]


def report(o: Outcomes) -> Report:
    """Return how often each rule is within the bound, here and elsewhere, and how much intervals of each hold."""
    fifths = [(told["recording"], result["tests"]) for told, result in o.items(fifths_left_out)]
    others = o.of(elsewhere)
    choices = "rule | within 5 % | of long recordings | over the best, mean | at worst | last of the five within 5 %"
    widths = (
        "half-widths | all: 85 to 95 %, above, below | long recordings | last of the five | held in the mean of all"
    )
    tables = [
        table("Which kind, each fifth left out", choices, choice_rows(fifths)),
        table("How many errors intervals hold, each fifth left out", widths, interval_rows(fifths)),
        table(
            "Which kind, on other recordings",
            "rule | within 5 % | over the best, mean | at worst",
            elsewhere_rows(others),
        ),
    ]
    return Report(filled(tables), [], [_REMARK])


_REMARK = (
    "Within 5 %: joints and tests on which the rule's error is no more than 5 % above that of the kind that is best "
    "there; long recordings are the four with more than a thousand rows. A rule that looks at what comes before cannot "
    "be asked about the first fifths: only the last of the five is counted for it."
)


def _ratios(test: Plain, rule: str) -> Floats:
    """Return the error of a rule's choice, or of a mean, over that of the best kind, (n,)."""
    kinds = [kind for kind in SIMPLEST_FIRST if kind in test["rmse"]]
    best = np.min([test["rmse"][kind] for kind in kinds], axis=0)
    if rule in test["rmse"]:
        return np.asarray(np.array(test["rmse"][rule]) / best)
    own = [test["rmse"][kind][j] for j, kind in enumerate(test["chosen"][rule])]
    return np.asarray(np.array(own) / best)


def _afterwards(tests: Sequence[Plain]) -> Floats:
    """Return the ratios of the one kind a joint that is most often within the bound over all tests, (tests, n)."""
    kinds = [kind for kind in SIMPLEST_FIRST if all(kind in test["rmse"] for test in tests)]
    rmse = np.array([[test["rmse"][kind] for kind in kinds] for test in tests])
    ratio = rmse / rmse.min(axis=1, keepdims=True)
    # among those, the one of the least mean
    merit = (ratio <= WITHIN).sum(axis=0) - 1e-3 * np.log(ratio).mean(axis=0)
    return np.take_along_axis(ratio, merit.argmax(axis=0)[None, None, :], axis=1)[:, 0, :]


def _counted(ratios: Floats) -> str:
    return f"{int((ratios <= WITHIN).sum())} of {ratios.size}" if ratios.size else "-"


def _of(ratios: Floats) -> list[str]:
    if not ratios.size:
        return ["-", "-"]
    return [f"{np.exp(np.log(ratios).mean()):.3f}", f"{ratios.max():.2f}"]


def _by_recording(
    fifths: Sequence[tuple[str, Sequence[Plain]]], found_of: Callable[[Sequence[Plain]], Floats]
) -> tuple[list[Floats], list[Floats], list[Floats]]:
    """Return what a rule has of every test, of those of long recordings, and of the last fifths, by recording.

    A rule that has the last fifth alone counts among the last ones only.
    """
    every, long, last = [], [], []
    for recording, tests in fifths:
        found = found_of(tests)
        if len(found):
            last.append(found[-1])
            if len(found) == len(tests):
                every.append(found)
                long += [found] if recording in TRAININGS else []
    return every, long, last


def choice_rows(fifths: Sequence[tuple[str, Sequence[Plain]]]) -> list[list[str]]:
    """Return how often each rule's choice is within the bound."""
    content = []
    for rule in (AUTO, LEAST, BEFORE, LAST, BOTH, MEAN, WEIGHTED, AFTERWARDS):

        def found_of(tests: Sequence[Plain], rule: str = rule) -> Floats:
            if rule == AFTERWARDS:
                return _afterwards(tests)
            return np.array([_ratios(test, rule) for test in tests if rule in {**test["chosen"], **test["rmse"]}])

        every, long, last = _by_recording(fifths, found_of)
        if last:
            all_of, of_long = (np.concatenate(each or [np.zeros((0, 1))]) for each in (every, long))
            content.append([rule, _counted(all_of), _counted(of_long), *_of(all_of), _counted(np.array(last))])
    return content


def elsewhere_rows(results: Sequence[Plain]) -> list[list[str]]:
    """Return how often each rule's choice is within the bound on other recordings."""
    content = []
    for rule in (AUTO, LEAST, REGIONS, EITHER, AFTERWARDS) if results else ():
        found = []
        for result in results:
            tests = [{"rmse": rmse, "chosen": result["chosen"]} for rmse in result["tests"].values()]
            afterwards = rule == AFTERWARDS
            found.append(_afterwards(tests) if afterwards else np.array([_ratios(test, rule) for test in tests]))
        ratios = np.concatenate(found)
        content.append([rule, _counted(ratios), *_of(ratios)])
    return content


def interval_rows(fifths: Sequence[tuple[str, Sequence[Plain]]]) -> list[list[str]]:
    """Return on how many joints, models and fifths half-widths of each rule hold 85 to 95 %, more, and less."""
    content = []
    for rule in (*INTERVALS, IN_ORDER, CONSTANT):

        def found_of(tests: Sequence[Plain], rule: str = rule) -> Floats:
            told = [list(test["held"].values()) for test in tests]
            return np.array([np.concatenate([each[rule] for each in of]) for of in told if all(rule in e for e in of)])

        every, long, last = _by_recording(fifths, found_of)
        if last:
            mean = f"{100.0 * np.concatenate(every).mean():.1f} %" if every else "-"
            content.append([rule, *(_bands(each) for each in (every, long, last)), mean])
    return content


def _bands(shares: Sequence[Floats]) -> str:
    if not shares:
        return "-"
    found = np.concatenate(shares)
    above, below = int((found > HIGH).sum()), int((found < LOW).sum())
    return f"{found.size - above - below}, {above}, {below} of {found.size}"


EXPERIMENT = Experiment(
    "beyond-rules", "beyond, which model and error bars",
    "Other rules for choices and intervals, and what any rule could reach", __doc__,
    cases, report, minutes=4.0, drawn=0, simulated=False, needs_data=True,
)  # fmt: skip
