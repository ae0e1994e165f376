from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.errors import FileFormatError, InputError
from catenary.files import sha256_of
from catenary.recording.import_formats.known_layouts import read_commands
from catenary.recording.logs import write_parquet
from catenary.robots.catalog import load_robot
from catenary.workflows.import_recording import import_recording, known_layout
from recordings import recording

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
    tau, qd = np.full((ROWS, 6), 2.0), np.full((ROWS, 6), 3.0)
    path = written(tmp_path, tau=tau, dq=qd)
    log, expected = read_commands(path), content()
    pairs = zip((log.q_nominal, log.q_encoder, log.ok, log.time), expected.values(), strict=True)
    for values, given in (*pairs, (log.tau, tau), (log.qd, qd)):
        assert_array_equal(values, given)
    assert (log.name, log.sha256, log.simulated) == ("log", sha256_of(path), False)


def test_time_is_optional_and_whole_numbers_are_read_as_floats_or_as_ok(tmp_path: Path) -> None:
    q = content()["q_act"]
    q[3] = np.nan
    ok = np.array([1, 0, 1, 0, 1])
    log = read_commands(written(tmp_path, t=None, q_des=np.ones((ROWS, 6), dtype=int), q_act=q, ok=ok))
    assert log.time is None
    assert_array_equal(log.ok, ok == 1)
    assert log.q_nominal.dtype == np.float64


def at_row_3(key: str, value: float) -> dict[str, Any]:
    values = content()[key]
    values[3] = value
    return {key: values}


EMPTY = {"q_des": np.zeros((0, 6)), "q_act": np.zeros((0, 6)), "ok": np.zeros(0, dtype=bool), "t": None}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"q_act": np.zeros((ROWS, 5))}, r"q_act: expected shape \(5, 6\), got \(5, 5\)"),
        ({"q_act": np.zeros((ROWS - 1, 6))}, r"q_act: expected shape \(5, 6\), got \(4, 6\)"),
        ({"tau": np.zeros((ROWS, 2))}, r"tau: expected shape \(5, 6\), got \(5, 2\)"),
        ({"q_act": np.zeros((ROWS, 6, 1))}, r"q_act: expected shape \(5, 6\), got \(5, 6, 1\)"),
        ({"q_des": np.ones((ROWS, 6)).astype(str)}, "q_des: expected numbers, got <U32"),
        (EMPTY, "q_des is empty"),
    ],
)
def test_an_array_that_is_not_as_it_should_be_is_refused(tmp_path: Path, changes: Any, said: str) -> None:
    with pytest.raises((InputError, FileFormatError), match=said):
        read_commands(written(tmp_path, **changes))


def test_rows_that_are_no_numbers_are_left_out_or_not_trusted_and_said(tmp_path: Path) -> None:
    log = read_commands(written(tmp_path, **at_row_3("q_des", np.nan)))
    assert len(log) == ROWS - 1
    assert any("1 of 5 rows without q_nominal were left out" in note for note in log.notes)
    log = read_commands(written(tmp_path, **at_row_3("q_act", np.nan)))
    assert_array_equal(log.ok, [True, True, True, False, True])


@pytest.mark.parametrize("key", ["q_des", "q_act", "ok"])
def test_missing_array_is_named_with_what_the_file_has(tmp_path: Path, key: str) -> None:
    with pytest.raises(FileFormatError, match=f'log.npz: array "{key}" is missing.*it holds .*t'):
        read_commands(written(tmp_path, **{key: None}))


@pytest.mark.parametrize(("n", "units"), [(3, "rad rad m"), (6, "rad rad m rad rad rad")])
def test_units_of_three_or_six_joints_are_assumed_and_noted_and_joints_numbered(tmp_path, n, units) -> None:
    log = read_commands(written(tmp_path, n=n))
    assert log.joint_units == tuple(units.split())
    assert log.joint_names == ("J1", "J2", "J3", "J4", "J5", "J6")[:n]
    assert log.units_assumed
    assert any("units not stated" in note for note in log.notes)


def test_given_units_and_names_are_taken_and_no_assumption(tmp_path: Path) -> None:
    given = {"units": ["m", "rad", "rad"], "joint_names": ["slide", "turn", "bend"]}
    log = read_commands(written(tmp_path, n=3), **given)
    assert (log.joint_units, log.joint_names) == (("m", "rad", "rad"), ("slide", "turn", "bend"))
    assert (log.units_assumed, log.notes) == (False, ())


@pytest.mark.parametrize("kind", ["U", "S"])
def test_units_and_names_of_the_file_are_taken(tmp_path: Path, kind: str) -> None:
    units, names = np.array(["m", "rad"], dtype=kind), np.array(["slide", "turn"], dtype=kind)
    log = read_commands(written(tmp_path, n=2, units=units, joint_names=names))
    assert (log.joint_units, log.joint_names) == (("m", "rad"), ("slide", "turn"))
    assert not log.units_assumed


STATED = {"units": np.array(["m", "rad", "rad"])}


@pytest.mark.parametrize(
    ("n", "stated", "given", "said"),
    [
        *[(n, {}, {}, "joints are not stated, and not clear") for n in (1, 2, 4, 5, 7)],
        (3, {}, {"units": ("deg", "deg", "mm")}, "each rad or m"),
        (3, {}, {"units": ("rad", "rad")}, "has 3 joints, but 2 units were given"),
        (3, {}, {"joint_names": ("a", "b", "c", "d")}, "has 3 joints, but 4 joint names were given"),
        (3, STATED, {"units": ("rad",) * 3}, "states the units m,rad,rad, but rad,rad,rad were given"),
    ],
)
def test_units_and_names_that_do_not_fit_are_refused(tmp_path, n, stated, given, said) -> None:
    with pytest.raises(InputError, match=said):
        read_commands(written(tmp_path, n=n, **stated), **given)


@pytest.mark.parametrize("names", [np.full(2000, "a"), np.array([b"\xff"] * 6)], ids=["many", "no UTF-8"])
def test_names_that_are_no_names_are_refused(tmp_path: Path, names: np.ndarray) -> None:
    with pytest.raises(InputError, match=r"log.npz: joint_names: expected"):
        read_commands(written(tmp_path, joint_names=names))


def test_clock_that_goes_back_is_noted_with_its_row_and_often_with_a_count(tmp_path: Path) -> None:
    log = read_commands(written(tmp_path, t=np.array([0.0, 1.0, 2.0, 0.0, 1.0])))
    assert log.starts == (0, 3)
    assert_array_equal(log.time, [0.0, 1.0, 2.0, 0.0, 1.0])
    assert any("row 3" in note for note in log.notes)
    q, backwards = np.zeros((40, 3)), np.arange(40.0)[::-1]
    path = written(tmp_path, n=3, q_des=q, q_act=q, ok=np.ones(40, dtype=bool), t=backwards)
    notes = read_commands(path).notes
    assert any("time goes back 39 time(s)" in n and "are the rows shuffled?" in n for n in notes)


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
