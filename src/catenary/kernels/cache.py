"""Runs generated modules, with their machine code cached in a folder of the user's own.

Code that is loaded from a folder is as safe as the folder. What is run here is a module's text in memory, just written:
the file with the same text beside it only tells numba which machine code, cached in `__pycache__`, belongs to it. That
machine code is read back, so before any is:

- the folder must be the user's alone (folders.py);
- the file must be a plain file of the user's under one name, and hold the text to the byte; otherwise it and the
  machine code beside it are removed and made anew;
- files with machine code must be plain files of the user's under one name.
"""

import contextlib
import os
import stat
import sys
import tempfile
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import Any

from catenary.kernels.compiled import Compiled
from catenary.kernels.folders import cache_folder, check_room, is_own, private_folder, remove, tell_in_memory


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


def _kept(name: str, content: bytes, folder: Path | None) -> Path | None:
    """Make sure that a private file of the name holds the content, and return its path; None where none can."""
    try:
        path = private_folder(cache_folder() if folder is None else folder) / name
        numbas = path.parent / "__pycache__"
        if os.path.lexists(numbas) and not is_own(numbas, stat.S_ISDIR):
            remove(numbas)
        machine_code = list(numbas.glob(f"{path.stem}.*"))
        if not (os.path.lexists(path) and is_own(path, stat.S_ISREG) and path.read_bytes() == content):
            for old in [path, *machine_code]:
                remove(old)
            _write(path, content)
        for cached in machine_code:
            if os.path.lexists(cached) and not is_own(cached, stat.S_ISREG):
                remove(cached)
        check_room(path.parent)
    except (OSError, RuntimeError) as error:  # RuntimeError: no home
        tell_in_memory(error)
        return None
    return path


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
