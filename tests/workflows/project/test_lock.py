"""Two processes at one project; the other one is a real process where it has to end."""

import errno
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from catenary.errors import FileFormatError, InUseError
from catenary.workflows.project.folder import LOCK, FolderLock

HOLDS = """
import sys, time
from pathlib import Path
sys.argv = ["catenary", "calibrate", "my project"]
from catenary.workflows.project.folder import FolderLock
FolderLock(Path(sys.orig_argv[-1])).take()
print("held", flush=True)
time.sleep(60)
"""


def taken(folder: Path) -> FolderLock:
    lock = FolderLock(folder)
    lock.take()
    return lock


def test_the_second_one_is_told_who_holds_it_and_gets_it_when_the_first_is_killed(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", HOLDS, tmp_path], stdout=subprocess.PIPE, text=True) as other:
        try:
            assert other.stdout is not None
            assert other.stdout.readline() == "held\n"
            words = rf"catenary calibrate 'my project' \(process {other.pid} on .+\) has been writing in it since 20"
            with pytest.raises(InUseError, match=words):
                taken(tmp_path)
        finally:
            other.send_signal(signal.SIGKILL)
    assert f"process {other.pid} on" in (tmp_path / LOCK).read_text()  # it had no time to take its name off
    mine = taken(tmp_path)
    assert f"process {os.getpid()} on" in (tmp_path / LOCK).read_text()
    mine.release()


def test_it_is_free_once_released_and_its_file_then_names_nobody(tmp_path: Path) -> None:
    taken(tmp_path).release()
    assert (tmp_path / LOCK).read_bytes() == b""
    taken(tmp_path).release()


@pytest.mark.parametrize("text", [b"", b"catenary excite p (process 1 on lab) has been writing in it", b"\xff" * 100])
def test_what_a_killed_process_left_is_taken_over(tmp_path: Path, text: bytes) -> None:
    (tmp_path / LOCK).write_bytes(text)
    taken(tmp_path).release()


def test_a_file_system_without_locks_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("fcntl.flock", unknown)
    with pytest.raises(FileFormatError, match=r"\.lock: cannot be locked: No locks available$"):
        taken(tmp_path)


def test_a_lock_whose_file_was_replaced_is_noticed_before_anything_is_noted(tmp_path: Path) -> None:
    first = taken(tmp_path)
    first.check()
    (tmp_path / LOCK).unlink()
    second = taken(tmp_path)
    with pytest.raises(InUseError, match="was deleted or replaced"):
        first.check()
    second.check()
    first.release()
    second.release()


def test_a_planted_link_is_not_followed(tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_text("mine")
    (tmp_path / LOCK).symlink_to(precious)
    with pytest.raises(FileFormatError, match="cannot be locked"):
        taken(tmp_path)
    assert precious.read_text() == "mine"


def test_a_full_disk_names_the_locks_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")  # by a descriptor the system names no file

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(FileFormatError, match=rf"^{tmp_path / LOCK}: cannot be locked: No space left on device$"):
        taken(tmp_path)
    monkeypatch.undo()
    taken(tmp_path).release()
