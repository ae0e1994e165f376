"""Where written kernels lie: a folder of the user's own, from which nothing foreign is ever run.

Code that is loaded from a folder is as safe as the folder. What is run here is the text in memory, just traced from
the robot: the file with the same text beside it only tells numba which machine code, cached in `__pycache__`,
belongs to it (numba_files.py). Machine code is read back, numba's, LLVM's (llvm_kernels.py) and a C compiler's
(c_compiler.py), so before any is:

- every folder above must be the user's or root's, and writable by nobody else (but for sticky ones like /tmp);
- the folder must be the user's own and no link; one that others could write to is emptied;
- the file must be a plain file of the user's, readable and writable by nobody else, under one name, and hold the text
  to the byte; otherwise it and the machine code beside it are removed and made anew;
- so must be the files with the machine code, but for what they hold; LLVM's and the C compiler's must be of the
  digest that lies beside them.

Where no such folder can be had, kernels are compiled in memory, for each process again.
"""

import contextlib
import logging
import os
import shutil
import stat
import tempfile
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

_log = logging.getLogger(__name__)
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
OTHERS = stat.S_IRWXG | stat.S_IRWXO


def cache_folder() -> Path:
    """Where kernels are kept: catenary/kernels under $XDG_CACHE_HOME, or under ~/.cache."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / "catenary" / "kernels"


def keep(name: str, content: bytes, folder: Path | None = None) -> Path | None:
    """Make sure that a private file of the name holds the content, and give its path; None where none can."""
    try:
        private = private_folder(folder)
        path = private / name
        if not is_kept(path, content):
            forget(path)
            _write(path, content)
        numbas = private / "__pycache__"
        if os.path.lexists(numbas) and not _is_own(numbas, stat.S_ISDIR, OTHERS_WRITE):
            _remove(numbas)
        for cached in machine_code(path):
            if not _is_own(cached, stat.S_ISREG, OTHERS_WRITE):
                _remove(cached)
    except (OSError, RuntimeError) as error:  # RuntimeError: no home
        _log.info("kernels are compiled in memory: %s", error)
        return None
    return path


def keep_with_digest(name: str, content: bytes, folder: Path) -> None:
    """Make private files of machine code and of its digest.

    Raises:
        PermissionError: The folder cannot be written to.
    """
    digest = sha256(content).hexdigest().encode()
    if keep(f"{name}.sha256", digest, folder) is None or keep(name, content, folder) is None:
        raise PermissionError(f"{folder} cannot be written")


def kept_with_digest(path: Path) -> bytes | None:
    """Give machine code from a private file, if it is of the digest beside it, which is private too."""
    try:
        content = path.read_bytes() if is_kept(path, None) else b""
        digest = sha256(content).hexdigest().encode()
        return content if content and is_kept(path.with_name(f"{path.name}.sha256"), digest) else None
    except OSError:
        return None


def forget(path: Path) -> None:
    """Remove a kernel's file and what was compiled from it."""
    for old in (path, *machine_code(path)):
        if os.path.lexists(old):
            _remove(old)


def private_folder(folder: Path | None = None) -> Path:
    """Give the folder, `cache_folder()` when None, made or repaired.

    Raises:
        OSError: It cannot be made, or others can write where it lies.
        RuntimeError: There is no home.
    """
    folder = cache_folder() if folder is None else folder
    folder.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    folder = folder.parent.resolve() / folder.name
    for above in folder.parents:
        status = above.stat()
        shared = status.st_mode & OTHERS_WRITE and not status.st_mode & stat.S_ISVTX
        if shared or status.st_uid not in (0, os.geteuid()):
            raise PermissionError(f"{above} can be written by others")
    if os.path.lexists(folder) and not _is_own(folder, stat.S_ISDIR, OTHERS_WRITE):
        _remove(folder)  # fails where it is somebody else's
    folder.mkdir(mode=0o700, exist_ok=True)
    folder.chmod(0o700)
    if not _is_own(folder, stat.S_ISDIR, OTHERS):
        raise PermissionError(f"{folder} belongs to another user")
    return folder


def _is_own(path: Path, is_kind: Callable[[int], bool], others: int) -> bool:
    """Whether a path is itself, not a link to, a file or folder of the user's, with no such rights for others."""
    status = os.lstat(path)
    return (
        is_kind(status.st_mode)
        and status.st_uid == os.geteuid()
        and not status.st_mode & others
        and (status.st_nlink == 1 or stat.S_ISDIR(status.st_mode))  # under another name it could be elsewhere
    )


def is_kept(path: Path, content: bytes | None) -> bool:
    """Whether a private file is there, and holds the content, any when None."""
    if not os.path.lexists(path) or not _is_own(path, stat.S_ISREG, OTHERS):
        return False
    return content is None or path.read_bytes() == content


def machine_code(path: Path) -> list[Path]:
    """Files that numba made from a kernel, among them a link or folder in their place."""
    folder = path.parent / "__pycache__"
    if folder.is_symlink() or not folder.is_dir():
        return []
    return [file for file in folder.iterdir() if file.name.startswith(f"{path.stem}.")]


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink()


def _write(path: Path, content: bytes) -> None:
    """Write a file that appears whole; mkstemp makes it readable and writable by its owner only."""
    descriptor, partial = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}.")
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
        os.replace(partial, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(partial)
        raise
