"""Paths, recordings and inputs of the calibration paper's experiments."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary import MotionLog
from papers.calibration import figure_3
from papers.calibration.figure_5 import LONG, parts
from papers.calibration.recordings import SETS, at_rows


def test_a_single_directions_volume_is_the_cubes_and_its_hole_half_the_diagonal_between_sweeps() -> None:
    found = figure_3.path("J1", (1 / 2,))
    side = 3.0**-0.5
    assert_allclose(found["volume"], side**3, rtol=0.06)  # the path goes 5 % beyond the cube
    # four sweeps of a square of side / 2 leave its middle half a diagonal away; the grid misses it by up to 1/40
    assert_allclose(found["hole"], side * np.sqrt(0.5), atol=0.1)
    assert found["reversals"] == [8, 2, 0]


@pytest.mark.parametrize("share", [0.25, 1.0])
def test_even_share_of_a_joint_that_dwells_on_a_part_of_its_range(share: float) -> None:
    rng = np.random.default_rng(0)
    positions = np.append(rng.uniform(0.0, share, 100_000), 1.0)
    assert_allclose(figure_3.even_share(positions), share, atol=0.02)  # one bin


def test_corners_are_where_a_broken_line_turns() -> None:
    line = np.concatenate([np.linspace(0.0, 1.0, 11), np.linspace(0.9, 0.0, 10)])
    rows = np.column_stack([line, line, 0.0 * line])
    assert figure_3.corners(rows).tolist() == [0, 10, 20]
    assert figure_3.reversals(line) == 1


SECONDS = {"1/2": 204.0, "1/3": 328.0, "1/4": 483.0, "1/5": 670.0, "1/6": 888.0}


def test_sets_are_all_combinations_no_longer_than_the_longest() -> None:
    names = list(SECONDS)
    several = ["+".join(name for k, name in enumerate(names) if mask >> k & 1) for mask in range(1, 2 ** len(names))]
    longest = sum(SECONDS[part] for part in parts("1/2+1/3+1/4"))
    assert {n for n in several if sum(SECONDS[part] for part in parts(n)) <= longest} == set(SETS)
    assert longest > LONG


def test_some_rows_of_a_recording_keep_every_column() -> None:
    q = np.arange(12.0).reshape(4, 3)
    log = MotionLog(
        "log",
        ("a", "b", "c"),
        ("rad", "rad", "m"),
        q,
        np.array([True, False, True, True]),
        q_encoder=q + 1.0,
        time=np.arange(4.0),
        tau=2.0 * q,
        signals={"more": np.arange(4.0)},
    )
    few = at_rows(log, np.array([1, 3]))
    np.testing.assert_array_equal(few.q_nominal, q[[1, 3]])
    np.testing.assert_array_equal(few.tau, 2.0 * q[[1, 3]])
    np.testing.assert_array_equal(few.signals["more"], [1.0, 3.0])
    assert few.ok.tolist() == [False, True]
