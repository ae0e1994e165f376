"""One process at a time writes in a folder; the file that says so tells who.

The system holds the lock (flock on the file `.lock`) and frees it when the process ends, however it ends: what the file
says only tells. On NFS, Linux asks the server (v4, or v3 with lockd) and all hosts see it; it is freed when the process
ends, or some minutes after its host is lost. Where locks are kept per host (`nolock`, `local_lock`), or not at all,
what the file says is believed: a process on another host that did not take its name off is not passed over.
"""

import contextlib
import fcntl
import json
import os
import shlex
import sys
from datetime import datetime
from pathlib import Path
from typing import Any

from catenary.documents import json_table
from catenary.errors import FileFormatError, InUseError

LOCK = ".lock"


class FolderLock:
    """The lock of a folder, as this object sees it; not reentrant."""

    def __init__(self, folder: Path) -> None:
        """Take nothing yet."""
        self.path = folder / LOCK
        self._descriptor: int | None = None

    @property
    def is_held(self) -> bool:
        """Whether this object holds it."""
        return self._descriptor is not None

    def take(self) -> None:
        """Lock the folder; what a process that is gone has left is taken over."""
        try:
            flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
            descriptor = os.open(self.path, flags, 0o666)
        except OSError as error:
            raise FileFormatError(f"{self.path}: cannot be written: {error.strerror}") from error
        try:
            is_locked = _flock(descriptor)
            holder = _holder(descriptor)
            if not is_locked or not _is_here(holder):
                gone = "" if _is_here(holder) else f", or delete {self.path} if that process is gone"
                raise InUseError(f"{self.path.parent}: {_told(holder)}; wait until it ends{gone}")
            os.ftruncate(descriptor, 0)
            os.pwrite(descriptor, json.dumps(_myself()).encode(), 0)
        except BaseException as error:
            os.close(descriptor)
            if isinstance(error, OSError):
                raise FileFormatError(f"{self.path}: cannot be written: {error.strerror}") from error
            raise
        self._descriptor = descriptor

    def check(self) -> None:
        """Refuse to go on without the lock's file: another process may have made, and locked, a new one."""
        try:
            is_ours = self._descriptor is not None and os.path.samestat(os.fstat(self._descriptor), self.path.lstat())
        except OSError:
            is_ours = False
        if not is_ours:
            raise InUseError(
                f"{self.path}: was deleted or replaced while this process wrote in the folder; nothing more is "
                "noted. Run the command again when no other process works there"
            )

    def release(self) -> None:
        """Give it back; without it, do nothing."""
        if self._descriptor is None:
            return
        descriptor, self._descriptor = self._descriptor, None
        with contextlib.suppress(OSError):  # what it says only tells
            os.ftruncate(descriptor, 0)
        os.close(descriptor)


def _flock(descriptor: int) -> bool:
    """Return whether the lock was had, or the file system knows none."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks: what the file says is all there is
        holder = _holder(descriptor)
        return not (_is_here(holder) and _is_running(holder.get("pid")))
    return True


def _myself() -> dict[str, Any]:
    command = shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]])
    since = datetime.now().astimezone().isoformat(timespec="seconds")
    return {**_machine(), "pid": os.getpid(), "command": command, "since": since}


def _machine() -> dict[str, str]:
    """Return the host's name, and Linux's number of this run of it, which containers share."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    except OSError:
        boot = ""
    return {"host": os.uname().nodename, "boot": boot}


def _holder(descriptor: int) -> dict[str, Any]:
    """Return what the file says; empty where nobody wrote anything that can be read."""
    try:
        return json_table(os.pread(descriptor, 10_000, 0), LOCK)
    except FileFormatError:
        return {}


def _is_here(holder: dict[str, Any]) -> bool:
    """Return whether a holder is, or was, on this machine; so is one that said nothing."""
    return not holder or any(value and holder.get(key) == value for key, value in _machine().items())


def _is_running(pid: object) -> bool:
    if not isinstance(pid, int) or pid <= 0 or pid == os.getpid():
        return False
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:  # somebody else's
        return True
    return True


def _told(holder: dict[str, Any]) -> str:
    """Return who holds the lock, in words without control characters."""
    if not holder:
        return "another process is writing in it"
    command, pid, host, since = (str(holder.get(key, "?")) for key in ("command", "pid", "host", "since"))
    text = f"{command} (process {pid} on {host}) has been writing in it since {since}"
    return "".join(c if c.isprintable() else "?" for c in text)
