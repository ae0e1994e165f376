import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_array_equal

from catenary.errors import FileFormatError, InputError
from catenary.files import sha256_of
from catenary.plant import MotionLog
from catenary.recording.logs import FORMAT, read_log, write_parquet
from recordings import recording


def full_log() -> MotionLog:
    rng = np.random.default_rng(0)
    log = recording(rng, rows=8)
    q, ok = log.q_encoder.copy(), log.ok.copy()
    q[5], ok[5] = np.nan, False
    return replace(
        log,
        q_encoder=q,
        ok=ok,
        qd=rng.normal(size=(8, 3)),
        tau=rng.normal(size=(8, 3)),
        signals={"temperature": rng.normal(size=8), "current": rng.normal(size=8)},
        signal_units={"temperature": "K", "current": "A"},
        robot="raven2",
        notes=("units not stated",),
        units_assumed=True,
    )


def rewritten(path: Path, change: Any) -> Path:
    """A Parquet log, changed behind the back of its writer."""
    write_parquet(full_log(), path)
    pq.write_table(change(pq.read_table(path)), path)
    return path


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "run.parquet"


@pytest.mark.parametrize("key", ["q_nominal", "q_encoder", "qd", "tau", "time", "ok"])
def test_arrays_come_back_bit_for_bit(path: Path, key: str) -> None:
    log = full_log()
    write_parquet(log, path)
    back, expected = getattr(read_log(path), key), getattr(log, key)
    assert back.dtype == expected.dtype
    assert back.tobytes() == expected.tobytes()


@pytest.mark.parametrize(
    "key", ["joint_names", "joint_units", "robot", "simulated", "units_assumed", "notes", "signal_units"]
)
def test_what_is_said_about_the_log_comes_back(path: Path, key: str) -> None:
    log = full_log()
    write_parquet(log, path)
    assert getattr(read_log(path), key) == getattr(log, key)


def test_signals_come_back_bit_for_bit(path: Path) -> None:
    log = full_log()
    write_parquet(log, path)
    signals = read_log(path).signals
    assert list(signals) == ["temperature", "current"]
    for name, values in signals.items():
        assert_array_equal(values, log.signals[name])


def test_minimal_log_comes_back_without_what_it_lacks(path: Path) -> None:
    write_parquet(replace(recording(np.random.default_rng(0), rows=4), q_encoder=None, time=None), path)
    log = read_log(path)
    assert (log.q_encoder, log.time, log.qd, log.tau, dict(log.signals)) == (None, None, None, None, {})


def test_simulated_log_says_so_when_read_again(path: Path) -> None:
    write_parquet(replace(full_log(), simulated=True), path)
    assert read_log(path).simulated


def test_log_names_its_file_and_the_files_hash(path: Path) -> None:
    write_parquet(full_log(), path)
    log = read_log(path)
    assert (log.name, log.sha256) == ("run", sha256_of(path))


def test_schema_states_the_unit_of_every_column(path: Path) -> None:
    write_parquet(full_log(), path)
    schema = pq.read_schema(path)
    units = {field.name: field.metadata[b"unit"].decode() for field in schema}
    assert units == {
        "time": "s",
        "ok": "",
        **dict(zip([f"q_nominal:J{i}" for i in (1, 2, 3)], ("rad", "rad", "m"), strict=True)),
        **dict(zip([f"q_encoder:J{i}" for i in (1, 2, 3)], ("rad", "rad", "m"), strict=True)),
        **dict(zip([f"qd:J{i}" for i in (1, 2, 3)], ("rad/s", "rad/s", "m/s"), strict=True)),
        **dict(zip([f"tau:J{i}" for i in (1, 2, 3)], ("Nm", "Nm", "N"), strict=True)),
        "temperature": "K",
        "current": "A",
    }


def test_joint_whose_name_holds_a_colon_comes_back(path: Path) -> None:
    write_parquet(replace(full_log(), joint_names=("left:J1", "left:J2", "left:J3")), path)
    assert read_log(path).joint_names == ("left:J1", "left:J2", "left:J3")


def test_folder_that_looks_like_a_partition_adds_no_column(tmp_path: Path) -> None:
    (tmp_path / "day=3").mkdir()
    write_parquet(full_log(), tmp_path / "day=3" / "run.parquet")
    assert "day" not in read_log(tmp_path / "day=3" / "run.parquet").signals


def test_single_precision_columns_are_read(path: Path) -> None:
    def narrow(table: pa.Table) -> pa.Table:
        i = table.column_names.index("tau:J1")
        return table.set_column(i, "tau:J1", table.column("tau:J1").cast(pa.float32()))

    assert read_log(rewritten(path, narrow)).tau.dtype == np.float64


@pytest.mark.parametrize("name", ["time", "ok", "q_nominal:J1", "tau:J3"])
def test_signal_with_the_name_of_a_column_is_refused(path: Path, name: str) -> None:
    with pytest.raises(InputError, match=f'"run": signal "{name}" has the name of a column'):
        write_parquet(replace(full_log(), signals={name: np.zeros(8)}), path)


@pytest.mark.parametrize("name", ["ok", "q_nominal:J2", "q_encoder:J1", "tau:J3"])
def test_missing_column_is_named(path: Path, name: str) -> None:
    with pytest.raises(FileFormatError, match=rf"run.parquet: column.* {name}.* missing"):
        read_log(rewritten(path, lambda table: table.drop_columns([name])))


def test_log_without_any_command_is_refused(path: Path) -> None:
    names = [f"q_nominal:J{i}" for i in (1, 2, 3)]
    with pytest.raises(FileFormatError, match="q_nominal:<joint> are missing for J1, J2, J3"):
        read_log(rewritten(path, lambda table: table.drop_columns(names)))


def test_column_of_texts_is_refused_by_name(path: Path) -> None:
    with pytest.raises(FileFormatError, match="column comment holds string, expected numbers"):
        read_log(rewritten(path, lambda table: table.append_column("comment", pa.array(["a"] * 8))))


def test_ok_of_numbers_is_refused(path: Path) -> None:
    def numbers(table: pa.Table) -> pa.Table:
        i = table.column_names.index("ok")
        return table.set_column(i, "ok", pa.array(np.full(8, np.nan)))

    with pytest.raises(FileFormatError, match="column ok holds double, expected true or false"):
        read_log(rewritten(path, numbers))


def test_empty_cell_in_a_command_is_refused_with_its_row(path: Path) -> None:
    def emptied(table: pa.Table) -> pa.Table:
        i = table.column_names.index("q_nominal:J1")
        return table.set_column(i, "q_nominal:J1", pa.array([0.0, None, *np.zeros(6)]))

    with pytest.raises(InputError, match="q_nominal is nan at row 1"):
        read_log(rewritten(path, emptied))


def test_foreign_parquet_is_refused(path: Path) -> None:
    pq.write_table(pa.table({"q_nominal:J1": np.zeros(3)}), path)
    with pytest.raises(FileFormatError, match=r"run.parquet: is Parquet but no catenary motion log"):
        read_log(path)


@pytest.mark.parametrize("about", [b"\xff\xfe", b"not json", b"[]", b"{}", b'{"joint_names": 3}'])
def test_damaged_schema_is_refused(path: Path, about: bytes) -> None:
    with pytest.raises(FileFormatError, match=r"run.parquet: is Parquet but no catenary motion log"):
        read_log(rewritten(path, lambda table: table.replace_schema_metadata({"catenary": about})))


def test_format_of_another_version_is_refused_by_number(path: Path) -> None:
    def later(table: pa.Table) -> pa.Table:
        about = json.loads(table.schema.metadata[b"catenary"]) | {"format": "catenary.motion_log.9"}
        return table.replace_schema_metadata({"catenary": json.dumps(about)})

    with pytest.raises(FileFormatError, match=r"format 'catenary.motion_log.9', expected"):
        read_log(rewritten(path, later))


def test_truncated_parquet_is_refused_wherever_it_ends(path: Path) -> None:
    write_parquet(full_log(), path)
    whole = path.read_bytes()
    for end in range(0, len(whole), 211):
        path.write_bytes(whole[:end])
        with pytest.raises(FileFormatError, match=r"run.parquet: cannot be read as Parquet"):
            read_log(path)


def test_random_bytes_are_refused(path: Path) -> None:
    path.write_bytes(np.random.default_rng(3).bytes(1000))
    with pytest.raises(FileFormatError, match=r"run.parquet: cannot be read as Parquet"):
        read_log(path)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"units": ("rad", "rad", "rad")}, "states the units rad,rad,m, but rad,rad,rad were given"),
        ({"joint_names": ("a", "b", "c")}, "states the joints J1, J2, J3, but a, b, c were given"),
    ],
    ids=["units", "names"],
)
def test_what_contradicts_the_file_is_refused(path: Path, given: Any, message: str) -> None:
    write_parquet(full_log(), path)
    with pytest.raises(InputError, match=message):
        read_log(path, **given)


def test_what_agrees_with_the_file_is_accepted(path: Path) -> None:
    write_parquet(full_log(), path)
    assert len(read_log(path, units=["rad", "rad", "m"], joint_names=["J1", "J2", "J3"])) == 8


def test_folder_that_does_not_exist_cannot_be_written_to(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"run.parquet: cannot be written"):
        write_parquet(full_log(), tmp_path / "none" / "run.parquet")


@pytest.mark.parametrize("name", ["none.npz", "none.parquet", "none.csv"])
def test_missing_file_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(FileFormatError, match=f"{name}: no such file"):
        read_log(tmp_path / name)


def test_unknown_ending_is_refused_with_those_known(tmp_path: Path) -> None:
    (tmp_path / "run.txt").write_text("a,b")
    with pytest.raises(
        FileFormatError, match=r'run.txt: ending ".txt": expected a recording, .npz, .parquet or .csv'
    ):
        read_log(tmp_path / "run.txt")


def test_command_log_is_read_with_given_names_and_units(tmp_path: Path) -> None:
    q = np.zeros((4, 2))
    np.savez(tmp_path / "run.npz", q_des=q, q_act=q, ok=np.ones(4, dtype=bool))
    log = read_log(tmp_path / "run.npz", units=("m", "rad"), joint_names=("slide", "turn"))
    assert (log.joint_units, log.joint_names) == (("m", "rad"), ("slide", "turn"))


def test_ten_thousand_rows_are_written_and_read_again(path: Path) -> None:
    log = recording(np.random.default_rng(0), rows=10_000)
    write_parquet(log, path)
    assert_array_equal(read_log(path).q_encoder, log.q_encoder)


def test_flipped_bits_are_noticed_unless_the_numbers_are_the_same(path: Path) -> None:
    log = full_log()
    write_parquet(log, path)
    whole, rng = path.read_bytes(), np.random.default_rng(4)
    footer = len(whole) - 8 - int.from_bytes(whole[-8:-4], "little")
    for place in rng.integers(4, footer, size=400):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        try:
            back = read_log(path)
        except (FileFormatError, InputError):
            continue
        assert_array_equal(back.q_nominal, log.q_nominal)
        assert_array_equal(back.q_encoder, log.q_encoder)


def test_joints_of_the_same_name_are_refused(tmp_path: Path) -> None:
    about = {"format": FORMAT, "joint_names": ["a", "a"], "joint_units": ["rad", "rad"]}
    table = pa.table({"q_nominal:a": [0.0, 1.0], "ok": [True, True]})
    pq.write_table(table.replace_schema_metadata({"catenary": json.dumps(about)}), tmp_path / "log.parquet")
    with pytest.raises(InputError, match="joint names must differ, got a, a"):
        read_log(tmp_path / "log.parquet")
