import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.errors import FileFormatError, InputError
from catenary.files import sha256_of
from catenary.recording.importers import read_arrays, read_command_log

ROWS = 5


def content(n: int = 6) -> dict[str, Any]:
    rng = np.random.default_rng(0)
    return {
        "q_des": rng.normal(size=(ROWS, n)),
        "q_act": rng.normal(size=(ROWS, n)),
        "ok": np.ones(ROWS, dtype=bool),
        "t": 0.4 * np.arange(ROWS),
    }


def written(folder: Path, n: int = 6, **changes: Any) -> Path:
    arrays = {key: values for key, values in (content(n) | changes).items() if values is not None}
    np.savez(folder / "log.npz", **arrays)
    return folder / "log.npz"


def test_arrays_of_the_file_become_the_log(tmp_path: Path) -> None:
    log = read_command_log(written(tmp_path))
    expected = content()
    assert_array_equal(log.q_nominal, expected["q_des"])
    assert_array_equal(log.q_encoder, expected["q_act"])
    assert_array_equal(log.ok, expected["ok"])
    assert_array_equal(log.time, expected["t"])


def test_log_names_its_file_and_the_files_hash(tmp_path: Path) -> None:
    path = written(tmp_path)
    log = read_command_log(path)
    assert (log.name, log.sha256) == ("log", sha256_of(path))


def test_recorded_log_is_not_simulated(tmp_path: Path) -> None:
    assert not read_command_log(written(tmp_path)).simulated


def test_torques_and_velocities_are_read_where_there_are_any(tmp_path: Path) -> None:
    tau, qd = np.full((ROWS, 6), 2.0), np.full((ROWS, 6), 3.0)
    log = read_command_log(written(tmp_path, tau=tau, dq=qd))
    assert_array_equal(log.tau, tau)
    assert_array_equal(log.qd, qd)


def test_time_is_optional(tmp_path: Path) -> None:
    assert read_command_log(written(tmp_path, t=None)).time is None


def test_whole_numbers_are_read_as_floats(tmp_path: Path) -> None:
    log = read_command_log(written(tmp_path, q_des=np.ones((ROWS, 6), dtype=int)))
    assert log.q_nominal.dtype == np.float64


@pytest.mark.parametrize("key", ["q_des", "q_act", "ok"])
def test_missing_array_is_named_with_what_the_file_has(tmp_path: Path, key: str) -> None:
    with pytest.raises(FileFormatError, match=f'log.npz: array "{key}" is missing.*this file has .*t'):
        read_command_log(written(tmp_path, **{key: None}))


@pytest.mark.parametrize(
    ("key", "shape"),
    [("q_act", (ROWS, 5)), ("q_act", (ROWS - 1, 6)), ("t", (ROWS + 1,)), ("tau", (ROWS, 2)), ("dq", (3, 6))],
)
def test_array_that_does_not_match_the_commands_is_refused(tmp_path: Path, key: str, shape: Any) -> None:
    with pytest.raises(InputError, match="expected shape"):
        read_command_log(written(tmp_path, **{key: np.zeros(shape)}))


@pytest.mark.parametrize(("key", "shape"), [("q_des", (ROWS,)), ("q_act", (ROWS, 6, 1)), ("t", (ROWS, 1))])
def test_array_of_other_dimensions_is_refused_by_name(tmp_path: Path, key: str, shape: Any) -> None:
    with pytest.raises(InputError, match=f"log.npz: {key}: expected shape"):
        read_command_log(written(tmp_path, **{key: np.zeros(shape)}))


@pytest.mark.parametrize("kind", [bool, complex, str])
def test_commands_that_are_not_numbers_are_refused(tmp_path: Path, kind: type) -> None:
    with pytest.raises(InputError, match="q_des: expected numbers"):
        read_command_log(written(tmp_path, q_des=np.ones((ROWS, 6)).astype(kind)))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_command_that_is_not_finite_is_refused_with_its_row(tmp_path: Path, value: float) -> None:
    q = content()["q_des"]
    q[3, 2] = value
    with pytest.raises(InputError, match=r"q_des is .* at row 3"):
        read_command_log(written(tmp_path, q_des=q))


def test_missing_measurement_is_fine_where_ok_is_not_set(tmp_path: Path) -> None:
    q, ok = content()["q_act"], content()["ok"]
    q[3], ok[3] = np.nan, False
    assert not read_command_log(written(tmp_path, q_act=q, ok=ok)).ok[3]


def test_missing_measurement_where_ok_is_set_is_refused_with_its_row(tmp_path: Path) -> None:
    q = content()["q_act"]
    q[3] = np.nan
    with pytest.raises(InputError, match="at row 3, where ok is set"):
        read_command_log(written(tmp_path, q_act=q))


def test_empty_log_is_refused(tmp_path: Path) -> None:
    empty = {"q_des": np.zeros((0, 6)), "q_act": np.zeros((0, 6)), "ok": np.zeros(0, dtype=bool)}
    with pytest.raises(InputError, match="is empty"):
        read_command_log(written(tmp_path, **empty, t=None))


def test_ok_as_ones_and_zeros_is_accepted(tmp_path: Path) -> None:
    log = read_command_log(written(tmp_path, ok=np.array([1, 0, 1, 1, 0])))
    assert_array_equal(log.ok, [True, False, True, True, False])


def test_ok_as_floats_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"ok: expected .* of true and false, got float64"):
        read_command_log(written(tmp_path, ok=np.ones(ROWS)))


def test_ok_with_another_number_is_refused_with_number_and_row(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="ok: expected true and false, or 1 and 0, got 2 at row 4"):
        read_command_log(written(tmp_path, ok=np.array([1, 0, 1, 1, 2])))


def test_ok_of_another_length_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"ok: expected \(5,\)"):
        read_command_log(written(tmp_path, ok=np.ones(4, dtype=bool)))


@pytest.mark.parametrize(("n", "units"), [(3, "rad rad m"), (6, "rad rad m rad rad rad")])
def test_units_of_three_or_six_joints_are_assumed_and_noted(tmp_path: Path, n: int, units: str) -> None:
    log = read_command_log(written(tmp_path, n=n))
    assert log.joint_units == tuple(units.split())
    assert log.units_assumed
    assert any("units not stated" in note for note in log.notes)


@pytest.mark.parametrize("n", [1, 2, 4, 5, 7])
def test_units_of_another_number_of_joints_must_be_given(tmp_path: Path, n: int) -> None:
    with pytest.raises(InputError, match=f"units of its {n} joints are not stated"):
        read_command_log(written(tmp_path, n=n))


def test_given_units_are_no_assumption(tmp_path: Path) -> None:
    log = read_command_log(written(tmp_path, n=3), units=["m", "rad", "rad"])
    assert (log.joint_units, log.units_assumed, log.notes) == (("m", "rad", "rad"), False, ())


@pytest.mark.parametrize("kind", ["U", "S"])
def test_units_and_names_of_the_file_are_taken(tmp_path: Path, kind: str) -> None:
    units, names = np.array(["m", "rad"], dtype=kind), np.array(["slide", "turn"], dtype=kind)
    log = read_command_log(written(tmp_path, n=2, units=units, joint_names=names))
    assert (log.joint_units, log.joint_names) == (("m", "rad"), ("slide", "turn"))
    assert not log.units_assumed


def test_given_units_that_contradict_the_file_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path, n=2, units=np.array(["m", "rad"]))
    with pytest.raises(InputError, match="states the units m,rad, but rad,m were given"):
        read_command_log(path, units=("rad", "m"))


def test_units_that_are_not_texts_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"units: expected \(n,\) texts"):
        read_command_log(written(tmp_path, n=2, units=np.array([1.0, 2.0])))


def test_unknown_unit_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="each rad or m"):
        read_command_log(written(tmp_path, n=3), units=("deg", "deg", "mm"))


def test_joints_are_numbered_where_nobody_names_them(tmp_path: Path) -> None:
    assert read_command_log(written(tmp_path, n=3)).joint_names == ("J1", "J2", "J3")


def test_given_joint_names_are_taken(tmp_path: Path) -> None:
    log = read_command_log(written(tmp_path, n=3), joint_names=["shoulder", "elbow", "insertion"])
    assert log.joint_names == ("shoulder", "elbow", "insertion")


@pytest.mark.parametrize(
    "given", [{"units": ("rad", "rad")}, {"joint_names": ("a", "b", "c", "d")}], ids=["units", "names"]
)
def test_another_number_of_units_or_names_is_refused(tmp_path: Path, given: Any) -> None:
    with pytest.raises(InputError, match="q_des has 3 joints, but"):
        read_command_log(written(tmp_path, n=3), **given)


def test_clock_that_goes_back_is_noted_with_its_row(tmp_path: Path) -> None:
    log = read_command_log(written(tmp_path, t=np.array([0.0, 1.0, 2.0, 0.0, 1.0])))
    assert log.starts == (0, 3)
    assert any("row 3" in note for note in log.notes)


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"none.npz: no such file"):
        read_command_log(tmp_path / "none.npz")


def test_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="no such file"):
        read_arrays(tmp_path)


def test_single_array_file_is_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "log.npy", np.zeros((ROWS, 6)))
    with pytest.raises(FileFormatError, match=r"log.npy: cannot be read as an .npz archive"):
        read_arrays(tmp_path / "log.npy")


def test_python_objects_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"log.npz: cannot be read as an .npz archive of plain arrays"):
        read_arrays(written(tmp_path, q_des=np.array([{"a": 1}], dtype=object)))


def test_zip_of_other_files_is_refused_by_member(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "log.npz", "w") as archive:
        archive.writestr("q_des", "not an array")
    with pytest.raises(FileFormatError, match=r'log.npz: .*"q_des" is not an array'):
        read_arrays(tmp_path / "log.npz")


def test_array_that_claims_more_than_memory_is_refused(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    header = {"descr": "<f8", "fortran_order": False, "shape": (10**15,)}
    np.lib.format.write_array_header_1_0(buffer, header)
    with zipfile.ZipFile(tmp_path / "log.npz", "w") as archive:
        archive.writestr("q_des.npy", buffer.getvalue())
    with pytest.raises(FileFormatError, match=r"log.npz: cannot be read"):
        read_arrays(tmp_path / "log.npz")


def test_truncated_archive_is_refused_wherever_it_ends(tmp_path: Path) -> None:
    path = written(tmp_path)
    whole = path.read_bytes()
    for end in range(0, len(whole), 37):
        path.write_bytes(whole[:end])
        with pytest.raises(FileFormatError, match=r"log.npz: cannot be read"):
            read_arrays(path)


def test_damaged_archive_gives_its_arrays_or_one_kind_of_error(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    path = written(tmp_path)
    whole, refused = path.read_bytes(), 0
    for _ in range(1000):
        damaged = bytearray(whole)
        damaged[rng.integers(len(whole))] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        try:
            arrays = read_arrays(path)
        except FileFormatError:
            refused += 1
        else:  # a flipped date in the directory does no harm
            assert all(np.isfinite(values).all() for values in arrays.values())
    assert refused > 500  # most bytes are data under a checksum


def test_random_bytes_are_refused(tmp_path: Path) -> None:
    (tmp_path / "log.npz").write_bytes(np.random.default_rng(2).bytes(4000))
    with pytest.raises(FileFormatError, match=r"log.npz: cannot be read"):
        read_arrays(tmp_path / "log.npz")


@pytest.mark.parametrize("bracket", ["(", "{", "["])
def test_array_header_with_an_open_bracket_is_refused(tmp_path: Path, bracket: str) -> None:
    buffer = io.BytesIO()
    np.save(buffer, np.zeros(3))
    raw = buffer.getvalue().replace(b" ", bracket.encode(), 1)
    with zipfile.ZipFile(tmp_path / "log.npz", "w") as archive:
        archive.writestr("q_des.npy", raw)
    with pytest.raises(FileFormatError, match=r"log.npz: cannot be read"):
        read_arrays(tmp_path / "log.npz")


def test_a_shuffled_log_has_one_note_for_all_the_times_it_goes_back(tmp_path: Path) -> None:
    q, backwards = np.zeros((40, 3)), np.arange(40.0)[::-1]
    log = written(tmp_path, n=3, q_des=q, q_act=q, ok=np.ones(40, dtype=bool), t=backwards)
    notes = read_command_log(log).notes
    assert notes[-1] == "time goes back 39 times in all; are the rows shuffled?"
    assert len(notes) < 10
