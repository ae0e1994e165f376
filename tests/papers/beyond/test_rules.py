"""The rules that are tried beside ours do what their names say, and the tables count them."""

import numpy as np
from numpy.testing import assert_allclose

from papers.beyond.rules import (
    AFTERWARDS,
    AUTO,
    EITHER,
    LEAST,
    MEANS,
    OURS,
    REGIONS,
    WEIGHTED,
    WIDEST,
    WITHOUT,
    choice_table,
    elsewhere_table,
    half_widths,
    interval_table,
    regions,
)


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


def test_tables_count_what_is_within_the_bound_and_what_one_kind_could_reach() -> None:
    rmse = [{"offset": [2.0], "linear": [1.0]}, {"offset": [1.0], "linear": [1.2]}, {"offset": [3.0], "linear": [1.0]}]
    held = {"linear, play": {OURS: [0.9]}, "neural": {OURS: [0.97]}}
    tests = [{"rmse": each, "chosen": {AUTO: ["linear"], LEAST: ["offset"]}, "held": held} for each in rmse]
    rows = {row[0]: row[1:] for row in choice_table([("random_train", tests)]).rows}
    assert rows[AUTO][:2] == ["2 of 3", "2 of 3"]
    assert rows[LEAST][0] == "1 of 3"
    assert rows[AFTERWARDS][0] == "2 of 3"
    assert interval_table([("error_exp1", tests)]).rows == [[OURS, "3, 3, 0 of 6", "-", "1, 1, 0 of 2", "93.5 %"]]
    result = {
        "tests": dict(zip("abc", rmse, strict=True)),
        "chosen": {rule: ["linear"] for rule in (AUTO, LEAST, REGIONS, EITHER)},
    }
    assert elsewhere_table([result]).rows[0] == [AUTO, "2 of 3", "1.063", "1.20"]
