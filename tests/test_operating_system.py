import ast
import errno
import os
import signal
import time
from pathlib import Path

import pytest

from catenary import operating_system
from catenary.control.loop import run_loop
from catenary.errors import InputError, UnsupportedSystemError
from catenary.operating_system import elapsed_ns, interrupt, lock, move_open, require_linux, reserve, take_priority
from catenary.teleop.terminal import RawTerminal

PACKAGE = Path(operating_system.__file__).parent
# of Python's own modules, what is not on Linux, macOS and Windows alike
MODULES = {"fcntl", "termios", "tty", "pty", "resource", "pwd", "grp", "msvcrt", "winreg", "posixpath", "ntpath"}
NAMES = {
    "posix_fallocate", "fork", "geteuid", "getuid", "uname", "pread", "pwrite", "nice", "mkfifo", "killpg", "setsid", "fsync",
    "sched_setscheduler", "sched_setaffinity", "sched_getaffinity", "O_NOFOLLOW", "O_CLOEXEC", "O_DIRECTORY",
    "O_NONBLOCK", "SIGHUP", "SIGKILL", "SIGUSR1", "SIGALRM", "setitimer", "AF_UNIX", "poll", "epoll",
    "clock_gettime", "clock_gettime_ns", "CLOCK_MONOTONIC", "CLOCK_BOOTTIME", "CLOCK_REALTIME",
}  # fmt: skip
# a file of ours is open for writing there, and is synchronised on every system
OPEN_FOR_WRITING = {("files.py", "fsync"), ("cards.py", "fsync"), ("recording/journal.py", "fsync")}


def test_one_file_asks_for_what_systems_do_not_have_alike() -> None:
    found = set()
    for path in sorted(PACKAGE.rglob("*.py")):
        name = path.relative_to(PACKAGE).as_posix()
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            imported = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            imported += [str(node.module)] if isinstance(node, ast.ImportFrom) else []
            found |= {(name, word) for word in imported if word in MODULES}
            of = node.value.id if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) else ""
            if of in ("os", "signal", "socket", "select", "time") and node.attr in NAMES:
                found.add((name, node.attr))
    assert {each for each in found if each[0] != "operating_system.py"} <= OPEN_FOR_WRITING


@pytest.mark.parametrize("system", ["darwin", "win32"])
def test_real_robots_are_refused_elsewhere_than_on_linux(system: str, monkeypatch: pytest.MonkeyPatch) -> None:
    class Real:
        simulated = False

    require_linux("ROS 1")
    monkeypatch.setattr(operating_system, "_SYSTEM", system)
    with pytest.raises(UnsupportedSystemError, match=r"^a robot's control loop: Linux only; on this system robots are"):
        run_loop(Real(), None, None, limits=None)  # type: ignore[arg-type]


def test_a_terminal_without_single_keys_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("catenary.teleop.terminal.HAS_SINGLE_KEYS", False)
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    with pytest.raises(InputError, match="teleop: needs a terminal of Linux or macOS for keys"):
        RawTerminal()


def test_space_is_asked_for_where_it_cannot_be_reserved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(os, "posix_fallocate")
    with (tmp_path / "a").open("wb") as file:
        reserve(file, 5000)
    assert (tmp_path / "a").stat().st_size == 5000
    with Path("/dev/full").open("wb", buffering=0) as full, pytest.raises(OSError) as error:
        reserve(full, 1 << 20)
    assert error.value.errno == errno.ENOSPC


def test_an_open_file_is_moved_closed_where_it_must_be(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for may, path in ((True, tmp_path / "a"), (False, tmp_path / "b")):
        monkeypatch.setattr(operating_system, "OPEN_FILES_CAN_MOVE", may)
        with path.open("wb") as file:
            file.write(b"now")
            file.flush()
            move_open(file, path, tmp_path / "new")
            assert file.closed is not may
        assert (tmp_path / "new").read_bytes() == b"now"


def test_without_locks_an_error_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(operating_system, "_fcntl", None)
    with (tmp_path / "a").open("wb") as file, pytest.raises(OSError, match="no locks") as error:
        lock(file.fileno())
    assert error.value.errno == errno.ENOTSUP


@pytest.mark.parametrize("windows", [False, True])
def test_a_process_interrupts_itself(windows: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(operating_system, "_IS_WINDOWS", windows)

    def interrupted() -> None:
        interrupt(signal.SIGINT)
        time.sleep(0.1)

    with pytest.raises(KeyboardInterrupt):
        interrupted()


def test_time_goes_on_by_any_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    before = elapsed_ns()
    time.sleep(0.01)
    assert elapsed_ns() - before > 5_000_000
    monkeypatch.delattr(time, "CLOCK_BOOTTIME")
    before = elapsed_ns()
    time.sleep(0.01)
    assert 5_000_000 < elapsed_ns() - before < 5_000_000_000


def test_no_priority_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(os, "sched_setscheduler")
    assert take_priority(40) is None
