"""Compiled functions: the one place that asks numba for them, and the private folders that keep their machine code.

numba takes a second to import and make ready: that is done when a compiled function is first called. It keeps machine
code on disk until the file of its function changes; here it is recompiled when any file with such functions has.

Code that is loaded from a folder is as safe as the folder. So every folder above must be the user's or root's, and
writable by nobody else (but for sticky ones like /tmp); the folder must be the user's own and no link, and is emptied
where others could enter it. Where no such folder can be had, code is compiled in memory, and one note says so.

Of a generated module (`load_module`) the text in memory is run; the file with the same text only tells numba which
machine code, cached in `__pycache__`, belongs to it. So before any is read back, the file must be a plain file of the
user's under one name, and hold the text to the byte, and files with machine code must be plain ones under one name;
otherwise they are recompiled.
"""

import contextlib
import logging
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable
from contextvars import ContextVar
from functools import cache, update_wrapper
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar, cast

from catenary.operating_system import reserve, user_id

_log = logging.getLogger(__name__)
in_motion: ContextVar[bool] = ContextVar("in_motion", default=False)  # a loop moves a robot: nothing may be compiled
_reasons: list[object] = []  # why code is compiled in memory
_OTHERS_WRITE_BITS = stat.S_IWGRP | stat.S_IWOTH
_OTHERS_BITS = stat.S_IRWXG | stat.S_IRWXO
_ROOM_BYTES = 4 << 20  # [B]; ten times the largest function
Function = TypeVar("Function", bound=Callable[..., object])
_inlined: list[Callable[..., object]] = []
_sources: set[str] = set()  # files of compiled and inlined functions


def cache_folder() -> Path:
    """Return catenary/kernels under $XDG_CACHE_HOME, or under ~/.cache; RuntimeError where there is no home."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(base) if os.path.isabs(base) else Path.home() / ".cache") / "catenary" / "kernels"


def warn_in_memory(why: object) -> None:
    """Say once that nothing is kept on disk, and why; what this process starts need not say it again."""
    from multiprocessing import parent_process

    if not _reasons and parent_process() is None:
        _reasons.append(why)
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
            reserve(file, _ROOM_BYTES)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(folder)) from None


def private_folder(folder: Path) -> Path:
    """Make or repair a folder that nobody else can enter; on Windows, whose modes do not tell, only make it."""
    folder.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    if user_id() is None:
        folder.mkdir(mode=0o700, exist_ok=True)
        return folder
    folder = folder.parent.resolve() / folder.name
    mode = folder.parent.stat().st_mode
    is_numbas = mode & _OTHERS_WRITE_BITS == stat.S_IWGRP  # as it makes folders by umask 002
    if is_numbas and is_own(folder.parent, stat.S_ISDIR):
        folder.parent.chmod(stat.S_IMODE(mode) & ~stat.S_IWGRP)  # its contents are checked below
    for above in folder.parents:
        status = above.stat()
        shared = status.st_mode & _OTHERS_WRITE_BITS and not status.st_mode & stat.S_ISVTX
        if shared or status.st_uid not in (0, user_id()):
            raise PermissionError(f"{above} can be written by others")
    if os.path.lexists(folder) and not _is_closed(folder):
        remove(folder)  # fails where it is somebody else's
    folder.mkdir(mode=0o700, exist_ok=True)
    if not _is_closed(folder):
        raise PermissionError(f"{folder} belongs to another user")
    return folder


def _is_closed(folder: Path) -> bool:
    return is_own(folder, stat.S_ISDIR) and not os.lstat(folder).st_mode & _OTHERS_BITS


def is_own(path: Path, is_kind: Callable[[int], bool]) -> bool:
    """Return True if a path is itself, not a link to, a file or folder of the user's."""
    status = os.lstat(path)
    # under another name it could be elsewhere
    one_name = status.st_nlink == 1 or stat.S_ISDIR(status.st_mode)
    return is_kind(status.st_mode) and user_id() in (None, status.st_uid) and one_name


def remove(path: Path) -> None:
    """Remove a file, a link or a folder with what it holds."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def inlined(function: Function) -> Function:
    """Let compiled functions call this one, which stays plain Python and runs on any numbers: floats, symbols."""
    _inlined.append(function)
    _sources.add(function.__code__.co_filename)
    return function


def compiled(function: Function) -> Function:
    """Compile a function on first use and keep it on disk; it neither holds Python's lock nor checks array bounds."""
    # fastmath stays off: results must not depend on the machine that compiled them
    _sources.add(function.__code__.co_filename)
    return cast(Function, Compiled(function, cache=True, nogil=True))


class Compiled:
    """A function that numba compiles when it is first called, from Python or from another compiled function."""

    def __init__(self, function: Callable[..., object], signature: str | None = None, **options: bool) -> None:
        """Take a function, the only signature that it is compiled for, if any, and numba's options."""
        self._function, self._options = function, {"signature_or_function": signature, **options}
        self._code: Any = None
        update_wrapper(self, function)

    @property
    def code(self) -> Any:
        """What numba made of it: calls of this cost 0.05 us less."""
        if self._code is None:
            self._code = _from_numba(self._function, self._options)
            # functions of its own file look its name up at every call: they call numba's from now on
            names = self._function.__globals__
            if names.get(self._function.__name__) is self:
                names[self._function.__name__] = self._code
        return self._code

    def __call__(self, *arguments: object) -> Any:
        """Run it."""
        return self.code(*arguments)

    def __reduce__(self) -> tuple[Callable[[str, str], Any], tuple[str, str]]:
        return _of_module, (self._function.__module__, self._function.__name__)

    @property
    def _numba_type_(self) -> Any:
        return self.code._numba_type_


def _from_numba(function: Callable[..., object], options: dict[str, Any]) -> Any:
    """Let numba take a function, without a cache on disk where none can be had."""
    numba, source = start_numba(), Path(function.__code__.co_filename)
    if options["cache"]:
        try:
            cache_folder()  # without a home numba would make one: a folder called ~, wherever it is
            code = numba.njit(**options, error_model="numpy")(function)
            if code is function:  # with NUMBA_DISABLE_JIT=1
                return code
            folder = Path(code.stats.cache_path)
            if folder.parent not in (source.parent, Path(numba.config.CACHE_DIR)):  # chosen, or as safe as the source
                private_folder(folder)
            check_room(folder)
            if str(source) in _sources:
                _forget_older_code(folder, source)
            return code
        except OSError as error:
            warn_in_memory(error)
        except RuntimeError:  # numba's; or there is no home
            warn_in_memory(f"neither {source.parent} nor ~/.cache can be written to")
    return numba.njit(**{**options, "cache": False}, error_model="numpy")(function)


def _of_module(module: str, name: str) -> Any:
    """Return a compiled function by its name, where it is unpickled."""
    return getattr(import_module(module), name)


def _forget_older_code(folder: Path, source: Path) -> None:
    """Remove the indices of a file's machine code that are older than any file that it may come from."""
    with contextlib.suppress(OSError):  # another process removes it too; or no source is there, only bytecode
        newest = max(Path(file).stat().st_mtime_ns for file in _sources)
        for index in folder.glob(f"{source.stem}.*.nbi"):
            if index.stat().st_mtime_ns < newest:
                index.unlink()


@cache
def _import_numba() -> ModuleType:
    import numba
    import numba.extending

    return cast(ModuleType, numba)


def start_numba() -> ModuleType:
    """Import numba, and tell it which functions compiled ones may call."""
    numba = _import_numba()
    while _inlined:  # called by compiled functions only: without wrappers for Python they compile an eighth quicker
        numba.extending.register_jitable(no_cpython_wrapper=True, no_cfunc_wrapper=True)(_inlined.pop())
    return numba


def load_module(stem: str, text: str, namespace: dict[str, Any], folder: Path | None = None) -> ModuleType:
    """Run a module's text, once in a process; its machine code is cached where that is safe.

    The text may use `@compiled` and `@compiled_for(SIGNATURE)`, which compiles for one signature of numba's, refuses
    others with TypeError, and keeps Python's lock: to give it takes as long as a torque. Where the module's `__file__`
    is None it is in memory. The file's name begins with `stem`; the text must determine `namespace`.
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
        namespace,
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
    """Make sure that a private file of the name holds the content, and return its path; None if none can."""
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
        warn_in_memory(error)
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
