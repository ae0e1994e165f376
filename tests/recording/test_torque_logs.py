import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import FileFormatError, InputError
from catenary.recording.torque_logs import read_torque_log
from catenary.robots.catalog import load_robot

ARM = load_robot("two_link")
Q = np.arange(12.0).reshape(6, 2)


@pytest.fixture
def read(tmp_path):
    def from_arrays(model=ARM, **arrays):
        path = tmp_path / "run.npz"
        np.savez(path, **arrays)
        return read_torque_log(path, model)

    return from_arrays


def test_a_recording_has_the_robots_names_units_and_a_hash(read):
    log = read(q=Q, tau=2 * Q, dq=3 * Q, fs=200.0)
    assert log.joint_names == ARM.joint_names
    assert log.joint_units == ARM.joint_units
    assert log.name == "run"
    assert log.sha256 is not None
    assert_allclose(log.qd, 3 * Q)
    assert_allclose(log.time, np.arange(6) / 200.0)


def test_time_stamps_go_before_a_rate_and_poses_need_none(read):
    time = np.array([0.0, 0.1, 0.3, 0.35, 0.4, 0.5])
    assert_allclose(read(q=Q, tau=Q, t=time, fs=10.0).time, time)
    log = read(q=Q.astype(np.float32), tau=Q)
    assert (log.time, log.qd, log.q_nominal.dtype) == (None, None, np.float64)


def test_raw_efforts_are_scaled_by_the_robots_file(read):
    model = load_robot("tiago")
    log = read(model, q=np.zeros((3, 8)), effort=np.ones((3, 8)))
    assert_allclose(log.tau[0], [1, 13.6, 13.6, -8.7, -8.7, -20.6, -20.6, -20.6])
    assert log.notes == ("raw efforts times the robot's effort_scale",)


@pytest.mark.parametrize(
    ("arrays", "error", "said"),
    [
        ({"tau": Q}, FileFormatError, "expected arrays q (N, n) and tau (N, n)"),
        ({"q": Q}, FileFormatError, "this file has q"),
        ({"q": Q[:, 0], "tau": Q}, InputError, "q: expected shape (N, n), got (6,)"),
        ({"q": Q, "tau": Q, "fs": [1.0, 2.0]}, InputError, "fs: expected shape (), got (2,)"),
        ({"q": Q, "tau": Q, "fs": -1.0}, InputError, "expected a rate above zero"),
        ({"q": Q, "tau": Q > 0}, InputError, "tau: expected numbers, got bool"),
        ({"q": Q, "tau": Q[:3]}, InputError, "tau: expected shape (6, 2), got (3, 2)"),
        ({"q": Q, "tau": Q * np.nan}, InputError, "tau is nan at row 0"),
        ({"q": Q, "effort": Q}, InputError, "gives no effort_scale"),
        ({"q": Q, "tau": Q, "t": np.full(6, np.inf)}, InputError, "t is inf at row 0"),
    ],
)
def test_what_is_no_recording_is_refused(read, arrays, error, said):
    with pytest.raises(error) as caught:
        read(**arrays)
    assert said in str(caught.value)


def test_files_of_other_kinds_are_refused(tmp_path):
    with pytest.raises(FileFormatError, match=r"run\.csv: ending"):
        read_torque_log(tmp_path / "run.csv", ARM)
    for ending in ("npz", "parquet"):
        with pytest.raises(FileFormatError, match="no such file"):
            read_torque_log(tmp_path / f"none.{ending}", ARM)
