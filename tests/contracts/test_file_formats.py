"""Every format of recordings: one recording in each of them gives equal logs, and equal verdicts."""

import gzip
import json
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from numpy.testing import assert_array_equal
from scipy.io import savemat

from catenary.cli import out_files
from catenary.file_formats import FORMATS, FileFormat, format_named, format_of
from catenary.plant import MotionLog
from catenary.recording.import_formats.recording_files import Sources
from catenary.recording.journal import JournalTopic, JournalWriter
from catenary.recording.logs import read_log, write_parquet
from catenary.recording.messages import ros2_name, typestore
from catenary.verdict.check import findings_of
from catenary.workflows.import_recording import import_recording
from command_line import catenary
from gallery import trackers
from gallery.containers import lerobot
from lab_bags import JOINT_STATE, JOINTS, START, Message, header, joint_state, true_q, write_bag

STATE, CAMERA = "/arm/joint_states", "/camera/joints"
# the robot at 30 Hz with jitter, the camera at 50 Hz, blind for two seconds, at last stuck on one joint
_RNG = np.random.default_rng(5)
T = np.round(np.cumsum(_RNG.uniform(0.025, 0.042, 400)), 4)
T_SEEN = np.round(np.arange(0.0, T[-1], 0.02), 4)
T_SEEN = T_SEEN[(T_SEEN < 4.0) | (T_SEEN > 6.0)]
Q, QD, TAU = true_q(T), np.gradient(true_q(T), T, axis=0), _RNG.normal(size=(len(T), 3))
SEEN = true_q(T_SEEN) + np.array([0.01, -0.02, 0.001])
SEEN[T_SEEN > 8.0, 1] = SEEN[T_SEEN > 8.0, 1][0]
SEEN[40, 2] = np.nan


def stamps(time: np.ndarray) -> np.ndarray:
    return START + np.rint(time * 1e9).astype(np.int64)


def messages() -> list[Message]:
    told: list[Message] = [
        (t, STATE, joint_state(JOINTS, *row)) for t, row in zip(T, zip(Q, QD, TAU, strict=True), strict=True)
    ]
    seen: list[Message] = [(t, CAMERA, joint_state(JOINTS, row)) for t, row in zip(T_SEEN, SEEN, strict=True)]
    return [*told, *seen]


def of_bag(kind: str) -> Callable[[Path], list[Path]]:
    def write(folder: Path) -> list[Path]:
        topics = {STATE: JOINT_STATE, CAMERA: JOINT_STATE}
        return [write_bag(folder / "lab", kind, topics, messages())]

    return write


def of_file(kind: str, pattern: str) -> Callable[[Path], list[Path]]:
    return lambda folder: list(of_bag(kind)(folder)[0].glob(pattern))


def of_split_bag(folder: Path) -> list[Path]:
    """A ROS 2 bag whose second file begins in the middle, as `ros2 bag record --max-bag-duration` writes it."""
    halves = {name: [m for m in messages() if (m[0] > 7.0) == (name == "second")] for name in ("first", "second")}
    topics = {STATE: JOINT_STATE, CAMERA: JOINT_STATE}
    return [write_bag(folder / name, "sqlite", topics, some) for name, some in halves.items()]


def of_journal(folder: Path) -> list[Path]:
    store = typestore(1)
    topics = [JournalTopic(topic, "sensor_msgs/JointState") for topic in (STATE, CAMERA)]
    with JournalWriter(folder / "lab", topics) as journal:
        for time, topic, make in sorted(messages(), key=lambda message: message[0]):
            head = header(store, START + round(time * 1e9), ros1=True)
            data = store.serialize_ros1(make(store, head), ros2_name("sensor_msgs/JointState"))
            journal.append(topic, START + round(time * 1e9), bytes(data))
    return [folder / "lab"]


def columns() -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """The two topics as columns: the stamp [ns], then numbers."""
    state = {f"{name}[{i}]": v[:, i] for name, v in (("q", Q), ("qd", QD), ("tau", TAU)) for i in range(3)}
    camera = {f"cam[{i}]": SEEN[:, i] for i in range(3)}
    return {"stamp": stamps(T), **state}, {"stamp": stamps(T_SEEN), **camera}


def one_table() -> dict[str, list[object]]:
    """All columns in one table, as PlotJuggler writes it: a row for each message, what is not in it left open."""
    state, camera = columns()
    names = [name for part in (state, camera) for name in part if name != "stamp"]
    rows = []
    for part in (state, camera):
        for i, stamp in enumerate(part["stamp"].tolist()):
            rows.append((stamp, {name: part[name][i] for name in part if name != "stamp"}))
    rows.sort(key=lambda row: row[0])
    table: dict[str, list[object]] = {"stamp": [stamp for stamp, _ in rows]}
    return table | {name: [row.get(name) for _, row in rows] for name in names}


def as_csv(path: Path, table: dict[str, list[object]], separator: str = ",") -> Path:
    lines = [separator.join(table)]
    lines += [
        separator.join("" if value is None else repr(getattr(value, "item", lambda v=value: v)()) for value in row)
        for row in zip(*table.values(), strict=True)
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


def of_one_csv(folder: Path) -> list[Path]:
    return [as_csv(folder / "lab.csv", one_table())]


def of_one_text(folder: Path) -> list[Path]:
    return [as_csv(folder / "lab.tsv", one_table(), "\t")]


def of_packed_csv(folder: Path) -> list[Path]:
    (folder / "lab.csv.gz").write_bytes(gzip.compress(as_csv(folder / "lab.csv", one_table()).read_bytes()))
    return [folder / "lab.csv.gz"]


def of_a_csv_a_topic(folder: Path) -> list[Path]:
    state, camera = columns()
    return [
        as_csv(folder / "lab.csv", {name: list(v) for name, v in state.items()}),
        as_csv(folder / "camera.csv", {name: list(v) for name, v in camera.items()}),
    ]


def of_parquet(folder: Path) -> list[Path]:
    pq.write_table(pa.table(one_table()), folder / "lab.parquet")
    return [folder / "lab.parquet"]


ARRAYS = {"stamp": stamps(T), "q": Q, "qd": QD, "tau": TAU, "stamp_cam": stamps(T_SEEN), "cam": SEEN}


def of_numpy(folder: Path) -> list[Path]:
    np.savez(folder / "lab.npz", **ARRAYS)
    return [folder / "lab.npz"]


def of_matlab(folder: Path) -> list[Path]:
    savemat(folder / "lab.mat", ARRAYS)
    return [folder / "lab.mat"]


def of_hdf5(folder: Path) -> list[Path]:
    import h5py

    with h5py.File(folder / "lab.hdf5", "w") as file:
        for name, values in ARRAYS.items():
            file[name] = values
    return [folder / "lab.hdf5"]


def of_lerobot(folder: Path) -> list[Path]:
    """A dataset of one episode, whose rows are those of one table; its lists have a number for each joint."""
    whole = one_table()
    lists = {
        name: np.array([whole[f"{name}[{i}]"] for i in range(3)], dtype=float).T for name in ("q", "qd", "tau", "cam")
    }
    return [lerobot(folder / "lab", "v3.0", [{"stamp": whole["stamp"], **lists}], {"motors": list(JOINTS)})]


BY_TOPIC = {
    "q_nominal": {"columns": f"{STATE}.position", "units": ["rad", "rad", "m"]},
    "q_encoder": {"columns": f"{CAMERA}.position", "units": ["rad", "rad", "m"]},
    "qd": {"columns": f"{STATE}.velocity", "units": ["rad", "rad", "m"]},
    "tau": {"columns": f"{STATE}.effort"},
}
BY_COLUMN = {
    "q_nominal": {"columns": "q", "units": ["rad", "rad", "m"]},
    "q_encoder": {"columns": "cam", "units": ["rad", "rad", "m"]},
    "qd": {"columns": "qd", "units": ["rad", "rad", "m"]},
    "tau": {"columns": "tau"},
    "joint_names": list(JOINTS),
    "time_unit": "ns",
}


class Example(NamedTuple):
    """A format's writer of the one recording, and the mapping that reads it."""

    format: str
    write: Callable[[Path], list[Path]]
    mapping: dict[str, Any]


CONTAINERS = {
    "ROS 1 bag": Example("a ROS 1 bag", of_bag("ros1"), BY_TOPIC),
    "split ROS 2 bag": Example("a ROS 2 bag", of_split_bag, BY_TOPIC),
    "SQLite": Example("SQLite of a ROS 2 bag", of_file("sqlite", "*.db3"), BY_TOPIC),
    "MCAP": Example("MCAP", of_file("mcap", "*.mcap"), BY_TOPIC),
    "journal": Example("a journal, or bags in a folder", of_journal, BY_TOPIC),
    "one CSV": Example("CSV", of_one_csv, BY_COLUMN),
    "a CSV a topic": Example("CSV", of_a_csv_a_topic, BY_COLUMN),
    "text with tabs": Example("a table of text", of_one_text, BY_COLUMN),
    "packed CSV": Example("a table that gzip packed", of_packed_csv, BY_COLUMN),
    "Parquet": Example("Parquet", of_parquet, BY_COLUMN),
    "NumPy": Example("NumPy's archive of arrays", of_numpy, BY_COLUMN),
    "MATLAB": Example("MATLAB up to version 7", of_matlab, BY_COLUMN),
    "HDF5": Example("HDF5", of_hdf5, BY_COLUMN),
    "LeRobot": Example("a dataset of LeRobot", of_lerobot, BY_COLUMN),
}
# formats that cannot hold the one recording: poses of a tracker, an array of one type; how one is written
OTHERS: dict[str, Callable[[Path], object]] = {
    "Motive's export": lambda path: trackers.motive(path, "1.23", "Meters"),
    "NumPy's array": lambda path: np.save(path, Q),
}
RECORDINGS = [form for form in FORMATS if form.holds in ("columns", "messages")]


def written(container: str, folder: Path) -> list[Path]:
    """Write the recording; skip this format alone where the package that reads it is missing."""
    example = CONTAINERS[container]
    needed = {form.name: form.package for form in FORMATS}[example.format]
    if needed:
        pytest.importorskip(needed)
    return example.write(folder)


@pytest.fixture(scope="module")
def log_of(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], MotionLog]:
    @cache
    def read(container: str) -> MotionLog:
        return import_recording(written(container, tmp_path_factory.mktemp("container")), CONTAINERS[container].mapping)

    return read


@pytest.mark.parametrize("form", RECORDINGS, ids=[form.name for form in RECORDINGS])
def test_every_format_of_recordings_has_an_example_is_told_by_it_and_read(form: FileFormat, tmp_path: Path) -> None:
    names = [name for name, example in CONTAINERS.items() if example.format == form.name]
    assert names or form.name in OTHERS, f"write an example of {form.name} into CONTAINERS of {__file__}"
    if names:
        paths = written(names[0], tmp_path)
    else:
        paths = [tmp_path / f"lab{form.ending or '.csv'}"]
        OTHERS[form.name](paths[0])
    assert format_of(paths[0]) is form
    assert Sources(paths).streams[0].rows >= 40
    if form.marks and paths[0].is_file():
        renamed = paths[0].rename(tmp_path / "run.unknown")
        assert format_of(renamed) is form


def test_no_ending_is_of_two_formats_and_what_commands_write_is_of_one() -> None:
    every = [ending for form in FORMATS for ending in form.endings]
    assert len(set(every)) == len(every)
    kinds = [kind for kind in vars(out_files).values() if isinstance(kind, out_files.FileKind)]
    assert len(kinds) > 8
    for ending in (ending for kind in kinds for ending in kind.endings):
        assert ending in format_named(Path(f"x{ending}")).endings


@pytest.mark.parametrize("container", CONTAINERS)
def test_every_container_gives_the_log_of_the_rule_and_equal_verdicts(
    log_of: Callable[[str], MotionLog], container: str
) -> None:
    """The rule, worked out here: the straight line between the two samples around each stamp, no farther apart than 50 ms."""
    log, first = log_of(container), log_of("ROS 1 bag")
    assert log.time is not None
    stamp, seen = stamps(T), stamps(T_SEEN)
    right = np.searchsorted(seen, stamp).clip(1, len(seen) - 1)
    left = right - 1
    near = (seen[right] - seen[left] <= 50_000_000) & (stamp <= seen[-1]) & (stamp >= seen[0])
    share = (stamp - seen[left]) / (seen[right] - seen[left])
    expected = SEEN[left] + share[:, None] * (SEEN[right] - SEEN[left])
    expected[stamp == seen[right]] = SEEN[right][stamp == seen[right]]
    trusted = near & np.isfinite(expected).all(axis=1)
    assert log.began == stamp[0] / 1e9
    known = {"q_nominal": Q, "qd": QD, "tau": TAU, "ok": trusted, "time": (stamp - stamp[0]) / 1e9}
    for key, values in (known | {"q_encoder": first.q_encoder}).items():  # of encoders the same to the last bit
        assert_array_equal(getattr(log, key), values, err_msg=key)
    assert 300 < log.ok.sum() < len(log) - 50
    np.testing.assert_allclose(log.q_encoder[trusted], expected[trusted], rtol=1e-15)
    assert (log.joint_names, log.joint_units) == (JOINTS, ("rad", "rad", "m"))
    verdict = findings_of(log)
    assert ("stuck", (JOINTS[1],)) in [(each.name, each.joints) for each in verdict]
    assert verdict == findings_of(first)


MISSING = (-9999.0, -999.0, -3.697314e28, 1e30, 65535.0)  # what loggers, trackers and 16 bits write for no number
GONE = {
    "q_nominal": (T > 3.0) & (T < 3.3),
    "q_encoder": (T_SEEN > 7.0) & (T_SEEN < 8.0),
    "tau": (T > 10.0) & (T < 10.2),
}


def spoil(monkeypatch: pytest.MonkeyPatch, number: float | None) -> None:
    """Let all containers hold `number`, of None each of MISSING in turn, on the rows GONE of one joint."""
    for name, array, key in (("Q", "q", "q_nominal"), ("SEEN", "cam", "q_encoder"), ("TAU", "tau", "tau")):
        values = ARRAYS[array].copy()
        rows = np.flatnonzero(GONE[key])
        values[rows, 1] = np.resize(MISSING, len(rows)) if number is None else number
        monkeypatch.setitem(globals(), name, values)
        monkeypatch.setitem(ARRAYS, array, values)


@pytest.mark.parametrize("container", CONTAINERS)
def test_numbers_that_mean_missing_are_missing_in_every_container(
    container: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The log is that of the same rows written as NaN, and each quantity's numbers are counted."""
    mapping = CONTAINERS[container].mapping
    read = []
    for name, number in (("nan", np.nan), ("numbers", None)):
        spoil(monkeypatch, number)
        (tmp_path / name).mkdir()
        read.append(import_recording(written(container, tmp_path / name), mapping))
    expected, log = read
    assert len(log) < len(T)
    for key in ("q_nominal", "q_encoder", "qd", "tau", "ok", "time"):
        assert_array_equal(getattr(log, key), getattr(expected, key), err_msg=key)
    assert np.abs(log.q_encoder[log.ok]).max() < 4.0
    said = " ".join(log.notes)
    for key, rows in GONE.items():
        assert f"{key}: {rows.sum()} number(s) mean that nothing was measured" in said


@pytest.mark.parametrize("container", CONTAINERS)
def test_a_path_that_is_no_utf8_is_read_like_any_other(container: str, tmp_path: Path) -> None:
    plain, folder = tmp_path / "plain", tmp_path / os.fsdecode(b"Pr\xfcfstand")
    plain.mkdir()
    paths = written(container, plain)
    plain.rename(folder)
    log = import_recording([folder / path.relative_to(plain) for path in paths], CONTAINERS[container].mapping)
    assert_array_equal(log.q_nominal, Q)
    write_parquet(log, folder / os.fsdecode(b"\xe9.parquet"))
    again = read_log(folder / os.fsdecode(b"\xe9.parquet"))
    assert_array_equal(again.q_encoder, log.q_encoder)
    assert again.name == "\\udce9"
    json.dumps([again.name, *again.notes], ensure_ascii=False).encode()  # into cards and pages
    assert catenary("check", str(folder / os.fsdecode(b"\xe9.parquet"))).code in (0, 1)
