"""The one place that asks numba for functions: `compiled` ones, and `inlined` ones that those may call.

numba takes half a second to import, and as long again to make ready. That is done when a compiled function is first
called, so programs that call none start without it.

numba keeps machine code on disk until the file of its function changes, whatever became of the functions in other
files that it calls. Here it is made anew when any file with such functions has changed; and where numba has no folder
that it could be kept in safely, functions are compiled in memory.
"""

import contextlib
from collections.abc import Callable
from functools import cache, update_wrapper
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar, cast

from catenary.kernels.folders import cache_folder, check_room, private_folder, tell_in_memory

Function = TypeVar("Function", bound=Callable[..., object])
_inlined: list[Callable[..., object]] = []
_sources: set[str] = set()  # files of compiled and inlined functions


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

    def __init__(
        self, function: Callable[..., object], signature: str | None = None, **options: bool
    ) -> None:
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
            if folder.parent not in (
                source.parent,
                Path(numba.config.CACHE_DIR),
            ):  # chosen, or as safe as the source
                private_folder(folder)
            check_room(folder)
            if str(source) in _sources:
                _forget_older_code(folder, source)
            return code
        except OSError as error:
            tell_in_memory(error)
        except RuntimeError:  # numba's; or there is no home
            tell_in_memory(f"neither {source.parent} nor ~/.cache can be written to")
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
    while (
        _inlined
    ):  # called by compiled functions only: without wrappers for Python they compile an eighth quicker
        numba.extending.register_jitable(no_cpython_wrapper=True, no_cfunc_wrapper=True)(_inlined.pop())
    return numba
