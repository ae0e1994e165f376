"""Command logs, a RAVEN-II's recordings (its topics on one clock, the published CSV) and a PSM's, against the recorded."""

import csv
import hashlib
from pathlib import Path
from shutil import copy
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from catenary.dvrk_psm import PSM as ROBOT
from catenary.dvrk_psm import PSM_JOINTS, psm_topics
from catenary.errors import FileFormatError, InputError
from catenary.files import sha256_of
from catenary.raven2.topics import _GOLD_MEASURED_JS, AXES, EXT_JPOS, RAVENSTATE, RAVENSTATE_100HZ, raven_topics
from catenary.recording.import_formats.importer import Synchronisation
from catenary.recording.import_formats.known_layouts import read_commands, read_psm, read_raven
from catenary.recording.journal import About, JournalTopic, JournalWriter
from catenary.recording.layout import encode, topic_named
from catenary.recording.logs import read_log, write_parquet
from catenary.recording.recorder import Recorder
from catenary.robots.catalog import load_robot
from catenary.topics import SECOND
from catenary.workflows.import_recording import import_recording, known_layout, propose_mapping
from lab_bags import JOINT_STATE, joint_state
from lab_bags import write_bag as write_lab_bag
from oracles import raven_recording
from oracles.raven_recording import record, write_bag, write_csv
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
    assert_allclose(mapped.time, log.time)


STATE_TIME = np.arange(0.0, 20.0, 1.0 / 30.0)
RIG_TIME = np.arange(0.0, 20.0, 0.01)
CHORD = (
    np.abs(raven_recording.AMPLITUDE) * np.square(raven_recording.RATE) * 0.015**2 / 8.0 * 1.01
)  # h² max|f''| / 8, intervals up to 15 ms


def _stamp(time: np.ndarray) -> np.ndarray:
    return raven_recording.START_NS + np.rint(time * 1e9).astype(np.int64)


def _synchronised(
    tmp_path: Path,
    rig_time: np.ndarray,
    rig: np.ndarray,
    state_time: np.ndarray = STATE_TIME,
    columns: dict[str, np.ndarray] | None = None,
) -> Synchronisation:
    """Of a state and an encoder given message by message."""
    columns = raven_recording.telemetry(state_time, np.random.default_rng(0)) if columns is None else columns
    streams = [(RAVENSTATE, _stamp(state_time), columns), (EXT_JPOS, _stamp(rig_time), {"ext_jpos": rig})]
    raven_recording.write_journal(tmp_path / "r", streams)
    return read_raven([tmp_path / "r"])


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Synchronisation:
    """Of a state and an encoder without any fault."""
    return _synchronised(tmp_path_factory.mktemp("plain"), RIG_TIME, raven_recording.encoder(RIG_TIME))


def test_simulated_time_begins_at_zero_and_its_first_stamp_is_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(raven_recording, "START_NS", 0)
    log = _synchronised(tmp_path, RIG_TIME, raven_recording.encoder(RIG_TIME)).log
    assert [note for note in log.notes if "no stamp" in note] == []


def test_a_recording_becomes_a_log_with_the_encoder_on_the_states_stamps(tmp_path: Path) -> None:
    raven_recording.record(tmp_path / "r", 20.0)
    result = read_raven([tmp_path / "r"])
    log = result.log
    assert log.joint_names == ("shoulder", "elbow", "insertion")
    assert log.joint_units == ("rad", "rad", "m")
    assert log.time[0] == 0.0
    assert log.ok[:-1].all()  # the last state may come after the last encoder sample
    assert_allclose(log.q_nominal, raven_recording.nominal(log.time), atol=1e-7)  # float32 degrees
    error = np.abs(log.q_encoder - raven_recording.encoder(log.time))[log.ok]
    assert (error <= CHORD + 1e-9).all()
    assert (log.robot, log.simulated) == ("raven2", True)
    assert result.without_encoder == int((~log.ok).sum())
    rates = {report.topic: report.rate for report in result.topics}
    assert_allclose([rates["/ravenstate"], rates["/ext_jpos"], rates["/arm2/measured_js"]], [30, 100, 100], rtol=0.02)


def test_torque_is_at_the_joint_and_other_joints_are_signals(plain: Synchronisation) -> None:
    columns = raven_recording.telemetry(STATE_TIME, np.random.default_rng(0))
    log = plain.log
    # at the joint, the gains 0.3, 0.3, 0.15 per motor radian are 454.3, 361.7 Nm/rad and 57055 N/m
    ratio = np.array([136.1963, 121.5221, 2158.590])
    cable = columns["tau"][:, :3] * np.array([454.3, 361.7, 57055.0]) / np.array([0.3, 0.3, 0.15]) / ratio
    # winding = C q, so power is kept by tau = C^T tension
    coupling = np.array([[1.0, 0.0, 0.0], [0.14545, 1.0, 0.0], [0.0077973826, 0.008077387, 1.0]])
    # the gains have four digits: 0.05 in 361.7; in the sum they may cancel
    assert_allclose(log.tau, cable @ coupling, rtol=1.5e-4, atol=5e-3)
    for name, axis in (("roll", 4), ("wrist", 5), ("jaw1", 6), ("jaw2", 7)):
        assert_allclose(log.signals[f"q:{name}"], columns["jpos"][:, axis], rtol=1e-6)  # float32
        assert log.signal_units[f"q:{name}"] == "rad"
        assert f"tau:{name}" in log.signals
    assert_allclose(log.qd, columns["jvel"][:, :3], rtol=1e-6)


def test_further_columns_are_signals_the_other_arms_under_its_name(tmp_path: Path) -> None:
    raven_recording.record(tmp_path / "r", 4.0)
    plain = read_raven([tmp_path / "r"]).log
    log = read_raven([tmp_path / "r"], columns=("all",)).log
    assert set(plain.signals) == {f"{g}:{j}" for g in ("q", "tau") for j in ("roll", "wrist", "jaw1", "jaw2", "unused")}
    assert {"mpos:shoulder", "jvel:roll", "pos:x", "ori:33", "type", "runlevel", "dt"} <= set(log.signals)
    assert {"green_tau:elbow", "green_jpos:unused", "green_pos:z", "green_type"} <= set(log.signals)
    # every number of the message, but for the jpos and tau of the arm's own eight channels
    assert len(log.signals) == len(plain.signals) + sum(c.width for c in RAVENSTATE.columns) - 16
    assert log.signal_units["encVals:elbow"] == "count"
    assert_array_equal(log.q_nominal, plain.q_nominal)
    some = read_raven([tmp_path / "r"], columns=("runlevel", "jpos")).log
    assert set(some.signals) - set(plain.signals) == {"runlevel", *(f"green_jpos:{axis}" for axis in AXES)}
    with pytest.raises(InputError, match="columns: no jpso in raven_state; it has all, runlevel"):
        read_raven([tmp_path / "r"], columns=("jpso",))


@pytest.mark.parametrize("by", [3600, -5])
def test_a_robots_clock_that_is_set_costs_no_row_and_no_order(tmp_path: Path, by: int) -> None:
    """The clock of state and encoder, by seconds, in the middle; arrivals are by a clock that nobody sets."""
    columns = raven_recording.telemetry(STATE_TIME, np.random.default_rng(0))
    rig = {"ext_jpos": raven_recording.encoder(RIG_TIME)}
    streams = [(topic, STATE_TIME, columns) for topic in (RAVENSTATE, _GOLD_MEASURED_JS)]
    streams.append((EXT_JPOS, RIG_TIME, rig))
    with JournalWriter(tmp_path / "r", [JournalTopic(t.name, t.type) for t, *_ in streams]) as journal:
        for topic, time, content in streams:
            true = _stamp(time)
            for message, arrival in zip(encode(topic, true + by * SECOND * (time >= 10.0), content), true, strict=True):
                journal.append(topic.name, int(arrival) + 1_000_000, message.tobytes())
    result = read_raven([tmp_path / "r"])
    assert_allclose(result.log.time, STATE_TIME, atol=1e-6)
    assert_allclose(result.log.q_nominal, raven_recording.nominal(STATE_TIME), atol=1e-7)
    assert result.log.ok[:-1].all()
    assert any(f"clock was set by {by:+d}.000 s, 10.0 s after" in note for note in result.log.notes)


def test_a_state_at_100_hz_is_found_and_two_are_one_too_many(tmp_path: Path) -> None:
    raven_recording.record(tmp_path / "r", 2.0, topics=raven_topics(state_rate=100.0))
    assert len(read_raven([tmp_path / "r"]).log) > 180
    raven_recording.record(tmp_path / "s", 2.0, topics=(RAVENSTATE, RAVENSTATE_100HZ, EXT_JPOS, _GOLD_MEASURED_JS))
    with pytest.raises(FileFormatError, match="expected one"):
        read_raven([tmp_path / "s"])


@pytest.fixture(scope="module")
def journal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("recording") / "journal", 6.0)


@pytest.fixture(scope="module")
def published(journal: Path) -> Path:
    """The recording in the published layout."""
    return write_csv(journal, journal.parent / "a.csv")


@pytest.fixture
def table(published: Path, tmp_path: Path) -> Path:
    return Path(copy(published, tmp_path / "a.csv"))


def _rows(path: Path) -> list[list[str]]:
    with path.open(newline="") as file:
        return list(csv.reader(file))


def _write(rows: list[list[str]], path: Path) -> None:
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(rows)


def test_the_csv_reads_back_as_the_log_of_the_recording(journal: Path, table: Path) -> None:
    assert min(float(row[15]) for row in _rows(table)) > 18.0  # 0.33 m times 180/pi, as if it were an angle
    expected = read_raven([journal]).log
    log = read_raven([table]).log
    assert_array_equal(log.q_nominal, expected.q_nominal)
    assert_array_equal(log.tau, expected.tau)
    assert list(log.signals) == list(expected.signals)
    both = log.ok & expected.ok
    assert both[1:-1].all()
    # samples of 100 Hz at 30 Hz: chords of up to 45 ms, 0.4 rad at 0.31 rad/s
    assert_allclose(log.q_encoder[both], expected.q_encoder[both], atol=0.045**2 / 8 * 0.4 * 0.31**2)


def test_every_column_of_the_csv_is_read_on_request(journal: Path, table: Path) -> None:
    expected = read_raven([journal], columns=("all",)).log
    log = read_raven([table], columns=("all",)).log
    assert set(expected.signals) - set(log.signals) == {"dt"}  # not in the layout
    for name in ("encVals:elbow", "green_mpos:shoulder", "pos:x", "mvel:jaw1"):
        assert_array_equal(log.signals[name], expected.signals[name])


def test_a_bag_of_its_topics_needs_no_mapping(journal: Path) -> None:
    log, own = import_recording(write_bag(journal, journal.parent / "a.bag")), read_raven([journal]).log
    for key in ("q_nominal", "q_encoder", "ok", "time", "qd", "tau"):
        assert_allclose(getattr(log, key), getattr(own, key))


def test_the_csv_opens_as_a_recording_that_knows_its_file_and_needs_no_mapping(table: Path) -> None:
    log, expected = read_log(table), read_raven([table]).log
    assert known_layout([table]) == "RAVEN-II's published CSV"
    assert_array_equal(import_recording(table).q_nominal, log.q_nominal)
    assert log.joint_names == ("shoulder", "elbow", "insertion")
    assert_array_equal(log.q_encoder, expected.q_encoder)
    assert log.sha256 == hashlib.sha256(table.read_bytes()).hexdigest()
    for given in ({"units": ["rad", "rad", "rad"]}, {"joint_names": ["a", "b", "c"]}):
        with pytest.raises(InputError, match="those given are"):
            read_log(table, **given)


def test_force_in_256_columns_is_read_as_signals(table: Path, tmp_path: Path) -> None:
    rows = _rows(table)
    for i, row in enumerate(rows):
        row += [row[12], "1.5", str(i), str(-i)]  # as of the state's stamp
    _write(rows, tmp_path / "b.csv")
    log = read_raven([tmp_path / "b.csv"]).log
    assert_array_equal(log.signals["force_x"], np.full(len(log), 1.5))
    assert_array_equal(log.signals["force_y"], np.arange(len(log)))
    assert log.signal_units["force_z"] == "N"


def test_stamps_that_all_count_from_the_first_state_read_the_same(table: Path, tmp_path: Path) -> None:
    rows = _rows(table)
    origin = float(rows[0][12])
    for row in rows:
        row[4], row[12] = (repr(float(row[i]) - origin) for i in (4, 12))
    _write(rows, tmp_path / "b.csv")
    a, b = read_raven([table]).log, read_raven([tmp_path / "b.csv"]).log
    assert_allclose(a.time, b.time, atol=1e-6)
    assert_allclose(a.q_encoder, b.q_encoder, atol=1e-6, equal_nan=True)


def test_rows_without_an_encoder_near_are_not_trusted(journal, tmp_path) -> None:
    write_csv(journal, tmp_path / "a.csv", farthest=0.0001)
    rows = _rows(tmp_path / "a.csv")
    lonely = [row[0] == "nan" for row in rows]
    assert any(lonely)
    assert not all(lonely)
    result = read_raven([tmp_path / "a.csv"])
    assert result.without_encoder > 0
    assert len(result.log) == len(rows)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: "1,2,3\n" * 9, "3 columns of numbers, expected RAVEN-II's 252, or 256"),
        (lambda text: text[:5000] + "oops" + text[5000:], "251 columns of numbers"),
        (lambda text: ",".join(f"c{i}" for i in range(252)) + "\n", "no column of numbers"),
    ],
    ids=["columns", "text", "names alone"],
)
def test_what_is_no_table_of_numbers_is_refused(table, change, message) -> None:
    table.write_text(change(table.read_text()))
    with pytest.raises((FileFormatError, InputError), match=message):
        read_raven([table])


PSM_TIME = np.arange(4000) * 1e-3
PSM_SPEED = np.array([0.1, -0.1, 0.02, 0.5, -0.4, 0.3])
PSM_OFFSET = np.array([0.01, -0.01, 1e-3, 0.1, 0.2, -0.1])


def recorded_psm(folder, namespace, **changed):
    q = PSM_TIME[:, None] * PSM_SPEED
    telemetry = {
        "measured_js": q,
        "measured_js_velocity": np.tile(PSM_SPEED, (len(PSM_TIME), 1)),
        "measured_js_effort": np.ones_like(q),
        "setpoint_js": q,
        "ext_jpos": q + PSM_OFFSET,
        **changed,
    }
    topics, rng = psm_topics(namespace), np.random.default_rng(0)
    with Recorder(folder, topics, telemetry, rng, about=About(robot=ROBOT, simulated=True)) as recorder:
        recorder.observe_many(PSM_TIME, telemetry)


@pytest.mark.parametrize("namespace", ["/PSM1", "PSM2", "/cart/PSM3"])
def test_the_tracker_is_brought_onto_the_robots_stamps(tmp_path, namespace):
    recorded_psm(tmp_path / "journal", namespace)
    found = read_psm([tmp_path / "journal"], namespace)
    log = found.log
    assert (log.joint_names, log.robot, log.simulated) == (PSM_JOINTS, ROBOT, True)
    assert log.ok.sum() > 0.9 * len(log)
    assert_allclose((log.q_encoder - log.q_nominal)[log.ok], np.tile(PSM_OFFSET, (log.ok.sum(), 1)), atol=1e-9)
    assert_allclose(log.qd, np.tile(PSM_SPEED, (len(log), 1)))
    assert_allclose(log.tau, 1.0)


def test_a_recording_without_a_tracker_says_so(tmp_path):
    bag = write_lab_bag(
        tmp_path / "psm",
        "ros1",
        {"/PSM1/measured_js": JOINT_STATE},
        [(0.0, "/PSM1/measured_js", joint_state(PSM_JOINTS, np.zeros(6)))],
    )
    with pytest.raises(InputError, match=r"no column .*/PSM1/tracker/measured_js.*; topics are /PSM1/measured_js"):
        read_psm([bag], "/PSM1")


@pytest.mark.parametrize("name", ["/MTML/measured_js", "/PSM1/measured_cp", "/PSM1/jaw/measured_js", "PSM1"])
def test_topics_of_others_are_not_taken_for_a_psms(name):
    assert topic_named(name) is None


SHORT = ("yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw")  # of the dVRK's present versions


@pytest.mark.parametrize("count", [3, 6])  # without an instrument, and with one
@pytest.mark.parametrize("names", [PSM_JOINTS, SHORT])
def test_potentiometers_are_offered_as_what_measured_the_joints(tmp_path, count, names):
    time = np.arange(600) * 1e-2
    q = (0.2 * np.sin(np.outer(time, 1.0 + 0.3 * np.arange(6))) + [0, 0, 0.12, 0, 0, 0])[:, :count]
    topics = ("/PSM1/measured_js", "/PSM1/setpoint_js", "/PSM1/io/pot/measured_js")
    messages = [
        (t, topic, joint_state(names[:count], row + 0.02 * ("pot" in topic)))
        for topic in topics
        for t, row in zip(time, q, strict=True)
    ]
    bag = write_lab_bag(tmp_path / "psm", "ros1", dict.fromkeys(topics, JOINT_STATE), messages)
    proposal = propose_mapping(bag, robot=ROBOT)
    assert [question.partition(" are q_encoder")[0] for question in proposal.questions] == [
        "whether the potentiometers /PSM1/io/pot/measured_js.position"
    ]
    assert (
        "mm" not in proposal.toml.partition("[q_nominal]")[2]
    )  # -80 mm is beyond the limit: no reason to read microns
    log = import_recording(bag, [f"q_nominal={topics[0]}.position", f"q_encoder={topics[2]}.position"], robot=ROBOT)
    assert log.joint_names == PSM_JOINTS[:count]
    assert log.joint_units == ("rad", "rad", "m", "rad", "rad", "rad")[:count]
    assert_allclose(log.q_encoder - log.q_nominal, 0.02, atol=1e-9)
