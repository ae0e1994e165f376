"""The rules that are tried beside ours do what their names say, and the tables count them."""

import numpy as np
from numpy.testing import assert_allclose

from papers.beyond.rules import MEANS, OURS, WEIGHTED, WIDEST, WITHOUT, half_widths, regions


def errors(rows: int = 1000, joints: int = 2) -> np.ndarray:
    return np.random.default_rng(0).standard_normal((rows, joints))


def test_half_widths_without_the_block_to_come_hold_the_share_of_the_rows_that_they_were_made_of() -> None:
    scores, recording = errors(), np.zeros(1000, dtype=np.int64)
    plain = half_widths(scores, recording, WITHOUT)
    held = (np.abs(scores) <= plain).mean(axis=0)
    assert_allclose(held, 0.9, atol=0.005)  # blocks of 20 rows weigh alike
    assert (half_widths(scores, recording, OURS) >= plain).all()
    assert (half_widths(scores, recording, WIDEST) >= plain).all()


def test_weights_of_least_squares_are_none_negative_and_no_worse_than_the_best_kind() -> None:
    rng = np.random.default_rng(1)
    shared = rng.standard_normal(500)
    kinds = np.column_stack([shared + rng.standard_normal(500) * spread for spread in (0.3, 0.6, 2.0)])
    weights = MEANS[WEIGHTED](kinds)
    assert (weights >= 0.0).all()
    assert_allclose(weights.sum(), 1.0, atol=1e-12)
    assert np.square(kinds @ weights).mean() <= np.square(kinds).mean(axis=0).min() + 1e-9


def test_regions_part_positions_that_lie_apart() -> None:
    middles = np.array([[0.0, 0.0], [5.0, 0.0], [0.0, 5.0], [5.0, 5.0], [10.0, 10.0]])
    found = regions(np.repeat(middles, 20, axis=0) + 0.01 * errors(100))
    assert [len(np.unique(part)) for part in np.split(found, 5)] == [1] * 5
    assert len(np.unique(found)) == 5
