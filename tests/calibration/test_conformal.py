import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from catenary.calibration.conformal import (
    _MIN_BLOCK_ROWS,
    block_quantile,
    coverage_verdict,
    estimate_intervals,
    expected,
    fewest_rows,
    rmse_of_other_minutes,
    time_blocks,
)
from catenary.calibration.evaluate import CrossValidation, Spread
from catenary.calibration.intervals import Intervals
from catenary.errors import InputError

BLOCKS, ROWS = 50, 20


def dependent_blocks(rng: np.random.Generator, blocks: int) -> np.ndarray:
    """Absolute errors (blocks, ROWS): each block has its own mean and spread, heavy-tailed."""
    mean, spread = rng.standard_t(3, size=(2, blocks, 1))
    return np.abs(mean + np.abs(spread) * rng.normal(size=(blocks, ROWS)))


@pytest.mark.parametrize(("blocks", "level"), [(50, 0.9), (25, 0.8)])
def test_rows_of_a_new_block_lie_within_as_often_as_stated_whatever_depends_in_a_block(
    blocks: int, level: float
) -> None:
    rng = np.random.default_rng(1)
    number, shares = np.repeat(np.arange(blocks), ROWS), []
    for _ in range(2000):
        errors = dependent_blocks(rng, blocks + 1)
        width = block_quantile(errors[:-1].ravel(), number, level)
        shares.append(np.mean(errors[-1] <= width))
    # the guarantee, within three standard deviations of the mean of 2000 draws
    assert np.mean(shares) >= level - 3.0 * np.std(shares) / math.sqrt(2000)
    # and no more than what is left for the block to come and the coarseness of a step
    assert np.mean(shares) <= level + 2.0 / (blocks + 1) + 3.0 * np.std(shares) / math.sqrt(2000)


@given(st.lists(st.lists(st.integers(0, 50), min_size=1, max_size=6), min_size=10, max_size=14), st.integers(1, 90))
def test_the_quantile_is_that_of_exact_weights(errors: list[list[int]], per_cent: int) -> None:
    level = Fraction(per_cent, 100)
    scores = np.array([e for block in errors for e in block], dtype=float)
    block = np.array([k for k, of in enumerate(errors) for _ in of])
    weight = Fraction(1, len(errors) + 1)

    def held(width: float) -> Fraction:
        return sum((weight * Fraction(sum(e <= width for e in of), len(of)) for of in errors), Fraction(0))

    enough = [width for width in sorted(set(scores)) if held(width) >= level]
    assert block_quantile(scores, block, per_cent / 100) == (enough[0] if enough else math.inf)


def test_nine_blocks_are_too_few_and_a_level_takes_its_blocks() -> None:
    assert block_quantile(np.ones(90), np.arange(90) // 10, 0.5) == math.inf
    assert block_quantile(np.ones(100), np.arange(100) // 10, 0.9) == 1.0
    assert block_quantile(np.ones(180), np.arange(180) // 10, 0.95) == math.inf
    assert fewest_rows(0.9) == 10 * _MIN_BLOCK_ROWS
    assert fewest_rows(0.95) == 19 * _MIN_BLOCK_ROWS


@given(st.lists(st.integers(1, 400), min_size=1, max_size=5), st.sampled_from([0.5, 0.8, 0.9, 0.99]))
def test_blocks_of_time_are_contiguous_and_of_one_recording(lengths: list[int], level: float) -> None:
    recording = np.repeat(np.arange(len(lengths)), lengths)
    block = time_blocks(recording, level=level)
    assert ((np.diff(block) == 0) | (np.diff(block) == 1)).all()
    assert (np.diff(block)[np.diff(recording) != 0] == 1).all()


def validation(rows: int, **changes: np.ndarray) -> CrossValidation:
    """One joint whose model leaves 1 and whose offset leaves 2, as many rows as wanted."""
    fields = {
        "after_offset": np.full((rows, 1), -2.0),
        "after_model": np.ones((rows, 1)),
        "inside": np.ones((rows, 1), dtype=bool),
        "recording": np.zeros(rows, dtype=np.int64),
        "block": np.zeros(rows, dtype=np.int64),
    }
    return CrossValidation((), **(fields | changes))


def test_a_joint_whose_folds_were_hardly_inside_has_the_offsets_half_width() -> None:
    inside = np.zeros((400, 1), dtype=bool)
    inside[:30] = True
    found = estimate_intervals(validation(400, inside=inside))
    assert found is not None
    assert found.inside.tolist() == [2.0]


def test_too_few_rows_give_no_intervals() -> None:
    assert estimate_intervals(validation(fewest_rows(0.9) - 1)) is None
    assert estimate_intervals(validation(fewest_rows(0.9))) is not None
    assert estimate_intervals(validation(fewest_rows(0.9)), level=0.95) is None


@pytest.mark.parametrize("level", [0.0, 1.0, 90.0, math.nan])
def test_a_coverage_that_is_no_share_is_refused(level: float) -> None:
    with pytest.raises(InputError, match=r"expected a share between 0 and 1, such as 0\.9"):
        estimate_intervals(validation(400), level=level)


def shares_held(blocks: int, rows: int, share: float) -> np.ndarray:
    held = np.zeros((rows, blocks), dtype=bool)
    held[: round(share * rows)] = True
    return held.T.ravel()


@pytest.mark.parametrize(
    ("blocks", "share", "verdict"),
    [(50, 0.95, "held"), (50, 0.85, "held"), (50, 0.7, "too narrow"), (10, 0.8, "below, which may be chance")],
)
def test_coverage_is_judged_by_blocks(blocks: int, share: float, verdict: str) -> None:
    rows = ROWS if blocks == BLOCKS else _MIN_BLOCK_ROWS
    held = shares_held(blocks, rows, share if rows == ROWS else 0.75)
    assert coverage_verdict(held, np.zeros(len(held), dtype=np.int64), 0.9) == verdict


def test_intervals_that_hold_are_seldom_called_too_narrow() -> None:
    rng = np.random.default_rng(2)
    verdicts = []
    for _ in range(1000):
        held = np.repeat(rng.uniform(size=BLOCKS) < 0.9, ROWS)  # whole blocks, the worst case
        verdicts.append(coverage_verdict(held, np.zeros(len(held), dtype=np.int64), 0.9))
    assert verdicts.count("too narrow") <= 50 + 3 * math.sqrt(50)


FOLDS, JOINTS = 5, 3


def stretch(rng: np.random.Generator) -> np.ndarray:
    """Errors (FOLDS, ROWS, JOINTS) of blocks whose sizes differ from each other by a fifth."""
    return np.exp(0.2 * rng.normal(size=(FOLDS, 1, JOINTS))) * rng.normal(size=(FOLDS, 10 * ROWS, JOINTS))


def rmse_of(errors: np.ndarray) -> np.ndarray:
    return np.sqrt(np.mean(np.square(errors), axis=-2))


def test_another_stretch_has_the_error_and_the_share_that_are_stated_nine_times_in_ten() -> None:
    rng = np.random.default_rng(4)
    fold, wide = np.repeat(np.arange(FOLDS), 10 * ROWS), np.full(JOINTS, 1.6)
    errors_held, shares_held = [], []
    for _ in range(300):
        seen, other = stretch(rng), stretch(rng)
        blocks = rmse_of(seen)
        spread = [Spread("J", "deg", FOLDS, m, 0.0, 9.0, 0.0) for m in blocks.mean(axis=0).tolist()]
        rows = seen.reshape(-1, JOINTS)
        left = CrossValidation(tuple(spread), rows, rows, np.ones(rows.shape, dtype=bool), 0 * fold, fold)
        stated = expected(left, rows, Intervals(0.9, wide, wide))
        low, high, a, b, margin = (
            np.array([getattr(each, name) for each in stated], dtype=float)
            for name in ("rmse_low", "rmse_high", "held_low", "held_high", "rmse_margin")
        )
        true, share = rmse_of(other).mean(axis=0), (np.abs(other) <= wide).mean(axis=(0, 1))
        errors_held.append((low <= true) & (true <= high))
        shares_held.append((a <= share) & (share <= b))
        assert (margin == 9.0).all()
    # three standard deviations of the mean of 900; joints share what they state, and the share's law is no normal one
    assert 0.87 <= np.mean(errors_held) <= 0.95
    assert 0.86 <= np.mean(shares_held) <= 0.97


def test_a_model_that_saw_more_rows_than_those_of_the_blocks_may_err_less() -> None:
    fold, rows = np.repeat(np.arange(FOLDS), ROWS), np.ones((FOLDS * ROWS, 1))
    spread = (Spread("J", "deg", FOLDS, 1.0, 0.0, 0.5, 0.0),)
    left = CrossValidation(spread, rows, rows, np.ones(rows.shape, dtype=bool), 0 * fold, fold)
    (stated,) = expected(left, 0.5 * rows, None)
    assert (stated.rmse_low, stated.rmse_high) == (pytest.approx(0.368 * 0.5 + 0.632), pytest.approx(1.0))
    assert (stated.rmse_margin, stated.held_low) == (stated.rmse_high, None)


def test_zeros_of_recordings_widen_what_another_one_may_err_but_not_where_its_zero_is_known() -> None:
    rng, fold, n = np.random.default_rng(5), np.tile(np.repeat(np.arange(FOLDS), ROWS), 4), 4 * FOLDS * ROWS
    recording, spread = np.repeat(np.arange(4), FOLDS * ROWS), (Spread("J", "deg", FOLDS, 1.0, 0.0, 9.0, 0.0),)
    errors, inside = rng.normal(size=(n, 1)), np.ones((n, 1), dtype=bool)
    zeros = np.array([-3.0, -1.0, 1.0, 3.0])[recording][:, None]
    known, unknown = (CrossValidation(spread, errors, errors, inside, recording, fold, z) for z in (None, zeros))
    (alone,), (widened,) = (expected(each, errors, None) for each in (known, unknown))
    assert alone.rmse_low == widened.rmse_low
    assert widened.rmse_high is not None
    assert widened.rmse_high > math.sqrt(6.0)  # of zeros and errors together
    narrow, wide = (estimate_intervals(each) for each in (known, unknown))
    assert narrow is not None
    assert wide is not None
    assert np.mean(np.abs(errors + zeros) <= wide.inside) >= 0.9 > np.mean(np.abs(errors + zeros) <= narrow.inside)


@pytest.mark.parametrize("memory", [0.0, 0.9, 0.98])
@pytest.mark.parametrize("apart", [0.0, 0.3])
def test_the_promise_for_other_minutes_holds_however_alike_rows_and_unlike_parts_are(
    memory: float, apart: float
) -> None:
    rng, held, widths = np.random.default_rng(6), [], []
    block = np.repeat(np.arange(8), 200)
    for _ in range(300):
        noise = np.sqrt(1.0 - memory**2) * rng.normal(size=(2, 1600))
        noise[:, 0] = rng.normal(size=2)
        errors = lfilter([1.0], [1.0, -memory], noise, axis=1)  # each a share of the one before
        errors *= np.repeat(np.exp(apart * rng.normal(size=(2, 8))), 200, axis=1)
        low, high = rmse_of_other_minutes(errors[0][:, None], block)
        held.append(low[0] <= np.sqrt(np.mean(errors[1] ** 2)) <= high[0])
        widths.append(np.log(high[0] / low[0]))
    # 95 %, within three standard deviations; the largest of unlike parts weighs most in an RMSE, the mean's law does not
    assert np.mean(held) >= 0.95 - 3.0 * math.sqrt(0.05 * 0.95 / 300) - 0.1 * apart
    assert np.mean(held) <= 0.995  # no wider than it must be
    assert np.median(widths) > 2.0 * apart


def test_half_widths_are_the_models_inside_and_the_offsets_outside_or_the_larger() -> None:
    found = estimate_intervals(validation(400))
    assert found is not None
    assert (found.level, found.inside.tolist(), found.outside.tolist()) == (0.9, [1.0], [2.0])
    worse = estimate_intervals(validation(400, after_offset=np.full((400, 1), 0.5)))
    assert worse is not None
    assert worse.outside.tolist() == [1.0]
