"""What an operating system offers beyond Python's own promises, asked for in this file alone.

Everything is there on Linux. macOS lacks real-time priority, reservation of disk space and a clock that counts while
the computer sleeps; Windows also lacks POSIX locks, signals, terminals, owners of files and synchronised folders. Each
function says what takes their place and what is then not promised.
"""

import contextlib
import errno
import os
import signal
import sys
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from select import select
from typing import TYPE_CHECKING, Any, BinaryIO, TextIO

from catenary.errors import UnsupportedSystemError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection


def _module(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError:
        return None


_fcntl, _msvcrt, _termios, _tty = map(_module, ("fcntl", "msvcrt", "termios", "tty"))
_SYSTEM = sys.platform
_IS_WINDOWS = _SYSTEM == "win32"
_LOCKED_BYTE = 1 << 30  # Windows locks bytes against reading, too: one that no file has

# Flags of `os.open` for a file of our own: no link is followed, no program started from here gets it, bytes stay as
# they are. Windows has only the last; it lets only administrators and developers make links.
OWN_FILE = sum(getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_CLOEXEC", "O_BINARY"))
WITHOUT_WAITING = getattr(os, "O_NONBLOCK", 0)  # for a named pipe, which Windows has in no folder
OPEN_FILES_CAN_MOVE = not _IS_WINDOWS
HAS_SINGLE_KEYS = _termios is not None
# those that ask a program to end; the last is Windows' for a window that is closed
ENDING_SIGNALS = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP", "SIGBREAK") if hasattr(signal, name)]


def require_linux(what: str) -> None:
    """Raise UnsupportedSystemError where this is not Linux, the only system on which `what` was ever run."""
    if _SYSTEM != "linux":
        raise UnsupportedSystemError(f"{what}: Linux only; on this system robots are simulated and recordings read")


def lock(descriptor: int) -> None:
    """Lock an open file or folder until it is closed; BlockingIOError where another holds it, OSError without locks.

    Windows locks no folders, which cannot be opened there.
    """
    if _fcntl is not None:
        _fcntl.flock(descriptor, _fcntl.LOCK_EX | _fcntl.LOCK_NB)
    elif _msvcrt is not None:
        place = os.lseek(descriptor, 0, os.SEEK_CUR)
        os.lseek(descriptor, _LOCKED_BYTE, os.SEEK_SET)
        try:
            _msvcrt.locking(descriptor, _msvcrt.LK_NBLCK, 1)
        except OSError as error:
            raise BlockingIOError(errno.EWOULDBLOCK, "locked by another process") from error
        finally:
            os.lseek(descriptor, place, os.SEEK_SET)
    else:
        raise OSError(errno.ENOTSUP, "this system has no locks of files")


def move_open(file: BinaryIO, path: Path, new: Path) -> None:
    """Rename an open file, replacing a file of the new name.

    Windows renames closed files only: the file is closed, and its lock lost, just before.

    Args:
        file, path, new: The open file, its name, and its new name.

    Raises:
        PermissionError: On Windows, another program has `new` open.
    """
    if not OPEN_FILES_CAN_MOVE:
        file.close()
    os.replace(path, new)


def sync_file(path: Path) -> None:
    """Have the disk keep a closed file's bytes; on macOS they may still be in the drive's own cache."""
    with path.open("r+b" if _IS_WINDOWS else "rb") as file:  # Windows refuses what is open for reading
        os.fsync(file.fileno())


def sync_folder(folder: Path) -> None:
    """Have the disk keep the names in a folder, where the system and the file system can be asked to.

    On Windows, and in a folder that may be written and not read, a name may be lost in a power cut.
    """
    try:
        descriptor = os.open(folder, os.O_RDONLY | getattr(os, "O_DIRECTORY", 0))
    except PermissionError:
        return
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(descriptor)


def reserve(file: BinaryIO, size: int) -> None:
    """Reserve disk space, or write zeros where the system cannot, for a new file; OSError when the disk is full.

    Args:
        file, size: Open file, and space [B].
    """
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(file.fileno(), 0, size)
    else:
        file.write(bytes(size))
        file.flush()


def user_id() -> int | None:
    """Return the user's number, as files have it; None on Windows, whose modes do not tell who may write to a file."""
    return os.geteuid() if hasattr(os, "geteuid") else None


def lasting_folder() -> str | None:
    """Return a folder for large temporary files, on a disk rather than in memory; None is Python's own choice."""
    return "/var/tmp" if "TMPDIR" not in os.environ and os.path.isdir("/var/tmp") else None


def elapsed_ns() -> int:
    """Return the time [ns] since an arbitrary moment, which only grows.

    On Linux it goes on while the computer is suspended, elsewhere it may stand still.
    """
    if hasattr(time, "CLOCK_BOOTTIME"):
        return time.clock_gettime_ns(time.CLOCK_BOOTTIME)
    return time.monotonic_ns()


def take_priority(level: int) -> Callable[[], None] | None:
    """Take real-time priority (SCHED_FIFO), and return what gives it back; None if it is not to be had."""
    try:
        policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(level))
    except (AttributeError, OSError):  # macOS and Windows have none; not allowed
        return None
    return lambda: os.sched_setscheduler(0, policy, parameters)


def interrupt(number: int) -> None:
    """Send this process a signal; on Windows, which would end it at once, its handler runs at the next instruction."""
    if _IS_WINDOWS:
        import _thread

        _thread.interrupt_main(signal.Signals(number))
    else:
        os.kill(os.getpid(), number)


def single_keys(descriptor: int) -> Callable[[], None]:
    """Let a terminal hand over keys one by one, unechoed, and return what puts it back; where HAS_SINGLE_KEYS."""
    before = _termios.tcgetattr(descriptor)

    def put_back() -> None:
        with contextlib.suppress(_termios.error):  # the terminal may be gone
            _termios.tcsetattr(descriptor, _termios.TCSANOW, before)

    _tty.setcbreak(descriptor, _termios.TCSANOW)
    return put_back


def takes_more(connection: "Connection | TextIO") -> bool:
    """Return True if a connection or file takes a message at once; Windows does not report it, and it may wait."""
    return _IS_WINDOWS or bool(select([], [connection], [], 0.0)[1])


def has_windows() -> bool:
    """Return True if programs can show windows; macOS and Windows are assumed to be used at their screen."""
    return _SYSTEM != "linux" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
