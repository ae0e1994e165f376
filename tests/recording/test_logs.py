"""Motion logs as files and on disk, bit for bit, and what is refused of them."""

import errno
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.calibration.fit_recordings import fit_logs
from catenary.errors import FileFormatError, InputError
from catenary.files import sha256_of
from catenary.parallel import on_workers
from catenary.plant import JOINT_ARRAYS, MotionLog
from catenary.recording import parquet_files
from catenary.recording.logs import _FORMAT, on_disk, read_log, read_torque_log, write_parquet
from catenary.recording.parquet_files import open_parquet
from catenary.robots.catalog import load_robot
from recordings import recording

ARM = load_robot("two_link")
Q = np.arange(12.0).reshape(6, 2)


def full_log(rows: int = 8) -> MotionLog:
    rng = np.random.default_rng(0)
    log = recording(rng, rows=rows)
    q, ok = log.q_encoder.copy(), log.ok.copy()
    q[5], ok[5] = np.nan, False
    return replace(
        log,
        q_encoder=q,
        ok=ok,
        qd=rng.normal(size=(rows, 3)),
        tau=rng.normal(size=(rows, 3)),
        signals={"temperature": rng.normal(size=rows), "current": rng.normal(size=rows)},
        signal_units={"temperature": "K", "current": "A"},
        robot="raven2",
        notes=("units not stated",),
        units_assumed=True,
        began=1.7e9,
    )


def rewritten(path: Path, change: Any) -> Path:
    """A Parquet log, changed behind the back of its writer."""
    write_parquet(full_log(), path)
    pq.write_table(change(pq.read_table(path)), path)
    return path


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "run.parquet"


ARRAYS = ("q_nominal", "q_encoder", "qd", "tau", "time", "ok")
SAID = ("joint_names", "joint_units", "robot", "simulated", "units_assumed", "notes", "signal_units", "began")


@pytest.mark.parametrize(
    "log", [full_log(), replace(full_log(), simulated=True, joint_names=("left:J1", "left:J2", "left:J3"))]
)
def test_a_log_comes_back_bit_for_bit(path: Path, log: MotionLog) -> None:
    write_parquet(log, path)
    back = read_log(path)
    for key in ARRAYS:
        assert getattr(back, key).dtype == getattr(log, key).dtype
        assert getattr(back, key).tobytes() == getattr(log, key).tobytes()
    for key in SAID:
        assert getattr(back, key) == getattr(log, key)
    assert list(back.signals) == ["temperature", "current"]
    for name, values in back.signals.items():
        assert_array_equal(values, log.signals[name])
    assert (back.name, back.sha256) == ("run", sha256_of(path))


def test_minimal_log_comes_back_without_what_it_lacks(path: Path) -> None:
    write_parquet(replace(recording(np.random.default_rng(0), rows=4), q_encoder=None, time=None), path)
    log = read_log(path)
    assert (log.q_encoder, log.time, log.qd, log.tau, dict(log.signals)) == (None, None, None, None, {})


def test_schema_states_the_unit_of_every_column(path: Path) -> None:
    write_parquet(full_log(), path)
    schema = pq.read_schema(path)
    units = {field.name: field.metadata[b"unit"].decode() for field in schema}
    expected = {"q_nominal": "rad rad m", "q_encoder": "rad rad m", "qd": "rad/s rad/s m/s", "tau": "Nm Nm N"}
    joints = {f"{key}:J{j + 1}": unit for key, of in expected.items() for j, unit in enumerate(of.split())}
    assert units == joints | {"time": "s", "ok": "", "temperature": "K", "current": "A"}


@pytest.mark.parametrize("name", ["time", "ok", "q_nominal:J1", "tau:J3"])
def test_signal_with_the_name_of_a_column_is_refused(path: Path, name: str) -> None:
    with pytest.raises(InputError, match=f'"run": signal "{name}" has the name of a column'):
        write_parquet(replace(full_log(), signals={name: np.zeros(8)}), path)


def without(*names: str) -> Any:
    return lambda table: table.drop_columns(list(names))


def with_column(name: str, values: Any) -> Any:
    """Table with another column of that name."""

    def change(table: pa.Table) -> pa.Table:
        if name not in table.column_names:
            return table.append_column(name, pa.array(values))
        return table.set_column(table.column_names.index(name), name, pa.array(values))

    return change


def with_metadata(about: bytes) -> Any:
    return lambda table: table.replace_schema_metadata({"catenary": about})


def of_a_later_version(table: pa.Table) -> pa.Table:
    about = json.loads(table.schema.metadata[b"catenary"]) | {"format": "catenary.motion_log.9"}
    return table.replace_schema_metadata({"catenary": json.dumps(about)})


def stating(**changes: Any) -> bytes:
    return json.dumps({"format": _FORMAT, "joint_names": ["a", "b"], "joint_units": ["rad", "rad"]} | changes).encode()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        *[
            (without(name), rf"run.parquet: column.* {name}.* missing")
            for name in ("ok", "q_nominal:J2", "q_encoder:J1", "tau:J3")
        ],
        (without("q_nominal:J1", "q_nominal:J2", "q_nominal:J3"), "q_nominal:<joint> are missing for J1, J2, J3"),
        (with_column("comment", ["a"] * 8), "column comment holds string, expected numbers"),
        (with_column("ok", np.full(8, np.nan)), "column ok holds double, expected true or false"),
        (with_column("q_nominal:J1", [0.0, None, *np.zeros(6)]), "q_nominal is nan at row 1"),
        *[
            (with_metadata(about), "run.parquet: is Parquet but no catenary motion log")
            for about in (b"\xff\xfe", b"not json", b"[]", b"{}", b'{"joint_names": 3}')
        ],
        (lambda _: pa.table({"q_nominal:J1": np.zeros(3)}), "run.parquet: is Parquet but no catenary motion log"),
        (of_a_later_version, "format 'catenary.motion_log.9', expected"),
        (with_metadata(stating(joint_names=["a", "a"])), "joint names must differ, got a, a"),
        (with_metadata(stating(joint_units=[1])), r"no catenary motion log.*joint_units\[0\]: .*string, got 1"),
        (with_metadata(stating(simulated="no")), "simulated: .*boolean, got 'no'"),
    ],
)
def test_a_changed_file_is_refused_by_what_is_wrong(path: Path, change: Any, said: str) -> None:
    with pytest.raises((FileFormatError, InputError), match=said):
        read_log(rewritten(path, change))


def test_truncated_parquet_is_refused_wherever_it_ends(path: Path) -> None:
    write_parquet(full_log(), path)
    whole = path.read_bytes()
    for end in range(0, len(whole), 211):
        path.write_bytes(whole[:end])
        with pytest.raises(FileFormatError, match=r"run.parquet: damaged: .*`catenary extract PROJECT`"):
            read_log(path)
    path.write_bytes(np.random.default_rng(3).bytes(1000))
    with pytest.raises(FileFormatError, match=r"run.parquet: damaged: .*`catenary extract PROJECT`"):
        read_log(path)


def test_what_contradicts_the_file_is_refused(path: Path) -> None:
    write_parquet(full_log(), path)
    with pytest.raises(InputError, match=r'"run" has joint "J3" in m, not rad'):
        read_log(path, units=("rad", "rad", "rad"))
    with pytest.raises(InputError, match=r'"run" has no joint "J4"; it has .* those given are J4'):
        read_log(path, joint_names=("J4", "J2", "J1"))
    assert len(read_log(path, units=["rad", "rad", "m"], joint_names=["J1", "J2", "J3"])) == 8


def test_files_are_told_by_their_ending_and_those_that_cannot_be_had_are_named(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"run.parquet: cannot be written"):
        write_parquet(full_log(), tmp_path / "none" / "run.parquet")
    for name in ("none.npz", "none.parquet", "none.csv"):
        with pytest.raises(FileFormatError, match=f"{name}: no such file"):
            read_log(tmp_path / name)
    np.savez(tmp_path / "run.npz", q_des=Q, q_act=Q, ok=np.ones(6, dtype=bool))
    log = read_log(tmp_path / "run.npz", units=("m", "rad"), joint_names=("slide", "turn"))
    assert (log.joint_units, log.joint_names) == (("m", "rad"), ("slide", "turn"))
    for name, said in (("none.npz", "no such file"), ("none.parquet", "no such file"), ("run.csv", "ending")):
        with pytest.raises(FileFormatError, match=f"{name}: {said}"):
            read_torque_log(tmp_path / name, ARM)
    (tmp_path / "run.txt").write_text("a,b")
    with pytest.raises(FileFormatError, match=r'ending ".txt": expected a recording, .npz, .parquet or .csv'):
        read_log(tmp_path / "run.txt")


@pytest.mark.parametrize(("rows", "flips"), [(8, 120), pytest.param(10_000, 400, marks=pytest.mark.slow)])
def test_flipped_bits_are_noticed_unless_the_numbers_are_the_same(path: Path, rows: int, flips: int) -> None:
    log = full_log(rows)
    write_parquet(log, path)
    whole, rng = path.read_bytes(), np.random.default_rng(4)
    footer = len(whole) - 8 - int.from_bytes(whole[-8:-4], "little")
    for place in rng.integers(4, footer, size=flips):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        try:
            back = read_log(path)
        except (FileFormatError, InputError):
            continue
        assert_array_equal(back.q_nominal, log.q_nominal)
        assert_array_equal(back.q_encoder, log.q_encoder)


ABOUT = {"format": _FORMAT, "joint_names": ["a"], "joint_units": ["rad"]}


def _written(path: Path, columns: dict[str, object], about: object = ABOUT, **options: object) -> Path:
    table = pa.table(columns).replace_schema_metadata({"catenary": json.dumps(about)})
    pq.write_table(table, path, **options)
    return path


def test_rows_that_unpack_to_gigabytes_are_refused_before_they_do(tmp_path: Path) -> None:
    columns = {f"q_nominal:{i}": pa.DictionaryArray.from_arrays(np.zeros(2_000_000, np.int8), [0.5]) for i in range(9)}
    path = _written(tmp_path / "log.parquet", columns)
    assert path.stat().st_size < 100_000  # by runs: a few bytes for millions
    with pytest.raises(FileFormatError, match="2000000 rows of 9 columns in"):
        read_log(path)


def test_pages_that_unpack_too_far_are_refused_before_they_do(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(parquet_files, "MAX_UNPACKED_BYTES", 100_000)
    path = _written(tmp_path / "log.parquet", {"x": ["a" * 100_000, "b" * 100_000]}, compression="zstd")
    assert path.stat().st_size < 5000
    with pytest.raises(FileFormatError, match="its pages would unpack to more than 100000 bytes"):
        open_parquet(path)


def test_whole_numbers_with_gaps_are_refused(tmp_path: Path) -> None:
    columns = {"q_nominal:a": np.zeros(3), "ok": np.ones(3, dtype=bool), "stamp": pa.array([1, None, 3])}
    with pytest.raises(FileFormatError, match="column stamp lacks 1"):
        read_log(_written(tmp_path / "x.parquet", columns))


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
        ({"q": Q}, FileFormatError, "it holds q"),
        ({"q": Q[:, 0], "tau": Q}, FileFormatError, "q: expected shape (N, n), got (6,)"),
        ({"q": Q, "tau": Q, "fs": -1.0}, InputError, "rate -1: expected 0.001 to"),
        ({"q": Q, "tau": Q[:3]}, FileFormatError, "tau: expected shape (6, 2), got (3, 2)"),
        ({"q": Q, "tau": Q * np.nan}, InputError, "no row has all of q_nominal, tau"),
        ({"q": Q, "effort": Q}, InputError, "gives no effort_scale"),
        ({"q": Q, "tau": Q, "t": np.full(6, np.inf)}, InputError, "no row has a time"),
    ],
)
def test_what_is_no_recording_is_refused(read, arrays, error, said):
    with pytest.raises(error) as caught:
        read(**arrays)
    assert said in str(caught.value)


def test_a_recording_on_disk_holds_the_same_bits_and_its_parts_stay_there() -> None:
    log = replace(recording(np.random.default_rng(0), rows=300), signals={"current": np.arange(300.0)})
    kept = on_disk(log)
    for one, other in ((kept, log), (kept.part(10, 200), log.part(10, 200)), (replace(kept, name="b"), log)):
        for name in (*JOINT_ARRAYS, "time", "ok"):
            assert_array_equal(getattr(one, name), getattr(other, name))
            assert getattr(one, name) is None or isinstance(getattr(one, name), np.memmap)
        assert_array_equal(one.signals["current"], other.signals["current"])
    with pytest.raises(ValueError, match="read-only"):
        kept.q_nominal[0, 0] = 1.0


@pytest.mark.parametrize("workers", [1, 2])
def test_a_fit_of_recordings_on_disk_is_that_of_the_same_in_memory(workers: int) -> None:
    logs = [replace(recording(np.random.default_rng(k), rows=400), name=f"run {k}") for k in range(3)]
    options, run = FitOptions(), FitRun()
    alone = fit_logs(logs, options, run)
    with on_workers(workers):
        found = fit_logs([on_disk(log) for log in logs], options, run)
    assert found.card == alone.card


def test_a_full_disk_is_told_with_the_way_round_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(np, "save", full)
    with pytest.raises(InputError, match="cannot hold it: No space left on device; name another folder by TMPDIR"):
        on_disk(recording(np.random.default_rng(0), rows=30))


def test_nothing_is_left_on_disk_when_the_program_ends() -> None:
    program = """
import numpy as np
from catenary.plant import MotionLog
from catenary.recording.logs import on_disk
print(on_disk(MotionLog("a", ("J1",), ("rad",), np.zeros((9, 1)), np.ones(9, dtype=bool))).q_nominal.filename)
"""
    path = Path(
        subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.strip()
    )
    assert path.suffix == ".npy"
    assert not path.parent.exists()
