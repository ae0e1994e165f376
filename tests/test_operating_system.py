"""What takes the place of what a system lacks; commands without it: test_other_systems.py."""

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
from catenary.operating_system import elapsed_ns, interrupt, lock, reserve, take_priority
from catenary.teleop.terminal import RawTerminal
from other_system import WINDOWS_LACKS
from test_structure import trees


def test_one_file_asks_for_what_systems_do_not_have_alike() -> None:
    lacking = {"posixpath", "ntpath"}.union(*(names.split() for names in WINDOWS_LACKS.values()))
    lacking.remove("SIGTSTP")  # which a terminal of single keys sends
    found = set()
    for name, tree in trees().items():
        for node in ast.walk(tree):
            imported = [str(node.module)] if isinstance(node, ast.ImportFrom) else []
            imported += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            of = getattr(node.value, "id", "") if isinstance(node, ast.Attribute) else ""
            if lacking & {*imported, node.attr if of in WINDOWS_LACKS else ""}:
                found.add(name)
    assert found == {"operating_system.py"}


def test_real_robots_are_refused_elsewhere_than_on_linux(monkeypatch: pytest.MonkeyPatch) -> None:
    class Real:
        simulated = False

    monkeypatch.setattr(operating_system, "_SYSTEM", "darwin")
    with pytest.raises(UnsupportedSystemError, match=r"^a robot's control loop: Linux only; on this system robots are"):
        run_loop(Real(), None, None, limits=None)  # type: ignore[arg-type]


def test_a_terminal_without_single_keys_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("catenary.teleop.terminal.HAS_SINGLE_KEYS", False)
    monkeypatch.setattr("sys.stdin.isatty", lambda: True)
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    with pytest.raises(InputError, match="teleop: needs a terminal of Linux or macOS for keys"):
        RawTerminal()


def test_locks_space_and_priority_that_are_not_to_be_had_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(operating_system, "_fcntl", None)
    monkeypatch.delattr(os, "posix_fallocate")
    monkeypatch.delattr(os, "sched_setscheduler")
    with (tmp_path / "a").open("wb") as file:
        reserve(file, 5000)
        with pytest.raises(OSError, match="no locks"):
            lock(file.fileno())
    assert (tmp_path / "a").stat().st_size == 5000
    with Path("/dev/full").open("wb", buffering=0) as full, pytest.raises(OSError) as error:
        reserve(full, 1 << 20)
    assert error.value.errno == errno.ENOSPC
    assert take_priority(40) is None


@pytest.mark.parametrize("windows", [False, True])
def test_a_process_interrupts_itself(windows: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(operating_system, "_IS_WINDOWS", windows)

    def interrupted() -> None:
        interrupt(signal.SIGINT)
        time.sleep(0.1)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
    try:
        with pytest.raises(KeyboardInterrupt):
            interrupted()
    finally:
        signal.signal(signal.SIGINT, before)


def test_time_goes_on_by_any_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    for clock in ("CLOCK_BOOTTIME", "none"):
        monkeypatch.delattr(time, clock, raising=False)
        before = elapsed_ns()
        time.sleep(0.01)
        assert 5_000_000 < elapsed_ns() - before < 5_000_000_000
