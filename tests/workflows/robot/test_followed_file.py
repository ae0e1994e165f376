from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose

from catenary.errors import FileFormatError, InputError
from catenary.plant import MotionLog
from catenary.recording.logs import write_parquet
from catenary.trajectories.zigzag import zigzag, zigzag_rows
from catenary.workflows.robot.followed_file import FollowedFile, read_followed_file


def read(folder: Path, text: str, **options: float) -> FollowedFile:
    (folder / "run.csv").write_text(text)
    return read_followed_file(folder / "run.csv", **options)


def test_units_of_the_heading_are_obeyed(tmp_path: Path) -> None:
    file = read(tmp_path, "time [ms],elbow [deg],insertion [mm]\n500,90,400\n1500,180,350\n")
    assert (file.joint_names, file.joint_units) == (("elbow", "insertion"), ("rad", "m"))
    assert_allclose(file.time, [0.0, 1.0])
    assert_allclose(file.q, [[np.pi / 2, 0.4], [np.pi, 0.35]])


@pytest.mark.parametrize(
    "text",
    [
        "time;elbow;insertion\n[ms];[deg];[mm]\n500;90,0;400\n1500;180,0;350\n",
        "% of the lab\n%time [ms]\telbow [deg]\tinsertion [mm]\n500\t90\t400\n1500\t180\t350\n",
        "# time [ms], elbow [deg], insertion [mm]\n  500   90  400\n 1500  180  350\n",
    ],
)
def test_a_motion_is_read_from_every_table_of_text_that_import_reads(text: str, tmp_path: Path) -> None:
    file = read(tmp_path, text)
    assert (file.joint_names, file.joint_units) == (("elbow", "insertion"), ("rad", "m"))
    assert_allclose(file.time, [0.0, 1.0])
    assert_allclose(file.q, [[np.pi / 2, 0.4], [np.pi, 0.35]])


def test_a_published_zigzag_becomes_the_trajectory_of_the_generator(tmp_path: Path) -> None:
    rows = zigzag_rows("J1", 0.5)
    np.savetxt(tmp_path / "traj.csv", rows, delimiter=",", fmt="%.17g")
    file = read_followed_file(tmp_path / "traj.csv")
    times = np.linspace(0.0, file.time[-1], 501)
    # each row is a corner here, only the turns are there: straight between either way
    q, expected = (motion.sample(times)[0] for motion in (file.trajectory(), zigzag("J1", [0.5])))
    assert_allclose(q, expected, rtol=0.0, atol=1e-9)
    assert file.notes


def test_a_motion_log_is_followed_along_what_the_robot_reported(tmp_path: Path) -> None:
    q = np.column_stack([np.linspace(0.1, 0.2, 20), np.linspace(0.3, 0.25, 20)])
    log = MotionLog("run", ("a", "b"), ("rad", "m"), q, np.ones(20, bool), time=5.0 + 0.1 * np.arange(20))
    write_parquet(log, tmp_path / "run.parquet")
    file = read_followed_file(tmp_path / "run.parquet")
    assert file.time[0] == 0.0
    assert_allclose(file.q, q)
    assert pq.read_schema(tmp_path / "run.parquet").names  # the file is left as it was


def test_an_archive_states_its_units(tmp_path: Path) -> None:
    np.savez(tmp_path / "run.npz", q=[[90.0], [45.0]], t=[0.0, 2.0], units=["deg"], joint_names=["a"])
    assert_allclose(read_followed_file(tmp_path / "run.npz").q, [[np.pi / 2], [np.pi / 4]])


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("time [s],elbow\n0,1\n", "no unit"),
        ("time [s],elbow [grad]\n0,1\n", "grad"),
        ("elbow [deg],time [s]\n0,1\n", "first column"),
        ("time [s],elbow [deg]\n0,1\n1,x\n", "line 3"),
        ("1,2\n3,4\n", "heading"),
        ("", "got no line"),
        *((f"time [s],elbow [deg]\n{rows}", "row 2") for rows in ("0,1\n0,2\n", "1,1\n0,2\n", "0,1\n1,nan\n")),
    ],
)
def test_a_csv_that_leaves_a_doubt_is_refused(tmp_path: Path, text: str, complaint: str) -> None:
    with pytest.raises((FileFormatError, InputError), match=complaint):
        read(tmp_path, text)


def test_a_rate_is_refused_where_the_file_has_times(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="states its times"):
        read(tmp_path, "time [s],elbow [deg]\n0,1\n1,2\n", rows_per_second=10.0)
