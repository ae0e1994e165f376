"""What others publish imports without a mapping."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import FileFormatError
from catenary.recording.import_formats.raven_recordings import read_raven
from catenary.recording.logs import read_log, write_parquet
from catenary.robots.catalog import load_robot
from catenary.workflows.import_recording import import_recording, known_layout
from oracles.raven_recording import record, write_bag, write_csv
from recordings import recording


@pytest.fixture(scope="module")
def raven(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("raven")
    return write_bag(record(folder / "journal", 3.0), folder / "a.bag")


def test_a_raven_s_bag_needs_no_mapping(raven: Path) -> None:
    log, own = import_recording(raven), read_raven([raven.parent / "journal"]).log
    for key in ("q_nominal", "q_encoder", "ok", "time", "qd", "tau"):
        assert_allclose(getattr(log, key), getattr(own, key))


def test_the_252_columns_need_no_mapping(raven: Path, tmp_path: Path) -> None:
    table = write_csv(raven.parent / "journal", tmp_path / "a.csv")
    assert known_layout([table]) == "RAVEN-II's published CSV"
    assert_allclose(import_recording(table).q_nominal, read_log(table).q_nominal)


def test_a_motion_log_and_a_command_log_stay_what_they_are(tmp_path: Path) -> None:
    log = recording(np.random.default_rng(0), rows=50)
    write_parquet(log, tmp_path / "log.parquet")
    assert_allclose(import_recording(tmp_path / "log.parquet").q_nominal, log.q_nominal)
    q = np.zeros((5, 2))
    np.savez(tmp_path / "log.npz", q_des=q, q_act=q, ok=np.ones(5, dtype=bool))
    assert import_recording(tmp_path / "log.npz", units="rad,m").joint_units == ("rad", "m")
    assert import_recording(tmp_path / "log.npz", robot="two_link").joint_names == load_robot("two_link").joint_names


def test_positions_and_torques_take_their_joints_from_the_robot(tmp_path: Path) -> None:
    q = np.zeros((5, 2))
    np.savez(tmp_path / "log.npz", q=q, tau=q + 1.0, fs=100.0)
    log = import_recording(tmp_path / "log.npz", robot="two_link")
    assert log.tau is not None
    assert known_layout([tmp_path / "log.npz"]) is None  # without a robot it needs a mapping
    mapped = import_recording(tmp_path / "log.npz", ["q_nominal=q", "tau=tau"], units="rad")
    assert_allclose(mapped.time, log.time)  # type: ignore[arg-type]


def test_no_file_is_told() -> None:
    with pytest.raises(FileFormatError, match="no such file"):
        import_recording("nothing.bag")
