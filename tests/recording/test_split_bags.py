"""ROS 2 bags of three files, and ROS 1 bags in a row, with every trouble that a folder may have, against the whole."""

import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from rosbags.rosbag2 import Reader

from catenary.plant import MotionLog
from catenary.recording.bag_reader import open_recording, open_recordings
from catenary.workflows.import_recording import import_recording
from catenary.workflows.recover import recover
from command_line import catenary
from lab_bags import JOINT_STATE, JOINTS, Kind, joint_state, true_q, write_bag

TOPIC = "/raven/joint_cmd"
PARTS = [np.arange(first, first + 1000) / 100.0 for first in (0, 1000, 2000)]  # [s] each ten seconds of 100 Hz
LAST = "lab_2"


def part(folder: Path, name: str, kind: Kind, times: np.ndarray) -> Path:
    """A bag of some seconds; of ROS 2 its file alone."""
    messages = [(t, TOPIC, joint_state(JOINTS, true_q(t))) for t in times]
    path = write_bag(folder / name, kind, {TOPIC: JOINT_STATE}, messages)
    if kind == "ros1":
        return path
    (inside,) = (p for p in path.iterdir() if p.suffix in (".mcap", ".db3"))
    return inside


def split(folder: Path, kind: Kind) -> Path:
    """A ROS 2 bag of three files, as `ros2 bag record --max-bag-duration 10` writes it."""
    bag = folder / "lab"
    bag.mkdir()
    names = []
    for i, times in enumerate(PARTS):
        inside = part(folder / "parts", f"lab_{i}", kind, times)
        names.append(f"lab_{i}{inside.suffix}")
        shutil.move(inside, bag / names[-1])
    text = (folder / "parts/lab_0/metadata.yaml").read_text()
    listed = "".join(f"  - {name}\n" for name in names)
    text = text.replace("  - lab_0.mcap\n", listed).replace("  - lab_0.db3\n", listed)
    text = text.replace("message_count: 1000", "message_count: 3000")
    (bag / "metadata.yaml").write_text(text)
    return bag


@pytest.fixture(scope="module", params=["sqlite", "mcap"])
def unspoilt(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return split(tmp_path_factory.mktemp(request.param), request.param)


@pytest.fixture
def bag(unspoilt: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(unspoilt, tmp_path / "lab"))


def files(bag: Path) -> list[Path]:
    return sorted(p for p in bag.iterdir() if p.suffix in (".mcap", ".db3"))


def imported(*paths: Path) -> MotionLog:
    return import_recording(list(paths), [f"q_nominal={TOPIC}.position"], units="rad,rad,m")


def warned(log: MotionLog) -> str:
    return "; ".join(note for note in log.notes if note.startswith("warning: "))


def edited(bag: Path, change: Callable[[str], str]) -> None:
    text = (bag / "metadata.yaml").read_text()
    assert change(text) != text
    (bag / "metadata.yaml").write_text(change(text))


def test_the_bag_is_one_that_rosbags_reads_whole(bag: Path) -> None:
    with Reader(bag) as reader:
        assert sum(1 for _ in reader.messages()) == 3000
    log = imported(bag)
    assert len(log) == 3000
    assert not warned(log)


METADATA_TROUBLES: dict[str, Callable[[Path], object]] = {
    "empty identifier": lambda bag: edited(
        bag,
        lambda text: text.replace("identifier: sqlite3", 'identifier: ""').replace(
            "identifier: mcap", 'identifier: ""'
        ),
    ),
    "an anchor": lambda bag: edited(bag, lambda text: text + "other: &a\n  b: 1\n"),
    "a file renamed": lambda bag: files(bag)[1].rename(bag / f"afternoon{files(bag)[1].suffix}"),
    "a list of files that are others": lambda bag: edited(bag, lambda text: text.replace("- lab_", "- old_")),
    "no metadata": lambda bag: (bag / "metadata.yaml").unlink(),
    "empty metadata": lambda bag: (bag / "metadata.yaml").write_text(""),
    "a topic that is not listed": lambda bag: edited(bag, lambda text: text.replace(TOPIC, "/another")),
}


@pytest.mark.alike
@pytest.mark.parametrize("trouble", METADATA_TROUBLES)
def test_metadata_that_cannot_be_used_cost_no_message(bag: Path, trouble: str) -> None:
    whole = imported(bag)
    METADATA_TROUBLES[trouble](bag)
    log = imported(bag)
    assert_array_equal(log.q_nominal, whole.q_nominal)
    assert_array_equal(log.time, whole.time)
    assert ("its files were read one by one" in warned(log)) == (trouble == "empty metadata")
    assert ("is listed in" in warned(log)) == ("file" in trouble)
    assert sum(1 for source in open_recordings([bag]) for _ in source.messages()) == 3000


def test_a_file_that_is_missing_leaves_a_gap_that_is_told(bag: Path) -> None:
    whole, lost = imported(bag), files(bag)[1]
    lost.unlink()
    log = imported(bag)
    assert_array_equal(log.q_nominal, np.concatenate([whole.q_nominal[:1000], whole.q_nominal[2000:]]))
    assert f"{lost}: is listed in metadata.yaml and missing" in warned(log)
    assert any("1 gap(s), the longest 10.010 s" in note for note in log.notes)
    assert open_recording(bag).counts == {TOPIC: 2000}


@pytest.mark.alike
@pytest.mark.parametrize("place", [0, 1, 2])
@pytest.mark.parametrize("share", [0.6, 0.0])
def test_of_a_file_that_was_cut_off_its_beginning_is_read_and_all_of_the_others(
    bag: Path, place: int, share: float
) -> None:
    whole, cut = imported(bag), files(bag)[place]
    cut.write_bytes(cut.read_bytes()[: int(share * cut.stat().st_size)])
    log = imported(bag)
    rows = len(log) - 2000
    assert 300 < rows < 800 if share else rows == 0
    first = 1000 * place
    kept = np.r_[: first + rows, first + 1000 : 3000]
    assert_array_equal(log.q_nominal, whole.q_nominal[kept])
    assert cut.name in warned(log)


def test_a_database_damaged_in_its_middle_is_read_as_far_as_sqlite_reads_it(tmp_path: Path) -> None:
    bag = split(tmp_path, "sqlite")
    whole = imported(bag)
    cut = files(bag)[1]
    data = bytearray(cut.read_bytes())
    half = len(data) // 8192 * 4096 + 1000  # within a page
    data[half : half + 20_480] = bytes(20_480)
    cut.write_bytes(data)
    log = imported(bag)
    rows = len(log) - 2000
    assert 200 < rows < 800
    assert_array_equal(log.q_nominal, whole.q_nominal[np.r_[: 1000 + rows, 2000:3000]])
    assert f"{cut.name}: cannot be read as SQLite to its end" in warned(log)


JOURNAL_MODES = {"wal": "-wal", "persist": "-journal", "truncate": "-journal"}


@pytest.mark.alike
@pytest.mark.parametrize(("mode", "beside"), JOURNAL_MODES.items(), ids=JOURNAL_MODES)
def test_a_database_is_read_with_what_waits_beside_it_and_stays_as_it_is(
    tmp_path: Path, mode: str, beside: str
) -> None:
    """A killed recorder leaves what SQLite, told the truth, would read: a copy of all files, opened by sqlite3."""
    bag = split(tmp_path, "sqlite")
    last = files(bag)[2]
    writer = sqlite3.connect(last, isolation_level=None)
    writer.executescript(f"PRAGMA journal_mode = {mode}; PRAGMA wal_autocheckpoint = 0; PRAGMA cache_size = 1; BEGIN")
    writer.execute("DELETE FROM messages WHERE id > 500")
    if mode == "wal":
        writer.execute("COMMIT")
    left = tmp_path / "left"
    shutil.copytree(bag, left)  # as a power cut leaves it
    writer.close()
    assert (left / f"{last.name}{beside}").stat().st_size > 512
    before = {path.name: path.read_bytes() for path in left.iterdir()}
    judge = shutil.copytree(left, tmp_path / "judge")
    (count,) = sqlite3.connect(judge / last.name).execute("SELECT count(*) FROM messages").fetchone()
    assert count == (500 if mode == "wal" else 1000)
    assert len(imported(left)) == 2000 + count
    assert recover(left).written is None
    assert {path.name: path.read_bytes() for path in left.iterdir()} == before


def test_a_file_that_the_metadata_do_not_list_is_another_recording(bag: Path, tmp_path: Path) -> None:
    kind: Kind = "mcap" if files(bag)[0].suffix == ".mcap" else "sqlite"
    stray = part(tmp_path / "others", "yesterday", kind, PARTS[0] - 86_400.0)
    shutil.copy(stray, bag / stray.name)
    log = imported(bag)
    assert len(log) == 3000
    assert f"{stray.name}: lies in the folder, and metadata.yaml does not list it: it was not read" in warned(log)


def test_metadata_that_count_more_messages_than_there_are_are_told(bag: Path) -> None:
    edited(bag, lambda text: text.replace("message_count: 3000", "message_count: 4000"))
    log = imported(bag)
    assert len(log) == 3000
    assert "counts 4000 messages, its files hold 3000" in warned(log)


def test_packed_files_that_are_not_read_are_told_with_what_unpacks_them(bag: Path) -> None:
    packed = files(bag)[2]
    packed.rename(packed.with_name(packed.name + ".zstd"))
    log = imported(bag)
    assert len(log) == 2000
    assert f"`zstd -d {packed.name}.zstd` unpacks it" in warned(log)


def test_a_single_file_is_read_and_the_others_named(bag: Path) -> None:
    log = imported(files(bag)[1])
    assert len(log) == 1000
    assert f"is one file of a bag; not read were {files(bag)[0].name}, {files(bag)[2].name}" in warned(log)


def test_recover_writes_all_that_is_whole(bag: Path, tmp_path: Path) -> None:
    whole, cut = imported(bag), files(bag)[1]
    cut.write_bytes(cut.read_bytes()[: cut.stat().st_size // 2])
    found = recover(bag, tmp_path / "saved")
    (topic,) = found.rescue.topics
    assert abs(topic.kept + topic.lost - 3000) < 5
    saved = imported(tmp_path / "saved")
    assert not warned(saved)
    assert len(saved) == topic.kept
    assert_array_equal(saved.q_nominal[-1000:], whole.q_nominal[-1000:])


def test_check_and_import_warn_on_a_line_of_their_own(bag: Path, tmp_path: Path) -> None:
    files(bag)[2].unlink()
    out = tmp_path / "log.parquet"
    outcome = catenary(
        "import", bag, "--map", f"q_nominal={TOPIC}.position", "--units", "rad,rad,m", "--out", out, "--no-notes"
    )
    assert outcome.code == 0, outcome.err
    assert any(line.startswith("warning: ") and "lab_2" in line for line in outcome.err.splitlines())


@pytest.mark.parametrize("given", ["a folder", "arguments"])
def test_ros1_bags_in_a_row_are_read_in_order_of_time(given: str, tmp_path: Path) -> None:
    folder = tmp_path / "lab"
    folder.mkdir()
    times = np.array_split(np.concatenate(PARTS), 11)  # lab_10 comes before lab_2 by its name
    bags = [part(folder, f"lab_{i}", "ros1", each) for i, each in enumerate(times)]
    log = imported(*([folder] if given == "a folder" else sorted(bags)))
    assert_array_equal(log.q_nominal, true_q(np.concatenate(PARTS)))
    assert not [note for note in log.notes if "out of order" in note]
