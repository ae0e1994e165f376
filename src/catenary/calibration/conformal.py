"""Conformal prediction intervals from a model's errors on held-out blocks of time, and a test of their coverage.

The scores are absolute errors on blocks of time, each predicted by a model that was not fitted to it (cross-conformal
prediction: Vovk, Annals of Mathematics and AI 74, 2015; Barber et al., Predictive inference with the jackknife+,
Annals of Statistics 49, 2021). Errors within a block are strongly dependent, so rows are not exchangeable, but blocks
nearly are. The half-width is that of hierarchical conformal prediction (Lee, Barber and Willett, arXiv 2306.06342;
Dunn, Wasserman and Ramdas, JASA 118, 2023): the quantile of the scores in which each of K blocks weighs 1 / (K + 1),
shared by its rows, and infinity weighs 1 / (K + 1), for the new block.

If blocks were exchangeable, an interval would contain a row of a new block with at least the stated probability. This
is approximate: arms drift, blocks must be longer than their memory (Oliveira et al., JMLR 25, 2024), and the final
model is fitted to all blocks. It holds on average over rows, not at each pose; `expected` gives one stretch's range.
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
from catenary.verdict.command_response import STANDING_SHARE, evenness, speeds_of
from catenary.verdict.delay import SHARP, Delay

_BLOCKS_OUTSIDE = 5  # blocks that 1 - level amounts to: the new block then takes a fifth of the share outside
_MIN_BLOCKS = 10
_MIN_BLOCK_ROWS = 4
_CHANCE_PROBABILITY = 0.05  # a coverage less likely than this under the stated one is not attributed to chance
_STRETCH_PROBABILITY = 0.9  # share of new stretches whose error and coverage are in the stated ranges
_PROMISE_PROBABILITY = 0.95  # share of other minutes of the same day whose RMSE is in the stated range
_LEAST_SQUARE = 1e-24  # [rad2|m2] below any error
_MAX_LOG_ERROR = math.log(10.0)  # largest half-width of a stated range of log RMSE, which is uninformative
_FITTED_WEIGHT = 0.368  # weight of the training error in the .632 estimate
_SLOPE_SIGMAS = 2.0  # of the slope of errors over speed
COVERAGE_LENIENCE = 0.5  # share of 1 - level by which a coverage may fall short: 85 % for 90 %

Verdict = Literal["held", "below, which may be chance", "too narrow"]


def estimate_intervals(
    errors: CrossValidation, *, level: float = 0.9, growth: Floats | float = 1.0
) -> Intervals | None:
    """Return half-widths for a model from the errors of its cross-validation, or None if there are too few rows.

    Half-widths inside the valid range come from rows inside the ranges of the folds' models; those outside come from
    the fixed offset's errors on all rows, as do those inside if too few blocks have such rows. Errors are divided by
    the `growth` (N, n) of the model's intervals.
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
    """Error from a delay of single joints' measurements that errors on blocks of time do not show, each (n,)."""

    late: Floats  # largest delay [s], or rows of recordings without stamps; 0 if the motion determines it
    rms: Floats  # [rad|m] RMS error that the delay may add at most
    within: Floats  # [rad|m] half-width that contains this error with the intervals' probability
    even: Flags  # at one speed, as on zig-zags, so that motion at other speeds would determine it

    def in_intervals(self, intervals: Intervals) -> Intervals:
        """Return intervals widened by this error."""
        inside, outside = (np.hypot(width, self.within) for width in (intervals.inside, intervals.outside))
        return replace(intervals, inside=inside, outside=outside)


def unseen_by_blocks(
    logs: Sequence[MotionLog], delays: Sequence[Delay | None], errors: CrossValidation, rates: Floats, level: float
) -> DelayMargin:
    """Bound the error from a delay of a single joint that its motion does not determine (`Delay.alone`).

    A single joint's measurement may lag, never lead. At constant speed a fit absorbs the whole lag as hysteresis. At
    varying speed the part that does not follow the direction remains in the errors on blocks: its size, and its slope
    over the speed, bound the delay. The RMS uses the upper end of the delay's interval, half-widths its middle.
    Recordings are assumed to share their sensors, so their intervals are intersected, unless they contradict each
    other.

    Args:
        logs, delays: Recordings and their delays.
        errors: Errors on held-out blocks.
        rates: Speeds (N, n) [rad/s|m/s] on the rows of `errors`; per row of recordings without stamps.
        level: Probability of the intervals.
    """
    speeds = np.concatenate([speeds_of(log) for log in logs])
    rms, within = np.sqrt(np.mean(speeds**2, axis=0)), np.quantile(speeds, level, axis=0)
    left = np.sqrt(np.mean(np.square(errors.after_model), axis=0))
    bounds, even = np.zeros((3, len(rms))), np.zeros(len(rms), dtype=bool)
    for j, name in enumerate(logs[0].joint_names):
        own = np.array([own[1:] for delay in delays if delay is not None for own in delay.alone if own[0] == name])
        if not len(own):
            continue
        low, high = own[:, 0].max(), own[:, 1].min()
        low, high = (low, high) if low <= high else (own[:, 0].min(), own[:, 1].max())
        if high <= 0.0 or high - low <= SHARP["rows" if logs[0].time is None else "s"]:
            continue
        along, is_even = evenness(speeds[:, j])
        likely = max(0.5 * (low + high), 0.0)
        upper = high * rms[j]
        if not is_even:
            slope = _slope_on_speed(errors.after_model[:, j], rates[:, j], errors.block)
            upper = min(left[j] * math.sqrt(along / (1.0 - along)), slope * rms[j])
        even[j] = is_even
        bounds[:, j] = high, max(min(high * rms[j], upper), likely * rms[j]), likely * within[j]
    return DelayMargin(bounds[0], bounds[1], bounds[2], even)


def _slope_on_speed(left: Floats, rate: Floats, block: Integers) -> float:
    """Return the largest delay [s] that errors (N,) on blocks of time show in what of the speed is not even."""
    moving = np.abs(rate) > STANDING_SHARE * np.sqrt(np.mean(rate**2))
    left, rate, block = left[moving], rate[moving], block[moving]
    uneven = rate - np.mean(np.abs(rate)) * np.sign(rate)
    parts = np.unique(block)
    common, size = np.array([[f[block == k].sum() for k in parts] for f in (left * uneven, uneven**2)])
    slope = common.sum() / size.sum()
    spread = np.square(common - slope * size).sum() * len(parts) / max(len(parts) - 1, 1)
    return float(abs(slope) + _SLOPE_SIGMAS * math.sqrt(spread) / size.sum())


def expected(
    errors: CrossValidation,
    fitted: Floats,  # (N, n) errors of the model on its training rows [rad|m]
    intervals: Intervals | None,  # whose coverage is stated
    widening: Floats | float = 1.0,  # (n,) factor on errors for other combinations of joint positions
    growth: Floats | float = 1.0,  # (N, n) as in `estimate_intervals`
    unseen: DelayMargin | None = None,  # margin of the model's intervals that `intervals` lack
) -> tuple[Spread, ...]:
    """Predict the range of RMSE and coverage on a new stretch as long as the data.

    The difference of the means of two stretches of K parts follows Student's distribution; the variance
    of a part's log RMSE or coverage is averaged over joints. The lower bound of the RMSE is the .632 estimate (Efron,
    JASA 78, 1983), as the final model sees more rows than those of the blocks. With several recordings, the upper
    bound comes from leaving out whole recordings, which are then the parts. In the margin of the valid range the error
    is at most that of the fixed offset.
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
    usual, other = mean * np.maximum(more, 1.0) * widening, times(_log_rmse(of_others, errors.stretch))
    late = np.zeros_like(mean) if unseen is None else unseen.rms / [TO_SI[s.unit][1] for s in spread]
    # independent of each other: logarithms add in quadrature
    high = usual * np.exp(np.hypot(other, np.log(np.hypot(1.0, late / np.maximum(usual, math.sqrt(_LEAST_SQUARE))))))
    names = ["rmse_low", "rmse_high", "rmse_margin"]
    stated: list[Floats] = [low, high, np.maximum(high, np.hypot(offset, late))]
    if intervals is not None:

        def held(by: Intervals) -> tuple[Floats, Floats]:
            held = np.abs(of_others) <= np.where(errors.inside, growth * by.inside, by.outside)
            shares = np.array([held[errors.stretch == k].mean(axis=0) for k in np.unique(errors.stretch)])
            return shares.mean(axis=0), times(shares)

        (share, off), (upper, above) = held(intervals), held(unseen.in_intervals(intervals) if unseen else intervals)
        names += ["held_low", "held_high"]
        stated += [np.maximum(share - off, 0.0), np.minimum(np.maximum(share + off, upper + above), 1.0)]
    of_joints: list[list[Any]] = np.array(stated).T.tolist()
    return tuple(
        replace(s, **dict(zip(names, numbers, strict=True))) for s, numbers in zip(spread, of_joints, strict=True)
    )


def rmse_of_other_minutes(left: Floats, block: Integers) -> tuple[Floats, Floats]:
    """Return bounds (n,) of the RMSE on other minutes, from residual errors (N, n) [rad|m] on blocks of time (N,).

    They hold with _PROMISE_PROBABILITY, for the larger of the joint's variance over blocks and the joints' mean.
    """
    parts = _log_rmse(left, block)
    variance = parts.var(axis=0, ddof=1)
    variance = np.maximum(variance, variance.mean())
    off = np.minimum(_of_another(variance, len(parts), len(parts) - 1, _PROMISE_PROBABILITY), _MAX_LOG_ERROR)
    rmse = np.sqrt(np.mean(np.square(left), axis=0))
    return rmse * np.exp(-off), rmse * np.exp(off)


def _of_another(variance: Floats, parts: int, freedom: int, probability: float) -> Floats:
    """Return the bound on the difference to a mean of as many other parts, by Student's distribution."""
    from scipy.stats import t

    return np.asarray(t.ppf(0.5 + 0.5 * probability, freedom) * np.sqrt(2.0 * variance / parts))


def _log_rmse(errors: Floats, part: Integers) -> Floats:  # (K, n) of errors (N, n) on each part (N,)
    squares = [np.mean(np.square(errors[part == k]), axis=0) for k in np.unique(part)]
    return np.asarray(0.5 * np.log(np.maximum(squares, _LEAST_SQUARE)))


def block_quantile(scores: Floats, block: Integers, level: float) -> float:
    """Return the half-width that contains a share of a new block's scores (N,); infinity with too few blocks (N,)."""
    names, of_row, rows = np.unique(block, return_inverse=True, return_counts=True)
    if len(names) < _MIN_BLOCKS:
        return math.inf
    order = np.argsort(scores, kind="stable")
    held = np.cumsum(1.0 / ((len(names) + 1.0) * rows[of_row[order]]))
    place = int(np.searchsorted(held, level * (1.0 - 1e-12)))  # rounding of the sum
    return float(scores[order[place]]) if place < len(scores) else math.inf


def fewest_rows(level: float) -> int:
    """Return the smallest number of rows for which a half-width at this level is finite."""
    return _MIN_BLOCK_ROWS * max(_MIN_BLOCKS, math.ceil(level / (1.0 - level) - 1e-9))


def time_blocks(recording: Integers, *, level: float) -> Integers:
    """Return the block of time (N,) of each row; no block spans two recordings (N,).

    1 - level amounts to _BLOCKS_OUTSIDE blocks, if each then has at least _MIN_BLOCK_ROWS rows.
    """
    rows = len(recording)
    blocks_needed = max(_MIN_BLOCKS, math.ceil(_BLOCKS_OUTSIDE / (1.0 - level) - 1e-9))
    blocks_needed = max(1, min(blocks_needed, rows // _MIN_BLOCK_ROWS))
    block, first = np.zeros(rows, dtype=np.int64), 0
    starts = np.flatnonzero(np.diff(recording)) + 1
    for part in np.split(np.arange(rows), starts):
        count = max(1, round(blocks_needed * len(part) / max(1, rows)))
        block[part] = first + np.arange(len(part)) * count // max(1, len(part))
        first += count
    return block


def coverage_verdicts(evaluation: Evaluation) -> tuple[Verdict, ...]:
    """Return a verdict per joint on the coverage of a model's intervals; empty for a model without intervals."""
    recording, level = evaluation.data.recording, evaluation.level
    return () if level is None else tuple(coverage_verdict(held, recording, level) for held in evaluation.held.T)


def coverage_verdict(held: Flags, recording: Integers, level: float) -> Verdict:
    """Return the verdict on intervals' coverage, on rows (N,) that the model has not seen.

    Rows are correlated, so blocks of time are counted: the mean of their coverages is compared with a binomial of K
    blocks, the distribution of largest variance with that mean (Hoeffding, JASA 58, 1963).
    """
    from scipy.stats import binom

    block = time_blocks(recording, level=level)
    rows = np.bincount(block)
    shares = np.bincount(block, weights=held)[rows > 0] / rows[rows > 0]
    # intervals of this kind can be expected to reach a coverage within the lenience
    if held.mean() >= level - COVERAGE_LENIENCE * (1.0 - level) - 1e-9:
        return "held"
    chance = float(binom.cdf(math.ceil(shares.sum() - 1e-9), len(shares), level))
    return "too narrow" if chance < _CHANCE_PROBABILITY else "below, which may be chance"
