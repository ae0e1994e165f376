"""What a journal keeps where the disk fails or its program is killed."""

import errno
import os
import re
import resource
from collections.abc import Callable
from pathlib import Path

import pytest

from catenary.errors import RecordingError
from catenary.recording.journal import JournalTopic, JournalWriter
from catenary.recording.journal_reader import JournalReader
from patience import until

TOPICS = (JournalTopic("/a", "std_msgs/String"),)


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
        journal.append("/a", i, b"x" * 69)  # a hundred bytes a record
    for stopped in (journal.close, lambda: journal.append("/a", 0, b"")):
        with pytest.raises(RecordingError, match="Safe are the first") as caught:
            stopped()
    safe = int(re.findall(r"first (\d+) of 60 messages", str(caught.value))[0])
    assert left // 100 - 12 <= safe <= left // 100  # what stands before them takes some hundred bytes
    assert f"{60 - safe} are lost" in str(caught.value)
    reader = JournalReader(tmp_path / "r")
    assert [stamp for _, stamp, _ in reader.messages()] == list(range(safe))


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
        journal.append("/a", i, b"x" * 100)
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
