"""A long text table becomes the same log in pieces as it becomes whole, in the memory of a piece."""

import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from catenary.errors import InputError
from catenary.plant import MotionLog
from catenary.recording import bag_reader
from catenary.recording.import_formats import csv_files, recording_files
from catenary.recording.logs import read_log
from catenary.workflows import import_recording as in_pieces
from catenary.workflows.import_recording import ImportedLog, import_recording, import_to_file
from lab_bags import JOINT_STATE, write_bag
from tests.contracts.test_file_formats import BY_TOPIC, CAMERA, CONTAINERS, STATE, messages

ROWS = 6000
T = np.arange(ROWS) / 100.0
Q = np.column_stack([2.5 * T, 1.0 + 0.4 * np.sin(0.9 * T)])  # [rad], the first turns on and on
SEEN = Q + 0.01 * np.sin(T)[:, None]
HEAD = "t,cmd1,cmd2,enc1,enc2"
MAPPING = ["q_nominal=cmd1,cmd2", "q_encoder=enc1,enc2"]


@pytest.fixture
def pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording_files, "_LONG_FILE_BYTES", 1000)
    monkeypatch.setattr(csv_files, "_SAMPLED_NUMBERS", 10_000)
    monkeypatch.setattr(in_pieces, "_PIECE_NUMBERS", 5 * 700)
    monkeypatch.setattr(in_pieces, "_OVERLAP_ROWS", 200)
    monkeypatch.setattr(csv_files, "_BLOCK_BYTES", 1 << 14)


def written(path: Path, rows: np.ndarray, stamps: list[str] | None = None) -> Path:
    cells = [[f"{v:.9f}" if np.isfinite(v) else "" for v in row] for row in rows]
    stamps = stamps or [f"{t:.9f}" for t in T]
    path.write_text("\n".join([HEAD, *(",".join([s, *row]) for s, row in zip(stamps, cells, strict=True))]) + "\n")
    return path


def plain(path: Path) -> Path:
    return written(path, np.hstack([Q, SEEN]))


def within_a_turn(path: Path) -> Path:
    wrapped = np.hstack([Q, SEEN])
    return written(path, (wrapped + np.pi) % (2 * np.pi) - np.pi)


def at_another_rate(path: Path) -> Path:
    rows = np.hstack([Q, SEEN])
    rows[::5, :2] = np.nan
    rows[np.arange(ROWS) % 5 != 0, 2:] = np.nan
    return written(path, rows)


def with_holes(path: Path) -> Path:
    rows = np.hstack([Q, SEEN])
    rows[1000:2900, 2:] = np.nan  # a camera that was covered, for longer than a piece
    rows[4321, 0] = np.nan
    return written(path, rows)


def over_midnight(path: Path) -> Path:
    day = np.datetime64("2026-03-29T23:59:40", "ms") + np.arange(ROWS) * np.timedelta64(10, "ms")
    return written(path, np.hstack([Q, SEEN]), [str(each).partition("T")[2] for each in day])


def two_recordings(path: Path) -> Path:
    return written(path, np.hstack([Q, SEEN]), [f"{t:.9f}" for t in np.concatenate([T[:2350], T[: ROWS - 2350]])])


def imported(path: Path, out: Path, **how: object) -> tuple[MotionLog, ImportedLog]:
    done = import_to_file(out, [path], MAPPING, units="rad", **how)
    return read_log(out), done


@pytest.mark.alike
@pytest.mark.parametrize(
    "make", [plain, within_a_turn, at_another_rate, with_holes, over_midnight, two_recordings], ids=lambda f: f.__name__
)
def test_the_log_does_not_depend_on_the_pieces(
    make: Callable[[Path], Path], tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    table = make(tmp_path / "lab.csv")
    whole = import_recording(table, MAPPING, units="rad")
    request.getfixturevalue("pieces")
    told: list[float] = []
    log, done = imported(table, tmp_path / "log.parquet", progress=told.append)
    assert (done.rows, done.measured) == (len(whole), int(whole.ok.sum()))
    assert done.seconds == pytest.approx(float(whole.time.max() - whole.time.min()))
    assert told == sorted(told)
    assert told[-1] == 1.0
    for key in ("q_nominal", "q_encoder", "ok", "time"):
        a, b = getattr(log, key), getattr(whole, key)
        rows = whole.ok if key == "q_encoder" else slice(None)
        assert_allclose(a[rows], b[rows], rtol=0.0, atol=1e-9, err_msg=key)
    assert log.starts == whole.starts
    assert log.began == whole.began


@pytest.mark.usefixtures("pieces")
def test_what_pieces_say_is_in_the_log_once(tmp_path: Path) -> None:
    log, done = imported(with_holes(tmp_path / "lab.csv"), tmp_path / "log.parquet")
    assert log.notes == done.notes[: len(log.notes)]
    (lost,) = [note for note in log.notes if "without q_nominal" in note]
    # row 4322 lies in the rows that two pieces have
    assert lost.startswith("rows 3301 to 4400: 1 of 1100 rows without q_nominal (J1 1)")
    assert lost.endswith("likewise in 1 more pieces, which overlap by 400 rows")
    (unseen,) = [note for note in log.notes if "have no q_encoder" in note]
    assert unseen.startswith("rows 501 to 1600: 600 of 1100 rows")
    assert unseen.endswith("likewise in 3 more pieces, which overlap by 400 rows")
    with pytest.raises(InputError, match="no usable row"):
        imported(written(tmp_path / "blind.csv", np.hstack([Q, SEEN + np.nan])), tmp_path / "log.parquet")


@pytest.mark.usefixtures("pieces")
def test_memory_is_that_of_a_piece_and_of_what_is_judged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("catenary.workflows.import_recording._MAX_JUDGED_POSITIONS", ROWS)
    most = []
    for times in (1, 3):
        table = written(
            tmp_path / "lab.csv",
            np.tile(np.hstack([Q, SEEN]), (times, 1)),
            [f"{t:.2f}" for t in np.arange(times * ROWS) / 100],
        )
        import_to_file(tmp_path / "warm.parquet", [table], MAPPING, units="rad")
        tracemalloc.start()
        import_to_file(tmp_path / "log.parquet", [table], MAPPING, units="rad")
        most.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert most[1] < 1.2 * most[0]


def a_bag_a_topic(folder: Path) -> list[Path]:
    topics = (CAMERA, STATE)
    own = [[message for message in messages() if message[1] == topic] for topic in topics]
    return [write_bag(folder / t[1:4], "ros1", {t: JOINT_STATE}, said) for t, said in zip(topics, own, strict=True)]


BAGS = {name: one.write for name, one in CONTAINERS.items() if one.mapping is BY_TOPIC} | {
    "a bag a topic": a_bag_a_topic
}


@pytest.mark.alike
@pytest.mark.parametrize("container", BAGS)
def test_a_bags_log_does_not_depend_on_the_pieces(
    container: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A camera that is blind for two seconds, longer than a piece and what it overlaps; some quantities optional."""
    paths = BAGS[container](tmp_path)
    absent = {"lost": {"columns": "/arm/lost.position", "optional": True}}
    mapping = BY_TOPIC | {"tau": {"columns": f"{STATE}.effort", "optional": True}, "signals": absent}
    whole = import_recording(paths, mapping)
    monkeypatch.setattr(in_pieces, "_PIECE_NUMBERS", 12 * 40)
    monkeypatch.setattr(in_pieces, "_OVERLAP_ROWS", 15)
    monkeypatch.setattr(recording_files, "_BATCH_MESSAGES", 20)
    monkeypatch.setattr(bag_reader, "_MESSAGES_AT_ONCE", 20)
    done = import_to_file(tmp_path / "log.parquet", paths, mapping)
    log = read_log(tmp_path / "log.parquet")
    assert (done.rows, done.measured) == (len(whole), int(whole.ok.sum()))
    for key in ("q_nominal", "q_encoder", "ok", "time", "qd", "tau"):
        assert_allclose(getattr(log, key), getattr(whole, key), rtol=0.0, atol=1e-9, err_msg=key)
    assert log.began == whole.began
    assert any("more pieces" in note for note in log.notes)


def test_bags_by_clocks_that_differ_are_held_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two computers recorded a topic each, one with a clock that is an hour late; stamps agree."""
    late = [(t, topic, make) for t, topic, make in messages() if topic == CAMERA]
    state = a_bag_a_topic(tmp_path)[1]
    camera = write_bag(tmp_path / "late", "ros1", {CAMERA: JOINT_STATE}, late, late={CAMERA: 3600 * 10**9})
    whole = import_recording([state, camera], BY_TOPIC | {"stamps": "header"})
    monkeypatch.setattr(in_pieces, "_PIECE_NUMBERS", 12 * 40)
    done = import_to_file(tmp_path / "log.parquet", [state, camera], BY_TOPIC | {"stamps": "header"})
    assert (done.rows, done.measured) == (len(whole), int(whole.ok.sum()))
    assert done.measured > 0.8 * done.rows
