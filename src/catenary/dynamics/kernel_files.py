"""Where written kernels lie: a folder of the user's own, from which nothing foreign is ever run.

Code that is loaded from a folder is as safe as the folder. What is run here is the text in memory, just traced from
the robot: the file with the same text beside it only tells numba which machine code, cached in `__pycache__`,
belongs to it. That machine code is read back, so before any is:

- every folder above must be the user's or root's, and writable by nobody else (but for sticky ones like /tmp);
- the folder must be the user's own and no link; one that others could write to is emptied;
- the file must be a plain file of the user's, readable and writable by nobody else, under one name, and hold the text
  to the byte; otherwise it and the machine code beside it are removed and made anew;
- so must be the files with the machine code, but for what they hold.

Where no such folder can be had, kernels are compiled in memory, for each process again.
"""

import contextlib
import logging
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import Any

from catenary.compiled import compiled, compiled_quick, in_memory
from catenary.exact_calls import as_arrays, exact, others

_log = logging.getLogger(__name__)
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
OTHERS = stat.S_IRWXG | stat.S_IRWXO


def cache_folder() -> Path:
    """Where kernels are kept: catenary/kernels under $XDG_CACHE_HOME, or under ~/.cache."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / "catenary" / "kernels"


def load_source(stem: str, source: str, given: dict[str, Any], folder: Path | None = None) -> ModuleType:
    """Run a kernel's source as a module, with its machine code cached where that is safe.

    Args:
        stem: What the file's name begins with; letters, digits and hyphens.
        source: The module's text.
        given: Names that it takes for given; what they are must follow from the text. Besides there are `compiled`,
            `compiled_quick`, `exact`, `others` and `as_arrays`.
        folder: Where files are kept; `cache_folder()` when None.
    """
    digest = sha256(source.encode()).hexdigest()
    name = f"_catenary_kernel_{digest[:32]}"
    if name in sys.modules:
        return sys.modules[name]
    path = keep(f"{stem}-{digest[:32]}.py", source.encode(), folder)
    module = ModuleType(name)
    module.__file__ = None if path is None else str(path)
    for decorator in (compiled, compiled_quick):
        module.__dict__[decorator.__name__] = in_memory(decorator) if path is None else decorator
    module.__dict__["exact"] = partial(exact, in_memory=path is None)
    module.__dict__["others"], module.__dict__["as_arrays"] = others, as_arrays
    module.__dict__.update(given)
    code = compile(source, f"<{stem}>" if path is None else str(path), "exec")
    sys.modules[name] = module  # machine code finds its module by name
    try:
        exec(code, module.__dict__)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def keep(name: str, content: bytes, folder: Path | None = None) -> Path | None:
    """Make sure that a private file of the name holds the content, and give its path; None where none can."""
    try:
        private = private_folder(folder)
        path = private / name
        if not is_kept(path, content):
            forget(path)
            _write(path, content)
        machine_code = private / "__pycache__"
        if os.path.lexists(machine_code) and not _is_own(machine_code, stat.S_ISDIR, OTHERS_WRITE):
            _remove(machine_code)
        for cached in _machine_code(path):
            if not _is_own(cached, stat.S_ISREG, OTHERS_WRITE):
                _remove(cached)
    except (OSError, RuntimeError) as error:  # RuntimeError: no home
        _log.info("kernels are compiled in memory: %s", error)
        return None
    return path


def seal(module: ModuleType) -> None:
    """Take others' rights from machine code that has just been written, whatever the umask."""
    if module.__file__ is not None:
        for cached in _machine_code(Path(module.__file__)):
            with contextlib.suppress(OSError):
                cached.chmod(0o600)


def forget(path: Path) -> None:
    """Remove a kernel's file and what was compiled from it."""
    for old in (path, *_machine_code(path)):
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


def _machine_code(path: Path) -> list[Path]:
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
