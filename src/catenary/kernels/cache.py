"""Runs generated modules, with their machine code cached in a folder of the user's own.

Code that is loaded from a folder is as safe as the folder. What is run here is a module's text in memory, just written:
the file with the same text beside it only tells numba which machine code, cached in `__pycache__`, belongs to it. That
machine code is read back, so before any is:

- every folder above must be the user's or root's, and writable by nobody else (but for sticky ones like /tmp);
- the folder must be the user's own and no link, and nobody else may enter it: one that others could read is emptied,
  since they could have written to files in it;
- the file must be a plain file of the user's under one name, and hold the text to the byte; otherwise it and the
  machine code beside it are removed and made anew;
- files with machine code must be plain files of the user's under one name.

Where no such folder can be had, modules are compiled in memory, for each process again.
"""

import contextlib
import logging
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import Any

from catenary.kernels.compiled import Compiled

_log = logging.getLogger(__name__)
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
OTHERS = stat.S_IRWXG | stat.S_IRWXO


def load_module(stem: str, text: str, given: dict[str, Any], folder: Path | None = None) -> ModuleType:
    """Run a module's text, once in a process; its machine code is cached where that is safe.

    The text may use `@compiled` (compiled.py) and `@compiled_for(SIGNATURE)`, which compiles for one signature of
    numba's, refuses others with TypeError, and keeps Python's lock: to give it takes as long as a torque. Where the
    module's `__file__` is None it is in memory.

    Args:
        stem: What the file's name begins with; letters, digits and hyphens.
        text: The module's.
        given: Further names that it uses; what they are must follow from the text.
        folder: Where files are kept; `cache_folder()` when None.
    """
    digest = sha256(text.encode()).hexdigest()[:32]
    name = f"_catenary_kernel_{digest}"
    if name in sys.modules:
        return sys.modules[name]
    path = _kept(f"{stem}-{digest}.py", text.encode(), folder)
    cached = path is not None
    module = ModuleType(name)
    module.__file__ = str(path) if cached else None
    module.__dict__.update(
        given,
        compiled=lambda function: Compiled(function, cache=cached, nogil=True),
        compiled_for=lambda signature: lambda function: Compiled(function, signature, cache=cached),
    )
    code = compile(text, str(path) if cached else f"<{stem}>", "exec")
    sys.modules[name] = module  # machine code finds its module by name
    try:
        exec(code, module.__dict__)
    except BaseException:
        del sys.modules[name]
        raise
    return module


def cache_folder() -> Path:
    """Return where modules are kept: catenary/kernels under $XDG_CACHE_HOME, or under ~/.cache."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / "catenary" / "kernels"


def _kept(name: str, content: bytes, folder: Path | None) -> Path | None:
    """Make sure that a private file of the name holds the content, and return its path; None where none can."""
    try:
        path = _private_folder(cache_folder() if folder is None else folder) / name
        numbas = path.parent / "__pycache__"
        if os.path.lexists(numbas) and not _is_own(numbas, stat.S_ISDIR):
            _remove(numbas)
        machine_code = list(numbas.glob(f"{path.stem}.*"))
        if not (os.path.lexists(path) and _is_own(path, stat.S_ISREG) and path.read_bytes() == content):
            for old in [path, *machine_code]:
                _remove(old)
            _write(path, content)
        for cached in machine_code:
            if os.path.lexists(cached) and not _is_own(cached, stat.S_ISREG):
                _remove(cached)
    except (OSError, RuntimeError) as error:  # RuntimeError: no home
        _log.info("kernels are compiled in memory: %s", error)
        return None
    return path


def _private_folder(folder: Path) -> Path:
    """Make or repair a folder that nobody else can enter.

    Raises:
        OSError: It cannot be made, or others can write where it lies.
    """
    folder.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    folder = folder.parent.resolve() / folder.name
    for above in folder.parents:
        status = above.stat()
        shared = status.st_mode & OTHERS_WRITE and not status.st_mode & stat.S_ISVTX
        if shared or status.st_uid not in (0, os.geteuid()):
            raise PermissionError(f"{above} can be written by others")
    if os.path.lexists(folder) and not _is_closed(folder):
        _remove(folder)  # fails where it is somebody else's
    folder.mkdir(mode=0o700, exist_ok=True)
    if not _is_closed(folder):
        raise PermissionError(f"{folder} belongs to another user")
    return folder


def _is_closed(folder: Path) -> bool:
    return _is_own(folder, stat.S_ISDIR) and not os.lstat(folder).st_mode & OTHERS


def _is_own(path: Path, is_kind: Callable[[int], bool]) -> bool:
    """Return whether a path is itself, not a link to, a file or folder of the user's."""
    status = os.lstat(path)
    # under another name it could be elsewhere
    one_name = status.st_nlink == 1 or stat.S_ISDIR(status.st_mode)
    return is_kind(status.st_mode) and status.st_uid == os.geteuid() and one_name


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


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
