"""A journal: what is written is read, whole or torn, and what is kept where the disk fails or its program is killed.

One that was cut off goes on: nothing twice, nothing missing but what was told.
"""

import errno
import os
import random
import re
import resource
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from catenary.crtk.message import codec
from catenary.crtk.message_values import joint_state_message
from catenary.dvrk_psm import psm_topic
from catenary.errors import FileFormatError, InputError, RecordingError
from catenary.recording.bag_reader import JournalReader
from catenary.recording.journal import ABOUT as NAME_OF_ABOUT
from catenary.recording.journal import MAGIC, About, JournalTopic, JournalWriter, metadata_record
from catenary.trajectories.reference import GoneOn
from catenary.workflows.robot.topic_recorder import left_off
from oracles.waves import Waves
from patience import until

TOPICS = (JournalTopic("/a", "std_msgs/String"), JournalTopic("/b", "std_msgs/Header"))
ABOUT = About("raven2", True, 5, {"speed": 1.5})


def _write(folder: Path, messages: int = 50, **options: int) -> list[tuple[str, int, bytes]]:
    rng = random.Random(1)
    sent = [(rng.choice(("/a", "/b")), 1000 * i, rng.randbytes(rng.randrange(200))) for i in range(messages)]
    with JournalWriter(folder, TOPICS, ABOUT, **options) as journal:
        for message in sent:
            journal.append(*message)
    return sent


def _text(content: bytes) -> bytes:
    """A std_msgs/String."""
    return len(content).to_bytes(4, "little") + content


def _read(path: Path) -> list[tuple[str, int, bytes]]:
    return list(JournalReader(path).messages())


def _read_through(path: Path) -> JournalReader:
    reader = JournalReader(path)
    list(reader.messages())
    return reader


def test_what_is_written_is_read_whole_or_one_topic_of_it_and_all_are_counted(tmp_path: Path) -> None:
    sent = _write(tmp_path / "r")
    reader = JournalReader(tmp_path / "r")
    assert list(reader.messages()) == sent
    assert reader.about == ABOUT
    assert set(reader.topics) == set(TOPICS)
    assert not reader.ends_early
    assert reader.problems == []
    assert list(reader.messages(("/b",))) == [message for message in sent if message[0] == "/b"]
    assert sum(reader.counts.values()) == len(sent)


def test_long_recordings_are_split_and_each_file_reads_by_itself(tmp_path: Path) -> None:
    sent = _write(tmp_path / "r", 200, max_bytes=8000)
    files = sorted((tmp_path / "r").iterdir())
    assert len(files) > 3
    assert all(file.stat().st_size < 12000 for file in files)
    assert _read(tmp_path / "r") == sent
    assert [m for file in files for m in _read(file)] == sent
    assert _read_through(tmp_path / "r").problems == []


def test_missing_files_are_noticed_and_what_was_in_the_middle_is_counted(tmp_path: Path) -> None:
    sent = _write(tmp_path / "r", 200, max_bytes=8000)
    _, second, *_, last = sorted((tmp_path / "r").iterdir())
    lost = len(_read(second))
    second.unlink()
    reader = _read_through(tmp_path / "r")
    assert sum(reader.counts.values()) == len(sent) - lost
    assert reader.lost == lost
    assert any("missing" in problem for problem in reader.problems)
    assert not reader.ends_early
    last.unlink()
    reader = _read_through(tmp_path / "r")
    assert reader.ends_early
    assert "was not closed" in reader.problems[-1]


def _flushed(folder: Path, count: int, about: About | None = None) -> Path:
    """A file of so many messages, a chunk each."""
    with JournalWriter(folder, TOPICS, about, flush_interval=60.0) as journal:
        for i in range(count):
            journal.append("/a", i, bytes([i]) * 40)
            journal.flush()
    return folder / "0000.mcap"


def test_any_reader_of_mcap_reads_it_by_its_index(tmp_path: Path) -> None:
    sent = _write(tmp_path / "r", 200, max_bytes=20_000)
    found = []
    for file in sorted((tmp_path / "r").iterdir()):
        with file.open("rb") as opened:
            reader = make_reader(opened, validate_crcs=True)
            summary = reader.get_summary()
            messages = [(channel.topic, m.log_time, m.data) for _, channel, m in reader.iter_messages()]
        assert summary.statistics.message_count == len(messages)
        assert {schema.name for schema in summary.schemas.values()} == {topic.type for topic in TOPICS}
        found += messages
    assert found == sent


def test_torn_last_message_is_dropped_at_every_byte_and_all_that_the_next_head_proves_is_kept(tmp_path: Path) -> None:
    with JournalWriter(tmp_path / "r", TOPICS, flush_interval=60.0) as journal:
        for i in range(5):
            journal.append("/a", i << 56, _text(bytes([i + 1]) * 36))
    whole = (tmp_path / "r" / "0000.mcap").read_bytes()
    last = whole.index(_text(bytes([5]) * 36)) - 31  # where its record begins
    for end in range(last, last + 71):
        torn = tmp_path / f"{end}" / "0000.mcap"
        torn.parent.mkdir()
        torn.write_bytes(whole[:end])
        reader = JournalReader(torn.parent)
        proven = 4 if end >= last + 23 else 3  # a message may be half of old bytes until the next one's head is there
        assert [stamp >> 56 for _, stamp, _ in reader.messages()] == list(range(proven)), end
        assert reader.ends_early
        assert any("was not closed" in problem for problem in reader.problems)


def test_a_damaged_byte_costs_one_chunk_that_is_counted(tmp_path: Path) -> None:
    whole = _flushed(tmp_path / "r", 5).read_bytes()
    with (tmp_path / "r" / "0000.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    third = summary.chunk_indexes[2]
    hit = tmp_path / "hit" / "0000.mcap"
    hit.parent.mkdir()
    for place in range(third.chunk_start_offset, third.chunk_start_offset + third.chunk_length, 7):
        damaged = bytearray(whole)
        damaged[place] ^= 0x40
        hit.write_bytes(damaged)
        reader = JournalReader(hit.parent)
        found = list(reader.messages())
        assert set(found) <= {("/a", i, bytes([i]) * 40) for i in range(5)}, place  # none is wrong
        assert len(found) == 5 - reader.lost, place
        assert reader.lost <= 1, place  # the times in a chunk's head cost nothing
        assert reader.lost == 0 or any("damaged" in problem for problem in reader.problems)


def test_a_damaged_beginning_costs_no_message_because_what_it_says_comes_again(tmp_path: Path) -> None:
    path = _flushed(tmp_path / "r", 6, ABOUT)
    whole = path.read_bytes()
    for place in (3, 20, 60):
        content = bytearray(whole)
        content[place] ^= 1
        path.write_bytes(content)
        reader = JournalReader(tmp_path / "r")
        assert [stamp for _, stamp, _ in reader.messages()] == list(range(6))
        assert (reader.about, reader.ends_early) == (ABOUT, False)


@pytest.mark.parametrize(
    ("about", "said"),
    [
        ("{", "cannot be read as JSON"),
        ("[1, 2]", "should be an object, got"),
        ('{"robot": 3}', "robot: Input should be a valid string, got 3"),
        ('{"seed": 1e300}', "seed: Input should be a valid integer"),
        ('{"configuration": [1]}', "configuration: Input should be an object"),
    ],
)
def test_what_a_recording_says_of_itself_is_believed_after_it_is_checked(tmp_path: Path, about: str, said: str) -> None:
    path = tmp_path / "0000.mcap"
    path.write_bytes(MAGIC + metadata_record(NAME_OF_ABOUT, about=about))
    with pytest.raises(FileFormatError, match=said) as caught:
        JournalReader(path)
    assert "0000.mcap" in str(caught.value)


def test_messages_that_come_again_are_told(tmp_path: Path) -> None:
    whole = _flushed(tmp_path / "r", 5).read_bytes()
    with (tmp_path / "r" / "0000.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    second, third = (summary.chunk_indexes[i].chunk_start_offset for i in (1, 2))
    (tmp_path / "r" / "0000.mcap").write_bytes(whole[:third] + whole[second:])
    assert any("out of order, or again" in problem for problem in _read_through(tmp_path / "r").problems)


@pytest.mark.parametrize("content", [b"", MAGIC, b"something else"])
def test_a_file_with_nothing_whole_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "0000.mcap"
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match="nothing can be read"):
        JournalReader(path)


def test_killed_while_the_next_file_begins_the_others_are_read(tmp_path: Path) -> None:
    sent = _write(tmp_path / "r", 200, max_bytes=8000)
    (tmp_path / "r" / "0099.mcap").write_bytes(b"")
    reader = JournalReader(tmp_path / "r")
    assert list(reader.messages()) == sent
    assert any("is empty" in problem for problem in reader.problems)


def test_what_cannot_be_opened_or_written_is_said(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="no journal there"):
        JournalReader(tmp_path)
    with pytest.raises(InputError, match="allow more"):
        JournalWriter(tmp_path / "short", TOPICS, max_bytes=100)
    assert not (tmp_path / "short").exists()
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="cannot be made"):
        JournalWriter(tmp_path / "file" / "r", TOPICS)
    with JournalWriter(tmp_path / "r", TOPICS) as journal, pytest.raises(InputError, match="/a, /b"):
        journal.append("/c", 0, b"")
    with pytest.raises(InputError, match="never overwritten"):
        JournalWriter(tmp_path / "r", TOPICS)


def test_threads_append_without_loss(tmp_path: Path) -> None:
    with JournalWriter(tmp_path / "r", TOPICS, max_bytes=20_000) as journal:

        def append(topic: str) -> None:
            for i in range(1000):
                journal.append(topic, i, b"x" * 30)

        threads = [threading.Thread(target=append, args=(t.name,)) for t in TOPICS]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    reader = _read_through(tmp_path / "r")
    assert reader.counts == {"/a": 1000, "/b": 1000}
    assert reader.problems == []


def test_what_waits_reaches_the_disk_without_a_further_message(tmp_path: Path) -> None:
    journal = JournalWriter(tmp_path / "r", TOPICS, flush_interval=0.05)
    journal.append("/a", 1, b"x")
    until(lambda: _read(tmp_path / "r"), every=0.02)
    assert _read(tmp_path / "r") == [("/a", 1, b"x")]
    journal.close()


@pytest.fixture
def disk_with(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Leaves so many bytes on the disk."""
    real = os.write

    def leave(left: int) -> None:
        def write(descriptor: int, data: bytes) -> int:
            nonlocal left
            if left <= 0:
                raise OSError(errno.ENOSPC, "No space left on device")
            written = real(descriptor, bytes(data)[:left])
            left -= written
            return written

        monkeypatch.setattr("catenary.recording.journal.os.write", write)

    return leave


@pytest.mark.parametrize("left", [900, 3000, 3001, 3037, 5000])
def test_a_full_disk_stops_the_recording_and_says_what_is_safe(tmp_path, disk_with, left) -> None:
    journal = JournalWriter(tmp_path / "r", TOPICS, flush_interval=60.0)
    disk_with(left)
    for i in range(60):
        journal.append("/a", i << 56, _text(b"x" * 65))  # a hundred bytes a record
    for stopped in (journal.close, lambda: journal.append("/a", 0, b"")):
        with pytest.raises(RecordingError, match="Safe are the first") as caught:
            stopped()
    safe = int(re.findall(r"first (\d+) of 60 messages", str(caught.value))[0])
    assert left // 100 - 12 <= safe <= left // 100  # what stands before them takes some hundred bytes
    assert f"{60 - safe} are lost" in str(caught.value)
    reader = JournalReader(tmp_path / "r")
    assert [stamp >> 56 for _, stamp, _ in reader.messages()] == list(range(safe))


def test_a_disk_that_is_full_at_the_first_byte_or_fills_between_appends_is_told(tmp_path, disk_with) -> None:
    journal = JournalWriter(tmp_path / "r", TOPICS, flush_interval=0.02)
    disk_with(50)
    with pytest.raises(RecordingError, match="No space left"):
        until(lambda: journal.append("/a", 0, b"x"), every=0.005)
    with pytest.raises(RecordingError, match="Safe are the first 0 of 0"):
        JournalWriter(tmp_path / "s", TOPICS)


def test_what_a_failing_disk_did_not_confirm_does_not_count_as_safe(tmp_path, monkeypatch) -> None:
    journal = JournalWriter(tmp_path / "r", TOPICS, flush_interval=60.0)
    for i in range(5):
        journal.append("/a", i, b"x")
    journal.flush()

    def fail(descriptor: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr("catenary.recording.journal.os.fsync", fail)
    journal.append("/a", 5, b"x")
    with pytest.raises(RecordingError, match=r"Input/output error\. Safe are the first 5 of 6"):
        journal.close()


def test_a_file_that_really_cannot_grow_keeps_what_is_safe(tmp_path: Path) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    journal = JournalWriter(tmp_path / "r", TOPICS, flush_interval=60.0)
    for i in range(3000):
        journal.append("/a", i, _text(b"x" * 100))
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, hard))
    try:
        with pytest.raises(RecordingError, match="File too large") as caught:
            journal.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    stamps = [stamp for _, stamp, _ in JournalReader(tmp_path / "r").messages()]
    assert stamps == list(range(len(stamps)))
    assert 1000 < len(stamps) < 3000
    assert f"first {len(stamps)} of 3000" in str(caught.value)


NUMBERED = [JournalTopic("/a", "std_msgs/Bool"), JournalTopic("/b", "std_msgs/Float64")]
SECOND = 10**9


def appended(writer: JournalWriter, first: int, last: int) -> None:
    """Messages that come every 10 ms, numbered by their bytes."""
    for k in range(first, last):
        writer.append("/b", SECOND + k * 10**7, np.float64(k).tobytes())
        if k % 3 == 0:
            writer.append("/a", SECOND + k * 10**7 + 1, bytes([k % 256]))


def numbers(folder: Path) -> tuple[list[int], JournalReader]:
    reader = JournalReader(folder)
    return [int(np.frombuffer(data)[0]) for name, _, data in reader.messages() if name == "/b"], reader


@pytest.mark.parametrize("end", ["closed", "torn", "empty file", "killed at once"])
@pytest.mark.parametrize("max_bytes", [2**26, 2**14])
def test_it_goes_on_behind_the_last_whole_message(tmp_path: Path, end: str, max_bytes: int) -> None:
    with JournalWriter(tmp_path, NUMBERED, max_bytes=max_bytes) as writer:
        appended(writer, 0, 2500)
    newest = max(tmp_path.glob("*.mcap"))
    if end == "torn":
        newest.write_bytes(newest.read_bytes()[: newest.stat().st_size // 2])
    elif end == "empty file":
        newest.with_name(f"{int(newest.stem) + 1:04d}.mcap").touch()
    elif end == "killed at once":
        newest.with_name(f"{int(newest.stem) + 1:04d}.mcap").write_bytes(newest.read_bytes()[:40])
    kept, _ = numbers(tmp_path)
    found = JournalReader(tmp_path).left_off()
    assert found.begins == pytest.approx(0.01 * kept[-1], abs=1e-6)
    with JournalWriter(tmp_path, NUMBERED, after=found._replace(begins=20.0), max_bytes=max_bytes) as writer:
        writer.note(found._replace(begins=20.0).gap(found.last + 5 * SECOND))
        appended(writer, kept[-1] + 1, 3000)
    whole, reader = numbers(tmp_path)
    assert whole == list(range(3000))
    assert not reader.ends_early
    assert [part.begins for part in reader.last_run()] == [20.0] * len(reader.last_run())
    assert [remark for remark in reader.problems if "5.0 s later from 20.0 s" in remark]


@given(cuts=st.lists(st.floats(0.02, 0.98), min_size=1, max_size=4))
@example(cuts=[0.96875, 0.96875, 0.75, 0.75])  # all 1000 are there before the last cut
@settings(max_examples=25, deadline=None)
def test_wherever_it_is_cut_it_ends_whole(tmp_path_factory: pytest.TempPathFactory, cuts: list[float]) -> None:
    folder, begin, found = tmp_path_factory.mktemp("cut") / "train", 0, None
    for cut in [*cuts, None]:
        with JournalWriter(folder, NUMBERED, after=found) as writer:
            appended(writer, begin, 1000 if cut is None else min(1000, begin + max(1, int(cut * (1000 - begin)))))
        if cut is None:
            break
        newest = max(folder.glob("*.mcap"))
        data = newest.read_bytes()
        newest.write_bytes(data[: int(cut * len(data))])
        try:
            found = JournalReader(folder).left_off()
        except FileFormatError:  # not one whole topic
            found = None
        if found is None:
            for file in folder.glob("*"):
                file.unlink()
        begin = numbers(folder)[0][-1] + 1 if found is not None else 0
    assert numbers(folder)[0] == list(range(1000))


def test_who_moves_it_not_keeps_all_that_came(tmp_path: Path) -> None:
    with JournalWriter(tmp_path, NUMBERED) as writer:
        appended(writer, 0, 730)
    found = JournalReader(tmp_path).left_off()
    assert found.begins == pytest.approx(7.29, abs=1e-6)
    with JournalWriter(tmp_path, NUMBERED, after=found) as writer:
        appended(writer, 2000, 2100)
    again = JournalReader(tmp_path).left_off()
    assert again.begins == pytest.approx(7.29 + 0.99, abs=1e-6)  # what lies between the two counts not
    assert numbers(tmp_path)[0] == [*range(730), *range(2000, 2100)]


def test_what_is_of_another_kind_does_not_go_on(tmp_path: Path) -> None:
    topics = [psm_topic("/PSM1", "measured_js")]
    about = About(robot="dvrk_psm", configuration={"motion": {"sines": (1, 2.5)}})
    with JournalWriter(tmp_path / "a", [JournalTopic(topics[0].name, topics[0].type)], about) as writer:
        message = joint_state_message(("x",), 0, [0.0])
        writer.append(topics[0].name, 5 * SECOND, codec(topics[0].type).encode(message, 0))

    def found(about: About, now: int = 6 * SECOND) -> bool:
        return left_off(tmp_path / "a", about, topics, now) is not None

    assert found(about)
    assert not found(About(robot="dvrk_psm", configuration={"motion": {"sines": (1, 3)}}))
    assert not found(About(robot="raven2", configuration=about.configuration))
    assert not found(about, 4 * SECOND)  # a clock that was set back
    assert left_off(tmp_path / "none", about, topics, 6 * SECOND) is None


def test_a_motion_goes_on_from_rest_and_is_itself_from_the_instant_on() -> None:
    motion = Waves(20.0)
    went = GoneOn(motion, 7.3)
    assert np.abs(went(0.0).qd).max() == 0.0
    times = np.linspace(0.0, went.duration, 400)
    _, qd, qdd = went.sample(times)
    h = 1e-5
    inner = times[1:-1]
    before, after = went.sample(inner - h), went.sample(inner + h)
    np.testing.assert_allclose((after[0] - before[0]) / (2 * h), qd[1:-1], atol=1e-6)  # central difference
    np.testing.assert_allclose((after[1] - before[1]) / (2 * h), qdd[1:-1], atol=1e-3)
    later = times[times > went.lead]
    np.testing.assert_allclose(went.sample(later)[0], motion.sample(later - went.lead + 7.3)[0], atol=1e-12)
    assert went.duration == pytest.approx(motion.duration - 7.3 + went.lead)
    np.testing.assert_array_equal(GoneOn(motion, 0.0).sample(times[:50])[0], motion.sample(times[:50])[0])
