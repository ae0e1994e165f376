import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from catenary.errors import InputError
from catenary.trajectories import zigzag
from catenary.trajectories.sinusoids import FASTEST_SPEEDS

STRETCHED = [("J1-J2-J3", "generator"), ("J1-J2-J3", "files")]
PATHS = [*((direction, "generator") for direction in zigzag.DIRECTIONS), STRETCHED[1], ("J1-J2-J3", "paper")]

# run_snake_generator.py @ c83e669 of the authors, line by line: turns in the order of the matrix product [deg], division
# after them, factors of the joints' ranges, and the stretch of an axis ("compensation"). files: as commented out there
# and as published; paper: equation 3, in equation 5's range
EDGE, DIAGONAL, A, B = 1 / np.sqrt(3), np.sqrt(2 / 3), 1 / np.sqrt(2), 1 / np.sqrt(3)
AUTHORS: dict[str, tuple[list[tuple[str, float]], list[float], list[float], dict[int, tuple[float, float]]]] = {
    "J1": ([], [1, 1, 1], [EDGE, EDGE, EDGE], {}),
    "J2": ([("z", 90)], [1, 1, 1], [EDGE, EDGE, EDGE], {}),
    "J3": ([("y", 90)], [1, 1, 1], [EDGE, EDGE, EDGE], {}),
    "J1-J2": ([("z", 45)], [A, A, 1], [DIAGONAL, DIAGONAL, EDGE], {}),
    "J2-J3": ([("x", 45), ("z", 90)], [1, A, A], [EDGE, DIAGONAL, DIAGONAL], {}),
    "J1-J3": ([("y", 45)], [A, 1, A], [DIAGONAL, EDGE, DIAGONAL], {}),
    "J1-J2-J3": (
        [("y", 45), ("x", 45), ("z", 45)],
        [B, B, B],
        [1, 1, 1],
        {0: (0.0668181961291, 0.933590052161), 2: (0.0669872981078, 0.934575650721)},
    ),
    "files": ([("x", 45), ("z", 45)], [B, B, B], [1, 1, 1], {0: (0.09093521295520893, 0.9082482904638634)}),
    "paper": ([("y", 45), ("x", 45)], [B, B, B], [1, 1, 1], {}),
}


def homogeneous(axis: str, degrees: float, translation: NDArray[np.float64]) -> NDArray[np.float64]:
    """The authors' Trans."""
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler(axis, degrees, degrees=True).as_matrix()
    matrix[:3, 3] = translation
    return matrix


def authors_path(s: float) -> NDArray[np.float64]:
    """Rows of the authors' loop: accumulated way of the move and of all moves in y and z, ways to go, what moves."""
    rows, point = [np.zeros(3)], np.zeros(3)
    way, far, toward, axis = 0.0, [0.0, 0.0, 0.0], [1.0, 1.0, 1.0], 0
    while far[2] <= 1.05:
        point = point + 0.001 * toward[axis] * np.eye(3)[axis]
        rows.append(point)
        way += 0.001
        far[axis] += 0.001
        if axis == 0 and way >= 1.0:
            axis, way, toward[0] = 1, 0.0, -toward[0]
            if far[1] >= 1.0:
                axis, far[1], toward[1] = 2, 0.0, -toward[1]
        elif axis > 0 and way >= s:
            axis, way = 0, 0.0
    return np.array(rows)


def test_default_box_is_the_published_one() -> None:
    scale = np.array([180.0 / np.pi, 180.0 / np.pi, 1.0])
    box = [zigzag.CALIBRATION_LOWER * scale, zigzag.CALIBRATION_UPPER * scale]
    assert_allclose(box, [[20.0, 55.0, 0.33], [60.0, 110.0, 0.42]])


# a quarter: 5 sweeps and 4 moves of 250 in y in each of 5 layers, and 4 moves and a bit in z
@pytest.mark.parametrize(("sparsity", "rows"), [(0.25, 31052), (0.3333, 21060)])
def test_rows_are_as_many_as_were_published(sparsity: float, rows: int) -> None:
    assert len(zigzag.unit_zigzag(sparsity)) == rows


@pytest.mark.parametrize("sparsity", [1 / 2, 0.3333, 0.1666])
def test_unit_path_is_that_of_the_authors_loop(sparsity: float) -> None:
    assert_allclose(zigzag.unit_zigzag(sparsity), authors_path(sparsity), rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(("direction", "form"), PATHS)
def test_rows_are_those_of_the_authors_transforms(direction: str, form: str) -> None:
    turns, rescale, factors, stretch = AUTHORS[direction if form == "generator" else form]
    u = np.column_stack([zigzag.unit_zigzag(0.5), np.ones(13052)])
    matrix = homogeneous("x", 0.0, 0.5 / np.array(rescale))
    for axis, degrees in turns:
        matrix = matrix @ homogeneous(axis, degrees, np.zeros(3))
    u = (u @ (matrix @ homogeneous("z", 0.0, np.full(3, -0.5))).T)[:, :3] * rescale
    for axis, (first, last) in stretch.items():
        u[:, axis] = (u[:, axis] - first) / (last - first)
    middle, reach = np.array([40.0, 82.5, 0.375]), np.array([40.0, 55.0, 0.09]) * factors
    expected = (middle - reach / 2.0 + u * reach) * [np.pi / 180.0, np.pi / 180.0, 1.0]
    rows = zigzag.zigzag_rows(direction, 0.5, form=form)
    assert_allclose(rows, expected, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(("direction", "form"), PATHS)
def test_motion_passes_the_rows_as_near_as_it_says(direction: str, form: str) -> None:
    rows = zigzag.zigzag_rows(direction, 1 / 3, form=form)
    motion = zigzag.zigzag(direction, [1 / 3], form=form)
    q, _, _ = motion.sample(np.arange(len(rows)) / zigzag.ROWS_PER_SECOND + 0.25)
    left = np.abs(q - rows).max(axis=0)
    assert_allclose(left, motion.corner_distance, rtol=1e-9)
    assert (motion.corner_distance < [np.deg2rad(0.13), np.deg2rad(0.14), 0.23e-3]).all()


def test_several_sparsities_join_at_twice_the_speed_of_the_sweeps_at_most() -> None:
    rows = [zigzag.zigzag_rows("J2-J3", s) for s in (1 / 2, 1 / 3)]
    motion = zigzag.zigzag("J2-J3", [1 / 2, 1 / 3])
    _, qd, _ = motion.sample(np.arange(0.0, motion.duration, 0.01))
    fastest = np.max([np.abs(np.diff(part, axis=0)).max(axis=0) for part in rows], axis=0) * zigzag.ROWS_PER_SECOND
    assert (np.abs(qd).max(axis=0) <= 2.0 * fastest * (1.0 + 1e-9)).all()
    assert (np.abs(qd).max(axis=0) <= FASTEST_SPEEDS).all()  # the authors' own
    apart = sum(len(part) - 1 for part in rows) / zigzag.ROWS_PER_SECOND
    assert apart < motion.duration < apart + 20.0  # crossing a range takes 8 s


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
        ({"direction": "J1-J2-J3", "form": "newest"}, "form of J1-J2-J3: expected one of generator, files, paper"),
        ({"direction": "J2-J3", "form": "paper"}, "direction J2-J3 has one form, generator; got 'paper'"),
        ({"sparsities": []}, "at least one"),
        *(({"sparsities": [0.5, wrong]}, "sparsity") for wrong in (0.0, 1.5, np.nan)),
        ({"rows_per_second": 0.0}, "rows_per_second"),
        ({"blend": -1.0}, "blend"),
        ({"lower": [0.0, 0.0, 0.5]}, "lower below upper"),
    ],
)
def test_bad_arguments_are_refused(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        zigzag.zigzag(**{"direction": "J1", "sparsities": [0.5], **arguments})
