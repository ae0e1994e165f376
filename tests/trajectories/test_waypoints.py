from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import FileFormatError, InputError
from catenary.trajectories.waypoints import follow_waypoints, play_rows, read_waypoints

CORNERS = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.5], [0.0, 0.5]]


def test_busiest_joint_moves_at_its_speed_past_the_rows() -> None:
    motion = follow_waypoints(CORNERS, speed=[0.1, 0.2], blend=0.5)
    assert motion.duration == pytest.approx(10.0 + 2.5 + 10.0 + 0.5)
    assert_allclose(motion(5.0).qd, [0.1, 0.0], atol=1e-12)
    assert_allclose(motion(11.5).qd, [0.0, 0.2], atol=1e-12)
    assert_allclose(motion.corner_distance, [3 / 32 * 0.1 * 0.5, 3 / 32 * 0.2 * 0.5])


def test_dense_rows_are_followed_smoothly() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 5000)
    motion = follow_waypoints(np.column_stack([np.cos(angle), np.sin(angle)]), speed=[0.2, 0.2], blend=0.5)
    q, qd, qdd = motion.sample(np.linspace(0.0, motion.duration, 5000))
    # averaging an arc of 0.14 rad (0.28 rad/s at most) over the blend cuts its corner by 1/20 of its square
    assert np.abs(np.linalg.norm(q, axis=1) - 1.0).max() < 1e-3
    assert np.abs(qd).max() <= 0.2 * (1.0 + 1e-9)
    assert np.abs(qdd).max() <= 3.0 * 0.2 / 0.5 * (1.0 + 1e-9)


def test_motion_starts_where_the_robot_is_and_rests_at_the_first_row() -> None:
    motion = follow_waypoints(CORNERS, speed=[0.1, 0.2], blend=0.5, q_start=[-0.5, 1.0])
    assert_allclose(motion(0.0).q, [-0.5, 1.0])
    there = 5.0 + 0.5
    assert_allclose(motion(there), [[0.0, 0.0], [0.0, 0.0], [0.0, 0.0]], atol=1e-12)
    onward = follow_waypoints(CORNERS, speed=[0.1, 0.2], blend=0.5)
    assert motion.duration == pytest.approx(there + onward.duration)
    assert_allclose(motion(there + 7.0).q, onward(7.0).q, atol=1e-12)


def test_robot_that_is_there_starts_at_once_and_one_row_is_a_go_to() -> None:
    speed = [0.5, 0.5]
    there = follow_waypoints(CORNERS, speed=speed, q_start=CORNERS[0])
    assert there.duration == follow_waypoints(CORNERS, speed=speed).duration
    motion = follow_waypoints([[1.0, 1.0]], speed=speed, q_start=[0.0, 0.5])
    assert_allclose(motion(motion.duration).q, [1.0, 1.0])
    assert follow_waypoints([[1.0, 1.0]], speed=speed).duration == 0.0


def test_repeated_rows_do_not_stop_the_motion() -> None:
    doubled = np.repeat(CORNERS, 2, axis=0)
    one, other = (follow_waypoints(rows, speed=[0.1, 0.1]) for rows in (CORNERS, doubled))
    assert_array_equal(one.sample(np.linspace(0, 20, 50))[0], other.sample(np.linspace(0, 20, 50))[0])


def test_rows_are_played_at_their_rate_and_equal_rows_pause() -> None:
    rows = np.array([[0.0], [1.0], [1.0], [1.0], [2.0]])
    motion = play_rows(rows, rows_per_second=2.0, blend=0.1)
    assert motion.duration == pytest.approx(4 / 2.0 + 0.1)
    assert_allclose(motion(1.0), [[1.0], [0.0], [0.0]], atol=1e-12)


@pytest.mark.parametrize("ending", [".csv", ".npy"])
def test_files_give_their_rows(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"motion{ending}"
    if ending == ".csv":
        np.savetxt(path, CORNERS, delimiter=",")
    else:
        np.save(path, CORNERS)
    assert_array_equal(read_waypoints(path, 2), CORNERS)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("motion.csv", "J1,J2\n0,1\n", "rows of 2 numbers"),
        ("motion.csv", "0,1,2\n", r"expected shape \(N, 2\)"),
        ("motion.csv", "0,1\n0,nan\n", "is nan"),
        ("motion.csv", "0,1\n0\n", "rows of 2 numbers"),
        ("motion.npy", "0,1\n", "rows of 2 numbers"),
        ("motion.txt", "0,1\n", "expected .csv or .npy"),
        ("motion.csv", None, "no such file"),
    ],
)
def test_bad_files_are_refused_by_name(tmp_path: Path, name: str, text: str | None, message: str) -> None:
    path = tmp_path / name
    if text is not None:
        path.write_text(text)
    with pytest.raises(FileFormatError, match=message) as caught:
        read_waypoints(path, 2)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"points": np.empty((0, 2))}, "at least one row"),
        ({"points": np.empty((3, 0)), "speed": []}, "at least one row of one joint"),
        ({"points": [0.0, 1.0]}, r"points: expected shape \(N, N\)"),
        ({"points": [[0.0, np.nan]]}, "is nan"),
        ({"speed": [0.1]}, r"speed: expected shape \(2,\)"),
        ({"speed": [0.1, 0.0]}, "speed: expected more than 0"),
        ({"blend": 0.0}, "blend: expected more than 0"),
        ({"q_start": [0.0]}, r"q_start: expected shape \(2,\)"),
    ],
)
def test_bad_arguments_are_refused(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        follow_waypoints(**{"points": CORNERS, "speed": [0.1, 0.1], **arguments})
    with pytest.raises(InputError, match="rows_per_second: expected more than 0"):
        play_rows(CORNERS, rows_per_second=0.0)
