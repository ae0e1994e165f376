import json
import random
import threading
from pathlib import Path

import pytest

from catenary.errors import FileFormatError, InputError, RecordingError
from catenary.recording.journal import (
    FOOTER,
    HEAD,
    HEADER,
    MAGIC,
    MARKER,
    MAX_HEADER,
    About,
    JournalTopic,
    JournalWriter,
    record_bytes,
)
from catenary.recording.journal_reader import JournalReader, JournalReport
from patience import until

TOPICS = (JournalTopic("/a", "std_msgs/String"), JournalTopic("/b", "std_msgs/Header"))
ABOUT = About("raven2", True, 5, {"speed": 1.5})


def _write(folder: Path, messages: int = 50, **options: int) -> list[tuple[str, int, bytes]]:
    rng = random.Random(1)
    sent = [(rng.choice(("/a", "/b")), 1000 * i, rng.randbytes(rng.randrange(200))) for i in range(messages)]
    with JournalWriter(folder, TOPICS, ABOUT, **options) as journal:  # type: ignore[arg-type]
        for message in sent:
            journal.append(*message)
    return sent


def _read(path: Path) -> list[tuple[str, int, bytes]]:
    return list(JournalReader(path).messages())


def _report(path: Path) -> JournalReport:
    reader = JournalReader(path)
    list(reader.messages())
    return reader.report


def test_what_is_written_is_read_whole_or_one_topic_of_it_and_all_are_counted(tmp_path: Path) -> None:
    sent = _write(tmp_path / "r")
    reader = JournalReader(tmp_path / "r")
    assert list(reader.messages()) == sent
    assert reader.about == ABOUT
    assert reader.topics == TOPICS
    assert reader.report.closed
    assert reader.problems == []
    assert list(reader.messages(("/b",))) == [message for message in sent if message[0] == "/b"]
    assert sum(reader.report.messages.values()) == len(sent)


def test_long_recordings_are_split_and_each_file_reads_by_itself(tmp_path: Path) -> None:
    sent = _write(tmp_path / "r", 200, max_bytes=4000)
    files = sorted((tmp_path / "r").iterdir())
    assert len(files) > 3
    assert all(file.stat().st_size < 6000 for file in files)
    assert _read(tmp_path / "r") == sent
    assert [m for file in files for m in _read(file)] == sent
    assert _report(tmp_path / "r").problems == []


def test_missing_files_are_noticed_and_what_was_in_the_middle_is_counted(tmp_path: Path) -> None:
    sent = _write(tmp_path / "r", 200, max_bytes=4000)
    _, second, *_, last = sorted((tmp_path / "r").iterdir())
    lost = len(_read(second))
    second.unlink()
    report = _report(tmp_path / "r")
    assert sum(report.messages.values()) == len(sent) - lost
    assert report.lost == lost + 2  # its header and footer
    assert any("missing" in problem for problem in report.problems)
    assert report.closed
    last.unlink()
    report = _report(tmp_path / "r")
    assert not report.closed
    assert "was not closed" in report.problems[-1]


@pytest.fixture
def five(tmp_path: Path) -> tuple[bytes, list[int]]:
    """A file of five messages, and where its records begin: header, messages, footer."""
    with JournalWriter(tmp_path / "r", TOPICS) as journal:
        for i in range(5):
            journal.append("/a", i, bytes([i]) * 40)
    whole = (tmp_path / "r" / "0000.journal").read_bytes()
    return whole, [i for i in range(len(whole)) if whole.startswith(MARKER, i)]


def test_torn_last_record_is_dropped_at_every_byte_and_all_before_it_is_kept(five, tmp_path: Path) -> None:
    whole, (*_, last, footer) = five
    assert footer - last == HEAD.size + 40
    torn = tmp_path / "torn.journal"
    for end in range(last, footer):
        torn.write_bytes(whole[:end])
        reader = JournalReader(torn)
        assert [stamp for _, stamp, _ in reader.messages()] == [0, 1, 2, 3]
        assert not reader.report.closed
        cut = [p for p in reader.problems if f"its last {end - last} bytes" in p]
        assert (len(cut), len(reader.problems)) == (end > last, 1 + (end > last))


def test_a_damaged_byte_costs_one_record_that_is_counted(five, tmp_path: Path) -> None:
    whole, starts = five
    hit = tmp_path / "hit.journal"
    for place in range(starts[3], starts[4]):  # the third message
        damaged = bytearray(whole)
        damaged[place] ^= 0x40
        hit.write_bytes(damaged)
        reader = JournalReader(hit)
        assert [stamp for _, stamp, _ in reader.messages()] == [0, 1, 3, 4], place
        assert reader.report.lost == 1
        assert any("damaged" in problem for problem in reader.problems)


def test_a_damaged_first_header_costs_no_message_because_it_comes_again(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("catenary.recording.journal.HEADER_INTERVAL", 0.0)
    with JournalWriter(tmp_path / "r", TOPICS, ABOUT, flush_interval=60.0) as journal:
        for i in range(6):
            journal.append("/a", i, b"x" * 40)
            journal.flush()
    path = tmp_path / "r" / "0000.journal"
    content = bytearray(path.read_bytes())
    content[len(MAGIC) + HEAD.size + 5] ^= 1
    path.write_bytes(content)
    reader = JournalReader(tmp_path / "r")
    assert [stamp for _, stamp, _ in reader.messages()] == list(range(6))
    assert (reader.topics, reader.about, reader.report.closed) == (TOPICS, ABOUT, True)
    assert any("damaged" in problem for problem in reader.problems)


def test_headers_come_again_each_second_while_messages_come(tmp_path, monkeypatch) -> None:
    now = 0.0
    monkeypatch.setattr("catenary.recording.journal.time.monotonic", lambda: now)
    with JournalWriter(tmp_path / "r", TOPICS, flush_interval=60.0) as journal:
        for i in range(30):
            now = 0.25 * i  # exact in binary
            if i < 20:
                journal.append("/a", i, b"x")
            journal.flush()
    content = (tmp_path / "r" / "0000.journal").read_bytes()
    assert content.count(b'"catenary.journal.1"') == 1 + 4  # at 1, 2, 3, 4 s, and none when nothing comes


def _with_header(path: Path, header: object) -> Path:
    text = header if isinstance(header, bytes) else json.dumps(header).encode()
    path.write_bytes(MAGIC + record_bytes(HEADER, 0, 0, text))
    return path


GOOD = {"name": "/a", "type": "std_msgs/String", "md5": "*", "definition": ""}


@pytest.mark.parametrize(
    ("header", "said"),
    [
        (b"{", "cannot be read as JSON"),
        (b"[1, 2]", "expected a table"),
        (b'{"a":' * 5000, "nested|JSON"),
        (b"\xff\xfe\xff", "UTF"),
        (b" " * (MAX_HEADER + 1), "bytes, expected"),
        ({"format": "x"}, "format 'x'"),
        ({}, "topics: expected a list"),
        ({"topics": {}}, "topics: expected a list"),
        ({"topics": [3]}, "topic 3"),
        ({"topics": [GOOD | {"name": 3}]}, "as its name"),
        ({"topics": [GOOD, GOOD]}, "twice"),
        ({"topics": [GOOD], "robot": 3}, "robot: expected a name"),
        ({"topics": [GOOD], "seed": 1e300}, "seed: expected a whole number"),
        ({"topics": [GOOD], "configuration": [1]}, "configuration: expected a table"),
        ({"topics": [GOOD | {"md5": "0" * 32, "definition": "string[99999999999] x"}]}, "md5 sum 0000"),
        ({"topics": [GOOD | {"md5": "0" * 32, "definition": "string[" + "9" * 5000 + "] x"}]}, "definition"),
        ({"topics": [GOOD | {"md5": "0" * 32, "definition": "string data\n" * 50_000}]}, "definition"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_a_header_is_believed_only_after_it_is_checked(tmp_path: Path, header, said: str) -> None:
    if isinstance(header, dict) and "format" not in header:
        header = {"format": "catenary.journal.1"} | header
    with pytest.raises(FileFormatError, match=said) as caught:
        JournalReader(_with_header(tmp_path / "x.journal", header))
    assert "x.journal" in str(caught.value)
    assert len(str(caught.value)) < 2000


def test_blank_lines_and_comments_of_a_definition_cost_nothing(tmp_path: Path) -> None:
    text = "\n" * 40_000 + "# data\n" * 5_000 + "string data\n"
    header = {"format": "catenary.journal.1", "topics": [GOOD | {"md5": "0" * 32, "definition": text}]}
    with pytest.raises(FileFormatError, match="md5 sum 0000"):  # 40,000 of them took two seconds
        JournalReader(_with_header(tmp_path / "x.journal", header))


def test_a_footer_of_nonsense_is_a_problem(tmp_path: Path) -> None:
    for footer in (b"{", b"[]", b'{"last": 3}', b"{}"):
        path = _with_header(tmp_path / "x.journal", {"format": "catenary.journal.1", "topics": [GOOD]})
        path.write_bytes(path.read_bytes() + record_bytes(FOOTER, 1, 0, footer))
        reader = JournalReader(path)
        assert list(reader.messages()) == []
        assert not reader.report.closed
        assert any("footer" in problem for problem in reader.problems)


def test_a_file_made_of_beginnings_of_records_takes_no_time(tmp_path: Path) -> None:
    path = _with_header(tmp_path / "x.journal", {"format": "catenary.journal.1", "topics": [GOOD]})
    count = 60_000
    false = b"".join(HEAD.pack(MARKER, 1, 32 * (count - 1 - i), 0, 0, i, 0) for i in range(count))
    path.write_bytes(path.read_bytes() + false)
    reader = JournalReader(path)
    assert list(reader.messages()) == []  # 60,000 checksums of 1 MB would take a minute
    assert any("in vain" in problem for problem in reader.problems)


def test_records_that_come_again_are_told(tmp_path: Path) -> None:
    _write(tmp_path / "r", 5)
    path = tmp_path / "r" / "0000.journal"
    whole = path.read_bytes()
    starts = [i for i in range(len(whole)) if whole.startswith(MARKER, i)]
    path.write_bytes(whole[: starts[3]] + whole[starts[2] :])
    assert any("out of order, or again" in problem for problem in _report(path).problems)


@pytest.mark.parametrize("content", [b"", MAGIC, b"something else", MAGIC + MARKER])
def test_a_file_with_nothing_whole_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x.journal"
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match="nothing can be read"):
        JournalReader(path)


def test_killed_while_the_next_file_begins_the_others_are_read(tmp_path: Path) -> None:
    sent = _write(tmp_path / "r", 200, max_bytes=4000)
    (tmp_path / "r" / "0099.journal").write_bytes(b"")
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


def test_a_type_of_another_version_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("catenary.recording.journal.md5_sum", lambda _: "0" * 32)
    _write(tmp_path / "r")
    monkeypatch.undo()
    with pytest.raises(FileFormatError, match="md5 sum 0000"):
        JournalReader(tmp_path / "r")


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
    report = _report(tmp_path / "r")
    assert report.messages == {"/a": 1000, "/b": 1000}
    assert report.problems == []


def test_what_waits_reaches_the_disk_without_a_further_message(tmp_path: Path) -> None:
    journal = JournalWriter(tmp_path / "r", TOPICS, flush_interval=0.05)
    journal.append("/a", 1, b"x")
    until(lambda: _read(tmp_path / "r"), every=0.02)
    assert _read(tmp_path / "r") == [("/a", 1, b"x")]
    journal.close()
