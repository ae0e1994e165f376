"""Half-widths that hold a stated share of a model's errors, from errors that it left on blocks of time; and a check.

The scores are absolute errors on blocks of time, each predicted by a model that was not fitted to it (cross-conformal
prediction: Vovk, Annals of Mathematics and AI 74, 2015; Barber et al., Predictive inference with the jackknife+,
Annals of Statistics 49, 2021). Errors within a block depend on each other strongly, so rows are not exchangeable;
blocks nearly are. The half-width is that of hierarchical conformal prediction (Lee, Barber and Willett, arXiv
2306.06342; Dunn, Wasserman and Ramdas, JASA 118, 2023): the quantile of the scores in which each of K blocks weighs
1 / (K + 1), shared by its rows, and 1 / (K + 1) lies at infinity, for the block to come.

A row of a new block would lie within it with at least the stated probability, were blocks exchangeable: but arms drift,
blocks must be long beside their memory (Oliveira et al., JMLR 25, 2024), and the final model is fitted to all. It is a
statement on all rows together, not on each pose. One stretch holds more or less: `expected` states between what.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal, NamedTuple

import numpy as np

from catenary.arrays import Flags, Floats, Integers
from catenary.calibration.evaluate import CrossValidation, Evaluation, Spread
from catenary.calibration.intervals import Intervals, check_level
from catenary.plant import MotionLog
from catenary.units import TO_SI
from catenary.verdict.delay import SHARP, Delay

_BLOCKS_OUTSIDE = 5  # worth of errors that may lie outside: the block to come then adds a fifth to what is free
_MIN_BLOCKS = 10
_MIN_BLOCK_ROWS = 4  # of a block
_CHANCE_PROBABILITY = 0.05  # a coverage that is less likely than this under the stated one is not laid to chance
_STRETCH_PROBABILITY = 0.9  # share of stretches whose error and coverage lie between what is stated
_PROMISE_PROBABILITY = 0.95  # of other minutes of a day, whose RMSE lies in what is stated
_LEAST_SQUARE = 1e-24  # [rad2|m2] below any error
_MAX_LOG_ERROR = math.log(10.0)  # of a promise: nothing is known
_FITTED_WEIGHT = 0.368  # weight of the error on the rows that were fitted to, in the .632 estimate
_STANDING_SHARE = 0.1  # of a joint's usual speed, below which it stands
# a speed is even whose mean squared is nearly the mean of its square (.98 on zig-zags, .5 to .94 on random motion), or
# that is within a tenth of its median on most rows (.75 of a zig-zag with half a minute of random motion, .1 of that)
_EVEN, _EVEN_WITHIN, _EVEN_SHARE = 0.95, 0.1, 0.5
COVERAGE_LENIENCE = 0.5  # share of what may lie outside by which a coverage may miss: 85 % of 90 %

Verdict = Literal["held", "below, which may be chance", "too narrow"]


def estimate_intervals(
    errors: CrossValidation, *, level: float = 0.9, growth: Floats | float = 1.0
) -> Intervals | None:
    """Return half-widths for a model from the errors of its cross-validation; None where there are too few rows.

    Inside the valid range they are of rows inside the ranges of the folds' models; outside, and where hardly a block
    has rows inside, of the fixed offset on all rows. Errors count over the `growth` (N, n) of the model's intervals.
    """
    check_level(level)
    block = time_blocks(errors.recording, level=level)
    inside, outside = [], []
    grown = np.abs(errors.of_others) / growth
    for j in range(grown.shape[1]):
        known = errors.inside[:, j]
        near = block_quantile(grown[known, j], block[known], level)
        far = block_quantile(np.abs(errors.after_offset[:, j]), block, level)
        if not math.isfinite(far):
            return None
        near = near if math.isfinite(near) else far
        outside.append(max(near, far))
        inside.append(near)
    return Intervals(level, np.array(inside), np.array(outside))


class DelayMargin(NamedTuple):
    """What errors on blocks of time do not show of joints whose measurement may be late by itself, each (n,)."""

    late: Floats  # [s], or rows of recordings without stamps; 0 where motion tells
    rms: Floats  # [rad|m] that it may add at most
    within: Floats  # [rad|m] in which a share of it lies, as errors do in their intervals

    def in_intervals(self, intervals: Intervals) -> Intervals:
        """Return intervals that hold it, too."""
        inside, outside = (np.hypot(width, self.within) for width in (intervals.inside, intervals.outside))
        return replace(intervals, inside=inside, outside=outside)


def unseen_by_blocks(
    logs: Sequence[MotionLog], delays: Sequence[Delay | None], errors: CrossValidation, level: float
) -> DelayMargin:
    """Return the error that a joint's own delay may add where its motion does not determine it (`Delay.alone`).

    A measurement may be late by itself, none is ahead by itself. At even speed a fit takes all of a lag for hysteresis.
    At uneven speed it leaves what does not go with the direction, on blocks, which bounds the rest; and intervals hold
    the delay that is in the middle of what it may be. Sensors of several recordings are one: each recording tells of
    all, unless they contradict each other.
    """
    speeds = np.concatenate([_speeds(log) for log in logs])
    rms, within = np.sqrt(np.mean(speeds**2, axis=0)), np.quantile(speeds, level, axis=0)
    left = np.sqrt(np.mean(np.square(errors.after_model), axis=0))
    found = np.zeros((3, len(rms)))
    for j, name in enumerate(logs[0].joint_names):
        own = np.array([own[1:] for delay in delays if delay is not None for own in delay.alone if own[0] == name])
        if not len(own):
            continue
        low, high = own[:, 0].max(), own[:, 1].min()
        low, high = (low, high) if low <= high else (own[:, 0].min(), own[:, 1].max())
        if high <= 0.0 or high - low <= SHARP["rows" if logs[0].time is None else "s"]:
            continue
        moving = speeds[speeds[:, j] > _STANDING_SHARE * rms[j], j]
        usual = np.median(moving)
        along = min(float(np.mean(moving)) ** 2 / float(np.mean(moving**2)), 1.0 - 1e-9)  # that goes with the direction
        is_even = along > _EVEN or np.mean(np.abs(moving - usual) < _EVEN_WITHIN * usual) > _EVEN_SHARE
        likely = high if is_even else max(0.5 * (low + high), 0.0)
        most = high * rms[j] if is_even else left[j] * math.sqrt(along / (1.0 - along))
        found[:, j] = high, max(min(high * rms[j], most), likely * rms[j]), likely * within[j]
    return DelayMargin(*found)


def _speeds(log: MotionLog) -> Floats:
    """Return the speeds between neighbouring rows, (M, n) [rad/s|m/s], or per row without stamps."""
    moved = np.abs(np.diff(log.q_nominal, axis=0))
    if log.time is None:
        return moved
    steps = np.diff(log.time)
    step = float(np.median(steps))
    near = np.abs(steps - step) < 0.5 * step
    return np.asarray(moved[near] / steps[near, None])


def expected(
    errors: CrossValidation,
    fitted: Floats,  # (N, n) errors of the model on the rows that it was fitted to [rad|m]
    intervals: Intervals | None,  # whose coverage is to be stated; none without
    widening: Floats | float = 1.0,  # (n,) times as large as on the blocks is an error where joints meet otherwise
    growth: Floats | float = 1.0,  # (N, n) as for `estimate_intervals`
    unseen: DelayMargin | None = None,  # that the model's intervals hold beyond these
) -> tuple[Spread, ...]:
    """Return the spread over blocks with what it lets expect of another stretch as long as the data.

    Its mean differs from that of these as two means of K parts do, by Student's distribution; a part's variance, of the
    logarithm of its RMSE or of the share held, is the mean of the joints'. The model itself, which saw more rows than
    those of the blocks, may err as little as the .632 estimate (Efron, JASA 78, 1983), and so may one whose zero of the
    recording is known; at most it errs as where whole recordings were left out, which are then the parts. In the margin
    of the valid range its error is at most that of the fixed offset.
    """
    spread, of_others = errors.spread, errors.of_others

    def times(values: Floats) -> Floats:
        (parts, joints), variance = values.shape, values.var(axis=0, ddof=1).mean()
        return _of_another(variance, parts, (parts - 1) * joints, _STRETCH_PROBABILITY)

    of_blocks = _log_rmse(errors.after_model, errors.block)
    known = np.sqrt(np.mean(np.square(fitted), axis=0)) / np.exp(of_blocks.mean(axis=0))
    mean, offset = (np.array([getattr(s, name) for s in spread]) for name in ("rmse_mean", "offset_rmse_mean"))
    fitted_share = _FITTED_WEIGHT * np.minimum(known, 1.0) + 1.0 - _FITTED_WEIGHT
    squares = np.maximum(np.mean(np.square(errors.after_model), axis=0), _LEAST_SQUARE)
    more = np.sqrt(np.mean(np.square(of_others), axis=0) / squares)
    low = mean * np.minimum(np.exp(-times(of_blocks)), fitted_share)
    high = mean * np.maximum(more, 1.0) * np.exp(times(_log_rmse(of_others, errors.stretch))) * widening
    late = 0.0 if unseen is None else unseen.rms / [TO_SI[s.unit][1] for s in spread]
    names = ["rmse_low", "rmse_high", "rmse_margin"]
    stated: list[Floats] = [low, np.hypot(high, late), np.hypot(np.maximum(high, offset), late)]
    if intervals is not None:

        def held(by: Intervals) -> tuple[Floats, Floats]:
            held = np.abs(of_others) <= np.where(errors.inside, growth * by.inside, by.outside)
            shares = np.array([held[errors.stretch == k].mean(axis=0) for k in np.unique(errors.stretch)])
            return shares.mean(axis=0), times(shares)

        (share, off), (most, above) = held(intervals), held(unseen.in_intervals(intervals) if unseen else intervals)
        names += ["held_low", "held_high"]
        stated += [np.maximum(share - off, 0.0), np.minimum(np.maximum(share + off, most + above), 1.0)]
    of_joints: list[list[Any]] = np.array(stated).T.tolist()
    return tuple(replace(s, **dict(zip(names, found, strict=True))) for s, found in zip(spread, of_joints, strict=True))


def rmse_of_other_minutes(left: Floats, block: Integers) -> tuple[Floats, Floats]:
    """Return between what RMSE (n,) errors of other minutes lie, from those left (N, n) [rad|m] on blocks of time (N,).

    Minutes differ from each other as their parts do: a joint by its own parts, or as the mean of all joints where that
    is more, with _PROMISE_PROBABILITY probability (`_of_another`).
    """
    parts = _log_rmse(left, block)
    variance = parts.var(axis=0, ddof=1)
    variance = np.maximum(variance, variance.mean())
    off = np.minimum(_of_another(variance, len(parts), len(parts) - 1, _PROMISE_PROBABILITY), _MAX_LOG_ERROR)
    rmse = np.sqrt(np.mean(np.square(left), axis=0))
    return rmse * np.exp(-off), rmse * np.exp(off)


def _of_another(variance: Floats, parts: int, freedom: int, probability: float) -> Floats:
    """Return by how much means of as many other parts differ, of parts whose variance is known to some freedom."""
    from scipy.stats import t

    return np.asarray(t.ppf(0.5 + 0.5 * probability, freedom) * np.sqrt(2.0 * variance / parts))


def _log_rmse(errors: Floats, part: Integers) -> Floats:
    """Return the logarithm of the RMSE of errors (N, n) on each part (N,), (K, n)."""
    squares = [np.mean(np.square(errors[part == k]), axis=0) for k in np.unique(part)]
    return np.asarray(0.5 * np.log(np.maximum(squares, _LEAST_SQUARE)))


def block_quantile(scores: Floats, block: Integers, level: float) -> float:
    """Return the half-width that holds a share of scores (N,) of a new block; infinity of too few blocks (N,)."""
    names, of_row, rows = np.unique(block, return_inverse=True, return_counts=True)
    if len(names) < _MIN_BLOCKS:
        return math.inf
    order = np.argsort(scores, kind="stable")
    held = np.cumsum(1.0 / ((len(names) + 1.0) * rows[of_row[order]]))
    place = int(np.searchsorted(held, level * (1.0 - 1e-12)))  # rounding of the sum
    return float(scores[order[place]]) if place < len(scores) else math.inf


def fewest_rows(level: float) -> int:
    """Return the number of blocks that a half-width needs, for a new block beside the share outside."""
    return _MIN_BLOCK_ROWS * max(_MIN_BLOCKS, math.ceil(level / (1.0 - level) - 1e-9))


def time_blocks(recording: Integers, *, level: float) -> Integers:
    """Return the number of the block of time that each row of recordings (N,) lies in, (N,); no block is of two.

    There are so many that _BLOCKS_OUTSIDE of them are a share of 1 - level, at most one for _MIN_BLOCK_ROWS rows.
    """
    rows = len(recording)
    wanted = max(_MIN_BLOCKS, math.ceil(_BLOCKS_OUTSIDE / (1.0 - level) - 1e-9))
    wanted = max(1, min(wanted, rows // _MIN_BLOCK_ROWS))
    block, first = np.zeros(rows, dtype=np.int64), 0
    starts = np.flatnonzero(np.diff(recording)) + 1
    for part in np.split(np.arange(rows), starts):
        count = max(1, round(wanted * len(part) / max(1, rows)))
        block[part] = first + np.arange(len(part)) * count // max(1, len(part))
        first += count
    return block


def coverage_verdicts(evaluation: Evaluation) -> tuple[Verdict, ...]:
    """Return in words, per joint, whether a model's intervals hold; none for a model without."""
    recording, level = evaluation.data.recording, evaluation.level
    return () if level is None else tuple(coverage_verdict(held, recording, level) for held in evaluation.held.T)


def coverage_verdict(held: Flags, recording: Integers, level: float) -> Verdict:
    """Return in words whether intervals hold what they are to hold, on rows (N,) that their model has not seen.

    Rows depend on each other, so blocks of time are counted: the mean of their shares is compared with that of K blocks
    held or not as a whole, a binomial, which varies most of all shares with that mean (Hoeffding, JASA 58, 1963).
    """
    from scipy.stats import binom

    block = time_blocks(recording, level=level)
    rows = np.bincount(block)
    shares = np.bincount(block, weights=held)[rows > 0] / rows[rows > 0]
    # a coverage within the lenience is what an interval of this kind can be expected to reach
    if held.mean() >= level - COVERAGE_LENIENCE * (1.0 - level) - 1e-9:
        return "held"
    chance = float(binom.cdf(math.ceil(shares.sum() - 1e-9), len(shares), level))
    return "too narrow" if chance < _CHANCE_PROBABILITY else "below, which may be chance"
