import errno
import os
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import Reader as Reader2

from catenary.errors import FileFormatError, InputError, RecordingError
from catenary.recording.bag_reader import JournalReader, open_recording
from catenary.workflows import recover as module
from catenary.workflows.recover import recover
from command_line import catenary, refusal
from lab_bags import JOINT_STATE, JOINTS, KINDS, Kind, joint_state, true_q
from lab_bags import write_bag as write_lab_bag
from oracles.raven_recording import record, write_bag


@pytest.fixture(scope="module")
def journal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("whole") / "run", 12.0)


def damaged(journal: Path, folder: Path, kind: str, damage: str) -> Path:
    """A recording of a kind, cut off or hit in the middle."""
    if kind == "journal":
        path = folder / "run"
        path.mkdir()
        file = path / "0000.mcap"
        file.write_bytes((journal / "0000.mcap").read_bytes())
    elif kind == "bag":
        path = file = write_bag(journal, folder / "run.bag")
    else:
        path = write_bag(journal, folder / "run")
        (file,) = path.glob("*.mcap")
    content = bytearray(file.read_bytes())
    middle = len(content) // 2
    if damage == "cut":
        del content[middle:]
    elif damage == "no index":
        del content[-60_000 if kind == "bag" else -1000 :]
    else:
        content[middle : middle + 20_000] = os.urandom(20_000)
    file.write_bytes(content)
    if kind == "mcap":
        (path / "metadata.yaml").unlink()
    return path


def bytes_below(path: Path) -> dict[str, bytes]:
    files = path.rglob("*") if path.is_dir() else [path]
    return {file.name: file.read_bytes() for file in files if file.is_file()}


@pytest.mark.alike
@pytest.mark.parametrize("kind", ["journal", "bag", "mcap"])
@pytest.mark.parametrize("damage", ["cut", "no index", "hit"])
def test_what_is_whole_becomes_a_whole_recording_of_the_same_kind(journal, tmp_path, kind: str, damage: str) -> None:
    path = damaged(journal, tmp_path, kind, damage)
    before = bytes_below(path)
    found = recover(path)
    assert bytes_below(path) == before
    assert found.written == tmp_path / {"bag": "run.recovered.bag"}.get(kind, "run.recovered")
    assert sorted(tmp_path.iterdir()) == sorted([path, found.written])  # nothing half written
    again = open_recording(found.written)
    stamps = [(topic, stamp) for topic, stamp, _ in again.messages()]
    assert again.damage == []
    assert again.about.robot == "raven2"
    kept = {one.topic: one.kept for one in found.rescue.topics}
    assert sum(kept.values()) == len(stamps)
    sent = [(topic, stamp) for topic, stamp, _ in JournalReader(journal).messages()]
    order = {one: i for i, one in enumerate(sent)}
    places = [order[one] for one in stamps if one in order]  # a bag does not tell a stamp that was hit
    assert places == sorted(places)
    assert len(places) >= len(stamps) - (0 if kind == "journal" else 2)
    least = {"cut": 0.4, "no index": 0.85, "hit": 0.45}[damage]
    assert len(stamps) > least * len(sent)
    assert found.rescue.ends_early == (damage == "cut" or (damage == "no index" and kind == "bag"))
    if kind == "journal":
        assert again.about.configuration["recovered"]["topics"][0]["kept"] == kept["/ravenstate"]
    if kind != "journal":  # rosbags judges; one message says of which robot
        with Reader1(found.written) if kind == "bag" else Reader2(found.written) as other:
            assert other.message_count == len(stamps) + 1


def test_a_type_that_catenary_does_not_know_is_kept(tmp_path: Path) -> None:
    with Writer1(tmp_path / "a.bag") as bag:
        image = bag.add_connection("/camera", "lab_msgs/msg/Picture", msgdef="uint8[] data\n", md5sum="0" * 32)
        for i in range(50):
            bag.write(image, 1000 + i, b"\x04\0\0\0abcd")
    whole = (tmp_path / "a.bag").read_bytes()
    (tmp_path / "a.bag").write_bytes(whole[:-50])
    found = recover(tmp_path / "a.bag")
    with Reader1(found.written) as reader:
        assert [bytes(data) for _, _, data in reader.messages()] == [b"\x04\0\0\0abcd"] * 50
        (connection,) = reader.connections
        assert (connection.msgtype, connection.msgdef.data) == ("lab_msgs/msg/Picture", "uint8[] data\n")


def test_a_whole_recording_is_told_so_and_nothing_is_written(journal: Path, tmp_path: Path) -> None:
    found = recover(journal, tmp_path / "out")
    assert found.written is None
    assert list(tmp_path.iterdir()) == []
    outcome = catenary("recover", journal)
    assert outcome.code == 0
    assert "nothing to recover, nothing written" in outcome.out


def test_nothing_is_overwritten_nor_the_recording_changed(journal: Path, tmp_path: Path) -> None:
    path = damaged(journal, tmp_path, "journal", "cut")
    (tmp_path / "run.recovered").write_text("mine")
    with pytest.raises(InputError, match="never overwritten"):
        recover(path)
    assert (tmp_path / "run.recovered").read_text() == "mine"
    for out, said in (
        (path / "x", "is inside the recording"),
        (tmp_path / "a.bag", "without .bag"),
        (tmp_path / "no" / "x", "does not exist"),
    ):
        with pytest.raises(InputError, match=said):
            recover(path, out)
    assert "never overwritten" in refusal("recover", path)


@pytest.mark.parametrize("content", [b"", b"#ROSBAG V2.0\n", b"words"])
def test_what_holds_no_message_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.bag").write_bytes(content)
    (tmp_path / "empty").mkdir()
    with pytest.raises(FileFormatError, match=r"a\.bag"):
        recover(tmp_path / "a.bag")
    with pytest.raises(FileFormatError, match="no such recording"):
        recover(tmp_path / "b.bag")
    with pytest.raises(FileFormatError, match="has no file of a bag; it holds nothing"):
        recover(tmp_path / "empty")


def one_topic(folder: Path, kind: Kind) -> tuple[Path, Path]:
    """20 s of an arm at 100 Hz, in one chunk, and the file of it."""
    messages = [(t, "/arm", joint_state(JOINTS, true_q(t))) for t in np.arange(0.0, 20.0, 0.01)]
    path = write_lab_bag(folder / "lab", kind, {"/arm": JOINT_STATE}, messages)
    return path, path if path.is_file() else next(p for p in path.iterdir() if p.suffix in (".mcap", ".db3"))


@pytest.mark.alike
@pytest.mark.parametrize("kind", KINDS)
def test_what_a_lost_byte_costs_is_told_in_messages_and_seconds(kind: Kind, tmp_path: Path) -> None:
    path, file = one_topic(tmp_path, kind)
    whole = file.read_bytes()
    file.write_bytes(whole[: len(whole) // 3] + whole[len(whole) // 3 + 1 :])
    found = recover(path)
    (topic,), ((begin, end),) = found.rescue.topics, found.rescue.gaps
    assert topic.kept + topic.lost == pytest.approx(2000, rel=0.03)  # SQLite's overhead is estimated
    assert topic.kept == sum(1 for _ in open_recording(found.written).messages())
    assert (begin, end) == (pytest.approx(topic.kept / 100, abs=0.02), pytest.approx(20.0, rel=0.03))
    assert f"no message for {end - begin:.1f} s, from {begin:.1f} to {end:.1f} s" in found.rescue.text()


@pytest.mark.alike
@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_whose_joints_an_editor_renamed_holds_no_message(kind: Kind, tmp_path: Path) -> None:
    path, file = one_topic(tmp_path, kind)
    file.write_bytes(file.read_bytes().replace(b"outer_yaw", b"outer_yaw_joint"))
    with pytest.raises(FileFormatError, match=r"no whole message is in it|nothing in it can be saved"):
        recover(path)


@pytest.mark.alike
@pytest.mark.parametrize("ending", [b"\r\n", b"\n"])
@pytest.mark.parametrize("kind", [*KINDS, "npz", "parquet", "journal"])
def test_what_was_copied_as_text_is_told_so(kind: str, ending: bytes, journal: Path, tmp_path: Path) -> None:
    if kind in KINDS:
        path, file = one_topic(tmp_path, kind)
    elif kind == "journal":
        path, file = tmp_path / "run", tmp_path / "run" / "0000.mcap"
        shutil.copytree(journal, path)
    else:
        path = file = tmp_path / f"a.{kind}"
        np.savez(path, q=true_q(np.arange(0.0, 20.0, 0.01)))
        if kind == "parquet":
            pq.write_table(pa.table({"q": true_q(np.arange(0.0, 20.0, 0.01))[:, 0]}), path)
    assert "copied as text" not in "".join(catenary("check", path)[1:])
    if ending == b"\n" and kind not in ("mcap", "journal"):
        return  # without a line end in its mark nobody sees that some are shorter
    file.write_bytes(file.read_bytes().replace(b"\r\n" if ending == b"\n" else b"\n", ending))
    for command in ("check", "import", "recover"):
        if command == "recover" and kind in ("npz", "parquet"):
            continue
        assert "it was copied as text" in refusal(command, path)


@pytest.mark.parametrize("kind", ["journal", "bag"])
def test_a_full_disk_leaves_nothing_half_written(journal, tmp_path, monkeypatch, kind: str) -> None:
    path = damaged(journal, tmp_path, kind, "cut")

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(module, "_write_journal" if kind == "journal" else "_write_bag", full)
    with pytest.raises(RecordingError, match=r"No space left on device; .* is as it was"):
        recover(path)
    assert list(tmp_path.iterdir()) == [path]


def test_the_command_tells_what_was_kept_and_lost(journal: Path, tmp_path: Path) -> None:
    path = damaged(journal, tmp_path, "journal", "hit")
    outcome = catenary("recover", path, "--out", tmp_path / "saved", "--json")
    assert outcome.code == 0
    assert outcome.json["written"] == str(tmp_path / "saved")
    lost = {one["topic"]: one["lost"] for one in outcome.json["topics"]}
    assert lost["/ext_jpos"] > lost["/ravenstate"] > 0
    outcome = catenary("recover", path, "--out", tmp_path / "again")
    assert f"written: {tmp_path / 'again'}" in outcome.out
    assert "/ext_jpos" in outcome.out
    assert "damaged" in outcome.err
