"""Runs kernels' sources as modules, with numba's machine code of them cached where that is safe (kernel_files.py)."""

import contextlib
import sys
from functools import partial
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import Any

from catenary.kernels.compiled import compiled, compiled_quick, in_memory
from catenary.kernels.exact_calls import as_arrays, exact, others
from catenary.kernels.kernel_files import keep, machine_code


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


def seal(module: ModuleType) -> None:
    """Take others' rights from machine code that has just been written, whatever the umask."""
    if module.__file__ is not None:
        for cached in machine_code(Path(module.__file__)):
            with contextlib.suppress(OSError):
                cached.chmod(0o600)
