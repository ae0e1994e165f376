from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import InputError
from catenary.trajectories import zigzag

LOW, HIGH = [-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]


def test_default_box_is_the_published_one() -> None:
    scale = np.array([180.0 / np.pi, 180.0 / np.pi, 1.0])
    box = [zigzag.CALIBRATION_LOWER * scale, zigzag.CALIBRATION_UPPER * scale]
    assert_allclose(box, [[20.0, 55.0, 0.33], [60.0, 110.0, 0.42]])


# a quarter: 5 sweeps and 4 moves of 250 in y in each of 5 layers, and 4 moves and a bit in z
@pytest.mark.parametrize(("sparsity", "rows"), [(0.25, 31052), (0.3333, 21060)])
def test_rows_are_as_many_as_were_published(sparsity: float, rows: int) -> None:
    assert len(zigzag.unit_zigzag(sparsity)) == rows


@settings(deadline=None)
@given(st.floats(0.1, 1.0))
def test_unit_path_moves_one_axis_at_a_time_and_covers_the_cube(sparsity: float) -> None:
    path = zigzag.unit_zigzag(sparsity)
    steps = np.diff(path, axis=0)
    assert_allclose(np.sort(np.abs(steps), axis=1), np.tile([0.0, 0.0, 0.001], (len(steps), 1)), atol=1e-12)
    assert_allclose(path.min(axis=0), 0.0, atol=1e-9)  # thousands of additions of 0.001
    assert (path.max(axis=0) >= 1.0 - 1e-9).all()
    # a move is a multiple of a step; the last one in y may begin just short of 1
    assert (path.max(axis=0) <= [1.002, 1.002 + sparsity, 1.052]).all()


@pytest.mark.parametrize("direction", zigzag.DIRECTIONS)
def test_sweeps_move_exactly_the_joints_in_the_name(direction: str) -> None:
    rows = zigzag.zigzag_rows(direction, 0.5, lower=LOW, upper=HIGH)
    moving = np.abs(rows[900] - rows[0]) > 1e-9
    named = [f"J{j}" in direction for j in (1, 2, 3)]
    assert_array_equal(moving, named)


@pytest.mark.parametrize("directions", [("J1", "J2", "J3"), ("J1-J2", "J2-J3", "J1-J3")])
def test_unpublished_directions_permute_the_joints_cyclically(directions: tuple[str, ...]) -> None:
    rows = [zigzag.zigzag_rows(direction, 0.5, lower=LOW, upper=HIGH) for direction in directions]
    for one, following in pairwise(rows):
        assert_allclose(np.roll(one, 1, axis=1), following, atol=1e-15)


@pytest.mark.parametrize("direction", zigzag.DIRECTIONS[:-1])
def test_single_and_double_directions_cover_equal_volumes(direction: str) -> None:
    rows = zigzag.zigzag_rows(direction, 0.5, lower=LOW, upper=HIGH)
    turns = [np.flatnonzero(np.abs(np.diff(rows, 2, axis=0)).max(axis=1) > 1e-6)[k] + 1 for k in (0, 1)]
    sweep, sideways = rows[turns[0]] - rows[0], rows[turns[1]] - rows[turns[0]]
    onward = rows[-1] - rows[-2]
    volume = abs(np.linalg.det([sweep, sideways / 0.5, onward / 0.001]))
    assert_allclose(volume, 8.0 / 3.0**1.5, rtol=1e-9)  # equations 4 and 5: a cube of 1/sqrt 3 of each range


@pytest.mark.parametrize("direction", zigzag.DIRECTIONS)
def test_motion_passes_the_rows_as_near_as_it_says(direction: str) -> None:
    rows = zigzag.zigzag_rows(direction, 1 / 3)
    motion = zigzag.zigzag(direction, [1 / 3])
    q, _, _ = motion.sample(np.arange(len(rows)) / zigzag.ROWS_PER_SECOND + 0.25)
    left = np.abs(q - rows).max(axis=0)
    assert_allclose(left, motion.corner_distance, rtol=1e-9)
    assert (motion.corner_distance < [np.deg2rad(0.13), np.deg2rad(0.14), 0.23e-3]).all()


def test_several_sparsities_join_without_exceeding_the_speed_of_the_sweeps() -> None:
    rows = [zigzag.zigzag_rows("J2-J3", s) for s in (1 / 2, 1 / 3)]
    motion = zigzag.zigzag("J2-J3", [1 / 2, 1 / 3])
    _, qd, _ = motion.sample(np.arange(0.0, motion.duration, 0.01))
    fastest = (
        np.max([np.abs(np.diff(part, axis=0)).max(axis=0) for part in rows], axis=0) * zigzag.ROWS_PER_SECOND
    )
    assert (np.abs(qd).max(axis=0) <= fastest * (1.0 + 1e-9)).all()
    apart = sum(len(part) - 1 for part in rows) / zigzag.ROWS_PER_SECOND
    assert apart < motion.duration < apart + 40.0  # crossing a range takes 16 s


def test_each_of_several_paths_is_as_it_would_be_alone() -> None:
    together, first, second = (zigzag.zigzag("J1-J3", s) for s in ([1 / 2, 1 / 3], [1 / 2], [1 / 3]))
    for alone, begin in ((first, 0.0), (second, together.duration - second.duration)):
        times = np.linspace(0.0, alone.duration, 5000)
        for one, other in zip(alone.sample(times), together.sample(begin + times), strict=True):
            assert_allclose(one, other, atol=1e-10)  # times in seconds, rounded to 1e-13


def test_speed_is_in_rows_per_second_and_shorter_blends_stay_nearer() -> None:
    motion = zigzag.zigzag("J1", [1 / 2], rows_per_second=100.0, blend=0.2)
    assert_allclose(motion.duration, (len(zigzag.unit_zigzag(1 / 2)) - 1) / 100.0 + 0.2)
    near = zigzag.zigzag("J1", [1 / 2], rows_per_second=100.0, blend=0.04)
    assert_allclose(motion.corner_distance, 5.0 * near.corner_distance, rtol=1e-6)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"direction": "J4"}, "direction: expected one of J1, J2"),
        ({"direction": "J3-J1"}, "direction"),
        ({"sparsities": []}, "at least one"),
        *(({"sparsities": [0.5, wrong]}, "sparsity") for wrong in (0.0, -0.5, 0.001, 1.5, np.nan, "half")),
        ({"rows_per_second": 0.0}, "rows_per_second"),
        ({"rows_per_second": np.nan}, "rows_per_second"),
        ({"blend": -1.0}, "blend"),
        ({"lower": [0.0, 0.0, 0.5]}, "lower below upper"),
        ({"upper": [1.0, 2.0]}, r"upper: expected shape \(3,\)"),
        ({"upper": [1.0, 2.0, np.inf]}, r"upper\[2\] is inf"),
    ],
)
def test_bad_arguments_are_refused(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        zigzag.zigzag(**{"direction": "J1", "sparsities": [0.5], **arguments})
