"""Folders that machine code is read back from: the user's alone, and with room for more.

Code that is loaded from a folder is as safe as the folder. So every folder above must be the user's or root's, and
writable by nobody else (but for sticky ones like /tmp); and the folder must be the user's own and no link, and nobody
else may enter it: one that others could read is emptied, since they could have written to files in it. Where no such
folder can be had, code is compiled in memory, for each process again, and one note says so.
"""

import logging
import os
import shutil
import stat
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

_log = logging.getLogger(__name__)
_told: list[object] = []  # why code is compiled in memory
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
OTHERS = stat.S_IRWXG | stat.S_IRWXO
ROOM = 4 << 20  # [B]; ten times the largest function


def cache_folder() -> Path:
    """Return catenary/kernels under $XDG_CACHE_HOME, or under ~/.cache; RuntimeError where there is no home."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / "catenary" / "kernels"


def tell_in_memory(why: object) -> None:
    """Say once that nothing is kept on disk, and why; what this process starts need not say it again."""
    from multiprocessing import parent_process

    if not _told and parent_process() is None:
        _told.append(why)
        _log.warning(
            "compiled code cannot be kept for the next start (%s): each start compiles again, for seconds to a minute; "
            "it is kept in a folder of this account's own that XDG_CACHE_HOME names",
            f"{why.filename}: {why.strerror}" if isinstance(why, OSError) and why.filename else why,
        )


@cache
def check_room(folder: Path) -> None:
    """Raise OSError where a folder is full, or cannot be written to."""
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            os.posix_fallocate(file.fileno(), 0, ROOM)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(folder)) from None


def private_folder(folder: Path) -> Path:
    """Make or repair a folder that nobody else can enter."""
    folder.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    folder = folder.parent.resolve() / folder.name
    mode = folder.parent.stat().st_mode
    if (
        is_own(folder.parent, stat.S_ISDIR) and mode & OTHERS_WRITE == stat.S_IWGRP
    ):  # as numba makes it by umask 002
        folder.parent.chmod(stat.S_IMODE(mode) & ~stat.S_IWGRP)  # what lies in it is looked at below
    for above in folder.parents:
        status = above.stat()
        shared = status.st_mode & OTHERS_WRITE and not status.st_mode & stat.S_ISVTX
        if shared or status.st_uid not in (0, os.geteuid()):
            raise PermissionError(f"{above} can be written by others")
    if os.path.lexists(folder) and not _is_closed(folder):
        remove(folder)  # fails where it is somebody else's
    folder.mkdir(mode=0o700, exist_ok=True)
    if not _is_closed(folder):
        raise PermissionError(f"{folder} belongs to another user")
    return folder


def _is_closed(folder: Path) -> bool:
    return is_own(folder, stat.S_ISDIR) and not os.lstat(folder).st_mode & OTHERS


def is_own(path: Path, is_kind: Callable[[int], bool]) -> bool:
    """Return whether a path is itself, not a link to, a file or folder of the user's."""
    status = os.lstat(path)
    # under another name it could be elsewhere
    one_name = status.st_nlink == 1 or stat.S_ISDIR(status.st_mode)
    return is_kind(status.st_mode) and status.st_uid == os.geteuid() and one_name


def remove(path: Path) -> None:
    """Remove a file, a link or a folder with what it holds."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
